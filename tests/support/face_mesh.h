#pragma once

// Face textures for tests: a grid of quads, each turned as one likes, and functions painted on it.

#include <cstdint>
#include <functional>
#include <vector>

#include "cache/facetex_writer.h"

namespace spillway::test {

// columns x rows unit squares in the plane. A face's corner 0 is the square's lower left one, turned `turn(face)`
// quarters against the clock.
class FaceGrid {
 public:
  using Turn = std::function<uint32_t(uint32_t)>;
  FaceGrid(
      uint32_t columns, uint32_t rows, Turn turn = [](uint32_t) { return 0u; });

  [[nodiscard]] uint32_t face_count() const { return columns_ * rows_; }
  [[nodiscard]] uint32_t turn(uint32_t face) const { return turn_(face); }
  // With neighbours; sizes by the caller.
  [[nodiscard]] std::vector<cache::FaceInfo> faces(
      const std::function<std::pair<uint8_t, uint8_t>(uint32_t)>& logs) const;
  // Where (u, v) of a face lies in the plane.
  struct Place {
    double x, y;
  };
  [[nodiscard]] Place place(uint32_t face, double u, double v) const;

 private:
  uint32_t columns_, rows_;
  Turn turn_;
};

// A face's texels: `value(u, v, channel)` at their middles, in 0..1.
std::vector<std::byte> painted_face(const cache::FaceTexFormat& format, const cache::FaceInfo& face,
                                    cache::FaceShape shape,
                                    const std::function<double(double, double, uint32_t)>& value);

}  // namespace spillway::test
