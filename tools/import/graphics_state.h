#pragma once

// What directives leave to those that follow, up to the end of their scope.

#include <memory>
#include <optional>

#include "tools/import/attributes.h"
#include "tools/import/color_space.h"
#include "tools/import/lights.h"
#include "tools/import/materials.h"
#include "tools/import/media.h"
#include "tools/import/transform.h"

namespace spillway::tools {

struct GraphicsState {
  // The current one, at the first of TransformTimes: world from shape (before WorldBegin: camera from world).
  Transform transform;
  Transform transform_end;                        // at the second
  bool changes_start = true, changes_end = true;  // ActiveTransform
  bool reverse_orientation = false;
  std::shared_ptr<MaterialDefinition> material;  // none: look up the name
  Token material_name;
  std::optional<AreaEmission> emission;
  Attributes attributes;
  MediumNames media;
  ColorSpace color_space = ColorSpace::srgb;
  [[nodiscard]] bool moves() const { return !(transform == transform_end); }
  // The parameters that follow, with what Attribute keeps for their kind.
  Result<ParamList> read_params_of(Tokenizer& tokens, Target target, pipeline::SceneSink* long_lists = nullptr) const {
    SPILLWAY_ASSIGN(ParamList params, read_params(tokens, color_space, long_lists));
    attributes.extend(target, params);
    return params;
  }
};

}  // namespace spillway::tools
