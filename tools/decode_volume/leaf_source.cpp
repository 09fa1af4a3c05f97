#include "tools/decode_volume/leaf_source.h"

#include <algorithm>

namespace spillway::tools {
namespace {

using Point = std::array<int32_t, 3>;
constexpr int32_t kSide = LeafSource::kLeafSide;

// sample(x, y, z) of every point of the cell that lies in the box of `side` at `corner`, to its place there.
template <class Sample>
void copy_cell(const Point& cell, const Point& corner, int32_t side, std::span<float> samples, const Sample& sample) {
  const auto from = [&](int a) { return std::max(cell[a], corner[a]); };
  const auto to = [&](int a) { return std::min(cell[a] + kSide, corner[a] + side); };
  for (int32_t z = from(2); z < to(2); ++z)
    for (int32_t y = from(1); y < to(1); ++y) {
      const size_t row = (static_cast<size_t>(z - corner[2]) * side + (y - corner[1])) * side;
      for (int32_t x = from(0); x < to(0); ++x) samples[row + (x - corner[0])] = sample(x, y, z);
    }
}

}  // namespace

void LeafSource::copy(const Point& corner, int32_t side, std::span<float> samples) const {
  const auto aligned = [](int32_t x) { return x & -kSide; };
  for (int32_t x = aligned(corner[0]); x < corner[0] + side; x += kSide)
    for (int32_t y = aligned(corner[1]); y < corner[1] + side; y += kSide)
      for (int32_t z = aligned(corner[2]); z < corner[2] + side; z += kSide) {
        const Values values = find({x, y, z});
        copy_cell({x, y, z}, corner, side, samples, [&](int32_t i, int32_t j, int32_t k) {
          return values.leaf != nullptr ? values.leaf[(i & 7) << 6 | (j & 7) << 3 | (k & 7)] : values.all;
        });
      }
}

}  // namespace spillway::tools
