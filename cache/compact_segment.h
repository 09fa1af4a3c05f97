#pragma once

// The columns of an attribute segment in fewer bytes, the same bits.
//
// Indices: vertices are numbered anew, in the order in which faces ask for them, and again where one was asked for too
// long ago, so that a byte tells a corner from the first vertex of its group of faces.
// Positions: where walls stand upright many vertices share two coordinates and many the third; pairs and lone
// coordinates are then kept once, and a vertex names them. Both only where they save something worth it.
//
// Functions of their arguments: the same input gives the same columns.

#include <cstdint>
#include <span>
#include <vector>

#include "cache/base/vec.h"

namespace spillway::cache {

inline constexpr uint32_t kFacesPerIndexGroup = 16;

// A group's corners are bases[group] + offsets[...].
struct NarrowIndices {
  std::vector<uint16_t> bases;   // one a group of faces
  std::vector<uint8_t> offsets;  // three a face
  std::vector<uint16_t> vertex;  // which vertex of the input each vertex is
};
// `vertex_bytes`: what another vertex costs. Empty where 16-bit indices take no more.
NarrowIndices narrow_indices(std::span<const uint16_t> indices, uint32_t vertex_count, uint32_t vertex_bytes);

// Which pair and which lone coordinate a position is made of.
struct PositionCode {
  uint16_t pair, lone;
};

struct PairedPositions {
  uint32_t lone_axis = 0;  // pairs are of axes (lone_axis + 1) % 3 and (lone_axis + 2) % 3
  std::vector<PositionCode> codes;
  std::vector<Float2> pairs;
  std::vector<float> lones;
};
// Empty where this would not save a quarter. At most 65535 positions.
PairedPositions pair_positions(std::span<const Float3> positions);

[[nodiscard]] inline Float3 paired_position(uint32_t lone_axis, Float2 pair, float lone) {
  if (lone_axis == 0) return {lone, pair.x, pair.y};
  return lone_axis == 1 ? Float3{pair.y, lone, pair.x} : Float3{pair.x, pair.y, lone};
}

}  // namespace spillway::cache
