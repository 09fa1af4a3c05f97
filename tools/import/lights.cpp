#include "tools/import/lights.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "tools/import/colors.h"
#include "tools/import/textures.h"

namespace spillway::tools {
namespace {

using shading::Light;
using shading::LightKind;

constexpr float kPi = 3.14159265358979f;

Float3 rounded(Vec3 v) { return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)}; }
Vec3 widened(Float3 v) { return {v.x, v.y, v.z}; }

Result<float> read_scale(const ParamList& params) {
  SPILLWAY_ASSIGN(const float scale, params.real("scale", 1));
  if (scale >= 0) return scale;
  return error_at(params.find(ParamType::real, "scale")->place, "\"scale\" of a light must not be negative");
}

Result<Float3> direction(const ParamList& params, Place place) {
  SPILLWAY_ASSIGN(const Float3 from, params.point3("from", {0, 0, 0}));
  SPILLWAY_ASSIGN(const Float3 to, params.point3("to", {0, 0, 1}));
  const Float3 along = to - from;
  if (length(along) > 0 && std::isfinite(length(along))) return along;
  return error_at(place, "\"from\" and \"to\" of a light must be two points");
}

Result<Float3> unit_axis(const ParamList& params, Place place, const Transform& world_from_light) {
  SPILLWAY_ASSIGN(const Float3 along, direction(params, place));
  const Vec3 axis = world_from_light.vector(widened(along));
  const double size = std::hypot(axis.x, axis.y, axis.z);  // squares of a double may overflow
  if (!(size > 0)) return error_at(place, "the transform makes the axis of this light vanish");
  return rounded({axis.x / size, axis.y / size, axis.z / size});
}

Status read_point(Session& session, const ParamList& params, const Transform& world_from_light, Light& light) {
  light.kind = LightKind::point;
  SPILLWAY_ASSIGN(light.radiance, light_color(session, params, "I"));
  SPILLWAY_ASSIGN(const Float3 from, params.point3("from", {0, 0, 0}));
  light.position = rounded(world_from_light.point(widened(from)));
  SPILLWAY_ASSIGN(const float power, params.real("power", -1));
  if (power > 0) light.radiance = light.radiance * (power / (4 * kPi));
  return {};
}

// The cone: full inside coneangle - conedeltaangle, nothing outside coneangle, a smoothstep in the cosine between.
Status read_cone(const ParamList& params, Place place, Light& light) {
  SPILLWAY_ASSIGN(const float outer_deg, params.real("coneangle", 30));
  SPILLWAY_ASSIGN(const float delta_deg, params.real("conedeltaangle", 5));
  if (!(outer_deg > 0 && outer_deg <= 180 && delta_deg >= 0)) {
    return error_at(place, "a spot takes a coneangle above 0, at most 180, and a conedeltaangle of at least 0");
  }
  light.cos_total = std::cos(outer_deg * (kPi / 180));
  light.cos_falloff = std::cos(std::max(outer_deg - delta_deg, 0.0f) * (kPi / 180));
  return {};
}

Status read_spot(Session& session, const ParamList& params, Place place, const Transform& world_from_light,
                 Light& light) {
  SPILLWAY_TRY(read_point(session, params, world_from_light, light));
  light.kind = LightKind::spot;
  SPILLWAY_ASSIGN(light.edge1, unit_axis(params, place, world_from_light));
  SPILLWAY_TRY(read_cone(params, place, light));
  SPILLWAY_ASSIGN(const float power, params.real("power", -1));
  if (power > 0) {  // read_point has spread it over the sphere; the integral of the cone's falloff is what it is
    const float solid_angle = 2 * kPi * ((1 - light.cos_falloff) + (light.cos_falloff - light.cos_total) / 2);
    light.radiance = light.radiance * (4 * kPi / solid_angle);
  }
  if (!world_from_light.keeps_angles()) {
    session.warn(place, "the transform of this spot changes angles: its axis is transformed, its cone stays round");
  }
  return {};
}

