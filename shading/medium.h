#pragma once

// Participating media as numbers: phase function, free paths, transmittance, collisions in the cells of a grid.
//
// Distances are in world units, coefficients per world unit. Cells of a grid are independent Poisson processes whose
// random numbers are keyed by (segment, cell, step): densities may be looked up in any order, and the nearest collision
// wins.
// Based on: Woodcock et al. 1965 (null collisions); Kutz et al. 2017, Spectral and Decomposition Tracking (colour: the
// chance of a collision is that of a mean over the channels, weighted by the path's throughput at the segment's start,
// and each channel's weight makes up for it; the paper's weights follow the path collision by collision, which would
// need the cells in order); Novak et al. 2014 (ratio tracking).

#include <algorithm>
#include <cstdint>

#include "cache/base/vec.h"
#include "shading/exponential.h"
#include "shading/sampler.h"

namespace spillway::shading {

// ---- phase function ----

// Henyey and Greenstein 1941. cosine: between the direction of flight and w_next; g > 0 is forward, |g| < 1.
// Returns the density over solid angle, which is also the function's value.
[[nodiscard]] float henyey_greenstein(float g, float cosine);
// w_flight unit, the direction of flight; u in [0, 1)^2. Returns w_next, unit, with density henyey_greenstein().
[[nodiscard]] Float3 sample_henyey_greenstein(float g, Float3 w_flight, Float2 u);

// ---- homogeneous media: closed forms ----

[[nodiscard]] inline float transmittance(float sigma_t, float distance) {
  return sigma_t > 0 ? exp_of(-sigma_t * distance) : 1;  // the distance may be infinite
}
[[nodiscard]] inline Rgb transmittance(Rgb sigma_t, float distance) {
  return {transmittance(sigma_t.r, distance), transmittance(sigma_t.g, distance), transmittance(sigma_t.b, distance)};
}

struct FreePath {
  float distance = INFINITY;  // of the collision; infinity: none before the segment's end
  Rgb weight{1, 1, 1};        // collision: transmittance * sigma_t / density; none: transmittance / probability
};
// Samples the distance by one channel, chosen in proportion to `shares` (>= 0, one at least > 0); the density is the
// mean over the channels, so that no weight is above the sum of shares over the smallest share in use.
[[nodiscard]] FreePath sample_free_path(Rgb sigma_t, Rgb shares, float distance_max, Float2 u);

// ---- grids: cells ----

// What identifies a segment of a path: see segment_key().
struct SegmentKey {
  SampleKey sample;
  uint32_t segment;
};
// Hashes where the segment starts: every segment of a path starts elsewhere.
[[nodiscard]] SegmentKey segment_key(SampleKey sample, uint32_t bounce, bool is_shadow, Float3 origin_world);

// The part of a segment inside one cell of a grid.
struct CellSegment {
  uint32_t cell;     // keys its random numbers: the same whatever the grid's bricks
  float begin, end;  // distances along the segment
};

// A step of a cell's Poisson process: the density there decides whether the segment collides.
struct CellStep {
  float distance;  // along the segment
  float majorant;  // rate of the process
  float decision;  // uniform in [0, 1)
};

// How far the steps of a cell have come.
struct CellProgress {
  uint32_t count = 0;
  float gone = 0;  // from the cell's begin
};

// Bounds tracking in one cell, by a number that no sensible cell reaches: beyond it the rest of the cell is passed as
// if it were empty, which is counted and too bright.
inline constexpr uint32_t kMaxCellSteps = 1u << 20;

// The steps of a cell. They do not depend on densities: where a segment must look is known before anything is read.
class CellSteps {
 public:
  CellSteps(const CellSegment& cell, float majorant, const SegmentKey& key, const CellProgress& from = {});
  // False at the end of the cell.
  bool next();
  [[nodiscard]] bool is_bounded() const { return progress_.count == kMaxCellSteps; }
  [[nodiscard]] CellStep step() const;
  [[nodiscard]] const CellProgress& progress() const { return progress_; }

 private:
  [[nodiscard]] float random(uint32_t which) const;

  const SegmentKey& key_;
  uint32_t cell_;
  float begin_, length_, majorant_, mean_step_;
  CellProgress progress_;
};

// What came of a segment's steps, up to the first real collision.
struct Collisions {
  float distance = INFINITY;   // of the first real collision
  OrderlessProduct weight[3];  // of what was passed and met, by channel
  uint32_t steps = 0;

  [[nodiscard]] bool collided() const { return distance < INFINITY; }
};

// What a medium does at the steps of its cells. Densities lie in [0, density_max]: one for all channels, the first of
// three, or one a channel.
class StepRule {
 public:
  // sigma_t: of density one; of a density a channel it is the same in all.
  StepRule(Rgb sigma_t, Rgb shares, bool has_channels = false);
  [[nodiscard]] float majorant(float density_max) const { return density_max * largest_; }
  [[nodiscard]] bool is_real(const CellStep& step, Rgb density) const { return step.decision < chance(step, density); }
  // Adds a step to `out`, in which nothing has collided yet. Returns whether it has now.
  bool track(const CellStep& step, Rgb density, Collisions& out) const;
  // Ratio tracking: the weights of all steps of a segment, multiplied, are an unbiased estimate of its transmittance.
  void pass(const CellStep& step, Rgb density, Collisions& out) const;

 private:
  [[nodiscard]] Rgb sigma(Rgb density) const { return has_channels_ ? density * largest_ : sigma_t_ * density.r; }
  // That the step collides; in proportion to what the path carries.
  [[nodiscard]] float chance(const CellStep& step, Rgb density) const;

  Rgb sigma_t_, shares_;
  float largest_, mean_;
  bool is_grey_, has_channels_;
};

}  // namespace spillway::shading

#include "shading/medium_tracking.h"
