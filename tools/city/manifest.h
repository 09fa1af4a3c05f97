#pragma once

// What a city consists of, as JSON for machines and as a few lines for people.

#include <string>

#include "tools/city/city.h"

namespace spillway::tools::city {

[[nodiscard]] std::string manifest_json(const City& city, const CityOptions& options);
[[nodiscard]] std::string describe(const City& city);

}  // namespace spillway::tools::city
