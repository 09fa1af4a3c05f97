#pragma once

// What stands in the city many times: lamps, trees, cars. Each is made once about its own origin, z up, front along x.

#include <array>
#include <vector>

#include "tools/city/geometry.h"

namespace spillway::tools::city {

enum class LampKind : uint8_t { arm, lantern, count };
enum class TreeKind : uint8_t { round, tall, blossom, conifer, count };
enum class CarKind : uint8_t { sedan, hatchback, van, pickup, count };
inline constexpr int kTreeVariants = 3;
inline constexpr int kCarPaints = 7;
inline constexpr size_t kLampKinds = static_cast<size_t>(LampKind::count);
inline constexpr size_t kTreeKinds = static_cast<size_t>(TreeKind::count);
inline constexpr size_t kCarKinds = static_cast<size_t>(CarKind::count);

// A number for each prototype: its object in a sink, or its triangles.
template <class Number>
struct ByPrototype {
  std::array<Number, kLampKinds> lamps{};
  std::array<std::array<Number, kTreeVariants>, kTreeKinds> trees{};
  std::array<std::array<Number, kCarPaints>, kCarKinds> cars{};
  Number sea{};
  std::vector<Number> buildings;  // by design
};

// The post only, and the part that emits light. An arm reaches along x, over the street.
void lamp_post(Geometry& g, LampKind kind);
void lamp_head(Geometry& g, LampKind kind, const Frame& frame);
void tree(Geometry& g, TreeKind kind, int variant);
void car(Geometry& g, CarKind kind, int paint);
[[nodiscard]] double car_length_m(CarKind kind);

}  // namespace spillway::tools::city
