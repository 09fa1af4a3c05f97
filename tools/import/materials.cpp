#include "tools/import/materials.h"

#include <algorithm>
#include <array>
#include <utility>

#include "tools/import/spectra.h"

namespace spillway::tools {
namespace {

using pipeline::Material;
using pipeline::MaterialKind;
using pipeline::Param;

struct KindName {
  std::string_view name;
  MaterialKind kind;
};
constexpr std::array kKindNames = {
    KindName{"diffuse", MaterialKind::diffuse},
    KindName{"conductor", MaterialKind::conductor},
    KindName{"dielectric", MaterialKind::dielectric},
    KindName{"thindielectric", MaterialKind::thin_dielectric},
    KindName{"coateddiffuse", MaterialKind::coated_diffuse},
    KindName{"coatedconductor", MaterialKind::coated_conductor},
    KindName{"diffusetransmission", MaterialKind::diffuse_transmission},
    KindName{"mix", MaterialKind::mix},
};

const KindName* find_kind(std::string_view name) {
  const auto at = std::find_if(kKindNames.begin(), kKindNames.end(), [&](const KindName& k) { return k.name == name; });
  return at == kKindNames.end() ? nullptr : &*at;
}

Param constant(float value) { return {{value, value, value}, TextureId::kNone}; }

// Samples pairs of wavelength and value where metals are sampled.
Rgb metal_from_pairs(std::span<const float> pairs) {
  return {spectrum_at(pairs, kRgbWavelengths_nm[0]), spectrum_at(pairs, kRgbWavelengths_nm[1]),
          spectrum_at(pairs, kRgbWavelengths_nm[2])};
}

}  // namespace

MaterialTable::MaterialTable(Session& session, TextureTable& textures)
    : session_(session), textures_(textures), standard_(std::make_shared<MaterialDefinition>()) {
  standard_->name = "default";
  standard_->type = "diffuse";
}

Status MaterialTable::define(const Token& name, ParamList params, Place place) {
  const auto at = named_.find(name.text);
  if (at != named_.end()) {
    return error_at(name.place, "material {} is defined twice (first at {}): rename one", to_string(name),
                    to_string(at->second->place));
  }
  auto definition = std::make_shared<MaterialDefinition>();
  SPILLWAY_ASSIGN(definition->type, params.string("type", ""));
  if (definition->type.empty()) return error_at(place, "MakeNamedMaterial {} has no \"string type\"", to_string(name));
  definition->name = name.text;
  definition->params = std::move(params);
  definition->place = place;
  named_.emplace(name.text, std::move(definition));
  return {};
}

Result<std::shared_ptr<MaterialDefinition>> MaterialTable::find(const std::string& name, const Place& place) const {
  const auto at = named_.find(name);
  if (at != named_.end()) return at->second;
  return error_at(place, "there is no material \"{}\": define it with MakeNamedMaterial before the shape that uses it",
                  name);
}

Result<MaterialId> MaterialTable::use(MaterialDefinition& definition) {
  if (definition.state == SendState::sent) return definition.id;
  if (definition.state == SendState::sending)
    return error_at(definition.place, "material \"{}\" uses itself", definition.name);
  if (depth_ == kMaxUseDepth) return error_at(definition.place, "materials are mixed more than {} deep", kMaxUseDepth);
  ++depth_;
  definition.state = SendState::sending;
  Result<MaterialId> sent = send(definition);
  --depth_;
  if (!sent) return sent.error();
  definition.id = *sent;
  definition.state = SendState::sent;
  return definition.id;
}

Result<MaterialId> MaterialTable::send(const MaterialDefinition& definition) {
  // Bounds a medium, and is not seen itself. Media are refused where they are named.
  if (definition.type == "interface" || definition.type.empty() || definition.type == "none") return MaterialId{};
  Material material;
  if (find_kind(definition.type) == nullptr) {
    SPILLWAY_TRY(session_.replaced(definition.place, fmt::format("material type \"{}\"", definition.type),
                                   "a grey diffuse one"));
    material.reflectance = constant(0.5f);
  } else {
    SPILLWAY_ASSIGN(material, read(definition));
    SPILLWAY_TRY(definition.params.check_all_used(session_, fmt::format("Material \"{}\"", definition.type)));
  }
  const std::string name = definition.name.empty() ? to_string(definition.place) : definition.name;
  Result<MaterialId> id = session_.sink.add_material(material, name);
  if (!id) return error_at(definition.place, "{}", id.error().message);
  return id;
}

Result<Material> MaterialTable::read(const MaterialDefinition& definition) {
  const ParamList& params = definition.params;
  Material material;
  material.kind = find_kind(definition.type)->kind;
  switch (material.kind) {
    case MaterialKind::diffuse:
      SPILLWAY_TRY(read_diffuse(params, material));
      break;
    case MaterialKind::conductor:
      SPILLWAY_TRY(read_conductor(definition, "", material));
      SPILLWAY_TRY(read_roughness(params, "", material.u_roughness, material.v_roughness));
      break;
    case MaterialKind::dielectric:
      SPILLWAY_TRY(read_dielectric(params, material));
      break;
    case MaterialKind::thin_dielectric: {
      SPILLWAY_ASSIGN(material.eta, eta_value(params, "eta"));
      break;
    }
    case MaterialKind::coated_diffuse:
      SPILLWAY_TRY(read_diffuse(params, material));
      SPILLWAY_TRY(read_coat(params, "", material));
      break;
    case MaterialKind::coated_conductor:
      SPILLWAY_TRY(read_conductor(definition, "conductor.", material));
      SPILLWAY_TRY(read_roughness(params, "conductor.", material.base_u_roughness, material.base_v_roughness));
      SPILLWAY_TRY(read_coat(params, "interface.", material));
      break;
    case MaterialKind::diffuse_transmission:
      SPILLWAY_TRY(read_diffuse_transmission(definition, material));
      break;
    case MaterialKind::mix:
      SPILLWAY_TRY(read_mix(definition, material));
      return material;
  }
  SPILLWAY_TRY(read_common(params, material));
  return material;
}

Status MaterialTable::read_common(const ParamList& params, Material& material) {
  const bool has_roughness = material.kind != MaterialKind::diffuse && material.kind != MaterialKind::thin_dielectric &&
                             material.kind != MaterialKind::diffuse_transmission;
  if (has_roughness) {
    SPILLWAY_ASSIGN(const bool remap, params.boolean("remaproughness", true));
    material.remap_roughness = remap;
  }
  SPILLWAY_ASSIGN(const std::optional<Param> displacement, textures_.real_param(params, "displacement"));
  if (displacement) material.displacement = displacement->texture;  // a constant one tilts nothing
  const Parameter* map = params.find(ParamType::string, "normalmap");
  if (map == nullptr) return {};
  if (displacement) return error_at(map->place, "a material takes \"normalmap\" or \"displacement\", not both");
  SPILLWAY_ASSIGN(const TextureId id, textures_.add_normal_map(*map));
  material.normal_map = id.value;
  return {};
}

Status MaterialTable::read_diffuse(const ParamList& params, Material& material) {
  SPILLWAY_ASSIGN(const std::optional<Param> reflectance, textures_.rgb_param(params, "reflectance", RgbRange::albedo));
  material.reflectance = reflectance.value_or(constant(0.5f));
  return {};
}

Status MaterialTable::read_diffuse_transmission(const MaterialDefinition& definition, Material& material) {
  const ParamList& params = definition.params;
  SPILLWAY_ASSIGN(const std::optional<Param> back, textures_.rgb_param(params, "reflectance", RgbRange::albedo));
  SPILLWAY_ASSIGN(const std::optional<Param> through, textures_.rgb_param(params, "transmittance", RgbRange::albedo));
  SPILLWAY_ASSIGN(const float scale, params.real("scale", 1));
  if (!(scale >= 0)) return error_at(definition.place, "\"scale\" must not be negative");
  SPILLWAY_ASSIGN(material.reflectance, textures_.scaled(back.value_or(constant(0.25f)), scale, definition.place));
  SPILLWAY_ASSIGN(material.transmittance, textures_.scaled(through.value_or(constant(0.25f)), scale, definition.place));
  return {};
}

Status MaterialTable::read_roughness(const ParamList& params, std::string_view prefix, Param& u, Param& v) {
  const std::string name(prefix);
  SPILLWAY_ASSIGN(std::optional<Param> u_given, textures_.real_param(params, name + "uroughness"));
  SPILLWAY_ASSIGN(std::optional<Param> v_given, textures_.real_param(params, name + "vroughness"));
  std::optional<Param> both;
  if (!u_given || !v_given) {  // otherwise it has no effect: an unused parameter
    SPILLWAY_ASSIGN(both, textures_.real_param(params, name + "roughness"));
  }
  u = u_given.value_or(both.value_or(constant(0)));
  v = v_given.value_or(both.value_or(constant(0)));
  return {};
}

Result<Param> MaterialTable::metal_param(const ParamList& params, const std::string& name, std::string_view otherwise) {
  const Parameter* spectrum = params.find(ParamType::spectrum, name);
  if (spectrum == nullptr) {
    SPILLWAY_ASSIGN(const std::optional<Param> given, textures_.rgb_param(params, name, RgbRange::unbounded));
    return given.value_or(Param{*metal_rgb(otherwise), TextureId::kNone});
  }
  if (spectrum->strings.empty()) {
    SPILLWAY_TRY(check_pairs(*spectrum));
    return Param{metal_from_pairs(spectrum->numbers), TextureId::kNone};
  }
  SPILLWAY_TRY(expect_count(*spectrum, spectrum->strings.size() + spectrum->numbers.size(), 1));
  const std::string& metal = spectrum->strings[0];
  if (const std::optional<Rgb> rgb = metal_rgb(metal)) return Param{*rgb, TextureId::kNone};
  if (const std::optional<float> glass = glass_eta(metal)) return constant(*glass);
  SPILLWAY_ASSIGN(const std::vector<float> pairs, spectrum_pairs(session_, *spectrum));
  return Param{metal_from_pairs(pairs), TextureId::kNone};
}

Status MaterialTable::read_conductor(const MaterialDefinition& definition, std::string_view prefix,
                                     Material& material) {
  const ParamList& params = definition.params;
  const std::string name(prefix);
  SPILLWAY_ASSIGN(const std::optional<Param> reflectance, textures_.rgb_param(params, "reflectance", RgbRange::albedo));
  if (reflectance) {  // eta and k are then unused parameters, and refused as such
    material.uses_reflectance = 1;
    material.reflectance = *reflectance;
    return {};
  }
  SPILLWAY_ASSIGN(material.conductor_eta, metal_param(params, name + "eta", "metal-Cu-eta"));
  SPILLWAY_ASSIGN(material.conductor_k, metal_param(params, name + "k", "metal-Cu-k"));
  return {};
}

Result<float> MaterialTable::eta_value(const ParamList& params, const std::string& name) {
  constexpr float kStandardEta = 1.5f;
  float eta = kStandardEta;
  const Parameter* given = params.find(ParamType::real, name);
  if (given != nullptr) {
    SPILLWAY_ASSIGN(eta, params.real(name, kStandardEta));
  } else if ((given = params.find(ParamType::spectrum, name)) != nullptr) {
    session_.warn(given->place, "colours are not dispersed: \"{}\" is taken at {} nm", name, kGlassWavelength_nm);
    const std::optional<float> glass = given->strings.size() == 1 ? glass_eta(given->strings[0]) : std::nullopt;
    if (glass) {
      eta = *glass;
    } else {
      SPILLWAY_ASSIGN(const std::vector<float> pairs, spectrum_pairs(session_, *given));
      eta = spectrum_at(pairs, kGlassWavelength_nm);
    }
  }
  if (!(eta > 0)) return error_at(given->place, "\"{}\" must be above 0", name);
  return eta;
}

Status MaterialTable::read_dielectric(const ParamList& params, Material& material) {
  SPILLWAY_ASSIGN(material.eta, eta_value(params, "eta"));
  return read_roughness(params, "", material.u_roughness, material.v_roughness);
}

// The coat is a closed form: it counts every bounce inside, and holds nothing that scatters.
Status MaterialTable::read_coat(const ParamList& params, std::string_view prefix, Material& material) {
  SPILLWAY_ASSIGN(material.eta, eta_value(params, std::string(prefix) + "eta"));
  SPILLWAY_TRY(read_roughness(params, prefix, material.u_roughness, material.v_roughness));
  SPILLWAY_ASSIGN(const std::optional<Param> albedo, textures_.rgb_param(params, "albedo", RgbRange::albedo));
  if (albedo && (albedo->texture != TextureId::kNone || !is_black(albedo->constant))) {
    session_.warn(params.find(ParamType::rgb, "albedo") != nullptr ? params.find(ParamType::rgb, "albedo")->place
                                                                   : params.find(ParamType::texture, "albedo")->place,
                  "the inside of a coat does not scatter: \"albedo\" is taken as 0");
  }
  for (const char* name : {"thickness", "g"}) {  // without meaning when nothing scatters
    (void)params.find(ParamType::real, name);
    (void)params.find(ParamType::texture, name);
  }
  for (const char* name : {"maxdepth", "nsamples"}) (void)params.find(ParamType::integer, name);
  return {};
}

Status MaterialTable::read_mix(const MaterialDefinition& definition, Material& material) {
  const Parameter* parts = definition.params.find(ParamType::string, "materials");
  if (parts == nullptr) return error_at(definition.place, "material \"mix\" without \"string materials\"");
  SPILLWAY_TRY(expect_count(*parts, parts->strings.size(), 2));
  for (size_t i = 0; i < 2; ++i) {
    SPILLWAY_ASSIGN(const std::shared_ptr<MaterialDefinition> part, find(parts->strings[i], parts->place));
    SPILLWAY_ASSIGN(const MaterialId id, use(*part));
    if (!id.valid()) return error_at(parts->place, "\"{}\" cannot be mixed: it has no surface", parts->strings[i]);
    material.mix_material[i] = id.value;
  }
  SPILLWAY_ASSIGN(const std::optional<Param> amount, textures_.real_param(definition.params, "amount"));
  material.mix_amount = amount.value_or(constant(0.5f));
  return {};
}

}  // namespace spillway::tools
