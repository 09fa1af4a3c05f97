#include "cache/external_sort.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <atomic>
#include <vector>

#include "cache/base/alignment.h"
#include "cache/base/check.h"
#include "cache/base/hash.h"
#include "cache/base/parallel.h"
#include "cache/base/parallel_status.h"
#include "cache/radix_sort.h"

// A run on scratch: sorted records in blocks of `block_bytes` (BlockHeader, records, zeros), and apart from them the keys
// of the run, in blocks of the same count, so that a partition finds its bounds by reading keys of two blocks a run.
// Every run's first key of each block stays in memory (16 bytes a block): splitters are chosen among these.

namespace spillway::cache {
namespace {

constexpr uint32_t kRunMagic = 0x4e525053;  // "SPRN"
constexpr size_t kBlock = 4096;  // items a task
constexpr size_t kPrefetch = 8;  // records ahead of the one that is copied: they lie in another order

struct BlockHeader {
  uint32_t magic;
  uint32_t count;
  uint64_t index;
  uint64_t checksum;  // of keys and records
};

uint64_t aligned(uint64_t bytes) { return spillway::aligned(bytes, kDirectAlignment); }

struct Run {
  uint64_t offset_bytes = 0;
  uint64_t size = 0;                 // records
  std::vector<SortKey> block_keys;   // first key of each block
};

}  // namespace

struct ByteSort::State {
  size_t record_bytes;
  StreamOptions options;
  uint64_t capacity;                 // records of a run, and of a partition
  uint64_t records_per_block, block_bytes;
  uint64_t request_blocks;           // neighbouring blocks of a run that are written or read at once
  Buffer<std::byte> records;
  Buffer<SortKey> keys;
  Buffer<KeyIndex<uint64_t>> pairs, pair_scratch;
  uint64_t filled = 0, size = 0;
  std::unique_ptr<Scratch::File> file;
  uint64_t file_bytes = 0;
  std::vector<Run> runs;
  std::vector<SortKey> splitters;    // partition p holds keys in [splitters[p], splitters[p + 1])
  tbb::enumerable_thread_specific<Buffer<std::byte>> thread_requests;  // what each thread writes or reads
  bool finished = false;

  State(size_t bytes, StreamOptions o) : record_bytes(bytes), options(std::move(o)) {
    const uint64_t item_bytes = record_bytes + sizeof(SortKey) + 2 * sizeof(KeyIndex<uint64_t>);
    capacity = std::clamp<uint64_t>(options.memory_limit_bytes / item_bytes, 64, UINT32_MAX);
    const uint64_t stored = record_bytes + sizeof(SortKey);
    // A partition reads a piece of every run, rounded to blocks: blocks are small against a partition.
    const uint64_t wanted = std::clamp<uint64_t>(capacity * stored / 256, kDirectAlignment, options.block_bytes);
    block_bytes = aligned(std::max<uint64_t>(wanted, sizeof(BlockHeader) + stored));
    records_per_block = (block_bytes - sizeof(BlockHeader)) / stored;
    request_blocks = std::max<uint64_t>(1, options.block_bytes / block_bytes);
  }

  // Room for `wanted` items in all arrays, by doubling up to the capacity (a partition of very many runs may need more).
  void grow(uint64_t wanted) {
    const uint64_t had = keys.capacity();
    if (wanted <= had) return;
    const uint64_t count = std::max(wanted, std::min(capacity, std::max<uint64_t>(2 * had, 4096)));
    records.grow(options.tag, count * record_bytes);
    keys.grow(options.tag, count), pairs.grow(options.tag, count), pair_scratch.grow(options.tag, count);
  }

  // Orders pairs by the whole key: radix on the high half, then each run of equal high halves by the low one.
  void sort_filled() {
    const std::span items(pairs.data(), filled);
    parallel_blocks(filled, kBlock, [&](size_t, size_t first, size_t last) {
      for (size_t i = first; i < last; ++i) items[i] = {keys[i].high, static_cast<uint32_t>(i)};
    });
    radix_sort(items, {pair_scratch.data(), filled});
    sort_ties(items);
  }

