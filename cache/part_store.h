#pragma once

// Parts of one large file (trace pages, attribute blocks) in memory as far as a budget allows; the rest is swept.
//
// Owns: the open file, the resident parts, the read-ahead buffer, the reader threads.
// Memory: `tag`, at most memory_limit_bytes: resident parts, plus one ring of read-ahead bytes for parts that come and
//         go. When all parts fit there is no ring, everything is read once, and the reader threads end with the last.
// Threads: resident() and read_early() may be called from any thread between sweeps; everything else by one thread at a
// time. The
//          visitor and the callbacks run on the sweeping thread, one part after the other, while a few reader threads
//          fetch and validate the next ones: `validate` must bear concurrent calls. No lock is held over I/O or
//          validation.
// Residency: see residency.h.
// Fails: short or failed reads and parts that `validate` refuses: an error naming file, part and offset. A part that is
//        read again is known by its checksum, and validated anew when that has changed. The store
//        remains usable: nothing is in flight, the part that failed is not in memory.

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
  uint64_t size_bytes = 0;    // more than 0
};

struct PartStoreCounters {
  uint64_t parts_read = 0;        // from the file
  uint64_t parts_read_again = 0;  // of those, not for the first time
  uint64_t parts_evicted = 0;     // dropped from memory after use
  uint64_t bytes_read = 0;
  uint64_t unique_bytes = 0;
  double wait_seconds = 0;  // the visitor waited for a read
};

class PartStore {
 public:
  struct Options {
    MemoryTag tag = MemoryTag::pages;
    IoPurpose purpose = IoPurpose::pages;
    uint64_t memory_limit_bytes = UINT64_MAX;
    uint64_t read_ahead_bytes = 32 << 20;  // within the limit, of which it takes a quarter at most unless two of the
                                           // largest parts need more; larger: more reads in flight, less resident
    int reader_threads = 4;
    uint32_t reads_ahead = UINT32_MAX;  // reads under way or done beyond the one that is visited; 0: none (ablation)
    bool direct = false;
    // Told of every visit of every sweep, in order, and whether its part had to be read: the log from which tests and
    // `whatif` recompute the counters. May be empty.
    std::function<void(uint32_t part, bool read)> access_log = {};
  };
  using Validate = std::function<Status(std::span<const std::byte> part, std::string_view where)>;

  // Refuses a limit below smallest_limit_bytes(parts), naming that number. `validate` may be empty.
  static Result<std::unique_ptr<PartStore>> open(const std::filesystem::path& path, std::vector<Part> parts,
                                                 Options options, Validate validate);
  ~PartStore();

  // The least memory that can sweep these parts: the largest one. And what holds all of them.
  [[nodiscard]] static uint64_t smallest_limit_bytes(std::span<const Part> parts);
  [[nodiscard]] static uint64_t whole_bytes(std::span<const Part> parts);

  [[nodiscard]] size_t size() const;
  // The part's bytes, or an empty span when it is not in memory.
  [[nodiscard]] std::span<const std::byte> resident(uint32_t part) const;
  // Called when a part becomes resident or leaves (empty span): lets the owner keep views.
  void on_residency(std::function<void(uint32_t part, std::span<const std::byte> bytes)> callback);

  // Visits `parts` (ascending or descending, without duplicates), resident ones included, in this order; each part that
  // is not resident is read exactly once and kept when there is room. The bytes are valid during the visit only.
  using Visit = std::function<Status(uint32_t part, std::span<const std::byte> bytes)>;
  Status sweep(std::span<const uint32_t> parts, const Visit& visit);

  // Begins to read a part that is not in memory and that the next sweep will visit: it visits such parts before all
  // others, in the order in which they were begun. One that it does not name after all was read for nothing. Refused,
  // as far as it would not stay, when the room to read ahead is taken.
  bool read_early(uint32_t part);

  // A resident part was used in this wave without a sweep: rebalance() then knows that it is wanted.
  void note_use(uint32_t part);
  // At a wave boundary: resident parts that fewer waves asked for give way to ones that more waves asked for.
  void rebalance();
  [[nodiscard]] PartStoreCounters counters() const;
  [[nodiscard]] bool all_resident() const;
  [[nodiscard]] bool fits() const;  // within the limit, all of them: nothing ever leaves
  [[nodiscard]] bool direct_effective() const;

 private:
  struct State;
  explicit PartStore(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace spillway::cache
