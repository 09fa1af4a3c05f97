#include "tools/import/media.h"

#include <array>
#include <vector>

#include "tools/import/colors.h"
#include "tools/import/measured_media.h"
#include "tools/import/spectra.h"

namespace spillway::tools {
namespace {

using pipeline::GlowKind;
using pipeline::Medium;
using pipeline::MediumInput;
using pipeline::MediumKind;
using pipeline::VolumeInput;

// Per unit length.
Result<Rgb> read_coefficient(Session& session, const ParamList& params, std::string_view name, Rgb otherwise) {
  SPILLWAY_ASSIGN(const std::optional<Rgb> given, surface_color(session, params, name, RgbRange::unbounded));
  return given.value_or(otherwise);
}

// pbrt's default is a marble per millimetre; grids scatter and absorb evenly.
constexpr Rgb kMarbleAbsorption{0.0011f, 0.0024f, 0.014f}, kMarbleScattering{2.55f, 3.21f, 3.77f};

// Wins over coefficients that are given, as in pbrt.
Result<std::optional<MeasuredMedium>> read_preset(Session& session, const ParamList& params) {
  SPILLWAY_ASSIGN(const std::string name, params.string("preset", ""));
  if (name.empty()) return std::optional<MeasuredMedium>();
  const std::optional<MeasuredMedium> known = measured_medium(name);
  if (!known)
    SPILLWAY_TRY(session.ignorable(params.find(ParamType::string, "preset")->place,
                                   "there is no measured medium \"{}\": give sigma_a and sigma_s", name));
  return known;
}

Status read_coefficients(Session& session, const ParamList& params, Medium& medium) {
  SPILLWAY_ASSIGN(const std::optional<MeasuredMedium> measured, read_preset(session, params));
  const bool grid = medium.kind == MediumKind::grid;
  SPILLWAY_ASSIGN(const float scale, params.real("scale", 1));
  SPILLWAY_ASSIGN(const Rgb sigma_a, read_coefficient(session, params, "sigma_a", grid ? Rgb{1, 1, 1} : kMarbleAbsorption));
  SPILLWAY_ASSIGN(const Rgb sigma_s, read_coefficient(session, params, "sigma_s", grid ? Rgb{1, 1, 1} : kMarbleScattering));
  medium.sigma_a = (measured ? measured->sigma_a : sigma_a) * scale;
  medium.sigma_s = (measured ? measured->sigma_s : sigma_s) * scale;
  SPILLWAY_ASSIGN(medium.g, params.real("g", 0));
  return {};
}

// The grid's box in the medium's space.
Result<Affine3> lattice_of(const ParamList& params, const std::array<int32_t, 3>& counts) {
  SPILLWAY_ASSIGN(const Float3 p0, params.point3("p0", {0, 0, 0}));
  SPILLWAY_ASSIGN(const Float3 p1, params.point3("p1", {1, 1, 1}));
  Affine3 medium_from_lattice;  // samples stand in the middle of their cells
  for (int a = 0; a < 3; ++a) {
    const float step = (p1[a] - p0[a]) / static_cast<float>(counts[a]);
    for (int b = 0; b < 3; ++b) medium_from_lattice.m[a][b] = a == b ? step : 0;
    medium_from_lattice.m[a][3] = p0[a] + step / 2;
  }
  return medium_from_lattice;
}

class MediumReader {
 public:
  MediumReader(Session& session, const ParamList& params, const Token& name)
      : session_(session), params_(params), name_(name) {}

  Result<Medium> read(const std::string& type) {
    Medium medium;
    if (type != "homogeneous") medium.kind = MediumKind::grid;
    SPILLWAY_TRY(read_coefficients(session_, params_, medium));
    if (type == "homogeneous") SPILLWAY_TRY(read_homogeneous(medium));
    if (type == "uniformgrid") SPILLWAY_TRY(read_uniform_grid(medium));
    if (type == "nanovdb" || type == "openvdb") SPILLWAY_TRY(read_file(medium));
    return medium;
  }

 private:
  // Radiance; none when the medium does not say, or says black. "Lescale" without it is left to be named as unused.
  Result<std::optional<Rgb>> read_emission() { return given_light_color(session_, params_, "Le"); }

  Status read_homogeneous(Medium& medium) {
    SPILLWAY_ASSIGN(const std::optional<Rgb> emission, read_emission());
    if (!emission) return {};
    SPILLWAY_ASSIGN(const float scale, params_.real("Lescale", 1));
    if (!is_black(*emission)) medium.glow_kind = GlowKind::constant, medium.glow = *emission * scale;
    return {};
  }

  Result<uint32_t> add_given(const Parameter& samples, const std::array<int32_t, 3>& counts) {
    SPILLWAY_ASSIGN(const Affine3 medium_from_lattice, lattice_of(params_, counts));
    const auto added =
        session_.sink.add_volume({to_string(samples.place), {}, {}, counts, samples.numbers, medium_from_lattice});
    if (!added) return error_at(samples.place, "{}", added.error().message);
    return *added;
  }

  Status read_uniform_grid(Medium& medium) {
    std::array<int32_t, 3> counts;
    SPILLWAY_ASSIGN(counts[0], params_.integer("nx", 1));
    SPILLWAY_ASSIGN(counts[1], params_.integer("ny", 1));
    SPILLWAY_ASSIGN(counts[2], params_.integer("nz", 1));
    const Parameter* density = params_.find(ParamType::real, "density");
    if (density == nullptr) return error_at(name_.place, "a uniformgrid medium without \"float density\"");
    for (const int32_t n : counts)
      if (n < 1 || n > cache::kMaxLattice)
        return error_at(name_.place, "nx, ny and nz must lie between 1 and {}", cache::kMaxLattice);
    SPILLWAY_ASSIGN(medium.density_volume, add_given(*density, counts));
    SPILLWAY_ASSIGN(const std::optional<Rgb> emission, read_emission());
    const Parameter* temperature = params_.find(ParamType::real, "temperature");
    if (temperature != nullptr && emission)
      return error_at(temperature->place, "a medium has \"temperature\" or \"Le\", not both");
    if (temperature != nullptr) {
      SPILLWAY_TRY(read_temperature(medium, "Lescale"));
      SPILLWAY_ASSIGN(medium.glow_volume, add_given(*temperature, counts));
    }
    return emission ? read_grid_emission(*emission, counts, medium) : Status{};
  }