  // First all ties are found, each where it begins, then sorted: nobody looks at an item that another moves.
  void sort_ties(std::span<KeyIndex<uint64_t>> items) {
    using Tie = std::span<KeyIndex<uint64_t>>;
    std::vector<std::vector<Tie>> ties(block_count(items.size(), kBlock));
    parallel_blocks(items.size(), kBlock, [&](size_t b, size_t first, size_t last) {
      while (first > 0 && first < last && items[first].key == items[first - 1].key) ++first;
      while (first < last) {
        size_t end = first + 1;
        while (end < items.size() && items[end].key == items[first].key) ++end;
        if (end - first > 1) ties[b].push_back(items.subspan(first, end - first));
        first = end;
      }
    });
    parallel_blocks(ties.size(), 1, [&](size_t b, size_t, size_t) {
      for (const Tie tie : ties[b]) std::ranges::sort(tie, {}, [&](const auto& item) { return keys[item.index].low; });
    });
  }

  // Writes the sorted records as a run, and forgets them.
  Status spill_run() {
    if (options.scratch == nullptr)
      return error("{}: more than {} bytes and no scratch to spill to; this is a bug", options.what,
                   options.memory_limit_bytes);
    if (!file) {
      SPILLWAY_ASSIGN(file, options.scratch->create_file(options.what, options.purpose));
    }
    sort_filled();
    Run run{file_bytes, filled, {}};
    const uint64_t blocks = block_count(filled, records_per_block);
    run.block_keys.resize(blocks);
    // Every thread fills and writes requests of its own: their checksums and writes go side by side.
    SPILLWAY_TRY(parallel_status(block_count(blocks, request_blocks), [&](size_t r) -> Status {
      const uint64_t begin = r * request_blocks, end = std::min(begin + request_blocks, blocks);
      Buffer<std::byte>& request = thread_requests.local();
      request.grow(MemoryTag::streams, (end - begin) * block_bytes);
      for (uint64_t b = begin; b < end; ++b) {
        const uint64_t first = b * records_per_block;
        run.block_keys[b] = keys[pairs[first].index];
        fill_block(request.data() + (b - begin) * block_bytes, first, std::min(records_per_block, filled - first), b);
      }
      return file->write(run.offset_bytes + begin * block_bytes, {request.data(), (end - begin) * block_bytes});
    }));
    file_bytes += blocks * block_bytes;
    runs.push_back(std::move(run));
    filled = 0;
    return {};
  }

  // Keys first, then records.
  void fill_block(std::byte* block, uint64_t first, uint64_t count, uint64_t index) const {
    std::byte* const body = block + sizeof(BlockHeader);
    auto* const to = reinterpret_cast<SortKey*>(body);
    std::byte* const to_records = body + count * sizeof(SortKey);
    const auto record = [&](uint64_t i) { return records.data() + uint64_t{pairs[first + i].index} * record_bytes; };
    for (uint64_t i = 0; i < count; ++i) {
      if (i + kPrefetch < count) __builtin_prefetch(record(i + kPrefetch)), __builtin_prefetch(record(i + kPrefetch) + 64);
      to[i] = keys[pairs[first + i].index];
      std::memcpy(to_records + i * record_bytes, record(i), record_bytes);
    }
    const uint64_t used = count * (sizeof(SortKey) + record_bytes);
    const BlockHeader header{kRunMagic, static_cast<uint32_t>(count), index, checksum(body, used)};
    std::memcpy(block, &header, sizeof header);
    std::memset(body + used, 0, block_bytes - sizeof header - used);
  }

