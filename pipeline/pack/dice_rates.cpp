#include "pipeline/pack/dice_rates.h"

#include <bit>
#include <cmath>

namespace spillway::pipeline {
namespace {

// An instance around the camera has no distance from it: it is diced as from a tenth of its size.
constexpr double kNearestInSizes = 0.1;
// 2^30 pixels a unit are more than any number of pieces serves, and 2^-30 fewer than any.
constexpr int kMostDetail = 30;

double distance(const Bounds3& box, Float3 from) {
  double squares = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double outside = std::max({0.0, static_cast<double>(box.lower[axis]) - from[axis],
                                     static_cast<double>(from[axis]) - box.upper[axis]});
    squares += outside * outside;
  }
  return std::sqrt(squares);
}

}  // namespace

Status check_dice_options(const DiceOptions& options) {
  if (!(options.edge_length_px > 0) || !std::isfinite(options.edge_length_px))
    return error("edges of {} pixels; a length above 0 is possible", options.edge_length_px);
  if (!std::has_single_bit(options.most_pieces) || options.most_pieces > 1024)
    return error("{} pieces an edge; powers of two up to 1024 are possible", options.most_pieces);
  return {};
}

uint32_t piece_count(double length_ratio, uint32_t most_pieces) {
  uint32_t pieces = 1;
  while (pieces < most_pieces && length_ratio > pieces) pieces *= 2;
  return pieces;
}

DiceView::DiceView(std::span<const shading::Camera> cameras) {
  for (const shading::Camera& camera : cameras) {
    const double px = std::max(camera.resolution_x_px / (2.0 * camera.tan_half_fov_x),
                               camera.resolution_y_px / (2.0 * camera.tan_half_fov_y));
    const bool parallel = camera.is_orthographic != 0;
    const double scale = parallel ? length(camera.world_from_camera.vector({0, 1, 0})) : 1;
    eyes_.push_back({camera.world_from_camera.point({0, 0, 0}), px / scale, parallel});
  }
}

double DiceView::px_per_unit(const Bounds3& box_world, double least_distance) const {
  double most = 0;
  for (const Eye& eye : eyes_) {
    const double away = eye.is_orthographic ? 1 : std::max(distance(box_world, eye.origin_world), least_distance);
    most = std::max(most, eye.px_at_unit_distance / away);
  }
  return most;
}

double largest_scale(const Affine3& world_from_object) {
  float most = 0;
  for (const Float3 axis : {Float3{1, 0, 0}, Float3{0, 1, 0}, Float3{0, 0, 1}})
    most = std::max(most, length(world_from_object.vector(axis)));
  return most;
}

Bounds3 transformed(const Bounds3& box, const Affine3& to) {
  Bounds3 result;
  for (int corner = 0; corner < 8; ++corner)
    result.grow(to.point({corner & 1 ? box.upper.x : box.lower.x, corner & 2 ? box.upper.y : box.lower.y,
                          corner & 4 ? box.upper.z : box.lower.z}));
  return result;
}

int detail_of_instance(const DiceView& view, const Bounds3& box_object, const Affine3& world_from_object) {
  const Bounds3 box_world = transformed(box_object, world_from_object);
  const double nearest = kNearestInSizes * length(box_world.extent());
  const double px = view.px_per_unit(box_world, nearest) * largest_scale(world_from_object);
  if (!(px > 0)) return -kMostDetail;
  return static_cast<int>(std::clamp(std::ceil(std::log2(px)), -double{kMostDetail}, double{kMostDetail}));
}

}  // namespace spillway::pipeline
