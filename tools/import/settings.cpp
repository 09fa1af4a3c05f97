#include "tools/import/settings.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace spillway::tools {
namespace {

using pipeline::SceneSettings;

template <size_t N>
bool contains(const std::array<std::string_view, N>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

Place place_of(const ParamList& params, ParamType type, std::string_view name, Place otherwise) {
  const Parameter* parameter = params.find(type, name);
  return parameter == nullptr ? otherwise : parameter->place;
}

// ---- film ----

Status read_resolution(const Waiting& film, shading::Camera& camera) {
  constexpr int32_t kMaxResolution_px = 1 << 16;
  SPILLWAY_ASSIGN(const int32_t x, film.params.integer("xresolution", 1280));
  SPILLWAY_ASSIGN(const int32_t y, film.params.integer("yresolution", 720));
  if (std::min(x, y) < 1 || std::max(x, y) > kMaxResolution_px) {
    return error_at(film.place, "a resolution of {} x {} pixels: each must be 1 to {}", x, y, kMaxResolution_px);
  }
  camera.resolution_x_px = static_cast<uint32_t>(x), camera.resolution_y_px = static_cast<uint32_t>(y);
  return {};
}

// Both windows are x0 x1 y0 y1; the crop window is in parts of the picture and wins, as in pbrt.
Status read_crop(const Waiting& film, const shading::Camera& camera, pipeline::FilmSettings& settings) {
  const Parameter* pixels = film.params.find(ParamType::integer, "pixelbounds");
  const Parameter* parts = film.params.find(ParamType::real, "cropwindow");
  if (pixels == nullptr && parts == nullptr) return {};
  const float size[2] = {static_cast<float>(camera.resolution_x_px), static_cast<float>(camera.resolution_y_px)};
  uint32_t bounds[4];
  for (size_t i = 0; i < 4; ++i) {
    if (parts != nullptr) {
      SPILLWAY_TRY(expect_count(*parts, parts->numbers.size(), 4));
      bounds[i] = static_cast<uint32_t>(std::ceil(size[i / 2] * std::clamp(parts->numbers[i], 0.0f, 1.0f)));
    } else {
      SPILLWAY_TRY(expect_count(*pixels, pixels->integers.size(), 4));
      bounds[i] = static_cast<uint32_t>(std::clamp(pixels->integers[i], 0, static_cast<int32_t>(size[i / 2])));
    }
  }
  if (bounds[0] >= bounds[1] || bounds[2] >= bounds[3]) {
    return error_at((parts != nullptr ? parts : pixels)->place, "the crop holds no pixel: give x0 x1 y0 y1");
  }
  settings.crop_x0 = bounds[0], settings.crop_x1 = bounds[1];
  settings.crop_y0 = bounds[2], settings.crop_y1 = bounds[3];
  return {};
}

// pbrt's imaging ratio for its standard sensor: exposure time (s) * ISO / 100, one by default.
Status read_exposure(Session& session, const Waiting& film, const shading::Camera& camera,
                     pipeline::FilmSettings& settings) {
  SPILLWAY_ASSIGN(const float iso, film.params.real("iso", 100));
  SPILLWAY_ASSIGN(const float seconds, film.params.real("exposuretime", camera.shutter_close - camera.shutter_open));
  settings.exposure_scale = seconds * iso / 100;
  if (!(settings.exposure_scale >= pipeline::kLeastExposure && settings.exposure_scale <= pipeline::kMostExposure)) {
    return error_at(film.place, "the film gathers no light, or too much: exposure time times \"iso\" must be above 0");
  }
  SPILLWAY_ASSIGN(const std::string sensor, film.params.string("sensor", "cie1931"));
  if (sensor != "cie1931") {
    session.warn(place_of(film.params, ParamType::string, "sensor", film.place),
                 "sensor \"{}\" is not simulated: the standard observer \"cie1931\" is used", sensor);
  }
  SPILLWAY_ASSIGN(const float white_kelvin, film.params.real("whitebalance", 0));
  if (white_kelvin != 0) {
    session.warn(place_of(film.params, ParamType::real, "whitebalance", film.place),
                 "no white balance is done: the picture keeps the colours of its lights");
  }
  return {};
}

Status read_film(Session& session, const Waiting& film, SceneSettings& settings) {
  constexpr std::array<std::string_view, 3> kTypes = {"rgb", "gbuffer", "spectral"};
  if (!contains(kTypes, film.type)) return error_at(film.place, "unknown film \"{}\": use \"rgb\"", film.type);
  if (film.type != "rgb") session.warn(film.place, "film \"{}\": \"rgb\" is used instead", film.type);
  SPILLWAY_TRY(read_resolution(film, settings.camera));
  SPILLWAY_TRY(read_crop(film, settings.camera, settings.film));
  SPILLWAY_TRY(read_exposure(session, film, settings.camera, settings.film));
  SPILLWAY_ASSIGN([[maybe_unused]] const std::string name, film.params.string("filename", ""));  // -o says it
  (void)film.params.find(ParamType::real, "diagonal");  // of realistic lenses alone
  (void)film.params.find(ParamType::boolean, "savefp16");
  if (const Parameter* limit = film.params.find(ParamType::real, "maxcomponentvalue")) {
    session.warn(limit->place, "samples are not clamped: \"maxcomponentvalue\" has no effect");
  }
  if (film.type == "rgb") return film.params.check_all_used(session, "Film \"rgb\"");
  return {};
}

// ---- camera ----

// The window on the plane that the field of view belongs to; its shorter axis is -1 to 1 unless the scene says more.
Status read_screen(const Waiting& camera, const shading::Camera& film, std::array<float, 4>& window) {
  const float resolution_aspect = static_cast<float>(film.resolution_x_px) / static_cast<float>(film.resolution_y_px);
  SPILLWAY_ASSIGN(const float aspect, camera.params.real("frameaspectratio", resolution_aspect));
  if (!(aspect > 0)) return error_at(camera.place, "\"frameaspectratio\" must be above 0");
  const float half_x = std::max(aspect, 1.0f), half_y = aspect > 1 ? 1 : 1 / aspect;
  window = {-half_x, half_x, -half_y, half_y};
  if (const Parameter* given = camera.params.find(ParamType::real, "screenwindow")) {
    SPILLWAY_TRY(expect_count(*given, given->numbers.size(), 4));
    std::copy(given->numbers.begin(), given->numbers.end(), window.begin());
    if (!(window[0] < window[1] && window[2] < window[3])) {
      return error_at(given->place, "\"screenwindow\" takes x0 x1 y0 y1 with x0 < x1 and y0 < y1");
    }
  }
  return {};
}

Status read_shutter(const Waiting& waiting, shading::Camera& camera) {
  SPILLWAY_ASSIGN(camera.shutter_open, waiting.params.real("shutteropen", 0));
  SPILLWAY_ASSIGN(camera.shutter_close, waiting.params.real("shutterclose", 1));
  if (camera.shutter_close > camera.shutter_open) return {};
  return error_at(waiting.place, "the shutter must close after it opens");
}

// What was read as finite may not be so any more once it is inverted, scaled or rounded.
bool is_finite(const shading::Camera& camera) {
  bool finite = true;
  for (const float number : {camera.tan_half_fov_x, camera.tan_half_fov_y, camera.screen_center_x, camera.screen_center_y})
    finite = finite && std::isfinite(number);
  for (const auto& row : camera.world_from_camera.m)
    for (const float number : row) finite = finite && std::isfinite(number);
  return finite;
}

Status read_camera(Session& session, const Waiting& waiting, shading::Camera& camera) {
  camera.is_orthographic = waiting.type == "orthographic";
  const bool is_known = waiting.type == "perspective" || camera.is_orthographic;
  if (!is_known) {
    constexpr std::array<std::string_view, 2> kOthers = {"spherical", "realistic"};
    if (!contains(kOthers, waiting.type)) return error_at(waiting.place, "unknown camera \"{}\"", waiting.type);
    SPILLWAY_TRY(session.replaced(waiting.place, fmt::format("camera \"{}\"", waiting.type), "\"perspective\""));
  }
  const ParamList& params = waiting.params;
  std::array<float, 4> window{};
  SPILLWAY_TRY(read_screen(waiting, camera, window));
  float tangent = 1;  // of an orthographic camera the window is what is seen
  if (!camera.is_orthographic) {
    SPILLWAY_ASSIGN(const float fov_deg, params.real("fov", 90));
    if (!(fov_deg > 0 && fov_deg < 180)) {
      return error_at(place_of(params, ParamType::real, "fov", waiting.place),
                      "\"fov\" must be between 0 and 180 degrees");
    }
    tangent = static_cast<float>(std::tan(fov_deg * (M_PI / 360)));
  }
  camera.tan_half_fov_x = tangent * (window[1] - window[0]) / 2;
  camera.tan_half_fov_y = tangent * (window[3] - window[2]) / 2;
  camera.screen_center_x = tangent * (window[0] + window[1]) / 2;
  camera.screen_center_y = tangent * (window[2] + window[3]) / 2;
  SPILLWAY_ASSIGN(camera.lens_radius, params.real("lensradius", 0));
  SPILLWAY_ASSIGN(camera.focal_distance, params.real("focaldistance", 1e6f));
  if (!(camera.lens_radius >= 0 && camera.focal_distance > 0)) {
    return error_at(waiting.place, "\"lensradius\" must be at least 0, \"focaldistance\" above 0");
  }
  if (!is_finite(camera)) return error_at(waiting.place, "the camera's transform or window is too large for 32-bit floats");
  if (!is_known) return {};  // the rest is of what is not done
  return params.check_all_used(session, fmt::format("Camera \"{}\"", waiting.type));
}

// ---- filter ----

struct FilterDefaults {
  std::string_view name;
  shading::FilterKind kind;
  float radius_px;
  std::string_view a_name, b_name;
  float a, b;
};
// pbrt's defaults.
constexpr std::array kFilters = {
    FilterDefaults{"box", shading::FilterKind::box, 0.5f, "", "", 0, 0},
    FilterDefaults{"triangle", shading::FilterKind::triangle, 2, "", "", 0, 0},
    FilterDefaults{"gaussian", shading::FilterKind::gaussian, 1.5f, "sigma", "", 0.5f, 0},
    FilterDefaults{"mitchell", shading::FilterKind::mitchell, 2, "B", "C", 1.0f / 3, 1.0f / 3},
    FilterDefaults{"sinc", shading::FilterKind::sinc, 4, "tau", "", 3, 0},
};

Status read_filter(Session& session, const Waiting& waiting, shading::Filter& filter) {
  constexpr float kMaxRadius_px = 64;
  for (const FilterDefaults& known : kFilters) {
    if (known.name != waiting.type) continue;
    filter.kind = known.kind;
    SPILLWAY_ASSIGN(filter.radius_px.x, waiting.params.real("xradius", known.radius_px));
    SPILLWAY_ASSIGN(filter.radius_px.y, waiting.params.real("yradius", known.radius_px));
    SPILLWAY_ASSIGN(filter.a, waiting.params.real(known.a_name, known.a));
    SPILLWAY_ASSIGN(filter.b, waiting.params.real(known.b_name, known.b));
    const auto [least, most] = std::minmax(filter.radius_px.x, filter.radius_px.y);
    if (!(least > 0 && most <= kMaxRadius_px)) {
      return error_at(waiting.place, "filter radii must be above 0 and at most {} pixels", kMaxRadius_px);
    }
    if (known.a > 0 && known.b == 0 && !(filter.a > 0)) {
      return error_at(waiting.place, "\"{}\" must be above 0", known.a_name);
    }
    return waiting.params.check_all_used(session, fmt::format("PixelFilter \"{}\"", waiting.type));
  }
  return error_at(waiting.place, "unknown filter \"{}\": use box, triangle, gaussian, mitchell or sinc", waiting.type);
}

// ---- sampler and integrator ----

Status read_sample_count(const Waiting& waiting, uint32_t& samples_per_pixel) {
  int64_t count = 0;
  if (waiting.type == "stratified") {
    SPILLWAY_ASSIGN(const int32_t x, waiting.params.integer("xsamples", 4));
    SPILLWAY_ASSIGN(const int32_t y, waiting.params.integer("ysamples", 4));
    (void)waiting.params.find(ParamType::boolean, "jitter");
    count = x > 0 && y > 0 ? static_cast<int64_t>(x) * y : 0;
  } else {
    SPILLWAY_ASSIGN(const int32_t given, waiting.params.integer("pixelsamples", 16));
    count = given;
  }
  constexpr int64_t kMaxSamples = 1 << 24;
  if (count < 1 || count > kMaxSamples)
    return error_at(waiting.place, "{} samples a pixel: 1 to {} can be", count, kMaxSamples);
  samples_per_pixel = static_cast<uint32_t>(count);
  return {};
}

Status read_sampler(Session& session, const Waiting& waiting, pipeline::RenderSettings& render) {
  constexpr std::array<std::string_view, 7> kTypes = {"sobol",       "paddedsobol", "zsobol", "halton",
                                                      "independent", "stratified",  "pmj02bn"};
  if (!contains(kTypes, waiting.type))
    return error_at(waiting.place, "unknown sampler \"{}\": use \"sobol\"", waiting.type);
  if (waiting.type == "independent") {
    render.sampler = shading::SamplerKind::independent;
  } else if (waiting.type != "sobol") {
    session.warn(waiting.place, "sampler \"{}\": the renderer's own Owen-scrambled Sobol' points are used",
                 waiting.type);
  }
  SPILLWAY_TRY(read_sample_count(waiting, render.samples_per_pixel));
  SPILLWAY_ASSIGN(const int32_t seed, waiting.params.integer("seed", static_cast<int32_t>(render.seed)));
  render.seed = static_cast<uint32_t>(seed);
  (void)waiting.params.find(ParamType::string, "randomization");
  return waiting.params.check_all_used(session, fmt::format("Sampler \"{}\"", waiting.type));
}

Status read_integrator(Session& session, const Waiting& waiting, pipeline::RenderSettings& render) {
  constexpr std::array<std::string_view, 3> kPaths = {"path", "volpath", "simplepath"};
  constexpr std::array<std::string_view, 6> kOthers = {"bdpt",      "mlt",        "sppm",
                                                       "lightpath", "randomwalk", "simplevolpath"};
  const bool is_path = contains(kPaths, waiting.type);
  if (!is_path && !contains(kOthers, waiting.type)) {
    return error_at(waiting.place, "integrator \"{}\" is not supported: use \"path\"", waiting.type);
  }
  if (!is_path) session.warn(waiting.place, "integrator \"{}\": \"path\" is used instead", waiting.type);
  SPILLWAY_ASSIGN(const int32_t depth, waiting.params.integer("maxdepth", 5));
  if (depth < 0) return error_at(waiting.place, "\"maxdepth\" must be at least 0");
  render.max_depth = static_cast<uint32_t>(depth);
  SPILLWAY_ASSIGN(const bool regularize, waiting.params.boolean("regularize", false));
  if (regularize) session.warn(waiting.place, "\"regularize\" is not done: materials stay as sharp as they are");
  if (!is_path) return {};  // the rest steers what is not done
  // Which light is chosen when changes noise, not the picture.
  for (const char* name : {"samplelights", "samplebsdf"}) (void)waiting.params.find(ParamType::boolean, name);
  (void)waiting.params.find(ParamType::string, "lightsampler");
  return waiting.params.check_all_used(session, fmt::format("Integrator \"{}\"", waiting.type));
}

Waiting or_default(const std::optional<Waiting>& given, const char* type, Place world_begin) {
  return given ? *given : Waiting{type, {}, world_begin};
}

}  // namespace

Result<SceneSettings> build_settings(Session& session, const SceneOptions& options, Place world_begin) {
  SceneSettings settings;
  const Waiting camera = or_default(options.camera, "perspective", world_begin);
  settings.camera.world_from_camera = options.camera_from_world.inverse().affine();
  settings.motion = options.motion;
  settings.render.camera_medium = options.camera_medium;
  settings.render.seed = static_cast<uint32_t>(options.seed);
  if (options.color_space != ColorSpace::srgb && options.film)
    session.warn(options.film->place, "the picture is written in Rec. 709, whatever the scene's color space");
  SPILLWAY_TRY(read_shutter(camera, settings.camera));
  SPILLWAY_TRY(read_film(session, or_default(options.film, "rgb", world_begin), settings));
  SPILLWAY_TRY(read_camera(session, camera, settings.camera));
  SPILLWAY_TRY(read_filter(session, or_default(options.filter, "gaussian", world_begin), settings.filter));
  SPILLWAY_TRY(read_sampler(session, or_default(options.sampler, "sobol", world_begin), settings.render));
  SPILLWAY_TRY(read_integrator(session, or_default(options.integrator, "path", world_begin), settings.render));
  return settings;
}

}  // namespace spillway::tools
