#pragma once

// Attribute directives: parameters that later directives of one kind get besides their own.

#include <array>
#include <memory>

#include "tools/import/params.h"

namespace spillway::tools {

enum class Target : uint8_t { shape, light, material, medium, texture };

// Copied with the graphics state; what is kept is shared.
class Attributes {
 public:
  // Attribute "target" parameters: what is said later wins.
  Status add(const Token& target, ParamList added);
  // The parameters of a directive, with what is kept for its kind.
  void extend(Target target, ParamList& params) const;

 private:
  std::array<std::shared_ptr<const ParamList>, 5> kept_;
};

}  // namespace spillway::tools
