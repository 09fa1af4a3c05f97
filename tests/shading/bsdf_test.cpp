#include "shading/bsdf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "shading/microfacet.h"
#include "tests/support/chi_square.h"
#include "tests/support/random.h"

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
          {"stretched dielectric", params(BsdfKind::dielectric, 0.5f, 0.25f)},
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

// What lets light through is seen from its inside too.
std::vector<Float3> directions_to(const BsdfParams& bsdf) {
  std::vector<Float3> from = kFrom;
  if (bsdf.kind == BsdfKind::dielectric || bsdf.kind == BsdfKind::diffuse_transmission)
    for (const Float3 w : kFrom) from.push_back({w.x, w.y, -w.z});
  return from;
}

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

TEST(Bsdf, directions_are_sampled_as_their_pdf_says) {
  constexpr int kSamples = 400000;
  for (const Case& c : continuous_cases())
    for (const Float3 w_prev : directions_to(c.bsdf)) {
      const Integrals expected = integrate(c.bsdf, w_prev);
      std::vector<double> seen(kRows * kColumns);
      test::Random u(7);
      for (int i = 0; i < kSamples; ++i) {
        const float x = u(), y = u();
        const BsdfSample sample = sample_bsdf(c.bsdf, w_prev, {x, y}, u());
        if (!sample.is_delta && sample.pdf_solid_angle > 0) ++seen[bin_of(sample.w_next_local)];
      }
      test::ChiSquare chi_square;
      for (size_t b = 0; b < seen.size(); ++b) chi_square.add(seen[b], expected.pdf[b] * kSamples);
      // Some thirty tests: five deviations are passed by chance once in a hundred thousand runs; the seed is fixed.
      EXPECT_LT(chi_square.deviations(), 5) << c.name << " from z " << w_prev.z;
      EXPECT_GT(chi_square.bins(), 20) << c.name;
    }
}

