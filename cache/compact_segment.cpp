#include "cache/compact_segment.h"

#include <algorithm>
#include <bit>

#include "cache/base/hash.h"

namespace spillway::cache {
namespace {

constexpr uint32_t kMaxVertices = 65535;
// Vertices this far back can be named beside as many new ones as a group may need.
constexpr uint32_t kReach = 256 - 3 * kFacesPerIndexGroup;

// Numbers bit patterns in the order in which they are first seen: -0 is not 0 here.
class Numbering {
 public:
  explicit Numbering(size_t most)
      : slots_(std::bit_ceil(2 * most), kNone), shift_(64 - std::countr_zero(slots_.size())) {}

  uint16_t number(uint64_t bits) {
    for (size_t slot = mix64(bits) >> shift_;; slot = (slot + 1) & (slots_.size() - 1)) {
      if (slots_[slot] == kNone) {
        slots_[slot] = static_cast<uint16_t>(seen_.size());
        seen_.push_back(bits);
      }
      if (seen_[slots_[slot]] == bits) return slots_[slot];
    }
  }
  [[nodiscard]] const std::vector<uint64_t>& seen() const { return seen_; }

 private:
  static constexpr uint16_t kNone = 0xffff;
  std::vector<uint16_t> slots_;
  int shift_;
  std::vector<uint64_t> seen_;
};

uint64_t bits_of(float value) { return std::bit_cast<uint32_t>(value); }
float float_of(uint64_t bits) { return std::bit_cast<float>(static_cast<uint32_t>(bits)); }

// Positions split at an axis, as far as their tables stay below `most_bytes`; beyond, nothing.
PairedPositions paired_along(std::span<const Float3> positions, uint32_t lone_axis, size_t most_bytes) {
  const auto axis = static_cast<int>(lone_axis), first = (axis + 1) % 3, second = (axis + 2) % 3;
  Numbering pairs(positions.size()), lones(positions.size());
  PairedPositions paired;
  paired.lone_axis = lone_axis;
  paired.codes.reserve(positions.size());
  for (const Float3& p : positions) {
    paired.codes.push_back(
        {pairs.number(bits_of(p[first]) << 32 | bits_of(p[second])), lones.number(bits_of(p[axis]))});
    if (pairs.seen().size() * sizeof(Float2) + lones.seen().size() * sizeof(float) >= most_bytes) return {};
  }
  for (const uint64_t bits : pairs.seen()) paired.pairs.push_back({float_of(bits >> 32), float_of(bits)});
  for (const uint64_t bits : lones.seen()) paired.lones.push_back(float_of(bits));
  return paired;
}

}  // namespace

NarrowIndices narrow_indices(std::span<const uint16_t> indices, uint32_t vertex_count, uint32_t vertex_bytes) {
  constexpr size_t kGroup = size_t{3} * kFacesPerIndexGroup;
  NarrowIndices narrow;
  std::vector<uint32_t> latest(vertex_count, UINT32_MAX);  // a vertex's latest number
  narrow.offsets.reserve(indices.size());
  narrow.bases.reserve(indices.size() / kGroup + 1);
  for (size_t first = 0; first < indices.size(); first += kGroup) {
    const std::span<const uint16_t> group = indices.subspan(first, std::min(kGroup, indices.size() - first));
    const auto begin = static_cast<uint32_t>(narrow.vertex.size());
    const uint32_t lowest = begin > kReach ? begin - kReach : 0;
    uint32_t base = UINT32_MAX;
    for (const uint16_t index : group) {
      if (latest[index] == UINT32_MAX || latest[index] < lowest) {
        latest[index] = static_cast<uint32_t>(narrow.vertex.size());
        narrow.vertex.push_back(index);
      }
      base = std::min(base, latest[index]);
    }
    if (narrow.vertex.size() > kMaxVertices) return {};
    narrow.bases.push_back(static_cast<uint16_t>(base));
    for (const uint16_t index : group) narrow.offsets.push_back(static_cast<uint8_t>(latest[index] - base));
  }
  const uint64_t wide_bytes = indices.size() * sizeof(uint16_t) + uint64_t{vertex_count} * vertex_bytes;
  const uint64_t bytes = indices.size() + narrow.bases.size() * sizeof(uint16_t) + narrow.vertex.size() * vertex_bytes;
  return bytes < wide_bytes ? narrow : NarrowIndices{};
}

PairedPositions pair_positions(std::span<const Float3> positions) {
  PairedPositions best;
  size_t most_bytes = 3 * positions.size_bytes() / 4 - positions.size() * sizeof(PositionCode) + 1;
  for (const uint32_t axis : {2u, 1u, 0u}) {
    PairedPositions paired = paired_along(positions, axis, most_bytes);
    if (paired.codes.empty()) continue;
    most_bytes = paired.pairs.size() * sizeof(Float2) + paired.lones.size() * sizeof(float);
    best = std::move(paired);
  }
  return best;
}

}  // namespace spillway::cache
