#pragma once

// Cameras of the city: from the air, in a street, on a flight. And the sky: an image of all directions, and the sun.

#include <filesystem>
#include <vector>

#include "pipeline/scene.h"
#include "tools/city/geometry.h"
#include "tools/city/street_plan.h"

namespace spillway::tools::city {

enum class CameraKind : uint8_t { aerial, street, flight };

struct View {
  Vec3 eye, target;
  double fov_deg = 40;  // of the shorter axis
};

// `part` of a flight, 0 to 1.
[[nodiscard]] View view_of(CameraKind kind, double part, const std::vector<Block>& blocks, const Terrain& terrain);
[[nodiscard]] pipeline::SceneSettings settings_of(const View& view);

inline constexpr uint32_t kSkySize = 512;  // texels an edge
// Radiance of the sky, without the sun.
[[nodiscard]] Rgb sky_radiance(TimeOfDay time, Float3 w_world);
Status write_sky(const std::filesystem::path& file, TimeOfDay time);
// The sun or the moon.
[[nodiscard]] shading::Light sun(TimeOfDay time);

}  // namespace spillway::tools::city
