#include "cache/record_stream.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <condition_variable>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "cache/base/alignment.h"
#include "cache/base/check.h"
#include "cache/base/hash.h"
#include "cache/base/parallel.h"
#include "cache/base/parallel_status.h"

// Format of a block on scratch: BlockHeader, then records, then zeros up to block_bytes. Blocks lie one after the other.

namespace spillway::cache {
namespace {

constexpr uint32_t kBlockMagic = 0x4b425053;  // "SPBK"

struct BlockHeader {
  uint32_t magic;
  uint32_t record_bytes;
  uint64_t index;
  uint64_t record_count;
  uint64_t checksum;  // of the records
};

uint64_t aligned(uint64_t bytes) { return spillway::aligned(bytes, kDirectAlignment); }

// Blocks on their way from scratch before they are asked for.
struct Ahead {
  using ReadBlock = std::function<Status(uint64_t index, std::span<std::byte> into)>;

  std::span<std::byte> memory;  // a block each
  uint64_t block_bytes, next = 0;
  std::vector<std::optional<Status>> done;
  ReadBlock read_block;
  std::mutex mutex;  // of next and done
  std::condition_variable is_done;
  std::vector<std::thread> readers;

  Ahead(std::span<std::byte> lent, uint64_t bytes, ReadBlock read)
      : memory(lent), block_bytes(bytes), done(lent.size() / bytes), read_block(std::move(read)) {
    constexpr int kReaders = 2;  // requests under way
    for (int i = 0; i < kReaders; ++i) readers.emplace_back([this] { read_all(); });
  }
  ~Ahead() {
    {
      const std::lock_guard lock(mutex);
      next = done.size();
    }
    for (std::thread& reader : readers) reader.join();
  }
  [[nodiscard]] std::span<std::byte> block(uint64_t index) const {
    return memory.subspan(index * block_bytes, block_bytes);
  }
  void read_all() {
    std::unique_lock lock(mutex);
    while (next < done.size()) {
      const uint64_t index = next++;
      lock.unlock();
      const Status status = read_block(index, block(index));
      lock.lock();
      done[index] = status;
      is_done.notify_all();
    }
  }
  Status wait_for(uint64_t index) {
    std::unique_lock lock(mutex);
    is_done.wait(lock, [&] { return done[index].has_value(); });
    return *done[index];
  }
};

}  // namespace

// Records are kept in chunks of one block each. While the limit allows, chunks stay; beyond it, the chunk that is full is
// handed to a writer thread and a second one is filled meanwhile.
struct ByteStream::State {
  size_t record_bytes;
  StreamOptions options;
  uint64_t block_bytes;
  uint64_t records_per_block;
  std::vector<Buffer<std::byte>> resident;  // blocks 0 .. resident.size() - 1
  Buffer<std::byte> filling, writing;       // of blocks beyond
  std::future<Status> write;
  std::unique_ptr<Scratch::File> file;
  uint64_t size = 0;
  uint64_t spilled_blocks = 0;  // handed to the writer so far
  bool finished = false;
  mutable tbb::enumerable_thread_specific<Buffer<std::byte>> thread_blocks;  // what each thread reads
  std::unique_ptr<Ahead> ahead;

  State(size_t bytes, StreamOptions o) : record_bytes(bytes), options(std::move(o)) {
    block_bytes = aligned(std::max<uint64_t>(options.block_bytes, sizeof(BlockHeader) + record_bytes));
    records_per_block = (block_bytes - sizeof(BlockHeader)) / record_bytes;
  }

  [[nodiscard]] uint64_t resident_limit() const {  // blocks; kept from overflowing where it counts records
    return std::min(options.memory_limit_bytes / block_bytes, UINT64_MAX / (2 * records_per_block));
  }
  [[nodiscard]] std::byte* records(Buffer<std::byte>& block) const { return block.data() + sizeof(BlockHeader); }
  [[nodiscard]] uint64_t used_blocks() const { return (size + records_per_block - 1) / records_per_block; }

