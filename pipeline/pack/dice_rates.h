#pragma once

// How finely cages are diced: as cameras see them.
//
// An edge is cut into the fewest pieces, a power of two of them, that are not longer than edge_length_px where it comes
// nearest to a camera. What lies outside the frame or faces away counts like everything else: it is seen in mirrors,
// casts shadows, and does not change when the camera turns.

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "cache/base/result.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

struct DiceOptions {
  float edge_length_px = 4;              // longest edge on the picture; half: four times the triangles
  uint32_t most_pieces = 256;            // of an edge, a power of two up to 1024: bounds what is close to a camera
  uint64_t most_triangles = 1ull << 28;  // of all cages
  // Performance: the store's bytes do not differ. Where diced cages are kept between packings, by content; empty: nowhere.
  std::filesystem::path cache_directory{};
  std::vector<shading::Camera> cameras{};  // the nearest counts; those of the scene's frames join them
};
Status check_dice_options(const DiceOptions& options);

// The pieces of an edge of so many times the longest length; at least one.
[[nodiscard]] uint32_t piece_count(double length_ratio, uint32_t most_pieces);

class DiceView {
 public:
  explicit DiceView(std::span<const shading::Camera> cameras);

  // Pixels a unit of length at the place of the box that is nearest to a camera, at the middle of its picture, but no
  // nearer than `least_distance`. May be infinite.
  [[nodiscard]] double px_per_unit(const Bounds3& box_world, double least_distance) const;

 private:
  struct Eye {
    Float3 origin_world;
    double px_at_unit_distance;  // orthographic: at any
    bool is_orthographic;
  };
  std::vector<Eye> eyes_;
};

// The longest of the axes' images: how much larger an object's edges become.
[[nodiscard]] double largest_scale(const Affine3& world_from_object);
[[nodiscard]] Bounds3 transformed(const Bounds3& box, const Affine3& to);

// Instances of an object are diced together when their edges need the same number of pieces: by the power of two at or
// above the pixels that a unit of the object takes on the picture.
[[nodiscard]] int detail_of_instance(const DiceView& view, const Bounds3& box_object, const Affine3& world_from_object);

}  // namespace spillway::pipeline
