#pragma once

// Parts of one large file (trace pages, attribute blocks) in memory as far as a budget allows; the rest is swept.
//
// Owns: the open file, the resident parts, the read-ahead buffers.
// Memory: `tag`, at most memory_limit_bytes: resident parts plus read_ahead_bytes for the sweep. When all parts fit,
//         no read-ahead buffer exists and everything is read once.
// Threads: resident() may be called from any thread between sweeps; sweep() by one thread at a time, its visitor is
//          called on the caller's thread, one part after the other, while a few reader threads fetch the next ones.
// Residency: filled first come, first kept, then never displaced during a wave (a cyclic scan through an LRU cache hits
//            nothing); rebalance() at a wave boundary may swap resident parts for ones that more waves asked for.
// Fails: short or failed reads and parts that `validate` refuses: an error naming file, part and offset.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/file.h"

namespace spillway::cache {

struct Part {
  uint64_t offset_bytes = 0;  // 4096-aligned
  uint64_t size_bytes = 0;
};

struct PartStoreCounters {
  uint64_t parts_read = 0;        // from the file
  uint64_t parts_read_again = 0;  // of those, not for the first time
  uint64_t parts_evicted = 0;     // dropped from memory after use
  uint64_t bytes_read = 0;
  uint64_t unique_bytes = 0;
  double wait_seconds = 0;        // the visitor waited for a read
};

class PartStore {
 public:
  struct Options {
    MemoryTag tag = MemoryTag::pages;
    IoPurpose purpose = IoPurpose::pages;
    uint64_t memory_limit_bytes = UINT64_MAX;
    uint64_t read_ahead_bytes = 32 << 20;  // within the limit; larger: more reads in flight
    int reader_threads = 4;
    bool direct = false;
  };
  using Validate = std::function<Status(std::span<const std::byte> part, std::string_view where)>;

  static Result<std::unique_ptr<PartStore>> open(const std::filesystem::path& path, std::vector<Part> parts,
                                                 Options options, Validate validate);
  ~PartStore();

  [[nodiscard]] size_t size() const;
  // The part's bytes, or an empty span when it is not in memory.
  [[nodiscard]] std::span<const std::byte> resident(uint32_t part) const;
  // Called when a part becomes resident or leaves (empty span): lets the owner keep views.
  void on_residency(std::function<void(uint32_t part, std::span<const std::byte> bytes)> callback);

  // Visits `parts` (ascending, without duplicates), resident ones included, in file order; each part that is not
  // resident is read exactly once and kept when there is room. The bytes are valid during the visit only.
  using Visit = std::function<Status(uint32_t part, std::span<const std::byte> bytes)>;
  Status sweep(std::span<const uint32_t> parts, const Visit& visit);

  // At a wave boundary: resident parts that fewer waves asked for give way to ones that more waves asked for.
  void rebalance();
  [[nodiscard]] PartStoreCounters counters() const;
  [[nodiscard]] bool all_resident() const;

 private:
  struct State;
  explicit PartStore(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace spillway::cache
