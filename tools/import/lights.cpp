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

// What a light may have besides itself.
struct LightExtras {
  const Parameter* file = nullptr;  // of its image
  Float3 axis[3];                   // of lights that throw it, see shading::LightImage
  float tangent = 0;
  bool is_power = false;
};

// The light's own axes in the world: rows of the rotation that takes the world there.
Status read_axes(Place place, const Transform& world_from_light, const char* what, Float3* const (&axes)[3]) {
  if (!world_from_light.keeps_angles()) return error_at(place, "the transform of {} must keep angles", what);
  const Transform light_from_world = world_from_light.inverse();
  for (int row = 0; row < 3; ++row) {
    const double* m = light_from_world.m[row];
    const double size = std::hypot(m[0], m[1], m[2]);
    *axes[row] = rounded({m[0] / size, m[1] / size, m[2] / size});
  }
  return {};
}

// Its power is what the texels come to, once they are read.
Status read_power(const ParamList& params, Light& light, LightExtras& extras) {
  SPILLWAY_ASSIGN(const float power, params.real("power", -1));
  extras.is_power = power > 0;
  if (extras.is_power) light.radiance = light.radiance * power;
  return {};
}

// Without an image a goniometric light is a point. pbrt turns the image's pole to the light's y.
Status read_goniometric(Session& session, const ParamList& params, Place place, const Transform& world_from_light,
                        Light& light, LightExtras& extras) {
  extras.file = params.find(ParamType::string, "filename");
  if (extras.file == nullptr) return read_point(session, params, world_from_light, light);
  SPILLWAY_TRY(expect_count(*extras.file, extras.file->strings.size(), 1));
  light.kind = LightKind::goniometric;
  light.position = rounded(world_from_light.point({0, 0, 0}));
  SPILLWAY_TRY(
      read_axes(place, world_from_light, "a goniometric light", {&extras.axis[0], &extras.axis[2], &extras.axis[1]}));
  SPILLWAY_ASSIGN(light.radiance, light_color(session, params, "I"));
  return read_power(params, light, extras);
}

