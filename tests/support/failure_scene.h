#pragma once

// Scenes in which methods fail, as users would have them: pbrt text in code, through the importer and the packer into
// pages so small that even they are several. What holds for every one of them, and what holds where the answer is
// known.

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/render/render_image.h"
#include "pipeline/store.h"
#include "tests/support/small_scene.h"

namespace spillway::test {

struct Frame {
  double mean = 0;  // luminance over the picture
  std::vector<Rgb> pixels;
  pipeline::RenderReport report;
};

class FailureScene {
 public:
  using MakeFiles = std::function<void(const std::filesystem::path& folder)>;
  // make_files writes what the text names, beside it. A scene that cannot be packed says why in error().
  explicit FailureScene(const std::string& text, const MakeFiles& make_files = {}, uint32_t triangles_per_page = 16);

  [[nodiscard]] const std::string& error() const { return error_; }
  [[nodiscard]] const pipeline::Store& store() const { return *store_; }

  // From now on; the default is the scene's.
  void use(pipeline::Estimator estimator) { estimator_ = estimator; }

  // On two threads, everything resident.
  [[nodiscard]] Frame render(uint32_t seed, uint32_t samples) const;
  // By independent samples instead of Sobol' points.
  [[nodiscard]] Frame render_independent(uint32_t seed, uint32_t samples) const;

  // Finite, and the same bits on one thread with everything in memory, on three with next to nothing in memory and all
  // else spilled, and from the depth-first reference. At two seeds and two counts of samples, the second odd.
  void expect_same_bits() const;

 private:
  [[nodiscard]] pipeline::RenderOptions options(uint32_t seed, uint32_t samples) const;
  [[nodiscard]] Frame render(const pipeline::RenderOptions& options, int threads) const;
  [[nodiscard]] pipeline::RenderOptions starved(pipeline::RenderOptions options) const;

  pipeline::Estimator estimator_ = pipeline::Estimator::mis_power;
  TemporaryDirectory directory_;
  std::unique_ptr<pipeline::Store> store_;
  std::string error_;
};

// The mean over frames of independent seeds, and what it is worth.
struct Estimate {
  double mean = 0, standard_error = 0;
  uint32_t count = 0;
};
[[nodiscard]] Estimate estimate(const FailureScene& scene, uint32_t first_seed, uint32_t seeds, uint32_t samples);

struct Trust {
  uint32_t seeds = 16;
  uint32_t samples = 64;   // a pixel, of the larger of two counts; the other is an eighth
  double rounding = 2e-5;  // of the answer: what 32-bit numbers and, where a test says so, geometry are off by
  double largest_error =
      0.01;  // of the answer: standard error that the larger count must stay below, else nothing is said
};

// The chance that an unbiased renderer fails one of these tests. There are about a hundred: one in a hundred for all.
inline constexpr double kFalseAlarm = 1e-4;

// The answer lies inside of the confidence interval at both counts; other seeds at each.
void expect_unbiased(const FailureScene& scene, double answer, const Trust& trust = {});

// ---- words of scenes ----

struct Vec {
  double x, y, z;
};

// Straight down from (0, 0, height): pixel (x, y) is a part of the square of half `half_width` around the origin.
std::string view_down(double height, double half_width, int max_depth, int pixels = 8);
// An orthographic view along a direction.
std::string view_along(Vec eye, Vec target, Vec up, double half_width, int max_depth, int pixels = 8);
std::string view_from(Vec eye, Vec target, Vec up, double fov_deg, int max_depth, int pixels = 8);

// A parallelogram whose front is on the side of cross(edge1, edge2).
std::string sheet(Vec corner, Vec edge1, Vec edge2);
// The inside of a box; fronts look in.
std::string room(Vec lower, Vec upper);
std::string diffuse(double reflectance);
std::string emitter(double radiance, const std::string& shape);  // black, one-sided
std::string sky(double radiance);

}  // namespace spillway::test
