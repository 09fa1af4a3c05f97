#include "pipeline/scene_validation.h"

#include <cmath>
#include <utility>

#include "pipeline/shutter.h"
#include "shading/noise.h"

namespace spillway::pipeline {
namespace {

constexpr uint32_t kLargestResolution = 65536;
constexpr float kLargestFilterRadius = 64;  // pixels

bool all_finite(std::span<const float> values) {
  for (const float value : values)
    if (!std::isfinite(value)) return false;
  return true;
}

bool is_finite_transform(const Affine3& t) { return all_finite(std::span(&t.m[0][0], 12)); }

bool is_texture(uint32_t texture, size_t count) { return texture == TextureId::kNone || texture < count; }

Status check_param(const Param& param, size_t texture_count, std::string_view where, const char* name) {
  if (!is_finite(param.constant)) return error("{}: {} is not finite", where, name);
  if (!is_texture(param.texture, texture_count))
    return error("{}: {} uses texture {} of {}", where, name, param.texture, texture_count);
  return {};
}

Status check_camera(const shading::Camera& c, std::string_view where) {
  if (c.resolution_x_px < 1 || c.resolution_x_px > kLargestResolution || c.resolution_y_px < 1 ||
      c.resolution_y_px > kLargestResolution)
    return error("{}: a resolution of {} x {}; 1 to {} is possible", where, c.resolution_x_px, c.resolution_y_px,
                 kLargestResolution);
  const float camera[] = {c.tan_half_fov_x, c.tan_half_fov_y, c.screen_center_x, c.screen_center_y,
                          c.lens_radius,    c.focal_distance, c.shutter_open,    c.shutter_close};
  if (c.is_orthographic > 1) return error("{}: a camera of no known kind", where);
  if (!is_finite_transform(c.world_from_camera) || !all_finite(camera) || c.lens_radius < 0 || c.focal_distance <= 0)
    return error("{}: the camera has a number that is not finite or of the wrong sign", where);
  return {};
}

Status check_shutter(const shading::Camera& c, const MotionSettings& motion, std::string_view where) {
  if (!(motion.end_time > motion.start_time))
    return error("{}: the keys of motion at {} and {} are not in order", where, motion.start_time, motion.end_time);
  const Shutter shutter = shutter_of(c, motion);
  if (std::isfinite(shutter.open) && std::isfinite(shutter.close) && shutter.close >= shutter.open) return {};
  return error("{}: a shutter from {} to {}, for motion from {} to {}", where, c.shutter_open, c.shutter_close,
               motion.start_time, motion.end_time);
}

}  // namespace

Status check_camera_path(std::span<const FrameCamera> path, const SceneSettings& settings, std::string_view where) {
  for (size_t i = 0; i < path.size(); ++i) {
    const FrameCamera& f = path[i];
    const std::string frame = fmt::format("{}: frame {}", where, f.frame);
    SPILLWAY_TRY(check_camera(f.camera, frame));
    SPILLWAY_TRY(check_shutter(f.camera, settings.motion, frame));
    if (f.camera.motion != 0) return error("{}: its camera moves; those of a path stand still", frame);
    if (i > 0 && f.frame <= path[i - 1].frame)
      return error("{}: frame {} follows frame {}", where, f.frame, path[i - 1].frame);
    if (f.camera.resolution_x_px != settings.camera.resolution_x_px ||
        f.camera.resolution_y_px != settings.camera.resolution_y_px)
      return error("{}: frame {} has {} x {} pixels, the settings {} x {}", where, f.frame, f.camera.resolution_x_px,
                   f.camera.resolution_y_px, settings.camera.resolution_x_px, settings.camera.resolution_y_px);
  }
  return {};
}

Status check_settings(const SceneSettings& settings, std::string_view where) {
  const shading::Camera& c = settings.camera;
  SPILLWAY_TRY(check_camera(c, where));
  SPILLWAY_TRY(check_shutter(c, settings.motion, where));
  const shading::Filter& f = settings.filter;
  const float radii[] = {f.radius_px.x, f.radius_px.y};
  for (const float radius : radii)
    if (!(radius > 0 && radius <= kLargestFilterRadius))
      return error("{}: a filter radius of {} pixels; up to {} is possible", where, radius, kLargestFilterRadius);
  if (f.kind > shading::FilterKind::sinc || !std::isfinite(f.a) || !std::isfinite(f.b))
    return error("{}: the pixel filter is of no known kind, or its parameters are not finite", where);
  const FilmSettings& film = settings.film;
  const bool no_crop = film.crop_x0 == 0 && film.crop_y0 == 0 && film.crop_x1 == 0 && film.crop_y1 == 0;
  if (!no_crop && (film.crop_x0 >= film.crop_x1 || film.crop_x1 > c.resolution_x_px || film.crop_y0 >= film.crop_y1 ||
                   film.crop_y1 > c.resolution_y_px))
    return error("{}: the crop {}..{} x {}..{} does not lie in the picture", where, film.crop_x0, film.crop_x1,
                 film.crop_y0, film.crop_y1);
  if (!(film.exposure_scale >= kLeastExposure && film.exposure_scale <= kMostExposure))
    return error("{}: an exposure scale of {}", where, film.exposure_scale);
  if (settings.render.sampler > shading::SamplerKind::independent)
    return error("{}: a sampler of no known kind", where);
  if (settings.render.samples_per_pixel == 0) return error("{}: no samples a pixel", where);
  if (settings.render.light_selection > LightSelection::uniform)
    return error("{}: lights are chosen in no known way", where);
  if (settings.render.estimator > Estimator::hemisphere || settings.render.roulette > 1 ||
      settings.render.texture_filter > TextureFilter::trilinear || settings.render.majorants > MajorantExtent::grid)
    return error("{}: the picture is estimated in no known way", where);
  return {};
}

namespace {

float octaves_of(const TextureNode& node) {
  const bool has =
      node.kind == TextureKind::fbm || node.kind == TextureKind::wrinkled || node.kind == TextureKind::marble;
  return has ? node.value[1] : 0;
}

}  // namespace

Status check_texture(const TextureNode& node, size_t index, size_t image_count, size_t face_texture_count,
                     std::string_view where) {
  if (node.kind > TextureKind::marble || node.mapping > TextureMapping::solid || node.wrap > cache::WrapMode::black ||
      node.filter > cache::TexelFilter::trilinear)
    return error("{}: is of no known kind, wrap or filter", where);
  if (!all_finite(node.value) || !all_finite(node.uv_scale) || !all_finite(node.uv_offset) ||
      !is_finite_transform(node.texture_from_world))
    return error("{}: has a number that is not finite", where);
  if (octaves_of(node) > shading::kMaxOctaves || octaves_of(node) < 0)
    return error("{}: has {} octaves of noise; 0 to {} can be", where, node.value[1], shading::kMaxOctaves);
  if (node.kind == TextureKind::image && node.image >= image_count)
    return error("{}: uses image {} of {}", where, node.image, image_count);
  if (node.kind == TextureKind::face && node.image >= face_texture_count)
    return error("{}: uses face texture {} of {}", where, node.image, face_texture_count);
  for (size_t c = 0; c < child_count(node.kind); ++c)
    if (node.child[c] >= index)
      return error("{}: uses texture {}; textures come after those they use", where, node.child[c]);
  return {};
}

Status TextureCosts::add(const TextureNode& node, std::string_view where) {
  uint64_t cost = 1 + static_cast<uint64_t>(octaves_of(node));  // each as dear as a lookup
  for (uint32_t c = 0; c < child_count(node.kind); ++c) cost += costs_[node.child[c]];
  if (cost > kMost)
    return error("{}: asks for more than {} lookups, since textures below it are used again and again", where, kMost);
  costs_.push_back(static_cast<uint32_t>(cost));
  return {};
}

Status check_material(const Material& material, size_t index, size_t texture_count, std::string_view where) {
  if (material.kind > MaterialKind::mix) return error("{}: is of no known kind", where);
  SPILLWAY_TRY(check_param(material.reflectance, texture_count, where, "reflectance"));
  SPILLWAY_TRY(check_param(material.transmittance, texture_count, where, "transmittance"));
  SPILLWAY_TRY(check_param(material.u_roughness, texture_count, where, "u roughness"));
  SPILLWAY_TRY(check_param(material.v_roughness, texture_count, where, "v roughness"));
  SPILLWAY_TRY(check_param(material.base_u_roughness, texture_count, where, "base u roughness"));
  SPILLWAY_TRY(check_param(material.base_v_roughness, texture_count, where, "base v roughness"));
  SPILLWAY_TRY(check_param(material.conductor_eta, texture_count, where, "eta"));
  SPILLWAY_TRY(check_param(material.conductor_k, texture_count, where, "k"));
  SPILLWAY_TRY(check_param(material.mix_amount, texture_count, where, "mix amount"));
  if (!std::isfinite(material.eta) || material.eta <= 0) return error("{}: an eta of {}", where, material.eta);
  if (!is_texture(material.displacement, texture_count))
    return error("{}: uses texture {} of {} as displacement", where, material.displacement, texture_count);
  if (!is_texture(material.normal_map, texture_count))
    return error("{}: uses texture {} of {} as normal map", where, material.normal_map, texture_count);
  if (material.kind != MaterialKind::mix) return {};
  for (const uint32_t part : material.mix_material)
    if (part >= index) return error("{}: mixes material {}; materials come after those they mix", where, part);
  return {};
}

Status check_medium(const Medium& m, size_t volume_count, std::string_view where) {
  for (const auto& [what, value] : {std::pair("sigma_a", m.sigma_a), {"sigma_s", m.sigma_s}, {"emission", m.glow}})
    if (!is_finite(value) || value.r < 0 || value.g < 0 || value.b < 0)
      return error("{}: its {} is ({}, {}, {}); it must be finite and not negative", where, what, value.r, value.g,
                   value.b);
  if (!(m.g > -1 && m.g < 1)) return error("{}: its g is {}; it must lie between -1 and 1", where, m.g);
  if (!std::isfinite(m.kelvin_scale) || !std::isfinite(m.kelvin_offset))
    return error("{}: its temperatures are scaled by {} and offset by {}", where, m.kelvin_scale, m.kelvin_offset);
  if (m.kind > MediumKind::color_grid || m.glow_kind > GlowKind::colors || m.reserved != 0)
    return error("{}: is of an unknown kind", where);
  const bool is_grid = m.kind != MediumKind::homogeneous, is_coloured = m.kind == MediumKind::color_grid;
  if (is_grid != (m.density_volume < volume_count))
    return error("{}: its density is volume {} of {}", where, m.density_volume, volume_count);
  if (is_coloured != (m.scatter_volume < volume_count))
    return error("{}: its scattering is volume {} of {}", where, m.scatter_volume, volume_count);
  if (m.glow_kind == GlowKind::colors && !is_coloured)
    return error("{}: only media of coloured grids emit the colours of a volume", where);
  const bool needs_glow = m.glow_kind != GlowKind::none && m.glow_kind != GlowKind::constant;
  if (needs_glow != (m.glow_volume < volume_count) || (needs_glow && !is_grid))
    return error("{}: its emission is volume {} of {}", where, m.glow_volume, volume_count);
  return {};
}

}  // namespace spillway::pipeline