// Along z, the image's top at the light's y.
Status read_projection(const ParamList& params, Place place, const Transform& world_from_light, Light& light,
                       LightExtras& extras) {
  extras.file = params.find(ParamType::string, "filename");
  if (extras.file == nullptr) return error_at(place, "light \"projection\" without \"string filename\"");
  SPILLWAY_TRY(expect_count(*extras.file, extras.file->strings.size(), 1));
  SPILLWAY_ASSIGN(const float fov_deg, params.real("fov", 90));
  if (!(fov_deg > 0 && fov_deg < 180)) return error_at(place, "\"fov\" must be between 0 and 180 degrees");
  light.kind = LightKind::projection;
  light.position = rounded(world_from_light.point({0, 0, 0}));
  SPILLWAY_TRY(read_axes(place, world_from_light, "a projection", {&extras.axis[0], &extras.axis[1], &extras.axis[2]}));
  extras.axis[1] = -extras.axis[1];
  light.edge1 = extras.axis[2];
  extras.tangent = std::tan(fov_deg * (kPi / 360));
  light.radiance = {1, 1, 1};
  return read_power(params, light, extras);
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

// The image in the light's frame.
Status read_environment(const ParamList& params, const Parameter& file, Place place,
                        const Transform& world_from_light, Light& light) {
  SPILLWAY_TRY(expect_count(file, file.strings.size(), 1));
  SPILLWAY_TRY(read_axes(place, world_from_light, "an infinite light with an image",
                         {&light.position, &light.edge1, &light.edge2}));
  if (const Parameter* illuminance = params.find(ParamType::real, "illuminance"))
    return error_at(illuminance->place, "\"illuminance\" of an image is not supported: use \"scale\"");
  light.radiance = {1, 1, 1};
  light.image = 1;
  return {};
}

Status read_infinite(Session& session, const ParamList& params, Place place, const Transform& world_from_light,
                     Light& light, LightExtras& extras) {
  light.kind = LightKind::infinite;
  extras.file = params.find(ParamType::string, "filename");
  if (extras.file != nullptr) return read_environment(params, *extras.file, place, world_from_light, light);
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

Result<ImageId> add_image(Session& session, const Parameter& file) {
  const std::string& name = file.strings[0];
  const Result<ImageId> image = session.sink.add_image(session.resolved(name), default_encoding(name));
  if (!image) return error_at(file.place, "{}", image.error().message);
  ++session.report.image_count;
  return image;
}

Status send(Session& session, const std::string& type, Place place, const Light& light, const LightExtras& extras) {
  const auto said = [&](const Status& status) -> Status {
    return status ? status : error_at(place, "{}", status.error().message);
  };
  if (extras.file == nullptr) return said(session.sink.add_light(light));
  SPILLWAY_ASSIGN(const ImageId image, add_image(session, *extras.file));
  if (!shading::throws_image(light)) return said(session.sink.add_environment(light, image));
  pipeline::ImageLightInput input{
      fmt::format("{}: light \"{}\"", to_string(place), type), light, image, {}, extras.tangent, extras.is_power};
  std::copy(std::begin(extras.axis), std::end(extras.axis), input.axis);
  return session.sink.add_image_light(input);  // its errors begin with the name
}

Status read_light(Session& session, const std::string& type, const ParamList& params, Place place,
                  const Transform& world_from_light, Light& light, LightExtras& extras) {
  if (type == "point") return read_point(session, params, world_from_light, light);
  if (type == "spot") return read_spot(session, params, place, world_from_light, light);
  if (type == "distant") return read_distant(session, params, place, world_from_light, light);
  if (type == "infinite") return read_infinite(session, params, place, world_from_light, light, extras);
  if (type == "goniometric") return read_goniometric(session, params, place, world_from_light, light, extras);
  return read_projection(params, place, world_from_light, light, extras);
}

bool is_light(const std::string& type) {
  for (const char* known : {"point", "spot", "distant", "infinite", "goniometric", "projection"})
    if (type == known) return true;
  return false;
}

// As in pbrt, the whole image over the parametrisation, clamped, the finest level.
Result<TextureId> emitted_image(Session& session, const Parameter& file) {
  SPILLWAY_TRY(expect_count(file, file.strings.size(), 1));
  SPILLWAY_ASSIGN(const ImageId image, add_image(session, file));
  pipeline::TextureNode node;
  node.kind = pipeline::TextureKind::image, node.image = image.value, node.wrap = cache::WrapMode::clamp;
  std::fill(std::begin(node.value), std::end(node.value), 1.0f);
  const Result<TextureId> texture = session.sink.add_texture(node);
  if (!texture) return error_at(file.place, "{}", texture.error().message);
  return texture;
}

}  // namespace

Result<AreaEmission> read_area_light(Session& session, const std::string& type, const ParamList& params, Place place) {
  if (type != "diffuse") return error_at(place, "area light \"{}\" is not known: use \"diffuse\"", type);
  AreaEmission emission;
  SPILLWAY_ASSIGN(const std::optional<Rgb> given, given_light_color(session, params, "L"));
  const Rgb color = given.value_or(Rgb{1, 1, 1});
  const Parameter* file = params.find(ParamType::string, "filename");
  if (file != nullptr && given) return error_at(file->place, "an area light has an \"L\" or an image, not both");
  SPILLWAY_ASSIGN(const float scale, read_scale(params));
  emission.radiance = color * scale;
  SPILLWAY_ASSIGN(emission.two_sided, params.boolean("twosided", false));
  SPILLWAY_ASSIGN(const float power, params.real("power", -1));
  emission.power = std::max(power, 0.0f);
  SPILLWAY_TRY(params.check_all_used(session, "AreaLightSource \"diffuse\""));
  if (file != nullptr) {
    SPILLWAY_ASSIGN(emission.image, emitted_image(session, *file));
  }
  return emission;
}

Status add_light(Session& session, const std::string& type, const ParamList& params, Place place,
                 const Transform& world_from_light) {
  if (!is_light(type))
    return session.ignorable(
        place, "light \"{}\" is not known: use infinite, distant, point, spot, goniometric or projection", type);
  Light light{};
  LightExtras extras;
  SPILLWAY_TRY(read_light(session, type, params, place, world_from_light, light, extras));
  SPILLWAY_ASSIGN(const float scale, read_scale(params));
  light.radiance = light.radiance * scale;
  const Parameter* portal = light.kind == LightKind::infinite ? params.find(ParamType::point3, "portal") : nullptr;
  SPILLWAY_TRY(params.check_all_used(session, fmt::format("LightSource \"{}\"", type)));
  const bool finite = is_finite(light.radiance) && is_finite(light.position) && is_finite(light.edge1) && is_finite(light.edge2);
  if (!finite) return error_at(place, "light \"{}\" is not finite", type);
  SPILLWAY_TRY(send(session, type, place, light, extras));
  ++session.report.light_count;
  if (portal == nullptr) return {};
  SPILLWAY_ASSIGN(const shading::Portal rectangle, read_portal(*portal));
  if (const Status added = session.sink.add_portal(rectangle); !added)
    return error_at(portal->place, "{}", added.error().message);
  return {};
}

}  // namespace spillway::tools
