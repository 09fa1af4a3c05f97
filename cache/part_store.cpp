#include "cache/part_store.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "cache/base/alignment.h"
#include "cache/base/check.h"
#include "cache/base/hash.h"
#include "cache/residency.h"
#include "cache/trace_log.h"

namespace spillway::cache {
namespace {

uint64_t aligned(uint64_t bytes) { return spillway::aligned(bytes, kDirectAlignment); }

// Chunks of one buffer, given back in the order in which they were placed.
class Ring {
 public:
  Ring() = default;
  Ring(MemoryTag tag, size_t size_bytes) : memory_(tag, size_bytes) {}

  // The chunk's offset, or nothing while it does not fit. An empty ring takes anything up to its size.
  std::optional<size_t> place(size_t bytes) {
    if (live_ == 0) head_ = tail_ = 0;
    const bool wrapped = live_ > 0 && head_ <= tail_;
    const size_t end = wrapped ? tail_ : memory_.size();
    if (head_ + bytes > end) {
      if (wrapped || bytes > tail_) return std::nullopt;
      head_ = 0;
    }
    ++live_;
    return std::exchange(head_, head_ + bytes);
  }
  void release(size_t offset, size_t bytes) { tail_ = offset + bytes, --live_; }
  void clear() { head_ = tail_ = live_ = 0; }
  std::byte* at(size_t offset) { return memory_.data() + offset; }
  [[nodiscard]] bool empty() const { return memory_.empty(); }

 private:
  Buffer<std::byte> memory_;
  size_t head_ = 0, tail_ = 0, live_ = 0;
};

enum class ReadState : uint8_t { planned, reading, ready, failed };

// One part to be read by a sweep: into memory of its own when it is kept, else into the ring.
struct Read {
  uint32_t part = 0;
  bool kept = false;
  ReadState state = ReadState::planned;
  size_t ring_offset = 0;
  Buffer<std::byte> memory;
  std::byte* bytes = nullptr;
  std::string failure;
};

enum class Early : uint8_t { no, begun, asked_for };

struct Slot {
  Buffer<std::byte> memory;  // empty: not resident
  bool seen = false;         // read before
  Early early = Early::no;   // its read began before the sweep, which names it
};

std::vector<uint64_t> sizes_of(std::span<const Part> parts) {
  std::vector<uint64_t> bytes;
  for (const Part& part : parts) bytes.push_back(part.size_bytes);
  return bytes;
}

}  // namespace

struct PartStore::State {
  State(ReadFile read_file, std::vector<Part> all_parts, Options all_options, Validate check)
      : file(std::move(read_file)),
        parts(std::move(all_parts)),
        options(std::move(all_options)),
        validate(std::move(check)),
        slots(parts.size()),
        residency(sizes_of(parts), options.memory_limit_bytes, options.read_ahead_bytes),
        valid_sums(parts.size()) {}
  ~State() { end_readers(); }

  ReadFile file;
  std::vector<Part> parts;
  Options options;
  Validate validate;
  std::function<void(uint32_t, std::span<const std::byte>)> on_residency;

  // Touched by the sweeping thread only.
  std::vector<Slot> slots;
  Residency residency;
  double wait_seconds = 0;
  uint64_t parts_evicted = 0;

  // Shared with the readers, under the mutex (a read's own fields belong to its reader while it is being read).
  mutable std::mutex mutex;
  std::condition_variable to_readers, to_visitor;
  std::vector<std::thread> readers;
  std::deque<Read> reads;            // where they are, whatever is added
  std::vector<uint64_t> valid_sums;  // of each part's bytes when they were found valid, 0: not yet; its reader's own
  size_t read_count = 0;             // of `reads`, in this sweep
  size_t early_count = 0;            // of these, the first ones, begun before it
  uint64_t early_ring_bytes = 0;
  size_t next_read = 0;
  size_t awaited = 0;  // reads that the visitor has asked for, in this sweep
  size_t active_reads = 0;
  bool ending = false;
  Ring ring;
  PartStoreCounters counters;

  [[nodiscard]] uint64_t held_bytes(uint32_t part) const { return residency.part_bytes(part); }
  [[nodiscard]] bool may_read() const {
    return next_read < read_count && next_read < awaited + std::min<size_t>(options.reads_ahead, read_count);
  }
  [[nodiscard]] std::span<const std::byte> bytes_of(uint32_t part) const;
  [[nodiscard]] std::string place_of(uint32_t part) const;

