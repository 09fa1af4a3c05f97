#pragma once

// Cuts a grid of samples into bricks, slab by slab.
//
// In:     a source of samples, which is asked for one slab of bricks after the other, along z.
// Out:    bricks appended to a file, by ascending (z, y, x); those without a sample above zero are left out.
// Memory: what the source holds of a slab, and a brick a thread.
// Order:  serial; a brick's bytes follow from its samples alone.
// Fails:  samples that are negative or not finite, naming the first; a grid too wide for its coordinates; a full disk.

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>

#include "cache/base/result.h"
#include "cache/volume_brick.h"

namespace spillway::pipeline {

// Lattice points [lower, upper).
struct LatticeBox {
  std::array<int32_t, 3> lower{0, 0, 0}, upper{0, 0, 0};
};

class SampleSource {
 public:
  virtual ~SampleSource() = default;
  // Where samples may differ from zero.
  [[nodiscard]] virtual LatticeBox bounds() const = 0;
  // Whether all samples are halves, so that bricks of halves lose nothing.
  [[nodiscard]] virtual bool is_half() const = 0;
  [[nodiscard]] virtual uint32_t channels() const { return 1; }  // or 3
  // Only points of this box are asked for until the next call.
  virtual Status load(const LatticeBox& slab) = 0;
  // Fills side^3 samples a channel, one channel after the other, x fastest; points outside of bounds() are zero.
  virtual void copy(const std::array<int32_t, 3>& corner, int32_t side, std::span<float> samples) const = 0;
};

using AppendBrick = std::function<Status(std::span<const std::byte> brick)>;
// `where` names file and grid.
Status cut_bricks(SampleSource& source, int32_t brick_voxels, std::string_view where, const AppendBrick& append);

}  // namespace spillway::pipeline
