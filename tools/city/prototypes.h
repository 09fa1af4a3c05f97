#pragma once

// What stands in the city many times: lamps, trees, cars. Each is made once about its own origin, z up, front along x.

#include "tools/city/geometry.h"

namespace spillway::tools::city {

enum class LampKind : uint8_t { arm, lantern, count };
enum class TreeKind : uint8_t { round, tall, blossom, conifer, count };
enum class CarKind : uint8_t { sedan, hatchback, van, pickup, count };
inline constexpr int kTreeVariants = 3;
inline constexpr int kCarPaints = 7;
// A post and a head that shines. An arm reaches along x, over the street.
void lamp(Geometry& g, LampKind kind);
void tree(Geometry& g, TreeKind kind, int variant);
void car(Geometry& g, CarKind kind, int paint);
[[nodiscard]] double car_length_m(CarKind kind);

}  // namespace spillway::tools::city