  // Reading, on the reader threads.
  void start_readers();
  void end_readers();
  void read_until_ended();
  bool claim(Read& read);
  Status fetch(Read& read);
  Status check(const Read& read);
  void finish(Read& read, const Status& status);

  // Of a sweep to come, on any thread.
  bool begin_early(uint32_t part);

  // Sweeping, on the caller's thread.
  void plan_reads(std::span<const uint32_t> wanted_parts);
  void plan_read(uint32_t part, bool kept);
  Status visit_early(const Visit& visit);
  void release(const Read& read);
  Read& wait_for(size_t index);
  Status visit_read(Read& read, const Visit& visit);
  void make_resident(Read& read);
  void stop_reads();

  // At wave boundaries.
  void evict(uint32_t part);
};

// ---- reading ----

std::span<const std::byte> PartStore::State::bytes_of(uint32_t part) const {
  const Slot& slot = slots[part];
  return slot.memory.empty() ? std::span<const std::byte>{} : std::span(slot.memory.data(), parts[part].size_bytes);
}

std::string PartStore::State::place_of(uint32_t part) const {
  return fmt::format("{}: part {} at byte {}", file.path().string(), part, parts[part].offset_bytes);
}

void PartStore::State::start_readers() {
  if (!readers.empty()) return;
  for (int i = 0; i < std::max(1, options.reader_threads); ++i) readers.emplace_back([this] { read_until_ended(); });
}

void PartStore::State::end_readers() {
  {
    const std::lock_guard lock(mutex);
    ending = true;
  }
  to_readers.notify_all();
  for (std::thread& reader : readers) reader.join();
  readers.clear();
  ending = false;
}

// Reads are claimed in order, and so is their place in the ring: the visitor gives it back in the same order.
bool PartStore::State::claim(Read& read) {
  if (!read.kept) {
    const std::optional<size_t> offset = ring.place(held_bytes(read.part));
    if (!offset) return false;
    read.ring_offset = *offset;
    read.bytes = ring.at(*offset);
  }
  read.state = ReadState::reading;
  ++active_reads;
  ++next_read;
  return true;
}

void PartStore::State::read_until_ended() {
  trace_log_name_thread("reader");
  std::unique_lock lock(mutex);
  while (true) {
    Read* read = nullptr;
    to_readers.wait(lock, [&] {
      if (!ending && may_read() && claim(reads[next_read])) read = &reads[next_read - 1];
      return ending || read != nullptr;
    });
    if (read == nullptr) return;
    lock.unlock();
    const Status status = fetch(*read);
    lock.lock();
    finish(*read, status);
  }
}

Status PartStore::State::fetch(Read& read) {
  const Part& part = parts[read.part];
  if (read.kept) {
    read.memory = Buffer<std::byte>(options.tag, held_bytes(read.part));
    read.bytes = read.memory.data();
  }
  // Whole blocks where the file has them: direct reads want aligned sizes.
  const uint64_t size = std::min(held_bytes(read.part), file.size_bytes() - part.offset_bytes);
  if (const Status status = file.read(part.offset_bytes, {read.bytes, size}); !status)
    return error("{} cannot be read: {}", place_of(read.part), status.error().message);
  return check(read);
}

// Bytes that were found valid before are known again by their checksum: going through their laws takes longer.
Status PartStore::State::check(const Read& read) {
  if (!validate) return {};
  const std::span<const std::byte> bytes(read.bytes, parts[read.part].size_bytes);
  const uint64_t sum = residency.fits() ? 0 : checksum(bytes.data(), bytes.size());
  if (sum != 0 && sum == valid_sums[read.part]) return {};
  SPILLWAY_TRY(validate(bytes, place_of(read.part)));
  valid_sums[read.part] = sum;
  return {};
}

void PartStore::State::finish(Read& read, const Status& status) {
  Slot& slot = slots[read.part];
  const uint64_t size = parts[read.part].size_bytes;
  ++counters.parts_read;
  counters.bytes_read += size;
  if (slot.seen) ++counters.parts_read_again;
  if (!slot.seen) counters.unique_bytes += size;
  slot.seen = true;
  if (!status) read.failure = status.error().message;
  read.state = status ? ReadState::ready : ReadState::failed;
  --active_reads;
  to_visitor.notify_all();
}

// ---- sweeping ----

// Under the mutex, as what follows: readers may be at work on reads that began early.
void PartStore::State::plan_read(uint32_t part, bool kept) {
  if (read_count == reads.size()) reads.emplace_back();
  Read& read = reads[read_count++];
  read.part = part;
  read.kept = kept;
  read.state = ReadState::planned;
  if (!kept && ring.empty()) ring = Ring(options.tag, residency.ring_bytes());
  start_readers();
}

bool PartStore::State::begin_early(uint32_t part) {
  const std::lock_guard lock(mutex);
  Slot& slot = slots[part];
  if (!slot.memory.empty() || slot.early != Early::no || early_count >= options.reads_ahead) return false;
  const bool kept = residency.take_room(part);
  if (!kept) {
    if (early_ring_bytes + held_bytes(part) > residency.ring_bytes()) return false;
    early_ring_bytes += held_bytes(part);
  }
  slot.early = Early::begun;
  plan_read(part, kept);
  ++early_count;
  return true;
}

// Which parts stay does not depend on the direction of the sweep.
void PartStore::State::plan_reads(std::span<const uint32_t> wanted_parts) {
  const bool descends = wanted_parts.size() > 1 && wanted_parts.front() > wanted_parts.back();
  const auto ascending = [&](size_t i) { return wanted_parts[descends ? wanted_parts.size() - 1 - i : i]; };
  {
    const std::lock_guard lock(mutex);
    for (size_t i = 0; i < wanted_parts.size(); ++i) {
      const uint32_t part = ascending(i);
      SPILLWAY_CHECK(part, <, parts.size());
      if (i > 0) SPILLWAY_CHECK(ascending(i - 1), <, part);
      residency.ask(part);
      Slot& slot = slots[part];
      if (slot.early == Early::begun)
        slot.early = Early::asked_for;
      else if (slot.memory.empty())
        plan_read(part, residency.take_room(part));
    }
    if (descends)
      std::reverse(reads.begin() + static_cast<ptrdiff_t>(early_count),
                   reads.begin() + static_cast<ptrdiff_t>(read_count));
    awaited = 0;
  }
  to_readers.notify_all();
}

Read& PartStore::State::wait_for(size_t index) {
  std::unique_lock lock(mutex);
  Read& read = reads[index];
  awaited = index + 1;
  if (options.reads_ahead < read_count) to_readers.notify_all();
  const auto done = [&] { return read.state == ReadState::ready || read.state == ReadState::failed; };
  if (done()) return read;
  const TraceSpan span("wait", "wait for a read");
  const auto start = std::chrono::steady_clock::now();
  to_visitor.wait(lock, done);
  wait_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return read;
}

void PartStore::State::make_resident(Read& read) {
  Slot& slot = slots[read.part];
  slot.memory = std::move(read.memory);
  read.kept = false;  // the room is the slot's now
  residency.set_resident(read.part);
  if (on_residency) on_residency(read.part, bytes_of(read.part));
}

Status PartStore::State::visit_read(Read& read, const Visit& visit) {
  if (read.state == ReadState::failed) return Error{read.failure};
  if (options.access_log) options.access_log(read.part, true);
  SPILLWAY_TRY(visit(read.part, {read.bytes, parts[read.part].size_bytes}));
  if (read.kept) {
    make_resident(read);
    return {};
  }
  ++parts_evicted;
  release(read);
  return {};
}

void PartStore::State::release(const Read& read) {
  {
    const std::lock_guard lock(mutex);
    ring.release(read.ring_offset, held_bytes(read.part));
  }
  to_readers.notify_all();
}

Status PartStore::State::visit_early(const Visit& visit) {
  for (size_t i = 0; i < early_count; ++i) {
    Read& read = wait_for(i);
    if (slots[read.part].early == Early::asked_for)
      SPILLWAY_TRY(visit_read(read, visit));
    else if (!read.kept)
      release(read);
  }
  return {};
}

// After the last visit, or an early end: nothing is in flight, what was not visited is dropped.
void PartStore::State::stop_reads() {
  std::unique_lock lock(mutex);
  next_read = read_count;
  to_visitor.wait(lock, [&] { return active_reads == 0; });
  for (size_t i = 0; i < read_count; ++i) {
    Read& read = reads[i];
    if (!read.kept) continue;
    residency.give_back(read.part);
    read.memory = {};
    read.kept = false;
  }
  for (size_t i = 0; i < early_count; ++i) slots[reads[i].part].early = Early::no;
  read_count = next_read = early_count = awaited = 0;
  early_ring_bytes = 0;
  ring.clear();
}

void PartStore::State::evict(uint32_t part) {
  if (on_residency) on_residency(part, {});
  slots[part].memory = {};
  ++parts_evicted;
}

Status PartStore::sweep(std::span<const uint32_t> parts, const Visit& visit) {
  State& s = *state_;
  s.plan_reads(parts);
  Status status = s.visit_early(visit);
  size_t next = s.early_count;
  for (const uint32_t part : parts) {
    if (!status) break;
    if (s.slots[part].early != Early::no) continue;
    if (next < s.read_count && s.reads[next].part == part) {
      status = s.visit_read(s.wait_for(next++), visit);
    } else {
      if (s.options.access_log) s.options.access_log(part, false);
      status = visit(part, s.bytes_of(part));
    }
  }
  s.stop_reads();
  if (all_resident()) s.end_readers();
  return status;
}

// ---- the store ----

uint64_t PartStore::smallest_limit_bytes(std::span<const Part> parts) {
  uint64_t bytes = 0;
  for (const Part& part : parts) bytes = std::max(bytes, aligned(part.size_bytes));
  return bytes;
}

uint64_t PartStore::whole_bytes(std::span<const Part> parts) {
  uint64_t bytes = 0;
  for (const Part& part : parts) bytes += aligned(part.size_bytes);
  return bytes;
}

namespace {

Status check_parts(const ReadFile& file, std::span<const Part> parts) {
  for (size_t i = 0; i < parts.size(); ++i) {
    const auto [offset, size] = parts[i];
    const bool inside = offset <= file.size_bytes() && size <= file.size_bytes() - offset;
    if (offset % kDirectAlignment == 0 && size > 0 && inside) continue;
    return error(
        "{}: part {} ({} bytes at byte {}) does not lie in the file ({} bytes) at a multiple of {}; the file "
        "or its table is damaged: pack the scene again",
        file.path().string(), i, size, offset, file.size_bytes(), kDirectAlignment);
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<PartStore>> PartStore::open(const std::filesystem::path& path, std::vector<Part> parts,
                                                   Options options, Validate validate) {
  SPILLWAY_ASSIGN(ReadFile file, ReadFile::open(path, {options.purpose, options.direct}));
  SPILLWAY_TRY(check_parts(file, parts));
  const uint64_t limit = options.memory_limit_bytes;
  const uint64_t smallest = smallest_limit_bytes(parts);
  if (limit < smallest)
    return error("{}: its largest part does not fit in the {} bytes of memory for {}; {} bytes would do", path.string(),
                 limit, spillway::name(options.tag), smallest);
  auto state = std::make_unique<State>(std::move(file), std::move(parts), std::move(options), std::move(validate));
  return std::unique_ptr<PartStore>(new PartStore(std::move(state)));
}

PartStore::PartStore(std::unique_ptr<State> state) : state_(std::move(state)) {}
PartStore::~PartStore() = default;

size_t PartStore::size() const { return state_->parts.size(); }
bool PartStore::all_resident() const { return state_->residency.all_resident(); }
bool PartStore::fits() const { return state_->residency.fits(); }
bool PartStore::direct_effective() const { return state_->file.direct_effective(); }
bool PartStore::read_early(uint32_t part) {
  if (!state_->begin_early(part)) return false;
  state_->to_readers.notify_all();
  return true;
}
void PartStore::note_use(uint32_t part) { state_->residency.ask(part); }
std::span<const std::byte> PartStore::resident(uint32_t part) const { return state_->bytes_of(part); }

void PartStore::on_residency(std::function<void(uint32_t, std::span<const std::byte>)> callback) {
  state_->on_residency = std::move(callback);
}

PartStoreCounters PartStore::counters() const {
  const std::lock_guard lock(state_->mutex);
  PartStoreCounters counters = state_->counters;
  counters.parts_evicted = state_->parts_evicted;
  counters.wait_seconds = state_->wait_seconds;
  return counters;
}

void PartStore::rebalance() {
  state_->residency.rebalance([this](uint32_t part) { state_->evict(part); });
}

}  // namespace spillway::cache