TEST(Bsdf, a_samples_weight_is_value_over_pdf) {
  for (const Case& c : continuous_cases())
    for (const Float3 w_prev : directions_to(c.bsdf)) {
      test::Random u(7);
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
    for (const Float3 w_prev : directions_to(c.bsdf)) {
      constexpr int kSamples = 200000;
      test::Random u(7);
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

// Both ways of sampling have one mean: also of surfaces that are mirrors in part or whole, and from inside of glass.
TEST(Bsdf, directions_spread_evenly_have_the_same_mean_weight) {
  std::vector<Case> cases = continuous_cases();
  cases.push_back({"mirror", params(BsdfKind::conductor, 0, 0)});
  cases.push_back({"glass", params(BsdfKind::dielectric, 0, 0)});
  cases.push_back({"pane", params(BsdfKind::thin_dielectric, 0, 0)});
  cases.push_back({"smooth coat on rough metal", params(BsdfKind::coated_conductor, 0, 0)});
  cases.push_back({"rough coat on smooth metal", params(BsdfKind::coated_conductor, 0.3f, 0.3f, 0)});
  for (const Case& c : cases)
    for (const Float3 w_prev : directions_to(c.bsdf)) {
      constexpr int kSamples = 200000;
      test::Random u(7);
      double sum[2] = {0, 0}, squares[2] = {0, 0};
      for (int i = 0; i < kSamples; ++i) {
        const float x = u(), y = u(), lobe = u();
        const BsdfSample evenly = sample_evenly(c.bsdf, w_prev, {x, y}, lobe);
        const double weights[] = {sample_bsdf(c.bsdf, w_prev, {x, y}, lobe).weight.g, evenly.weight.g};
        for (int k = 0; k < 2; ++k) sum[k] += weights[k], squares[k] += weights[k] * weights[k];
        ASSERT_TRUE(evenly.is_transmission == (evenly.w_next_local.z * w_prev.z < 0) || evenly.weight.g == 0);
      }
      double variance = 0;
      for (int k = 0; k < 2; ++k) {
        const double mean = sum[k] / kSamples;
        variance += std::max(0.0, squares[k] / kSamples - mean * mean) / kSamples;
      }
      // Five standard errors of some forty comparisons, and the rounding of sums.
      EXPECT_NEAR(sum[1] / kSamples, sum[0] / kSamples, 5 * std::sqrt(variance) + 1e-6) << c.name << " z " << w_prev.z;
    }
}

TEST(Bsdf, reflection_is_reciprocal) {
  for (const Case& c : continuous_cases()) {
    test::Random u(7);
    for (int i = 0; i < 2000; ++i) {
      const Float3 a = direction(0.05f + 0.95f * u(), 6.28f * u()), b = direction(0.05f + 0.95f * u(), 6.28f * u());
      const Rgb ab = evaluate_bsdf(c.bsdf, a, b).f_cos, ba = evaluate_bsdf(c.bsdf, b, a).f_cos;
      ASSERT_NEAR(ab.g / b.z, ba.g / a.z, 1e-4f * (1 + ab.g / b.z)) << c.name;
    }
  }
}

// Radiance changes by eta^2 where light is refracted; for the rest the way back is as wide as the way there.
TEST(Bsdf, refraction_is_reciprocal_up_to_the_squared_index) {
  for (const float alpha : {0.2f, 0.5f}) {
    const BsdfParams b = params(BsdfKind::dielectric, alpha, 0.7f * alpha);
    test::Random u(7);
    int compared = 0;
    for (int i = 0; i < 4000; ++i) {
      const Float3 above = direction(0.05f + 0.95f * u(), 6.28f * u()),
                   below = direction(-0.05f - 0.95f * u(), 6.28f * u());
      const float in = evaluate_bsdf(b, above, below).f_cos.g / -below.z,
                  out = evaluate_bsdf(b, below, above).f_cos.g / above.z;
      ASSERT_NEAR(in * b.eta * b.eta, out, 2e-4f * (1 + out)) << above.z << ' ' << below.z;
      compared += out > 1e-3f;
    }
    EXPECT_GT(compared, 500);
  }
}

// ---- white furnaces: what a surface of no absorption returns of light of one from all around ----

double returned(const BsdfParams& bsdf, Float3 w_prev, int samples = 100000) {
  test::Random u(7);
  double sum = 0;
  for (int i = 0; i < samples; ++i) {
    const float x = u(), y = u();
    const BsdfSample s = sample_bsdf(bsdf, w_prev, {x, y}, u());
    sum += s.weight.g * s.eta_scale;  // radiance of one, as it is on that side
  }
  return sum / samples;
}

TEST(Bsdf, surfaces_of_one_bounce_that_lose_nothing_return_everything) {
  BsdfParams sheet = params(BsdfKind::diffuse_transmission, 0, 0), mirror = params(BsdfKind::conductor, 0, 0);
  sheet.reflectance = {0, 0.3f, 0}, sheet.transmittance = {0, 0.7f, 0};
  mirror.conductor_k = {1e4f, 1e4f, 1e4f};
  BsdfParams white = params(BsdfKind::diffuse, 0, 0);
  white.reflectance = {1, 1, 1};
  std::vector<BsdfParams> all{sheet, mirror, white};
  for (const float eta : {1.05f, 1.5f, 2.4f})
    for (const BsdfKind kind : {BsdfKind::dielectric, BsdfKind::thin_dielectric}) {
      all.push_back(params(kind, 0, 0));
      all.back().eta = eta;
    }
  for (const BsdfParams& bsdf : all)
    for (const Float3 w : directions_to(bsdf))
      // The weights are one, but for the side that a sheet's light leaves by: exact in expectation, 0.002 of noise.
      EXPECT_NEAR(returned(bsdf, w), 1, bsdf.kind == BsdfKind::diffuse_transmission ? 0.002 : 1e-3)
          << static_cast<int>(bsdf.kind) << ' ' << w.z;
}

// The visible normals of a rough surface, seen from anywhere, fill exactly what is seen (Heitz 2014, equation 16): no
// light is lost or made before the second bounce, at any roughness.
TEST(Bsdf, visible_normals_fill_what_is_seen_at_any_roughness) {
  constexpr int kSteps = 500;
  for (const float alpha_x : {0.02f, 0.1f, 0.3f, 0.7f, 1.0f})
    for (const float stretch : {1.0f, 0.4f})
      for (const float z : {1.0f, 0.7f, 0.3f, 0.05f}) {
        const Ggx surface{alpha_x, alpha_x * stretch};
        const Float3 w = direction(z, 0.9f);
        double sum = 0;
        for (int i = 0; i < kSteps * kSteps; ++i) {  // normals in proportion to their projected area, by inversion
          // Slopes reach far: the last of them in steps of the fourth power.
          const double left = 1 - (i % kSteps + 0.5) / kSteps, phi = 2 * M_PI * (i / kSteps + 0.5) / kSteps;
          const double v = left * left * left * left, slope = std::sqrt((1 - v) / v);
          const Float3 m = normalize(Float3{static_cast<float>(-slope * surface.alpha_x * std::cos(phi)),
                                            static_cast<float>(-slope * surface.alpha_y * std::sin(phi)), 1});
          sum += surface.visible_pdf(w, m) / (surface.d(m) * m.z) * 4 * left * left * left;
        }
        EXPECT_NEAR(sum / (kSteps * kSteps), 1, 2e-3) << alpha_x << ' ' << stretch << ' ' << z;  // the grid
      }
}

// Rough glass loses what would bounce twice, and no more: little when it is smooth, more as it is rough, never a gain.
TEST(Bsdf, rough_glass_loses_second_bounces_alone) {
  for (const float side : {1.0f, -1.0f}) {
    double before = 1.0005;
    for (const float alpha : {0.02f, 0.1f, 0.3f, 0.6f, 1.0f}) {
      const double share = returned(params(BsdfKind::dielectric, alpha, alpha), direction(0.6f * side, 1));
      EXPECT_LT(share, before + 0.002) << alpha;  // noise
      EXPECT_GT(share, alpha < 0.05f ? 0.995 : alpha < 0.2f ? 0.96 : 0.5) << alpha;
      before = share;
    }
  }
}

TEST(Bsdf, nothing_returns_more_than_it_gets) {
  for (Case& c : continuous_cases()) {
    c.bsdf.reflectance = {1, 1, 1}, c.bsdf.transmittance = {0, 0, 0};
    for (const Float3 w_prev : kFrom) {
      test::Random u(7);
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
    test::Random u(7);
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
  for (const float eta : {1.2f, 1.5f, 2.0f}) {
    BsdfParams b = params(BsdfKind::coated_diffuse, 0, 0);
    b.reflectance = {1, 1, 1};
    b.eta = eta, b.coat_internal_reflectance = internal_diffuse_reflectance(eta);
    // Over all directions of arrival: the closed form is exact for the mean, since the base forgets where light came
    // from.
    test::Random u(7);
    double sum = 0;
    constexpr int kSamples = 400000;
    for (int i = 0; i < kSamples; ++i) {
      const Float3 w_prev = direction(std::sqrt(u()), 6.28f * u());  // cosine distributed
      const float x = u(), y = u();
      sum += sample_bsdf(b, w_prev, {x, y}, u()).weight.g;
    }
    EXPECT_NEAR(sum / kSamples, 1, 0.004) << eta;
  }
}

TEST(Bsdf, a_smooth_dielectric_splits_light_as_fresnel_says) {
  const BsdfParams b = params(BsdfKind::dielectric, 0, 0);
  test::Random u(7);
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
