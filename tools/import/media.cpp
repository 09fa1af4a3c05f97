#include "tools/import/media.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cache/base/parallel.h"
#include "shading/noise.h"
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
  SPILLWAY_ASSIGN(const Rgb sigma_a,
                  read_coefficient(session, params, "sigma_a", grid ? Rgb{1, 1, 1} : kMarbleAbsorption));
  SPILLWAY_ASSIGN(const Rgb sigma_s,
                  read_coefficient(session, params, "sigma_s", grid ? Rgb{1, 1, 1} : kMarbleScattering));
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

// Colours of a grid from number `first` on, as linear Rec. 709; ones where none are given.
Status read_colors(const Parameter* given, size_t first, std::span<float> colors) {
  std::fill(colors.begin(), colors.end(), 1.0f);
  if (given == nullptr) return {};
  if (given->stream) {
    SPILLWAY_TRY(given->stream->read(first, colors));
  } else {
    std::copy_n(given->numbers.begin() + static_cast<std::ptrdiff_t>(first), colors.size(), colors.begin());
  }
  for (size_t i = 0; i < colors.size(); i += 3) {
    if (given->color_space == ColorSpace::srgb) {
      if (std::min({colors[i], colors[i + 1], colors[i + 2]}) >= 0) continue;
      return error_at(given->place, "\"rgb {}\": sample {} is negative", given->name, (first + i) / 3);
    }
    const Rgb inside = surface_rec709(given->color_space, {colors[i], colors[i + 1], colors[i + 2]});
    colors[i] = std::max(inside.r, 0.0f), colors[i + 1] = std::max(inside.g, 0.0f);
    colors[i + 2] = std::max(inside.b, 0.0f);
  }
  return {};
}

class MediumReader {
 public:
  MediumReader(Session& session, const ParamList& params, const Token& name)
      : session_(session), params_(params), name_(name) {}

