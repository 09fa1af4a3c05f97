#pragma once

// A sequence of trivially copyable records: in memory until its limit, then in checksummed blocks on scratch.
//
// Owns: its records. Memory: `tag` up to memory_limit_bytes, then two blocks of MemoryTag::streams,
//       and one a thread that reads.
// Threads: one appender, then (after finish) readers of any number, and two of its own while it reads ahead; no lock is
//          held over I/O.
// Fails: a full scratch disk on append/finish; a damaged block on read, naming stream, block and offset.
// Order: records come back in the order of append, whatever was spilled.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <type_traits>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/file.h"

namespace spillway::cache {

struct StreamOptions {
  std::string what = "stream";             // for messages and the report
  MemoryTag tag = MemoryTag::paths;
  IoPurpose purpose = IoPurpose::paths;
  uint64_t memory_limit_bytes = UINT64_MAX;  // larger: spills later. 0 spills everything
  uint64_t block_bytes = 4 << 20;            // larger: fewer, longer requests and more buffer memory
  Scratch* scratch = nullptr;                // none: must never exceed its limit
};

// A piece of what a parallel stage made, to be appended in order with others.
struct RecordSpan {
  const void* records = nullptr;
  size_t count = 0;
};

// The untyped part; records of a fixed size in bytes.
class ByteStream {
 public:
  ByteStream(size_t record_bytes, StreamOptions options);
  ByteStream(ByteStream&&) noexcept;
  ByteStream& operator=(ByteStream&&) noexcept;
  ~ByteStream();

  Status append(std::span<const std::byte> records);
  // The same as appending one after the other; copies in parallel while everything stays in memory.
  Status append(std::span<const RecordSpan> pieces);
  Status finish();  // flushes; afterwards only reads
  void clear();     // empty again, ready for appends; keeps its memory, gives its scratch back
  [[nodiscard]] uint64_t size() const;  // records
  [[nodiscard]] uint64_t spilled_bytes() const;
  // Copies records [first, first + out.size() / record_bytes) to out. Sequential readers should ask for whole
  // multiples of records_per_block(): each block is then read once.
  Status read(uint64_t first, std::span<std::byte> out) const;
  [[nodiscard]] uint64_t records_per_block() const;
  // After finish(): begins to read what is spilled, from its first block on, into memory that is lent until clear();
  // read() takes it from there. For every record that was read, in order, the lender may take so many bytes back, from
  // the front. As many blocks are read ahead as have room behind that.
  void read_ahead(std::span<std::byte> memory, uint64_t taken_bytes_a_record);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

template <class T>
class RecordStream {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  explicit RecordStream(StreamOptions options) : bytes_(sizeof(T), std::move(options)) {}
  Status append(std::span<const T> records) { return bytes_.append(std::as_bytes(records)); }
  Status append(std::span<const RecordSpan> pieces) { return bytes_.append(pieces); }  // each of T
  Status finish() { return bytes_.finish(); }
  void clear() { bytes_.clear(); }
  [[nodiscard]] uint64_t size() const { return bytes_.size(); }
  [[nodiscard]] uint64_t spilled_bytes() const { return bytes_.spilled_bytes(); }
  [[nodiscard]] uint64_t records_per_block() const { return bytes_.records_per_block(); }
  void read_ahead(std::span<std::byte> memory, uint64_t taken_bytes_a_record) {
    bytes_.read_ahead(memory, taken_bytes_a_record);
  }
  Status read(uint64_t first, std::span<T> out) const { return bytes_.read(first, std::as_writable_bytes(out)); }

 private:
  ByteStream bytes_;
};

}  // namespace spillway::cache
