#pragma once

// What was measured of milk, marble, coffee and others, under the names that pbrt's "preset" has.

#include <optional>
#include <string_view>

#include "cache/base/vec.h"

namespace spillway::tools {

// Per millimetre, by channel.
struct MeasuredMedium {
  Rgb sigma_a, sigma_s;
};
[[nodiscard]] std::optional<MeasuredMedium> measured_medium(std::string_view name);

}  // namespace spillway::tools
