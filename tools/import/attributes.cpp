#include "tools/import/attributes.h"

#include <algorithm>
#include <utility>

namespace spillway::tools {
namespace {

constexpr std::array<std::string_view, 5> kTargetNames = {"shape", "light", "material", "medium", "texture"};

}  // namespace

Status Attributes::add(const Token& target, ParamList added) {
  const auto at = std::find(kTargetNames.begin(), kTargetNames.end(), target.text);
  if (at == kTargetNames.end()) {
    return error_at(target.place,
                    "unknown target {}: use \"shape\", \"light\", \"material\", \"medium\" or \"texture\"",
                    to_string(target));
  }
  std::shared_ptr<const ParamList>& kept = kept_[static_cast<size_t>(at - kTargetNames.begin())];
  if (kept) added.inherit(*kept);
  if (added.parameters.size() > kMaxParameters)
    return error_at(target.place, "more than {} attributes of one kind", kMaxParameters);
  kept = std::make_shared<const ParamList>(std::move(added));
  return {};
}

void Attributes::extend(Target target, ParamList& params) const {
  if (const auto& kept = kept_[static_cast<size_t>(target)]) params.inherit(*kept);
}

}  // namespace spillway::tools
