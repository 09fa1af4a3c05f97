#include "tools/city/view.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>

#include "shading/environment.h"
#include "tools/import/transform.h"

namespace spillway::tools::city {
namespace {

// Along the middle of a street, from one end of the block towards the other.
View street_view(const std::vector<Block>& blocks, const Terrain& terrain) {
  const double r = terrain.radius_m();
  const Block* best = nullptr;
  size_t best_edge = 0;
  double best_score = -1e30;
  for (const Block& block : blocks) {
    if (block.use != BlockUse::built || (block.district != District::midtown && block.district != District::old_town))
      continue;
    for (size_t i = 0; i < block.cell.size(); ++i) {
      const Vec2 a = block.cell[i].at, edge = next_corner(block.cell, i).at - a;
      if (block.cell[i].street > 8 || block.cell[i].street < 4) continue;
      // Long, near downtown, and looking towards it.
      const double score = std::min(length(edge), 180.0) / 180 - 2.5 * std::fabs(length(a) / r - 0.25) +
                           1.4 * dot(normalize(edge), normalize(a * -1)) +
                           (block.district == District::old_town ? 0.5 : 0.0);
      if (score > best_score) best_score = score, best = &block, best_edge = i;
    }
  }
  if (best == nullptr && !blocks.empty()) best = &blocks.front(), best_edge = longest_edge(best->cell);
  if (best == nullptr) return {{0, -60, terrain.height({0, -60}) + 1.7}, {0, 0, terrain.height({0, 0}) + 6}, 50};
  const Vec2 a = best->cell[best_edge].at, along = normalize(next_corner(best->cell, best_edge).at - a);
  const double street = best->cell[best_edge].street;
  const Vec2 eye = a + along * 6 + left_of(along) * (street * 0.12),
             target = a + along * 90 - left_of(along) * (street * 0.1);
  return {{eye.x, eye.y, terrain.height(eye) + 1.75}, {target.x, target.y, terrain.height(eye) + 9.5}, 48};
}

View aerial_view(const Terrain& terrain) {
  const double r = std::max(terrain.radius_m(), 250.0);
  return {{-0.50 * r, -0.84 * r, 0.20 * r}, {0.12 * r, -0.03 * r, 0.015 * r}, 38};
}

// From over the bay past downtown's towers to the hills.
View flight_view(double part, const Terrain& terrain) {
  const double r = std::max(terrain.radius_m(), 250.0), angle = -1.2 + 1.9 * part;
  const Vec2 eye = direction_of(angle) * (r * (1.15 - 0.6 * part));
  return {{eye.x, eye.y, r * (0.36 - 0.12 * part) + 60}, {0, 0.04 * r * part, 0.05 * r}, 42};
}

float mix(float a, float b, float t) { return a + (b - a) * t; }
Rgb mix(Rgb a, Rgb b, float t) { return {mix(a.r, b.r, t), mix(a.g, b.g, t), mix(a.b, b.b, t)}; }

Float3 towards_sun(TimeOfDay time) {
  switch (time) {
    case TimeOfDay::day:
      return spillway::normalize({-0.62f, -0.48f, 0.62f});
    case TimeOfDay::dusk:
      return spillway::normalize({-0.93f, 0.36f, 0.055f});
    case TimeOfDay::night:
      break;
  }
  return spillway::normalize({0.5f, -0.45f, 0.74f});  // the moon
}

struct SkyColours {
  Rgb horizon, zenith, glow;
  float glow_width;
};
SkyColours sky_colours(TimeOfDay time) {
  switch (time) {
    case TimeOfDay::day:
      return {{1.15f, 1.25f, 1.38f}, {0.27f, 0.47f, 0.92f}, {1.0f, 0.85f, 0.62f}, 12};
    case TimeOfDay::dusk:
      return {{0.36f, 0.22f, 0.24f}, {0.035f, 0.06f, 0.16f}, {1.5f, 0.62f, 0.16f}, 5};
    case TimeOfDay::night:
      break;
  }
  return {{0.046f, 0.050f, 0.082f}, {0.009f, 0.013f, 0.036f}, {0.02f, 0.024f, 0.03f}, 30};
}

}  // namespace

View view_of(CameraKind kind, double part, const std::vector<Block>& blocks, const Terrain& terrain) {
  switch (kind) {
    case CameraKind::street:
      return street_view(blocks, terrain);
    case CameraKind::flight:
      return flight_view(part, terrain);
    default:
      return aerial_view(terrain);
  }
}

pipeline::SceneSettings settings_of(const View& view) {
  pipeline::SceneSettings settings;
  const tools::Vec3 eye{view.eye.x, view.eye.y, view.eye.z}, target{view.target.x, view.target.y, view.target.z};
  if (const auto camera_from_world = look_at(eye, target, {0, 0, 1})) {
    Affine3& world_from_camera = settings.camera.world_from_camera;
    world_from_camera = camera_from_world->inverse().affine();
    // pbrt looks at left-handed worlds; this one is right-handed, with east to the right of north.
    for (auto& row : world_from_camera.m) row[0] = -row[0];
  }
  const auto tangent = static_cast<float>(std::tan(view.fov_deg * (M_PI / 360)));
  settings.camera.resolution_x_px = 1280, settings.camera.resolution_y_px = 720;
  settings.camera.tan_half_fov_x = tangent * (1280.0f / 720.0f), settings.camera.tan_half_fov_y = tangent;
  settings.render.samples_per_pixel = 16, settings.render.max_depth = 5;
  return settings;
}

Rgb sky_radiance(TimeOfDay time, Float3 w) {
  const SkyColours colours = sky_colours(time);
  const float up = std::clamp(w.z, 0.0f, 1.0f);
  Rgb sky = mix(colours.horizon, colours.zenith, 1 - std::pow(1 - up, 4.0f));
  const float near_sun = std::max(0.0f, spillway::dot(w, towards_sun(time)));
  const float low = time == TimeOfDay::dusk ? std::pow(1 - up, 5.0f) : 1.0f;
  sky += colours.glow * (low * std::pow(near_sun, colours.glow_width));
  if (w.z < 0) sky = sky * std::max(0.3f, 1 + w.z);  // below the horizon: haze over the land
  return sky;
}

Status write_sky(const std::filesystem::path& file, TimeOfDay time) {
  std::vector<float> texels;
  texels.reserve(size_t{kSkySize} * kSkySize * 3);
  for (uint32_t y = 0; y < kSkySize; ++y)
    for (uint32_t x = 0; x < kSkySize; ++x) {
      const Float2 square{(static_cast<float>(x) + 0.5f) / kSkySize, (static_cast<float>(y) + 0.5f) / kSkySize};
      const Rgb sky = sky_radiance(time, shading::equal_area_direction(square));
      texels.insert(texels.end(), {sky.r, sky.g, sky.b});
    }
  const auto output = OIIO::ImageOutput::create(file.string());
  if (!output) return error("{}: cannot be written: {}", file.string(), OIIO::geterror());
  OIIO::ImageSpec spec(kSkySize, kSkySize, 3, OIIO::TypeDesc::HALF);
  spec.attribute("compression", "zip");
  const bool written =
      output->open(file.string(), spec) && output->write_image(OIIO::TypeDesc::FLOAT, texels.data()) && output->close();
  if (!written) return error("{}: cannot be written: {}", file.string(), output->geterror());
  return {};
}

shading::Light sun(TimeOfDay time) {
  shading::Light light{};
  light.kind = shading::LightKind::distant;
  light.edge1 = towards_sun(time) * -1.0f;
  switch (time) {
    case TimeOfDay::day:
      light.radiance = {4.3f, 3.8f, 3.05f};
      break;
    case TimeOfDay::dusk:
      light.radiance = {0.85f, 0.36f, 0.13f};
      break;
    case TimeOfDay::night:
      light.radiance = {0.035f, 0.045f, 0.068f};
      break;
  }
  return light;
}

}  // namespace spillway::tools::city