  // Where block `index` is being filled, made when it is new.
  Result<Buffer<std::byte>*> block_to_fill(uint64_t index) {
    if (index < resident.size()) return &resident[index];
    if (index < resident_limit()) {
      resident.emplace_back(options.tag, block_bytes);
      return &resident.back();
    }
    if (options.scratch == nullptr)
      return error("{}: more than {} bytes and no scratch to spill to; this is a bug", options.what,
                   options.memory_limit_bytes);
    if (!file) {
      SPILLWAY_ASSIGN(file, options.scratch->create_file(options.what, options.purpose));
      filling.grow(MemoryTag::streams, block_bytes), writing.grow(MemoryTag::streams, block_bytes);
    }
    return &filling;
  }

  Status wait_for_writer() { return write.valid() ? write.get() : Status{}; }

  // Hands the filled block to the writer; the other buffer is filled next.
  Status spill(uint64_t record_count) {
    SPILLWAY_TRY(wait_for_writer());
    const uint64_t index = resident.size() + spilled_blocks;
    BlockHeader header{kBlockMagic, static_cast<uint32_t>(record_bytes), index, record_count, 0};
    std::swap(filling, writing);
    const uint64_t offset = spilled_blocks++ * block_bytes;
    write = std::async(std::launch::async, [this, header, offset]() mutable {
      header.checksum = checksum(records(writing), header.record_count * record_bytes);
      std::memcpy(writing.data(), &header, sizeof header);
      return file->write(offset, writing);
    });
    return {};
  }

  Status read_block(uint64_t spilled_index, std::span<std::byte> into) const {
    const uint64_t offset = spilled_index * block_bytes;
    SPILLWAY_TRY(file->read(offset, into));
    BlockHeader header;
    std::memcpy(&header, into.data(), sizeof header);
    const bool sane = header.magic == kBlockMagic && header.record_bytes == record_bytes &&
                      header.index == resident.size() + spilled_index && header.record_count <= records_per_block;
    if (!sane || checksum(into.data() + sizeof header, header.record_count * record_bytes) != header.checksum)
      return error("{}: block {} at byte {} of its scratch file came back damaged; check the disk", options.what,
                   spilled_index, offset);
    return {};
  }

  // How many spilled blocks may lie at the end of so much memory: each until its last record was read, behind what is
  // taken until then. Most room is lacking for the first of them or for the last.
  [[nodiscard]] uint64_t blocks_ahead(uint64_t memory_bytes, uint64_t taken_bytes_a_record) const {
    const auto has_room = [&](uint64_t index, uint64_t count) {
      const uint64_t read = (resident.size() + index + 1) * records_per_block;
      return read * taken_bytes_a_record + (count - index) * block_bytes <= memory_bytes;
    };
    uint64_t count = spilled_blocks;
    while (count > 0 && !(has_room(0, count) && has_room(count - 1, count))) --count;
    return count;
  }

