#pragma once

// Materials, named and not: sent to the sink when a shape first uses them, mixed ones after their parts.

#include <map>
#include <memory>
#include <string>

#include "tools/import/params.h"
#include "tools/import/session.h"
#include "tools/import/textures.h"

namespace spillway::tools {

struct MaterialDefinition {
  std::string name;  // may be empty
  std::string type;
  ParamList params;
  Place place;
  SendState state = SendState::waiting;
  MaterialId id;
};

class MaterialTable {
 public:
  MaterialTable(Session& session, TextureTable& textures);

  // MakeNamedMaterial: the type is a parameter.
  Status define(const Token& name, ParamList params, Place place);
  // The named one; `place` is where it is used.
  Result<std::shared_ptr<MaterialDefinition>> find(const std::string& name, const Place& place) const;
  // pbrt's material before the first directive: grey, diffuse.
  [[nodiscard]] const std::shared_ptr<MaterialDefinition>& standard() const { return standard_; }

  // None (lenient only): shapes with this material are to be left out.
  Result<MaterialId> use(MaterialDefinition& definition);

 private:
  Result<MaterialId> send(const MaterialDefinition& definition);
  Result<pipeline::Material> read(const MaterialDefinition& definition);
  Status read_diffuse_transmission(const MaterialDefinition& definition, pipeline::Material& material);
  Status read_diffuse(const ParamList& params, pipeline::Material& material);
  Status read_conductor(const MaterialDefinition& definition, std::string_view prefix, pipeline::Material& material);
  Status read_dielectric(const ParamList& params, pipeline::Material& material);
  Status read_coat(const ParamList& params, std::string_view prefix, pipeline::Material& material);
  Status read_mix(const MaterialDefinition& definition, pipeline::Material& material);
  Status read_common(const ParamList& params, pipeline::Material& material);
  Status read_roughness(const ParamList& params, std::string_view prefix, pipeline::Param& u, pipeline::Param& v);
  Result<pipeline::Param> metal_param(const ParamList& params, const std::string& name, std::string_view otherwise);
  Result<float> eta_value(const ParamList& params, const std::string& name);

  Session& session_;
  TextureTable& textures_;
  std::map<std::string, std::shared_ptr<MaterialDefinition>> named_;
  std::shared_ptr<MaterialDefinition> standard_;
  int depth_ = 0;
};

}  // namespace spillway::tools
