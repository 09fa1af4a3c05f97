// Scenes whose error falls slowly, as CSV for bench/failures_chart.py: the mean deviation of 48 frames of independent
// samples from the answer, over samples a frame. Where there is no closed form the answer is the mean of all frames.

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <functional>

#include "tests/support/closed_forms.h"

namespace {

using namespace spillway::test;

constexpr uint32_t kSeeds = 48;
constexpr int kPixels = 4;

void chart(const char* name, const FailureScene& scene, uint32_t most_samples, double answer) {
  if (!scene.error().empty()) return void(std::fprintf(stderr, "%s: %s\n", name, scene.error().c_str()));
  std::vector<std::vector<double>> means;
  double all = 0, weight = 0;
  for (uint32_t samples = 4; samples <= most_samples; samples *= 4) {
    means.emplace_back();
    for (uint32_t seed = 0; seed < kSeeds; ++seed) {
      means.back().push_back(scene.render_independent(samples * 100 + seed, samples).mean);
      all += means.back().back() * samples, weight += samples;
    }
  }
  if (answer == 0) answer = all / weight;
  uint32_t samples = 4;
  for (const auto& frames : means) {
    double deviation = 0;
    for (const double mean : frames) deviation += std::fabs(mean / answer - 1) / kSeeds;
    fmt::print("{},{},{:.6g}\n", name, samples * kPixels * kPixels, deviation);
    samples *= 4;
  }
}

// A point in gas, and rays all around it: what one collision brings has a tail of exponent 3/2, no variance, and the
// mean of n of them an error of n^(-1/3).
void point_in_fog() {
  constexpr double kHalf = 0.5, kSigma = 0.3;
  const FailureScene scene(
      fmt::format(
          "MakeNamedMedium \"gas\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [0 0 0] \"rgb sigma_s\" [{0} {0} "
          "{0}]\nMediumInterface \"\" \"gas\"\n",
          kSigma) +
      view_along({0, 0, 2}, {0, 0, 0}, {0, 1, 0}, kHalf, 1, kPixels) +
      "LightSource \"point\" \"point3 from\" [0 0 0] \"rgb I\" [1 1 1]\n");
  // At a distance b from the point, along the ray by the angle under which the point is seen: dt / d^2 = d(angle) / b.
  const auto at = [&](double b) {
    return integral(-std::atan(2 / b), M_PI / 2 - 1e-9, 40, [&](double angle) {
      return kSigma / (4 * M_PI) * std::exp(-kSigma * (2 + b * std::tan(angle) + b / std::cos(angle)));
    });
  };
  const double eighth =
      integral(0, M_PI / 4, 4, [&](double phi) { return integral(1e-9, kHalf / std::cos(phi), 40, at); });
  chart("point light in fog (-1/3)", scene, 16384, 8 * eighth / (4 * kHalf * kHalf));
}

// A caustic: bounded, so n^(-1/2), from a level that goes with the lamp's side.
void caustic(double side) {
  const FailureScene scene(
      view_down(0.4, 0.5, 12, kPixels) + diffuse(0.5) + sheet({-20, -20, 0}, {40, 0, 0}, {0, 40, 0}) +
      "AttributeBegin Material \"dielectric\" Translate 0 0 1.5 Shape \"sphere\" \"float radius\" 0.8 "
      "AttributeEnd\n" +
      emitter(1 / (side * side), sheet({-side / 2, -side / 2, 4}, {0, side, 0}, {side, 0, 0})));
  chart(fmt::format("caustic, lamp {:g} (-1/2)", side).c_str(), scene, 4096, 0);
}

}  // namespace

int main() {
  fmt::print("scene,samples,error\n");
  point_in_fog();
  for (const double side : {1.0, 0.25, 0.0625}) caustic(side);
  return 0;
}