  // A block of a run, checked: its keys and its records.
  struct Block {
    std::span<const SortKey> keys;
    const std::byte* records;
  };
  Result<Block> checked(const std::byte* block, const Run& run, uint64_t index) const {
    BlockHeader header;
    std::memcpy(&header, block, sizeof header);
    const std::byte* body = block + sizeof header;
    const uint64_t used = header.count * (sizeof(SortKey) + record_bytes);
    const bool sane = header.magic == kRunMagic && header.index == index && header.count <= records_per_block;
    if (!sane || checksum(body, used) != header.checksum)
      return error("{}: block {} at byte {} of a sorted run came back damaged; check the disk", options.what, index,
                   run.offset_bytes + index * block_bytes);
    return Block{{reinterpret_cast<const SortKey*>(body), header.count}, body + header.count * sizeof(SortKey)};
  }

  // Splitters such that no partition can exceed the capacity. The keys of blocks are samples: between two neighbouring
  // splitters `n` sampled blocks start, so at most n + runs blocks overlap.
  void choose_splitters() {
    std::vector<SortKey> samples;
    for (const Run& run : runs) samples.insert(samples.end(), run.block_keys.begin(), run.block_keys.end());
    std::sort(samples.begin(), samples.end());
    const uint64_t blocks_that_fit = capacity / records_per_block;
    const uint64_t stride = blocks_that_fit > runs.size() + 1 ? blocks_that_fit - runs.size() : 1;
    splitters = {SortKey{0, 0}};
    for (uint64_t i = stride; i < samples.size(); i += stride)
      if (splitters.back() < samples[i]) splitters.push_back(samples[i]);
  }

  // Neighbouring blocks of a run that may hold keys of [from, to), at most a request of them.
  struct Place {
    const Run* run;
    uint64_t index, count;
  };
  [[nodiscard]] std::vector<Place> blocks_between(const SortKey& from, const SortKey* to) const {
    std::vector<Place> places;
    for (const Run& run : runs) {
      const auto begin = run.block_keys.begin();
      const auto after = std::upper_bound(begin, run.block_keys.end(), from);
      const auto end = to == nullptr ? run.block_keys.end() : std::lower_bound(after, run.block_keys.end(), *to);
      const auto last = static_cast<uint64_t>(end - begin);
      for (auto index = static_cast<uint64_t>(std::max<ptrdiff_t>(after - begin - 1, 0)); index < last; index += request_blocks)
        places.push_back({&run, index, std::min(request_blocks, last - index)});
    }
    return places;
  }

  // Brings the records of [from, to) into the filling arrays, in any order: they are sorted by a total order next.
  Status load(const SortKey& from, const SortKey* to) {
    const std::vector<Place> places = blocks_between(from, to);
    uint64_t blocks = 0;
    for (const Place& place : places) blocks += place.count;
    filled = 0;
    grow(blocks * records_per_block);
    std::atomic<uint64_t> placed = 0;
    const Status status = parallel_status(places.size(), [&](size_t p) -> Status {
      const Place& place = places[p];
      Buffer<std::byte>& request = thread_requests.local();
      request.grow(MemoryTag::streams, place.count * block_bytes);
      SPILLWAY_TRY(file->read(place.run->offset_bytes + place.index * block_bytes, {request.data(), place.count * block_bytes}));
      for (uint64_t b = 0; b < place.count; ++b) {
        SPILLWAY_ASSIGN(const Block content, checked(request.data() + b * block_bytes, *place.run, place.index + b));
        keep(content, from, to, placed);
      }
      return {};
    });
    filled = placed;
    return status;
  }

