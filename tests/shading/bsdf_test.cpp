#include "shading/bsdf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace spillway::shading {
namespace {

struct Case {
  std::string name;
  BsdfParams bsdf;
};

BsdfParams params(BsdfKind kind, float alpha_x, float alpha_y, float base_alpha = 0.3f) {
  BsdfParams b;
  b.kind = kind;
  b.alpha_x = alpha_x, b.alpha_y = alpha_y;
  b.base_alpha_x = b.base_alpha_y = base_alpha;
  b.reflectance = {0.8f, 0.5f, 0.2f};
  b.transmittance = {0.1f, 0.3f, 0.6f};
  b.conductor_eta = {0.2f, 0.9f, 1.1f}, b.conductor_k = {3.9f, 2.5f, 2.4f};
  b.coat_internal_reflectance = internal_diffuse_reflectance(b.eta);
  return b;
}

std::vector<Case> continuous_cases() {
  return {{"diffuse", params(BsdfKind::diffuse, 0, 0)},
          {"conductor", params(BsdfKind::conductor, 0.3f, 0.3f)},
          {"stretched conductor", params(BsdfKind::conductor, 0.15f, 0.5f)},
          {"dielectric", params(BsdfKind::dielectric, 0.4f, 0.4f)},
          {"coated diffuse, rough", params(BsdfKind::coated_diffuse, 0.3f, 0.3f)},
          {"coated diffuse, smooth", params(BsdfKind::coated_diffuse, 0, 0)},
          {"coated conductor", params(BsdfKind::coated_conductor, 0.25f, 0.25f)},
          {"diffuse transmission", params(BsdfKind::diffuse_transmission, 0, 0)}};
}

Float3 direction(float z, float phi) {
  const float r = std::sqrt(std::max(0.0f, 1 - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}
const std::vector<Float3> kFrom = {direction(0.95f, 0.3f), direction(0.6f, 2.0f), direction(0.25f, 4.4f)};

constexpr int kRows = 12, kColumns = 16, kFine = 24;  // bins of the sphere, and points of integration a bin's side

// Over each bin of the sphere: the integral of pdf and of f cos.
struct Integrals {
  std::vector<double> pdf = std::vector<double>(kRows * kColumns);
  double pdf_sum = 0, f_cos = 0;
};

Integrals integrate(const BsdfParams& bsdf, Float3 w_prev) {
  Integrals sum;
  const double area = 4 * M_PI / (kRows * kColumns * kFine * kFine);
  for (int row = 0; row < kRows * kFine; ++row)
    for (int column = 0; column < kColumns * kFine; ++column) {
      const float z = 1 - 2 * (static_cast<float>(row) + 0.5f) / (kRows * kFine);
      const float phi = static_cast<float>(2 * M_PI) * (static_cast<float>(column) + 0.5f) / (kColumns * kFine);
      const BsdfValue value = evaluate_bsdf(bsdf, w_prev, direction(z, phi));
      sum.pdf[static_cast<size_t>(row / kFine * kColumns + column / kFine)] += value.pdf_solid_angle * area;
      sum.pdf_sum += value.pdf_solid_angle * area, sum.f_cos += value.f_cos.g * area;
    }
  return sum;
}

size_t bin_of(Float3 w) {
  const int row = std::min(kRows - 1, static_cast<int>((1 - w.z) / 2 * kRows));
  const double phi = std::atan2(w.y, w.x), turn = phi < 0 ? phi / (2 * M_PI) + 1 : phi / (2 * M_PI);
  return static_cast<size_t>(row * kColumns + std::min(kColumns - 1, static_cast<int>(turn * kColumns)));
}

class Uniform {
 public:
  float operator()() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }

 private:
  std::mt19937_64 engine_{7};
};

// Of chi-square with n degrees of freedom, as standard deviations of a normal (Wilson and Hilferty 1931).
double deviations(double chi_square, double n) {
  return (std::cbrt(chi_square / n) - (1 - 2 / (9 * n))) / std::sqrt(2 / (9 * n));
}

TEST(Bsdf, directions_are_sampled_as_their_pdf_says) {
  constexpr int kSamples = 400000;
  for (const Case& c : continuous_cases())
    for (const Float3 w_prev : kFrom) {
      const Integrals expected = integrate(c.bsdf, w_prev);
      std::vector<double> seen(kRows * kColumns);
      Uniform u;
      for (int i = 0; i < kSamples; ++i) {
        const float x = u(), y = u();
        const BsdfSample sample = sample_bsdf(c.bsdf, w_prev, {x, y}, u());
        if (!sample.is_delta && sample.pdf_solid_angle > 0) ++seen[bin_of(sample.w_next_local)];
      }
      double chi_square = 0, bins = 0, rest_seen = 0, rest_expected = 0;
      for (size_t b = 0; b < seen.size(); ++b) {
        const double wanted = expected.pdf[b] * kSamples;
        if (wanted < 20) {  // too few for the normal approximation: together
          rest_seen += seen[b], rest_expected += wanted;
          continue;
        }
        chi_square += (seen[b] - wanted) * (seen[b] - wanted) / wanted, ++bins;
      }
      if (rest_expected > 5) chi_square += (rest_seen - rest_expected) * (rest_seen - rest_expected) / rest_expected, ++bins;
      // 21 tests: five deviations are passed by chance once in a hundred thousand runs; the seed is fixed.
      EXPECT_LT(deviations(chi_square, bins), 5) << c.name << " from z " << w_prev.z << ": " << chi_square << " of " << bins;
      EXPECT_GT(bins, 20) << c.name;
    }
}

TEST(Bsdf, a_samples_weight_is_value_over_pdf) {
  for (const Case& c : continuous_cases())
    for (const Float3 w_prev : kFrom) {
      Uniform u;
      int compared = 0;
      for (int i = 0; i < 3000; ++i) {
        const float x = u(), y = u();
        const BsdfSample sample = sample_bsdf(c.bsdf, w_prev, {x, y}, u());
        if (sample.is_delta || !(sample.pdf_solid_angle > 0)) continue;
        const BsdfValue value = evaluate_bsdf(c.bsdf, w_prev, sample.w_next_local);
        // Both go through the half vector, whose rounding a narrow lobe magnifies.
        ASSERT_NEAR(value.pdf_solid_angle / sample.pdf_solid_angle, 1, 2e-3) << c.name;
        ASSERT_NEAR(sample.weight.g * sample.pdf_solid_angle, value.f_cos.g, 2e-3f * (1 + value.f_cos.g)) << c.name;
        ++compared;
      }
      EXPECT_GT(compared, 500) << c.name;
    }
}

TEST(Bsdf, the_mean_weight_is_the_integral_of_the_value) {
  for (const Case& c : continuous_cases()) {
    if (c.bsdf.kind == BsdfKind::coated_diffuse && c.bsdf.alpha_x == 0) continue;  // its coat is a delta
    for (const Float3 w_prev : kFrom) {
      constexpr int kSamples = 200000;
      Uniform u;
      double sum = 0, squares = 0;
      for (int i = 0; i < kSamples; ++i) {
        const float x = u(), y = u();
        const double weight = sample_bsdf(c.bsdf, w_prev, {x, y}, u()).weight.g;
        sum += weight, squares += weight * weight;
      }
      const double mean = sum / kSamples, error = std::sqrt(std::max(0.0, squares / kSamples - mean * mean) / kSamples);
      // Four standard errors, and a thousandth for the grid of the integral.
      EXPECT_NEAR(mean, integrate(c.bsdf, w_prev).f_cos, 4 * error + 1e-3) << c.name << " from z " << w_prev.z;
    }
  }
}

TEST(Bsdf, reflection_is_reciprocal) {
  for (const Case& c : continuous_cases()) {
    Uniform u;
    for (int i = 0; i < 2000; ++i) {
      const Float3 a = direction(0.05f + 0.95f * u(), 6.28f * u()), b = direction(0.05f + 0.95f * u(), 6.28f * u());
      const Rgb ab = evaluate_bsdf(c.bsdf, a, b).f_cos, ba = evaluate_bsdf(c.bsdf, b, a).f_cos;
      ASSERT_NEAR(ab.g / b.z, ba.g / a.z, 1e-4f * (1 + ab.g / b.z)) << c.name;
    }
  }
}

TEST(Bsdf, nothing_returns_more_than_it_gets) {
  for (Case& c : continuous_cases()) {
    c.bsdf.reflectance = {1, 1, 1}, c.bsdf.transmittance = {0, 0, 0};
    for (const Float3 w_prev : kFrom) {
      Uniform u;
      double sum = 0;
      constexpr int kSamples = 100000;
      for (int i = 0; i < kSamples; ++i) {
        const float x = u(), y = u();
        sum += sample_bsdf(c.bsdf, w_prev, {x, y}, u()).weight.g;
      }
      EXPECT_LT(sum / kSamples, 1.005) << c.name;
      EXPECT_TRUE(c.name != "diffuse" || std::fabs(sum / kSamples - 1) < 1e-6);
    }
  }
}

TEST(Bsdf, a_translucent_sheet_sends_each_share_to_its_side) {
  const BsdfParams b = params(BsdfKind::diffuse_transmission, 0, 0);
  for (const float side : {1.0f, -1.0f}) {
    const Float3 w_prev = direction(0.6f * side, 2);
    Uniform u;
    double back = 0, through = 0;
    constexpr int kSamples = 200000;
    for (int i = 0; i < kSamples; ++i) {
      const float x = u(), y = u();
      const BsdfSample sample = sample_bsdf(b, w_prev, {x, y}, u());
      ASSERT_EQ(sample.is_transmission, sample.w_next_local.z * side < 0);
      (sample.is_transmission ? through : back) += sample.weight.g;
    }
    EXPECT_NEAR(back / kSamples, 0.5, 0.006);  // four standard errors
    EXPECT_NEAR(through / kSamples, 0.3, 0.006);
    for (int i = 0; i < 1000; ++i) {  // reciprocal across the sheet too
      const Float3 a = direction(0.05f + 0.95f * u(), 6.28f * u()), c = direction(-0.05f - 0.95f * u(), 6.28f * u());
      ASSERT_NEAR(evaluate_bsdf(b, a, c).f_cos.r / -c.z, evaluate_bsdf(b, c, a).f_cos.r / a.z, 1e-6);
    }
  }
}

// A smooth coat over a white base, with what goes to and fro between them, loses nothing.
TEST(Bsdf, a_white_coated_surface_returns_everything) {
  BsdfParams b = params(BsdfKind::coated_diffuse, 0, 0);
  b.reflectance = {1, 1, 1};
  // Over all directions of arrival: the closed form is exact for the mean, since the base forgets where light came from.
  Uniform u;
  double sum = 0;
  constexpr int kSamples = 400000;
  for (int i = 0; i < kSamples; ++i) {
    const Float3 w_prev = direction(std::sqrt(u()), 6.28f * u());  // cosine distributed
    const float x = u(), y = u();
    sum += sample_bsdf(b, w_prev, {x, y}, u()).weight.g;
  }
  EXPECT_NEAR(sum / kSamples, 1, 0.004);
}

TEST(Bsdf, a_smooth_dielectric_splits_light_as_fresnel_says) {
  const BsdfParams b = params(BsdfKind::dielectric, 0, 0);
  Uniform u;
  int reflected = 0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const float x = u(), y = u();
    const BsdfSample sample = sample_bsdf(b, {0, 0, 1}, {x, y}, u());
    ASSERT_TRUE(sample.is_delta);
    ASSERT_EQ(std::fabs(sample.w_next_local.z), 1);
    reflected += !sample.is_transmission;
  }
  EXPECT_NEAR(reflected / static_cast<double>(kSamples), 0.04, 0.0025);  // ((1.5 - 1) / (1.5 + 1))^2; four deviations
}

TEST(Bsdf, internal_reflectance_has_its_published_value) {
  EXPECT_NEAR(internal_diffuse_reflectance(1.5f), 0.5963f, 2e-4f);  // Walsh 1926: 0.0918 outside
  EXPECT_NEAR(internal_diffuse_reflectance(1.0001f), 0, 2e-3f);
}

}  // namespace
}  // namespace spillway::shading
