#include "cache/residency.h"

#include <algorithm>
#include <numeric>

#include "cache/file.h"

namespace spillway::cache {
namespace {

// What a rebalanced score gains when a wave asks for a part; it loses an eighth of itself a wave, so that a part
// that is always asked for settles at eight times this.
constexpr uint32_t kAskedScore = 32;
// A newcomer must have been asked for in about two waves more than the part that leaves: a swap costs a read.
constexpr uint32_t kSwapMargin = 2 * kAskedScore;

// Two of the largest parts, so that one can be read while the other is visited; beyond that a quarter of the limit, so
// that three quarters stay with resident parts, which save reads in every wave.
uint64_t ring_size(uint64_t largest, uint64_t limit, uint64_t read_ahead) {
  const uint64_t least = std::min(limit, 2 * largest);
  return std::max(least, std::min(read_ahead, limit / 4)) / kDirectAlignment * kDirectAlignment;
}

}  // namespace

Residency::Residency(std::vector<uint64_t> part_bytes, uint64_t memory_limit_bytes, uint64_t read_ahead_bytes)
    : part_bytes_(std::move(part_bytes)), slots_(part_bytes_.size()) {
  for (uint64_t& bytes : part_bytes_) bytes = (bytes + kDirectAlignment - 1) / kDirectAlignment * kDirectAlignment;
  const uint64_t all = std::accumulate(part_bytes_.begin(), part_bytes_.end(), uint64_t{0});
  const uint64_t largest = part_bytes_.empty() ? 0 : std::ranges::max(part_bytes_);
  if (all > memory_limit_bytes) ring_bytes_ = ring_size(largest, memory_limit_bytes, read_ahead_bytes);
  room_bytes_ = memory_limit_bytes - ring_bytes_;
}

// First come, first kept, but the room that rebalance() made is kept for the parts it was made for.
bool Residency::take_room(uint32_t part) {
  Slot& slot = slots_[part];
  if (slot.wanted) wanted_bytes_ -= part_bytes_[part];
  slot.wanted = false;
  if (resident_bytes_ + wanted_bytes_ + part_bytes_[part] > room_bytes_) return false;
  resident_bytes_ += part_bytes_[part];
  return true;
}

void Residency::set_resident(uint32_t part) {
  slots_[part].resident = true;
  ++resident_count_;
}

void Residency::give_back(uint32_t part) { resident_bytes_ -= part_bytes_[part]; }

// Best newcomers first against weakest residents first; equal scores by index, so that runs agree.
void Residency::rank() {
  newcomers_.clear(), leavers_.clear();
  for (uint32_t part = 0; part < slots_.size(); ++part) {
    Slot& slot = slots_[part];
    slot.score = slot.score - slot.score / 8 + (slot.asked ? kAskedScore : 0);
    slot.asked = slot.wanted = false;
    (slot.resident ? leavers_ : newcomers_).push_back(part);
  }
  wanted_bytes_ = 0;
  const auto score = [this](uint32_t part) { return slots_[part].score; };
  std::ranges::stable_sort(newcomers_, std::ranges::greater{}, score);
  std::ranges::stable_sort(leavers_, std::ranges::less{}, score);
}

// Makes room for one newcomer out of the leavers from `first` on that it outscores. Returns how many left; none when
// that would not be room enough.
size_t Residency::swap_in(uint32_t newcomer, size_t first, const std::function<void(uint32_t)>& evict) {
  const uint64_t needed = resident_bytes_ + wanted_bytes_ + part_bytes_[newcomer];
  uint64_t freed = 0;
  size_t count = 0;
  while (needed > room_bytes_ + freed) {
    if (first + count == leavers_.size()) return 0;
    const uint32_t leaver = leavers_[first + count];
    if (slots_[leaver].score + kSwapMargin > slots_[newcomer].score) return 0;
    freed += part_bytes_[leaver];
    ++count;
  }
  for (size_t i = 0; i < count; ++i) {
    const uint32_t leaver = leavers_[first + i];
    evict(leaver);
    slots_[leaver].resident = false;
    resident_bytes_ -= part_bytes_[leaver];
    --resident_count_;
  }
  slots_[newcomer].wanted = true;
  wanted_bytes_ += part_bytes_[newcomer];
  return count;
}

void Residency::rebalance(const std::function<void(uint32_t)>& evict) {
  if (fits()) return;
  rank();
  size_t gone = 0;
  for (const uint32_t newcomer : newcomers_) {
    if (slots_[newcomer].score == 0) break;
    const size_t left = swap_in(newcomer, gone, evict);
    if (left == 0 && !slots_[newcomer].wanted) break;
    gone += left;
  }
}

}  // namespace spillway::cache