// Without an image a goniometric light is a point.
Status read_goniometric(Session& session, const ParamList& params, Place place, const Transform& world_from_light,
                        Light& light) {
  if (params.find(ParamType::string, "filename") != nullptr)
    SPILLWAY_TRY(session.replaced(place, "light \"goniometric\" with an image", "a \"point\""));
  return read_point(session, params, world_from_light, light);
}

Status read_projection(Session& session, const ParamList& params, Place place, const Transform& world_from_light,
                       Light& light) {
  SPILLWAY_TRY(session.replaced(place, "light \"projection\"", "a \"spot\" as wide as its field of view"));
  (void)params.find(ParamType::string, "filename");
  SPILLWAY_ASSIGN(const float fov_deg, params.real("fov", 90));
  if (!(fov_deg > 0 && fov_deg < 180)) return error_at(place, "\"fov\" must be between 0 and 180 degrees");
  SPILLWAY_TRY(read_point(session, params, world_from_light, light));
  light.kind = LightKind::spot;
  SPILLWAY_ASSIGN(light.edge1, unit_axis(params, place, world_from_light));
  light.cos_total = light.cos_falloff = std::cos(fov_deg * (kPi / 360));
  return {};
}

Status read_distant(Session& session, const ParamList& params, Place place, const Transform& world_from_light,
                    Light& light) {
  light.kind = LightKind::distant;
  SPILLWAY_ASSIGN(light.radiance, light_color(session, params, "L"));
  SPILLWAY_ASSIGN(light.edge1, unit_axis(params, place, world_from_light));
  SPILLWAY_ASSIGN(const float illuminance, params.real("illuminance", -1));
  if (illuminance > 0) light.radiance = light.radiance * illuminance;
  return {};
}

// The image in the light's frame: its axes are rows of the rotation that takes the world there.
Status read_environment(const ParamList& params, const Parameter& file, Place place,
                        const Transform& world_from_light, Light& light) {
  SPILLWAY_TRY(expect_count(file, file.strings.size(), 1));
  if (!world_from_light.keeps_angles())
    return error_at(place, "the transform of an infinite light with an image must keep angles");
  if (const Parameter* illuminance = params.find(ParamType::real, "illuminance"))
    return error_at(illuminance->place, "\"illuminance\" of an image is not supported: use \"scale\"");
  const Transform light_from_world = world_from_light.inverse();
  Float3* const axes[3] = {&light.position, &light.edge1, &light.edge2};
  for (int row = 0; row < 3; ++row) {
    const double* m = light_from_world.m[row];
    const double size = std::hypot(m[0], m[1], m[2]);
    *axes[row] = rounded({m[0] / size, m[1] / size, m[2] / size});
  }
  light.radiance = {1, 1, 1};
  light.has_image = 1;
  return {};
}

Status read_infinite(Session& session, const ParamList& params, Place place, const Transform& world_from_light, Light& light) {
  light.kind = LightKind::infinite;
  if (const Parameter* file = params.find(ParamType::string, "filename"))
    return read_environment(params, *file, place, world_from_light, light);
  SPILLWAY_ASSIGN(light.radiance, light_color(session, params, "L"));
  SPILLWAY_ASSIGN(const float illuminance, params.real("illuminance", -1));
  if (illuminance > 0) light.radiance = light.radiance * (illuminance / kPi);  // of a hemisphere of radiance 1
  return {};
}

