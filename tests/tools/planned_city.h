#pragma once

#include <gtest/gtest.h>

#include "tools/city/city.h"

namespace spillway::tools::city {

[[nodiscard]] inline City planned(const CityOptions& options) {
  Result<City> city = City::plan(options);
  EXPECT_TRUE(city) << city.error().message;
  return std::move(*city);
}

}  // namespace spillway::tools::city