  // Copies what lies in [from, to) behind what others placed.
  void keep(const Block& block, const SortKey& from, const SortKey* to, std::atomic<uint64_t>& placed) {
    const auto begin = block.keys.begin(), end = block.keys.end();
    const auto first = std::lower_bound(begin, end, from), last = to == nullptr ? end : std::lower_bound(begin, end, *to);
    const auto skipped = static_cast<uint64_t>(first - begin), count = static_cast<uint64_t>(last - first);
    const uint64_t at = placed.fetch_add(count);
    std::copy(first, last, keys.data() + at);
    std::memcpy(records.data() + at * record_bytes, block.records + skipped * record_bytes, count * record_bytes);
  }
};

ByteSort::ByteSort(size_t record_bytes, StreamOptions options)
    : state_(std::make_unique<State>(record_bytes, std::move(options))) {}
ByteSort::ByteSort(ByteSort&&) noexcept = default;
ByteSort& ByteSort::operator=(ByteSort&&) noexcept = default;
ByteSort::~ByteSort() = default;

Status ByteSort::append(std::span<const SortKey> keys, std::span<const std::byte> records) {
  State& s = *state_;
  SPILLWAY_CHECK(s.finished, ==, false);
  uint64_t done = 0;
  while (done < keys.size()) {
    if (s.filled == s.capacity) SPILLWAY_TRY(s.spill_run());
    const uint64_t now = std::min<uint64_t>(keys.size() - done, s.capacity - s.filled);
    s.grow(s.filled + now);
    std::memcpy(static_cast<void*>(s.keys.data() + s.filled), keys.data() + done, now * sizeof(SortKey));
    std::memcpy(s.records.data() + s.filled * s.record_bytes, records.data() + done * s.record_bytes,
                now * s.record_bytes);
    s.filled += now, s.size += now, done += now;
  }
  return {};
}

uint64_t ByteSort::capacity() const { return state_->capacity; }

std::span<std::byte> ByteSort::lend(uint64_t count) {
  State& s = *state_;
  SPILLWAY_CHECK(s.size, ==, 0u);
  count = std::min(count, s.capacity);
  s.grow(count);
  return {s.records.data(), count * s.record_bytes};
}

Status ByteSort::make_room(uint64_t count) {
  State& s = *state_;
  SPILLWAY_CHECK(s.finished, ==, false);
  SPILLWAY_CHECK(count, <=, s.capacity);
  if (s.filled + count > s.capacity) SPILLWAY_TRY(s.spill_run());
  s.grow(s.filled + count);
  return {};
}

void ByteSort::append_apart(std::span<const SortKey> keys, const std::byte* records) {
  State& s = *state_;
  if (keys.empty()) return;
  const uint64_t at = std::atomic_ref(s.filled).fetch_add(keys.size(), std::memory_order_relaxed);
  SPILLWAY_CHECK(at + keys.size(), <=, s.keys.capacity());
  std::atomic_ref(s.size).fetch_add(keys.size(), std::memory_order_relaxed);
  std::memcpy(static_cast<void*>(s.keys.data() + at), keys.data(), keys.size_bytes());
  std::memcpy(s.records.data() + at * s.record_bytes, records, keys.size() * s.record_bytes);
}

Status ByteSort::finish() {
  State& s = *state_;
  s.finished = true;
  if (s.size == 0) return {};
  if (s.runs.empty()) {
    s.splitters = {SortKey{0, 0}};
    return {};
  }
  if (s.filled > 0) SPILLWAY_TRY(s.spill_run());
  s.choose_splitters();
  return {};
}

void ByteSort::clear() {
  State& s = *state_;
  s.filled = s.size = s.file_bytes = 0;
  s.file.reset();
  s.runs.clear();
  s.splitters.clear();
  s.finished = false;
}

size_t ByteSort::partition_count() const { return state_->splitters.size(); }
uint64_t ByteSort::spilled_bytes() const { return state_->file_bytes; }
uint64_t ByteSort::size() const { return state_->size; }

Result<ByteSort::Partition> ByteSort::partition(size_t p) {
  State& s = *state_;
  SPILLWAY_CHECK(p, <, s.splitters.size());
  if (!s.runs.empty()) {
    SPILLWAY_TRY(s.load(s.splitters[p], p + 1 < s.splitters.size() ? &s.splitters[p + 1] : nullptr));
  }
  s.sort_filled();
  return Partition{{s.pairs.data(), s.filled}, s.records.data()};
}

}  // namespace spillway::cache
