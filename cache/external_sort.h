#pragma once

// Sorts records by a 128-bit key: in memory while they fit, else as sorted runs on scratch that are cut into partitions
// by sampled splitters over the whole key and brought back one partition after the other.
//
// In: append() any number of times. Out: partitions in key order, each a contiguous array in memory.
// Memory: `tag` up to memory_limit_bytes in both phases: while filling, records, keys and sort pairs of one run and its
//         sorted copy (2 record + 48 bytes an item); while reading, one partition the same way. Besides, a request of
//         MemoryTag::streams a thread (options.block_bytes, or one block of the run).
// Threads: one appender; sorting and reading use the threads of the current arena.
// Order: by key; the caller makes keys unique, so the order is total and depends on nothing else.
// Based on: sample sort of external runs (splitters from every run's every n-th key), one write and one read a record.

#include <cstdint>
#include <memory>
#include <span>

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

// A piece of what a parallel stage made: keys and records, to be appended in order with others.
struct SortSpan {
  const SortKey* keys = nullptr;
  const void* records = nullptr;
  size_t count = 0;
};

class ByteSort {
 public:
  ByteSort(size_t record_bytes, StreamOptions options);
  ByteSort(ByteSort&&) noexcept;
  ByteSort& operator=(ByteSort&&) noexcept;
  ~ByteSort();

  Status append(std::span<const SortKey> keys, std::span<const std::byte> records);
  // The same as appending one after the other; copies in parallel while the run has room.
  Status append(std::span<const SortSpan> pieces);
  Status finish();
  void clear();  // empty again; keeps its memory, gives its scratch back
  [[nodiscard]] size_t partition_count() const;  // 1 when nothing was spilled (0 when empty)
  [[nodiscard]] uint64_t spilled_bytes() const;
  [[nodiscard]] uint64_t size() const;
  // The records of partition p in key order. The span is valid until the next call. Ask in ascending order, once each.
  Result<std::span<const std::byte>> partition(size_t p);

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
  Status append(std::span<const SortSpan> pieces) { return sort_.append(pieces); }  // records each of T
  Status finish() { return sort_.finish(); }
  void clear() { sort_.clear(); }
  [[nodiscard]] size_t partition_count() const { return sort_.partition_count(); }
  [[nodiscard]] uint64_t spilled_bytes() const { return sort_.spilled_bytes(); }
  [[nodiscard]] uint64_t size() const { return sort_.size(); }
  Result<std::span<const T>> partition(size_t p) {
    SPILLWAY_ASSIGN(const std::span<const std::byte> raw, sort_.partition(p));
    return std::span<const T>(reinterpret_cast<const T*>(raw.data()), raw.size() / sizeof(T));
  }

 private:
  ByteSort sort_;
};

}  // namespace spillway::cache