  // Copies `count` records of a block, from the one numbered `first` in it on.
  Status copy(uint64_t block, uint64_t first, uint64_t count, std::byte* to) const {
    const auto copy_from = [&](std::span<const std::byte> bytes) {
      std::memcpy(to, bytes.data() + sizeof(BlockHeader) + first * record_bytes, count * record_bytes);
    };
    if (block < resident.size()) {
      copy_from(resident[block]);
      return {};
    }
    if (const uint64_t index = block - resident.size(); ahead && index < ahead->done.size()) {
      SPILLWAY_TRY(ahead->wait_for(index));
      copy_from(ahead->block(index));
      return {};
    }
    Buffer<std::byte>& bytes = thread_blocks.local();
    bytes.grow(MemoryTag::streams, block_bytes);
    SPILLWAY_TRY(read_block(block - resident.size(), bytes));
    copy_from(bytes);
    return {};
  }
};

ByteStream::ByteStream(size_t record_bytes, StreamOptions options)
    : state_(std::make_unique<State>(record_bytes, std::move(options))) {}
ByteStream::ByteStream(ByteStream&&) noexcept = default;
ByteStream& ByteStream::operator=(ByteStream&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}
ByteStream::~ByteStream() {
  if (state_ && state_->write.valid()) state_->write.wait();
}

Status ByteStream::append(std::span<const std::byte> records) {
  State& s = *state_;
  SPILLWAY_CHECK(s.finished, ==, false);
  uint64_t left = records.size() / s.record_bytes;
  const std::byte* from = records.data();
  while (left > 0) {
    const uint64_t block = s.size / s.records_per_block, at = s.size % s.records_per_block;
    const uint64_t now = std::min(left, s.records_per_block - at);
    SPILLWAY_ASSIGN(Buffer<std::byte>* const to, s.block_to_fill(block));
    std::memcpy(s.records(*to) + at * s.record_bytes, from, now * s.record_bytes);
    s.size += now, left -= now, from += now * s.record_bytes;
    if (to == &s.filling && at + now == s.records_per_block) SPILLWAY_TRY(s.spill(s.records_per_block));
  }
  return {};
}

Status ByteStream::append(std::span<const RecordSpan> pieces) {
  State& s = *state_;
  SPILLWAY_CHECK(s.finished, ==, false);
  uint64_t end = s.size;
  std::vector<uint64_t> firsts;
  for (const RecordSpan& piece : pieces) firsts.push_back(std::exchange(end, end + piece.count));
  if (end > s.resident_limit() * s.records_per_block) {
    for (const RecordSpan& piece : pieces)
      SPILLWAY_TRY(append({static_cast<const std::byte*>(piece.records), piece.count * s.record_bytes}));
    return {};
  }
  while (s.resident.size() * s.records_per_block < end) s.resident.emplace_back(s.options.tag, s.block_bytes);
  parallel_blocks(pieces.size(), 1, [&](size_t i, size_t, size_t) {
    const auto* from = static_cast<const std::byte*>(pieces[i].records);
    uint64_t first = firsts[i], left = pieces[i].count;
    while (left > 0) {
      const uint64_t at = first % s.records_per_block, now = std::min(left, s.records_per_block - at);
      std::memcpy(s.records(s.resident[first / s.records_per_block]) + at * s.record_bytes, from, now * s.record_bytes);
      first += now, left -= now, from += now * s.record_bytes;
    }
  });
  s.size = end;
  return {};
}

Status ByteStream::finish() {
  State& s = *state_;
  if (s.finished) return {};
  s.finished = true;
  if (s.file) {
    const uint64_t spilled = s.size - s.resident.size() * s.records_per_block;
    if (const uint64_t rest = spilled % s.records_per_block; rest != 0) SPILLWAY_TRY(s.spill(rest));
    SPILLWAY_TRY(s.wait_for_writer());
  }
  return {};
}

void ByteStream::read_ahead(std::span<std::byte> memory, uint64_t taken_bytes_a_record) {
  State& s = *state_;
  SPILLWAY_CHECK(s.finished, ==, true);
  s.ahead.reset();
  const uint64_t whole = memory.size() / kDirectAlignment * kDirectAlignment;  // the end of what is lent, aligned
  const uint64_t bytes = s.blocks_ahead(whole, taken_bytes_a_record) * s.block_bytes;
  if (bytes == 0) return;
  s.ahead = std::make_unique<Ahead>(memory.first(whole).last(bytes), s.block_bytes,
                                    [&s](uint64_t index, std::span<std::byte> into) { return s.read_block(index, into); });
}

void ByteStream::clear() {
  State& s = *state_;
  s.ahead.reset();
  if (s.write.valid()) s.write.wait();
  s.write = {};
  s.file.reset();
  s.size = s.spilled_blocks = 0;
  s.finished = false;
}

uint64_t ByteStream::size() const { return state_->size; }
uint64_t ByteStream::spilled_bytes() const { return state_->spilled_blocks * state_->block_bytes; }
uint64_t ByteStream::records_per_block() const { return state_->records_per_block; }

Status ByteStream::read(uint64_t first, std::span<std::byte> out) const {
  const State& s = *state_;
  const uint64_t count = out.size() / s.record_bytes;
  SPILLWAY_CHECK(first + count, <=, s.size);
  if (count == 0) return {};
  const uint64_t first_block = first / s.records_per_block, last_block = (first + count - 1) / s.records_per_block;
  return parallel_status(last_block - first_block + 1, [&](size_t i) {
    const uint64_t block = first_block + i, block_begin = block * s.records_per_block;
    const uint64_t from = std::max(first, block_begin), to = std::min(first + count, block_begin + s.records_per_block);
    return s.copy(block, from - block_begin, to - from, out.data() + (from - first) * s.record_bytes);
  });
}

}  // namespace spillway::cache
