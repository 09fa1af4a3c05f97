#include "tools/city/terrain.h"

#include <algorithm>

#include "tools/city/random.h"

namespace spillway::tools::city {
namespace {

constexpr double kQuay_m = 3.5;  // streets lie at least so high above the sea
constexpr double kSeabed_m = -14;
constexpr double kSteepest = 0.12;  // rise of a hill in parts of its width: streets of at most 8 %

double lattice(uint64_t key, int64_t x, int64_t y) {
  return 2 * Random(key_of(key_of(key, static_cast<uint64_t>(x)), static_cast<uint64_t>(y))).unit() - 1;
}

double bump(Vec2 offset, double width) { return std::exp(-dot(offset, offset) / (2 * width * width)); }

}  // namespace

double smoothstep(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

double value_noise(uint64_t key, Vec2 at) {
  const double fx = std::floor(at.x), fy = std::floor(at.y);
  const auto x = static_cast<int64_t>(fx), y = static_cast<int64_t>(fy);
  const double tx = smoothstep(0, 1, at.x - fx), ty = smoothstep(0, 1, at.y - fy);
  const double low = lattice(key, x, y) * (1 - tx) + lattice(key, x + 1, y) * tx;
  const double high = lattice(key, x, y + 1) * (1 - tx) + lattice(key, x + 1, y + 1) * tx;
  return low * (1 - ty) + high * ty;
}

Terrain::Terrain(const TerrainOptions& options) : options_(options) {
  Random random(key_of(options.seed, 0x7e44a1));
  const double r = options.radius_m;
  if (options.bay)
    islands_ = {{{0.97 * r, -1.30 * r}, 0.13 * r, 0.09 * r + 20}, {{-1.4 * r, -1.3 * r}, 0.2 * r, 0.12 * r + 20}};
  if (!options.hills) return;
  for (int i = 0; i < 9; ++i) {
    const double width = r * random.between(0.10, 0.19);
    const Vec2 at = direction_of(random.between(-0.35, 3.5)) * (r * random.between(0.42, 0.95));
    hills_.push_back({at, width, std::min(95.0, width * random.between(0.6, 1.0) * kSteepest)});
  }
  for (int i = 0; i < 14; ++i) {
    const double width = r * random.between(0.2, 0.42);
    const Vec2 at = direction_of(random.between(-0.05, 3.2)) * (r * random.between(1.5, 2.6));
    mountains_.push_back({at, width, std::min(420.0, width * random.between(0.3, 0.62))});
  }
}

double Terrain::shore_y(double x) const {
  if (!options_.bay) return -1e9;
  const double r = options_.radius_m, t = x / r;
  const double open = 0.5 - 0.5 * std::cos(std::min(std::fabs(t - 0.05) / 0.95, 1.0) * 3.141592653589793);
  const double ripple = 0.022 * std::sin(6.1 * t + 0.7) + 0.012 * std::sin(14.3 * t + 2.1);
  return r * (-0.27 - 0.20 * open + ripple);
}

Line Terrain::shore_line(double x, double inland_m) const {
  constexpr double kStep_m = 4;
  const Vec2 along{2 * kStep_m, shore_y(x + kStep_m) - shore_y(x - kStep_m)};
  return {{x, shore_y(x) + inland_m}, normalize(along)};
}

double Terrain::inland(Vec2 at) const { return at.y - shore_y(at.x); }

double Terrain::height(Vec2 at) const {
  const double r = options_.radius_m, far = length(at);
  double ground = kQuay_m;
  if (options_.hills) {
    double rise = 0, peaks = 0;
    for (const Hill& hill : hills_) rise += hill.rise * bump(at - hill.at, hill.width);
    for (const Hill& hill : mountains_) peaks += hill.rise * bump(at - hill.at, hill.width);
    const double rough = value_noise(options_.seed + 1, at * (5 / r)) +
                         0.5 * value_noise(options_.seed + 2, at * (11 / r)) +
                         0.25 * value_noise(options_.seed + 3, at * (23 / r));
    peaks *= (1 + 0.35 * rough) * smoothstep(0.95 * r, 1.6 * r, far);
    ground += rise * (1 - 0.95 * bump(at, 0.2 * r)) + peaks;
  }
  if (!options_.bay) return ground;
  const double inland_m = inland(at);
  const double fade = smoothstep(0.02 * r, 0.16 * r, inland_m);  // no hill at the quay
  ground = kQuay_m + (ground - kQuay_m) * fade;
  double island = 0;
  for (const Hill& hill : islands_) island += hill.rise * bump(at - hill.at, hill.width);
  ground = kSeabed_m + (ground - kSeabed_m) * smoothstep(-30, 1, inland_m);
  return island > 1 ? std::max(ground, kSeabed_m + island) : ground;
}

double Terrain::lowest(const Polygon& polygon) const {
  double least = height(centroid(polygon));
  for (const Corner& c : polygon) least = std::min(least, height(c.at));
  return least;
}

double Terrain::highest(const Polygon& polygon) const {
  double most = height(centroid(polygon));
  for (const Corner& c : polygon) most = std::max(most, height(c.at));
  return most;
}

bool Terrain::is_flat(const Polygon& polygon) const { return highest(polygon) - lowest(polygon) < 0.06; }

}  // namespace spillway::tools::city