  // Evenly, by one number or by one a sample.
  Status read_grid_emission(Rgb emission, const std::array<int32_t, 3>& counts, Medium& medium) {
    const Parameter* scale = params_.find(ParamType::real, "Lescale");
    if (is_black(emission)) return {};
    medium.glow = emission, medium.glow_kind = GlowKind::constant;
    if (scale == nullptr) return {};
    if (scale->numbers.size() == 1) {
      medium.glow = medium.glow * scale->numbers[0];
      return {};
    }
    medium.glow_kind = GlowKind::scaled;
    SPILLWAY_ASSIGN(medium.glow_volume, add_given(*scale, counts));
    return {};
  }

  // pbrt spells the scale differently for grids that are given and grids of files.
  Status read_temperature(Medium& medium, std::string_view scale_name) {
    medium.glow_kind = GlowKind::temperature;
    SPILLWAY_ASSIGN(const float cutoff, params_.real("temperaturecutoff", 0));
    SPILLWAY_ASSIGN(medium.kelvin_offset, params_.real("temperatureoffset", cutoff));
    SPILLWAY_ASSIGN(medium.kelvin_scale, params_.real("temperaturescale", 1));
    SPILLWAY_ASSIGN(const float scale, params_.real(scale_name, 1));
    medium.glow = {scale, scale, scale};
    return {};
  }

  Result<uint32_t> add_grid(const std::string& file, const std::string& grid) {
    const std::filesystem::path path = session_.resolved(file);
    const auto added =
        session_.sink.add_volume({fmt::format("{}: grid '{}'", path.string(), grid), path, grid, {0, 0, 0}, {}, {}});
    if (!added) return error_at(name_.place, "{}", added.error().message);
    return *added;
  }

  // A temperature is asked for by name: a file may hold one that is not meant to glow.
  Status read_file(Medium& medium) {
    const Parameter* file = params_.find(ParamType::string, "filename");
    if (file == nullptr || file->strings.size() != 1)
      return error_at(name_.place, "a medium of a volume file takes \"string filename\"");
    SPILLWAY_ASSIGN(const std::string density, params_.string("densityname", "density"));
    SPILLWAY_ASSIGN(const std::string temperature, params_.string("temperaturename", ""));
    SPILLWAY_ASSIGN(medium.density_volume, add_grid(file->strings[0], density));
    if (temperature.empty()) return {};
    SPILLWAY_TRY(read_temperature(medium, "LeScale"));
    SPILLWAY_ASSIGN(medium.glow_volume, add_grid(file->strings[0], temperature));
    return {};
  }

  Session& session_;
  const ParamList& params_;
  const Token& name_;
};

std::vector<Rgb> black_body_table() {
  std::vector<Rgb> table;
  for (uint32_t i = 0; i < pipeline::kBlackBodyEntries; ++i)
    table.push_back(normalised_blackbody_rgb(static_cast<float>(i) * pipeline::kBlackBodyStep_kelvin));
  return table;
}

bool is_supported(const std::string& type) {
  return type == "homogeneous" || type == "uniformgrid" || type == "nanovdb" || type == "openvdb";
}

}  // namespace

Status MediumTable::define(const Token& name, ParamList params, const Transform& world_from_medium) {
  const Parameter* given = params.find(ParamType::string, "type");
  const std::string type = given != nullptr && given->strings.size() == 1 ? given->strings[0] : "";
  if (!is_supported(type))
    return error_at(name.place,
                    "medium type \"{}\" is not supported: use \"homogeneous\", \"uniformgrid\", \"nanovdb\" or "
                    "\"openvdb\"",
                    type);
  MediumInput input{fmt::format("medium {}", to_string(name)), {}, world_from_medium.affine()};
  SPILLWAY_ASSIGN(input.medium, MediumReader(session_, params, name).read(type));
  SPILLWAY_TRY(params.check_all_used(session_, fmt::format("medium type \"{}\"", type)));
  if (input.medium.glow_kind == GlowKind::temperature && !has_black_bodies_) {
    session_.sink.set_black_bodies(black_body_table());
    has_black_bodies_ = true;
  }
  const Result<uint32_t> added = session_.sink.add_medium(input);
  if (!added) return error_at(name.place, "{}", added.error().message);
  media_[name.text] = *added;
  return {};
}

Result<uint32_t> MediumTable::find(const Token& name) const {
  if (name.text.empty()) return pipeline::kNoMedium;
  const auto at = media_.find(name.text);
  if (at != media_.end()) return at->second;
  return error_at(name.place, "there is no medium {}: define it with MakeNamedMedium before it is used",
                  to_string(name));
}

Result<MediumNames> read_medium_interface(Tokenizer& tokens, const Token& directive) {
  MediumNames names;
  SPILLWAY_ASSIGN(names.inside, read_string_token(tokens, directive.text));
  names.outside = names.inside;
  SPILLWAY_ASSIGN(const Token* next, tokens.peek());
  if (next->kind == TokenKind::string) {
    SPILLWAY_ASSIGN(names.outside, tokens.take());
  }
  return names;
}

}  // namespace spillway::tools
