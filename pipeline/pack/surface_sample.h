#pragma once

// A point of a limit surface as a vertex of triangles: position, normal, uv, and how a displacement moves it.

#include <functional>
#include <span>

#include "cache/base/vec.h"
#include "pipeline/pack/limit_surface.h"

namespace spillway::pipeline {

// Where a height is asked for, before anything moves. Widths are those of a step of the dicing, which heights are
// filtered to: in uv units, and of the surface.
struct HeightPlace {
  Float3 position, normal;
  Float2 uv;
  float width_uv, width;
};
using HeightsAt = std::function<void(std::span<const HeightPlace> places, std::span<float> heights)>;

struct SurfaceSample {
  Float3 position;         // on the limit surface
  Float3 normal_limit;     // unit
  Float2 uv;
  float height = 0;        // along normal_limit
  Float3 normal;           // unit, of the displaced surface
  [[nodiscard]] Float3 displaced() const { return position + normal_limit * height; }
};

[[nodiscard]] SurfaceSample surface_sample(const LimitFace& face, QuadPlace place);
// `step`: half a piece, as a share of the quad. Slopes are central differences over it, one-sided at the quad's sides.
[[nodiscard]] SurfaceSample displaced_sample(const LimitFace& face, QuadPlace place, double step, const HeightsAt& heights);

}  // namespace spillway::pipeline