// Four corners in world space, whatever the light's transform, as in pbrt.
Result<shading::Portal> read_portal(const Parameter& given) {
  SPILLWAY_TRY(expect_count(given, given.numbers.size(), 12));
  Float3 p[4];
  for (size_t i = 0; i < 12; ++i) p[i / 3][static_cast<int>(i % 3)] = given.numbers[i];
  const Float3 across = p[3] - p[0], up = p[1] - p[0], rest = p[2] - p[0] - across - up;
  constexpr float kTolerance = 1e-3f;  // pbrt's, of the sides' directions
  const float sides = length(across) * length(up);
  const bool is_rectangle = sides > 0 && std::isfinite(sides) && std::fabs(dot(across, up)) <= kTolerance * sides &&
                            length(rest) <= kTolerance * std::max(length(across), length(up));
  if (!is_rectangle) return error_at(given.place, "\"portal\" takes the four corners of a rectangle, in turn");
  return shading::Portal{p[0], across, up, 0};
}

Status send(Session& session, const ParamList& params, const Light& light) {
  if (light.has_image == 0) return session.sink.add_light(light);
  const std::string& name = params.find(ParamType::string, "filename")->strings[0];
  SPILLWAY_ASSIGN(const ImageId image, session.sink.add_image(session.resolved(name), default_encoding(name)));
  ++session.report.image_count;
  return session.sink.add_environment(light, image);
}

}  // namespace

Result<AreaEmission> read_area_light(Session& session, const std::string& type, const ParamList& params, Place place) {
  if (type != "diffuse") return error_at(place, "area light \"{}\" is not known: use \"diffuse\"", type);
  if (const Parameter* file = params.find(ParamType::string, "filename")) {
    SPILLWAY_TRY(session.replaced(file->place, "an area light with an image", "its \"L\""));
  }
  AreaEmission emission;
  SPILLWAY_ASSIGN(const Rgb color, light_color(session, params, "L"));
  SPILLWAY_ASSIGN(const float scale, read_scale(params));
  emission.radiance = color * scale;
  SPILLWAY_ASSIGN(emission.two_sided, params.boolean("twosided", false));
  SPILLWAY_ASSIGN(const float power, params.real("power", -1));
  emission.power = std::max(power, 0.0f);
  SPILLWAY_TRY(params.check_all_used(session, "AreaLightSource \"diffuse\""));
  return emission;
}

Status add_light(Session& session, const std::string& type, const ParamList& params, Place place,
                 const Transform& world_from_light) {
  Light light{};
  if (type == "point")
    SPILLWAY_TRY(read_point(session, params, world_from_light, light));
  else if (type == "spot")
    SPILLWAY_TRY(read_spot(session, params, place, world_from_light, light));
  else if (type == "distant")
    SPILLWAY_TRY(read_distant(session, params, place, world_from_light, light));
  else if (type == "infinite")
    SPILLWAY_TRY(read_infinite(session, params, place, world_from_light, light));
  else if (type == "goniometric")
    SPILLWAY_TRY(read_goniometric(session, params, place, world_from_light, light));
  else if (type == "projection")
    SPILLWAY_TRY(read_projection(session, params, place, world_from_light, light));
  else
    return session.ignorable(place, "light \"{}\" is not known: use infinite, distant, point or spot", type);
  SPILLWAY_ASSIGN(const float scale, read_scale(params));
  light.radiance = light.radiance * scale;
  const Parameter* portal = light.kind == LightKind::infinite ? params.find(ParamType::point3, "portal") : nullptr;
  SPILLWAY_TRY(params.check_all_used(session, fmt::format("LightSource \"{}\"", type)));
  const bool finite = is_finite(light.radiance) && is_finite(light.position) && is_finite(light.edge1) && is_finite(light.edge2);
  if (!finite) return error_at(place, "light \"{}\" is not finite", type);
  if (const Status added = send(session, params, light); !added) return error_at(place, "{}", added.error().message);
  ++session.report.light_count;
  if (portal == nullptr) return {};
  SPILLWAY_ASSIGN(const shading::Portal rectangle, read_portal(*portal));
  if (const Status added = session.sink.add_portal(rectangle); !added)
    return error_at(portal->place, "{}", added.error().message);
  return {};
}

}  // namespace spillway::tools