  Result<Medium> read(const std::string& type) {
    Medium medium;
    if (type != "homogeneous") medium.kind = MediumKind::grid;
    if (type == "rgbgrid") {
      SPILLWAY_TRY(read_color_grid(medium));
      return medium;
    }
    SPILLWAY_TRY(read_coefficients(session_, params_, medium));
    if (type == "homogeneous") SPILLWAY_TRY(read_homogeneous(medium));
    if (type == "uniformgrid") SPILLWAY_TRY(read_uniform_grid(medium));
    if (type == "cloud") SPILLWAY_TRY(read_cloud(medium));
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

  Result<uint32_t> add_volume(const Place& place, const VolumeInput& volume) {
    const auto added = session_.sink.add_volume(volume);
    if (!added) return error_at(place, "{}", added.error().message);
    return *added;
  }
  Result<uint32_t> add_volume(const Place& place, const std::array<int32_t, 3>& counts, uint32_t channels,
                              std::shared_ptr<const pipeline::SampleStream> samples) {
    SPILLWAY_ASSIGN(const Affine3 medium_from_lattice, lattice_of(params_, counts));
    return add_volume(place, {to_string(place), {}, {}, counts, channels, std::move(samples), medium_from_lattice});
  }

  Result<uint32_t> add_given(const Parameter& samples, const std::array<int32_t, 3>& counts) {
    if (samples.stream) return add_volume(samples.place, counts, 1, samples.stream);
    SPILLWAY_ASSIGN(const auto stream, pipeline::to_sample_stream(session_.sink, samples.numbers));
    return add_volume(samples.place, counts, 1, stream);
  }

  // The same, of numbers that are made some at a time: fill(first, numbers).
  template <class Fill>
  Result<uint32_t> add_made(const Place& place, const std::array<int32_t, 3>& counts, uint32_t channels,
                            const Fill& fill) {
    constexpr size_t kAtOnce = size_t{3} << 16;  // 768 KiB, colours whole
    SPILLWAY_ASSIGN(const auto stream, session_.sink.make_sample_stream());
    const size_t count = static_cast<size_t>(counts[0]) * counts[1] * counts[2] * channels;
    std::vector<float> some(std::min(count, kAtOnce));
    for (size_t first = 0; first < count; first += kAtOnce) {
      const std::span numbers = std::span(some).first(std::min(kAtOnce, count - first));
      SPILLWAY_TRY(fill(first, numbers));
      SPILLWAY_TRY(stream->append(numbers));
    }
    SPILLWAY_TRY(stream->finish());
    return add_volume(place, counts, channels, stream);
  }

  Result<std::array<int32_t, 3>> read_counts() {
    std::array<int32_t, 3> counts;
    SPILLWAY_ASSIGN(counts[0], params_.integer("nx", 1));
    SPILLWAY_ASSIGN(counts[1], params_.integer("ny", 1));
    SPILLWAY_ASSIGN(counts[2], params_.integer("nz", 1));
    for (const int32_t n : counts)
      if (n < 1 || n > cache::kMaxLattice)
        return error_at(name_.place, "nx, ny and nz must lie between 1 and {}", cache::kMaxLattice);
    return counts;
  }

  Status read_uniform_grid(Medium& medium) {
    SPILLWAY_ASSIGN(const auto counts, read_counts());
    const Parameter* density = params_.find(ParamType::real, "density");
    if (density == nullptr) return error_at(name_.place, "a uniformgrid medium without \"float density\"");
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
    if (scale->number_count() == 1) {
      medium.glow = medium.glow * scale->numbers[0];
      return {};
    }
    medium.glow_kind = GlowKind::scaled;
    SPILLWAY_ASSIGN(medium.glow_volume, add_given(*scale, counts));
    return {};
  }

  // The colours of a grid, or none when the scene does not give them.
  Result<const Parameter*> find_colors(std::string_view name, const std::array<int32_t, 3>& counts) {
    const Parameter* given = params_.find(ParamType::rgb, name);
    if (given == nullptr) return given;
    const double wanted = 3.0 * counts[0] * counts[1] * counts[2];
    if (static_cast<double>(given->number_count()) != wanted)
      return error_at(given->place, "\"rgb {}\" takes three numbers a sample of nx * ny * nz, {} in all, not {}", name,
                      wanted, given->number_count());
    return given;
  }

  // What is not given of absorption and scattering is one everywhere, as in pbrt.
  Status read_color_grid(Medium& medium) {
    medium.kind = MediumKind::color_grid;
    SPILLWAY_ASSIGN(const auto counts, read_counts());
    SPILLWAY_ASSIGN(const Parameter* absorbs, find_colors("sigma_a", counts));
    SPILLWAY_ASSIGN(const Parameter* scatters, find_colors("sigma_s", counts));
    if (absorbs == nullptr && scatters == nullptr)
      return error_at(name_.place, "an rgbgrid medium without \"rgb sigma_a\" and \"rgb sigma_s\": give one of them");
    const Place place = (absorbs != nullptr ? absorbs : scatters)->place;
    std::vector<float> scattered;
    const auto total = [&](size_t first, std::span<float> colors) -> Status {
      scattered.resize(colors.size());
      SPILLWAY_TRY(read_colors(absorbs, first, colors));
      SPILLWAY_TRY(read_colors(scatters, first, scattered));
      for (size_t i = 0; i < colors.size(); ++i) colors[i] += scattered[i];
      return {};
    };
    SPILLWAY_ASSIGN(medium.density_volume, add_made(place, counts, 3, total));
    SPILLWAY_ASSIGN(medium.scatter_volume, add_colors(place, counts, scatters));
    SPILLWAY_ASSIGN(const float scale, params_.real("scale", 1));
    medium.sigma_a = {0, 0, 0}, medium.sigma_s = {scale, scale, scale};
    SPILLWAY_ASSIGN(medium.g, params_.real("g", 0));
    return read_color_emission(counts, absorbs != nullptr, medium);
  }

  Result<uint32_t> add_colors(const Place& place, const std::array<int32_t, 3>& counts, const Parameter* given) {
    return add_made(place, counts, 3,
                    [&](size_t first, std::span<float> colors) { return read_colors(given, first, colors); });
  }

  Status read_color_emission(const std::array<int32_t, 3>& counts, bool absorbs, Medium& medium) {
    SPILLWAY_ASSIGN(const Parameter* emission, find_colors("Le", counts));
    if (emission == nullptr) return {};
    if (!absorbs)
      return error_at(emission->place, "an rgbgrid medium emits what it absorbs: \"rgb Le\" takes \"rgb sigma_a\" too");
    SPILLWAY_ASSIGN(const float scale,
                    params_.real(params_.find(ParamType::real, "LeScale") ? "LeScale" : "Lescale", 1));
    medium.glow_kind = GlowKind::colors, medium.glow = {scale, scale, scale};
    SPILLWAY_ASSIGN(medium.glow_volume, add_colors(emission->place, counts, emission));
    return {};
  }

  // A function of the place, sampled twice a finest wave of its noise (16 times the frequency), 256 samples an axis at
  // most.
  Status read_cloud(Medium& medium) {
    shading::CloudParams cloud;
    SPILLWAY_ASSIGN(cloud.density, params_.real("density", cloud.density));
    SPILLWAY_ASSIGN(cloud.wispiness, params_.real("wispiness", cloud.wispiness));
    SPILLWAY_ASSIGN(cloud.frequency, params_.real("frequency", cloud.frequency));
    SPILLWAY_ASSIGN(const Float3 p0, params_.point3("p0", {0, 0, 0}));
    SPILLWAY_ASSIGN(const Float3 p1, params_.point3("p1", {1, 1, 1}));
    constexpr float kSamplesPerUnit = 2 * 16, kMostSamples = 256;
    std::array<int32_t, 3> counts;
    for (int a = 0; a < 3; ++a) {
      if (p0[a] == p1[a]) return error_at(name_.place, "p0 and p1 of a cloud are at the same place along axis {}", a);
      const float wanted = std::ceil(std::fabs((p1[a] - p0[a]) * cloud.frequency) * kSamplesPerUnit);
      counts[a] = static_cast<int32_t>(std::clamp(wanted, 16.0f, kMostSamples));
    }
    SPILLWAY_ASSIGN(const Affine3 medium_from_lattice, lattice_of(params_, counts));
    const auto sample = [&](size_t at) {
      const size_t row = at / counts[0];
      const Float3 p{static_cast<float>(at % counts[0]), static_cast<float>(row % counts[1]),
                     static_cast<float>(row / counts[1])};
      return shading::cloud_density(medium_from_lattice.point(p), cloud);
    };
    const auto fill = [&](size_t at, std::span<float> samples) -> Status {
      parallel_blocks(samples.size(), 1024, [&](size_t, size_t first, size_t last) {
        for (size_t i = first; i < last; ++i) samples[i] = sample(at + i);
      });
      return {};
    };
    SPILLWAY_ASSIGN(medium.density_volume, add_made(name_.place, counts, 1, fill));
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
    return add_volume(name_.place, {fmt::format("{}: grid '{}'", path.string(), grid), path, grid});
  }

  // Glow, and temperature that glows, are asked for by name: a file may hold some that is not meant to.
  Status read_file(Medium& medium) {
    const Parameter* file = params_.find(ParamType::string, "filename");
    if (file == nullptr || file->strings.size() != 1)
      return error_at(name_.place, "a medium of a volume file takes \"string filename\"");
    SPILLWAY_ASSIGN(const std::string density, params_.string("densityname", "density"));
    SPILLWAY_ASSIGN(const std::string temperature, params_.string("temperaturename", ""));
    SPILLWAY_ASSIGN(const std::string emission, params_.string("emissionname", ""));
    SPILLWAY_ASSIGN(medium.density_volume, add_grid(file->strings[0], density));
    if (!emission.empty()) {
      if (!temperature.empty())
        return error_at(name_.place, "a medium has \"temperaturename\" or \"emissionname\", not both");
      return read_file_emission(file->strings[0], emission, medium);
    }
    if (temperature.empty()) return {};
    SPILLWAY_TRY(read_temperature(medium, "LeScale"));
    SPILLWAY_ASSIGN(medium.glow_volume, add_grid(file->strings[0], temperature));
    return {};
  }

  // A grid of numbers that the colour "Le" is multiplied by.
  Status read_file_emission(const std::string& file, const std::string& grid, Medium& medium) {
    SPILLWAY_ASSIGN(const std::optional<Rgb> color, read_emission());
    SPILLWAY_ASSIGN(const float scale, params_.real("LeScale", 1));
    medium.glow_kind = GlowKind::scaled, medium.glow = color.value_or(Rgb{1, 1, 1}) * scale;
    SPILLWAY_ASSIGN(medium.glow_volume, add_grid(file, grid));
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
  return type == "homogeneous" || type == "uniformgrid" || type == "rgbgrid" || type == "cloud" || type == "nanovdb" ||
         type == "openvdb";
}

}  // namespace

Status MediumTable::define(const Token& name, ParamList params, const Transform& world_from_medium) {
  const Parameter* given = params.find(ParamType::string, "type");
  const std::string type = given != nullptr && given->strings.size() == 1 ? given->strings[0] : "";
  if (!is_supported(type))
    return error_at(
        name.place,
        "medium type \"{}\" is not supported: use \"homogeneous\", \"uniformgrid\", \"rgbgrid\", \"cloud\", "
        "\"nanovdb\" or \"openvdb\"",
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
