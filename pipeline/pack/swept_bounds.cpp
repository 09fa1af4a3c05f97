#include "pipeline/pack/swept_bounds.h"

#include <cmath>

#include "pipeline/pack/pack_page_tree.h"

namespace spillway::pipeline {
namespace {

// Half a turn strays by 3e-4 of the object's reach; without any, paths are lines.
constexpr int kStepsOfATurn = 64;
// Roundings (2^-24) of the reach: those of the parts, of the angle (2 pi), and of the sine, several times over.
constexpr double kRounding = 64 * 0x1p-24;

struct Reach {
  double stretched = 0;  // largest |S p|
  double change = 0;     // largest |dS/dt p|
};

double length_of_product(const double (&s)[6], Float3 p) {
  return std::hypot(s[0] * p.x + s[5] * p.y + s[4] * p.z, s[5] * p.x + s[1] * p.y + s[3] * p.z,
                    s[4] * p.x + s[3] * p.y + s[2] * p.z);
}

// Lengths are convex and the stretch is linear in time: the largest are at corners, at keys.
Reach reach_of(const Motion& motion, const Bounds3& bounds) {
  double first[6], last[6], change[6];
  for (int e = 0; e < 6; ++e)
    first[e] = motion.stretch[0][e], last[e] = motion.stretch[1][e], change[e] = last[e] - first[e];
  Reach reach;
  for (int corner = 0; corner < 8; ++corner) {
    const Float3 p{corner & 1 ? bounds.upper.x : bounds.lower.x, corner & 2 ? bounds.upper.y : bounds.lower.y,
                   corner & 4 ? bounds.upper.z : bounds.lower.z};
    reach.stretched = std::max({reach.stretched, length_of_product(first, p), length_of_product(last, p)});
    reach.change = std::max(reach.change, length_of_product(change, p));
  }
  return reach;
}

}  // namespace

Bounds3 swept_bounds(const Motion& motion, float first_time, float last_time, const Bounds3& bounds) {
  const int steps = motion.turns > 0 ? kStepsOfATurn : 1;
  Bounds3 out;
  double longest_step = 0;
  float previous = first_time;
  for (int i = 0; i <= steps; ++i) {
    const float part = static_cast<float>(i) / static_cast<float>(steps);
    const float time = i == steps ? last_time : first_time + (last_time - first_time) * part;
    out.grow(transformed_bounds(transform_at(motion, time), bounds));
    longest_step = std::max(longest_step, std::fabs(static_cast<double>(time) - previous));
    previous = time;
  }
  const Reach reach = reach_of(motion, bounds);
  const double theta = 2 * M_PI * motion.turns;
  const double curvature = theta * theta * reach.stretched + 2 * theta * reach.change;
  const double margin = longest_step * longest_step / 8 * curvature + kRounding * reach.stretched;
  for (int a = 0; a < 3; ++a) {
    out.lower[a] = std::nextafter(static_cast<float>(out.lower[a] - margin), -INFINITY);
    out.upper[a] = std::nextafter(static_cast<float>(out.upper[a] + margin), INFINITY);
  }
  return out;
}

}  // namespace spillway::pipeline
