#pragma once

// Sorts records by a 128-bit key: in memory while they fit, else as sorted runs on scratch that are cut into partitions
// by sampled splitters over the whole key and brought back one partition after the other.
//
// In: append() any number of times. Out: partitions in key order, each in memory: its records as they came, and their order.
// Memory: `tag` up to memory_limit_bytes in both phases: while filling, records, keys and sort pairs of one run
//         (a record and 48 bytes an item); while reading, one partition the same way. Besides, a request of
//         MemoryTag::streams a thread (options.block_bytes, or one block of the run).
// Threads: one appender, or any number within make_room(); sorting and reading use the threads of the current arena.
// Order: by key; the caller makes keys unique, so the order is total and depends on nothing else.
// Based on: sample sort of external runs (splitters from every run's every n-th key), one write and one read a record.

#include <cstdint>
#include <memory>
#include <span>

#include "cache/radix_sort.h"
#include "cache/record_stream.h"

namespace spillway::cache {

struct SortKey {
  uint64_t high = 0;
  uint64_t low = 0;
  friend bool operator<(const SortKey& a, const SortKey& b) {
    return a.high != b.high ? a.high < b.high : a.low < b.low;
  }
  friend bool operator==(const SortKey& a, const SortKey& b) = default;
};

// Records in the order of their keys. They are not moved: a copy of all would cost as much as the sort.
template <class T>
class SortedRecords {
 public:
  SortedRecords() = default;
  SortedRecords(std::span<const KeyIndex<uint64_t>> order, const T* records) : order_(order), records_(records) {}
  [[nodiscard]] size_t size() const { return order_.size(); }
  [[nodiscard]] bool empty() const { return order_.empty(); }
  const T& operator[](size_t i) const { return records_[order_[i].index]; }
  [[nodiscard]] const T& front() const { return (*this)[0]; }
  [[nodiscard]] SortedRecords first(size_t count) const { return {order_.first(count), records_}; }
  [[nodiscard]] SortedRecords subspan(size_t first, size_t count = std::dynamic_extent) const {
    return {order_.subspan(first, count), records_};
  }
  // With those that follow them, both of one range.
  [[nodiscard]] SortedRecords joined(const SortedRecords& next) const {
    return {{order_.data(), order_.size() + next.order_.size()}, records_};
  }
  // All of them, one after the other; the memory is asked ahead.
  void copy_to(T* to) const {
    constexpr size_t kAhead = 8;
    for (size_t i = 0; i < size(); ++i) {
      if (i + kAhead < size()) {
        const auto* const at = reinterpret_cast<const char*>(&(*this)[i + kAhead]);
        for (size_t line = 0; line < sizeof(T); line += 64) __builtin_prefetch(at + line);
      }
      to[i] = (*this)[i];
    }
  }

 private:
  std::span<const KeyIndex<uint64_t>> order_;
  const T* records_ = nullptr;
};

class ByteSort {
 public:
  ByteSort(size_t record_bytes, StreamOptions options);
  ByteSort(ByteSort&&) noexcept;
  ByteSort& operator=(ByteSort&&) noexcept;
  ~ByteSort();

  Status append(std::span<const SortKey> keys, std::span<const std::byte> records);
  // Room in memory for so many more, capacity() at most; spills what there is where both do not fit.
  Status make_room(uint64_t count);
  // Within the room that was made, by any number of threads at once: who comes first does not show in the order of keys.
  void append_apart(std::span<const SortKey> keys, const std::byte* records);
  [[nodiscard]] uint64_t capacity() const;  // records that fit in memory
  // Memory of so many records, capacity() at most, before any are there. append_apart() takes it from the front.
  std::span<std::byte> lend(uint64_t count);
  Status finish();
  void clear();  // empty again; keeps its memory, gives its scratch back
  [[nodiscard]] size_t partition_count() const;  // 1 when nothing was spilled (0 when empty)
  [[nodiscard]] uint64_t spilled_bytes() const;
  [[nodiscard]] uint64_t size() const;
  // The records of partition p, and their order. Valid until the next call. Ask in ascending order, once each.
  struct Partition {
    std::span<const KeyIndex<uint64_t>> order;
    const std::byte* records = nullptr;
  };
  Result<Partition> partition(size_t p);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

template <class T>
class ExternalSort {
 public:
  explicit ExternalSort(StreamOptions options) : sort_(sizeof(T), std::move(options)) {}
  Status append(std::span<const SortKey> keys, std::span<const T> records) {
    return sort_.append(keys, std::as_bytes(records));
  }
  Status make_room(uint64_t count) { return sort_.make_room(count); }
  void append_apart(std::span<const SortKey> keys, const T* records) {
    sort_.append_apart(keys, reinterpret_cast<const std::byte*>(records));
  }
  [[nodiscard]] uint64_t capacity() const { return sort_.capacity(); }
  std::span<std::byte> lend(uint64_t count) { return sort_.lend(count); }
  Status finish() { return sort_.finish(); }
  void clear() { sort_.clear(); }
  [[nodiscard]] size_t partition_count() const { return sort_.partition_count(); }
  [[nodiscard]] uint64_t spilled_bytes() const { return sort_.spilled_bytes(); }
  [[nodiscard]] uint64_t size() const { return sort_.size(); }
  Result<SortedRecords<T>> partition(size_t p) {
    SPILLWAY_ASSIGN(const ByteSort::Partition raw, sort_.partition(p));
    return SortedRecords<T>(raw.order, reinterpret_cast<const T*>(raw.records));
  }

 private:
  ByteSort sort_;
};

}  // namespace spillway::cache
