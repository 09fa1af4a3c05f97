#include "tools/city/air.h"

#include <algorithm>

#include "shading/noise.h"
#include "tools/city/random.h"

namespace spillway::tools::city {
namespace {

// Lengths are parts of the city's radius and densities go with its inverse: small and large cities look alike from their
// cameras.
constexpr double kReach = 2;            // of the grid of the whole, from the centre
constexpr double kFogTop = 0.06;
constexpr double kFogDensity = 26;      // over the bay
constexpr double kCloudBase = 0.26, kCloudThickness = 0.16, kCloudDensity = 28;

// Of a plume, metres.
constexpr double kPlumeLength_m = 130, kPlumeStep_m = 1.25;
constexpr double kRise = 2.3;           // a hot plume rises with the power 2/3 of its way downwind (Briggs 1969)
constexpr double kEntrainment = 0.33;   // and widens with its rise
constexpr double kMouthDensity = 1.1;

int32_t whole_leaves(double cells) { return static_cast<int32_t>(std::ceil(cells / 8)) * 8; }

double rise_at(double along) { return kRise * std::pow(std::max(along, 0.0), 2.0 / 3); }
double radius_at(const Chimney& c, double along) { return 1.15 * c.radius_m + kEntrainment * rise_at(along); }

// Of so many octaves, between about -1 and 1.
double billows(Vec3 p, int octaves) {
  double sum = 0, weight = 1;
  for (int i = 0; i < octaves; ++i) {
    sum += weight * shading::gradient_noise(
                        {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
    p = p * 2.03 + Vec3{17.3, 41.9, 5.7}, weight *= 0.55;
  }
  return sum * 1.1;
}

}  // namespace

bool overlap(const Box& a, const Box& b) {
  return a.lower.x <= b.upper.x && b.lower.x <= a.upper.x && a.lower.y <= b.upper.y && b.lower.y <= a.upper.y &&
         a.lower.z <= b.upper.z && b.lower.z <= a.upper.z;
}

Affine3 AirGrid::world_from_lattice() const {
  const auto f = [](double x) { return static_cast<float>(x); };
  return {{{f(step.x), 0, 0, f(origin.x)}, {0, f(step.y), 0, f(origin.y)}, {0, 0, f(step.z), f(origin.z)}}};
}

Box AirGrid::box() const {
  return {origin - step, origin + Vec3{step.x * count[0], step.y * count[1], step.z * count[2]}};
}

Air::Air(const Terrain& terrain, uint64_t seed, AirKinds kinds, uint32_t cells)
    : terrain_(terrain), kinds_(kinds), cells_(cells), r_(terrain.radius_m()) {
  Random random(key_of(seed, 0xf06));
  noise_at_ = {random.between(20, 200), random.between(20, 200), random.between(20, 200)};
  wind_ = direction_of(random.between(-0.4, 0.7));
}

// ---- fog ----

Air::Ground Air::ground(Vec2 at) const {
  Ground ground{std::max(0.0, terrain_.height(at)), 0, 0};
  if (!kinds_.fog) return ground;
  const double over_bay = terrain_.has_bay() ? 1 - smoothstep(-0.06 * r_, 0.12 * r_, terrain_.inland(at)) : 0;
  const Vec3 place = Vec3{at.x / r_, at.y / r_, 0};
  const double patches = 0.5 + 0.5 * std::clamp(billows(noise_at_ + place * 3.1, 3), -1.0, 1.0);
  const double over_land = 0.04 + 0.11 * patches;
  ground.fog = over_bay * (0.16 + 0.84 * smoothstep(0.35, 0.65, patches)) + (1 - over_bay) * over_land;
  ground.fog *= kFogDensity / r_ * (1 - smoothstep(0.75 * kReach * r_, 0.97 * kReach * r_, length(at)));
  const double swell = billows(noise_at_ + Vec3{9, 3, 7} + place * 7.7, 3);
  ground.top = std::max(12.0, kFogTop * r_) * std::clamp(0.85 + 0.6 * swell, 0.3, 1.6);
  return ground;
}

double Air::fog(const Ground& ground, Vec3 p) const {
  const double up = std::max(0.0, p.z - ground.height) / ground.top;
  if (ground.fog <= 0 || up >= 1) return 0;
  const double wisps = billows(noise_at_ + Vec3{p.x, p.y, 2.2 * p.z} * (13 / r_), 4);
  return ground.fog * smoothstep(0, 0.7, 1 - up) * std::clamp(0.75 + 0.9 * wisps, 0.05, 1.8);
}

// ---- cloud ----

// A bank behind the city: flat below, billows above.
double Air::cloud(Vec3 p) const {
  const double x = (p.x - 0.35 * r_) / (1.5 * r_), y = (p.y - 1.0 * r_) / (0.62 * r_), inside = 1 - x * x - y * y;
  const double up = (p.z / r_ - kCloudBase) / kCloudThickness;
  if (inside <= 0 || up <= 0 || up >= 1) return 0;
  const double body = smoothstep(0, 0.4, up) * (1 - smoothstep(0.4, 1, up)) * std::min(1.0, 1.8 * inside);
  const double shape = 1.3 * body - 0.62 + 0.95 * billows(noise_at_ + Vec3{p.x, p.y, 1.4 * p.z} * (4.6 / r_), 5);
  return kCloudDensity / r_ * std::clamp(shape / 0.55, 0.0, 1.0);
}

// ---- smoke ----

double Air::smoke(const Chimney& chimney, Vec3 p) const {
  const Vec3 d = p - chimney.mouth;
  const double along = wind_.x * d.x + wind_.y * d.y, across = wind_.x * d.y - wind_.y * d.x;
  if (along < -2 * chimney.radius_m || along > kPlumeLength_m) return 0;
  const double radius = radius_at(chimney, along), up = d.z - rise_at(along);
  // Puffs are about as large as the plume is where they are.
  const Vec3 puff = noise_at_ + p * (0.085 / std::sqrt(1 + along / 40));
  const double q = (across * across + up * up) / (radius * radius);
  if (q > 4 || d.z < 0) return 0;
  const double shape = 1 - q + 0.95 * billows(puff, 4) * std::min(1.0, 0.3 + along / 25);
  const double thinned = std::pow(1.15 * chimney.radius_m / radius, 1.3);
  return kMouthDensity * thinned * std::clamp(shape / 0.6, 0.0, 1.0) *
         (1 - smoothstep(0.45 * kPlumeLength_m, kPlumeLength_m, along)) *
         smoothstep(-2 * chimney.radius_m, 0, along);
}

AirGrid Air::plume_grid(const Chimney& c) const {
  const double far = 2 * radius_at(c, kPlumeLength_m), near = 4 * c.radius_m;
  const Vec2 end = wind_ * kPlumeLength_m;
  const Vec3 lower{std::min(-near, end.x - far), std::min(-near, end.y - far), 0};
  const Vec3 upper{std::max(near, end.x + far), std::max(near, end.y + far), rise_at(kPlumeLength_m) + far};
  AirGrid grid;
  grid.step = {kPlumeStep_m, kPlumeStep_m, kPlumeStep_m};
  grid.origin = c.mouth + lower;
  const Vec3 size = (upper - lower) * (1 / kPlumeStep_m);
  grid.count = {whole_leaves(size.x), whole_leaves(size.y), whole_leaves(size.z)};
  return grid;
}

std::vector<Plume> Air::plumes(std::vector<Chimney> chimneys, std::span<const Vec3> kept_free) const {
  std::vector<Plume> chosen;
  if (!kinds_.smoke) return chosen;
  const auto key = [](const Chimney& c) {
    return std::array{length({c.mouth.x, c.mouth.y}), c.mouth.x, c.mouth.y};
  };
  std::sort(chimneys.begin(), chimneys.end(), [&](const Chimney& a, const Chimney& b) { return key(a) < key(b); });
  for (const Chimney& chimney : chimneys) {
    if (chosen.size() == kMostPlumes) break;
    Plume plume{chimney, plume_grid(chimney)};
    const Box box = plume.grid.box();
    const auto meets = [&](const Plume& other) { return overlap(other.grid.box(), box); };
    const auto holds = [&](const Vec3& p) { return overlap({p, p}, {box.lower - Vec3{1, 1, 1}, box.upper + Vec3{1, 1, 1}}); };
    if (std::any_of(chosen.begin(), chosen.end(), meets) || std::any_of(kept_free.begin(), kept_free.end(), holds))
      continue;
    plume.grid.name = fmt::format("smoke{}", chosen.size());
    chosen.push_back(std::move(plume));
  }
  return chosen;
}

// ---- grids ----

AirGrid Air::grid() const {
  AirGrid grid;
  grid.name = "air";
  const double side = r_ / cells_;
  grid.step = {side, side, side / 2};
  grid.origin = {-kReach * r_, -kReach * r_, -2 * grid.step.z};
  const double top = kinds_.cloud ? (kCloudBase + kCloudThickness) * r_ : 0.35 * r_;  // fog lies on hills, too
  grid.count = {whole_leaves(2 * kReach * cells_), whole_leaves(2 * kReach * cells_),
                whole_leaves((top - grid.origin.z) / grid.step.z + 1)};
  return grid;
}

void Air::fill_column(const AirGrid& grid, const Plume* plume, int32_t x, int32_t y, std::span<float> samples) const {
  const Vec2 at{grid.origin.x + grid.step.x * x, grid.origin.y + grid.step.y * y};
  const Ground below = ground(at);
  for (size_t k = 0; k < samples.size(); ++k) {
    const Vec3 p{at.x, at.y, grid.origin.z + grid.step.z * static_cast<double>(k)};
    double density = 0;
    if (p.z >= below.height - 2 * grid.step.z) {
      if (kinds_.fog) density += fog(below, p);
      if (kinds_.cloud) density += cloud(p);
      if (plume != nullptr) density += smoke(plume->chimney, p);
    }
    samples[k] = static_cast<float>(density);
  }
}

namespace {

pipeline::Medium grey_grid(Rgb albedo, float g) {
  pipeline::Medium medium;
  medium.kind = pipeline::MediumKind::grid;
  medium.sigma_s = albedo, medium.sigma_a = Rgb{1, 1, 1} + albedo * -1.0f;
  medium.g = g;
  return medium;
}

}  // namespace

// Droplets absorb next to nothing and scatter forward; g is below theirs, as is usual where paths end after some bounces.
pipeline::Medium mist_medium() { return grey_grid({0.995f, 0.995f, 0.995f}, 0.5f); }
pipeline::Medium smoke_medium() { return grey_grid({0.80f, 0.785f, 0.77f}, 0.35f); }

}  // namespace spillway::tools::city
