#pragma once

// Which parts of a file are in memory: the policy of PartStore without the memory, so that `whatif` can replay it.
//
// Owns: a row a part. Memory: some bytes a part. Threads: one at a time.
// Policy: filled first come, first kept, then never displaced during a wave (a cyclic scan through an LRU cache hits
//         nothing); rebalance() at a wave boundary may swap resident parts for ones that more waves asked for. Part of
//         the limit is a ring for parts that come and go, unless everything fits.

#include <cstdint>
#include <functional>
#include <vector>

namespace spillway::cache {

class Residency {
 public:
  // part_bytes: of each in the file; in memory it takes whole blocks of kDirectAlignment. read_ahead_bytes: of the limit, of which it takes a quarter at most unless
  // two of the largest parts need more.
  Residency(std::vector<uint64_t> part_bytes, uint64_t memory_limit_bytes, uint64_t read_ahead_bytes);

  [[nodiscard]] size_t size() const { return slots_.size(); }
  [[nodiscard]] uint64_t part_bytes(uint32_t part) const { return part_bytes_[part]; }
  [[nodiscard]] uint64_t ring_bytes() const { return ring_bytes_; }  // 0: everything fits
  [[nodiscard]] bool fits() const { return ring_bytes_ == 0; }
  [[nodiscard]] bool is_resident(uint32_t part) const { return slots_[part].resident; }
  [[nodiscard]] bool all_resident() const { return resident_count_ == slots_.size(); }

  // This wave wants the part.
  void ask(uint32_t part) { slots_[part].asked = true; }
  // Whether a part that is about to be read may stay; its room is then taken, until it is resident or given back.
  bool take_room(uint32_t part);
  void set_resident(uint32_t part);
  void give_back(uint32_t part);

  // At a wave boundary: resident parts that fewer waves asked for give way to ones that more waves asked for. evict()
  // is called for each that leaves, while it still counts as resident.
  void rebalance(const std::function<void(uint32_t part)>& evict);

 private:
  struct Slot {
    uint32_t score = 0;
    bool resident = false;
    bool asked = false;   // in this wave
    bool wanted = false;  // rebalance() made room for it
  };
  void rank();
  size_t swap_in(uint32_t newcomer, size_t first, const std::function<void(uint32_t)>& evict);

  std::vector<uint64_t> part_bytes_;
  std::vector<Slot> slots_;
  uint64_t ring_bytes_ = 0;
  uint64_t room_bytes_ = 0;      // for resident parts: the limit without the ring
  uint64_t resident_bytes_ = 0;  // and parts on their way to residency
  uint64_t wanted_bytes_ = 0;    // of room that rebalance() made
  size_t resident_count_ = 0;
  std::vector<uint32_t> newcomers_, leavers_;  // of rebalance(), reused
};

}  // namespace spillway::cache
