#include "shading/frame.h"
#include "shading/image_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "shading/environment.h"
#include "shading/light.h"
#include "shading/trigonometry.h"
#include "tests/support/random.h"

namespace spillway::shading {
namespace {

// Texels that all differ, of one light in a frame of its own: a turned one, mirrored as those of pbrt's are.
struct Thrown {
  Thrown(LightKind kind, uint32_t width, uint32_t height, float tangent = 0) {
    for (uint32_t i = 0; i < width * height; ++i) {
      const auto value = static_cast<float>(1 + i * 2654435761u % 97);
      texels.push_back({value, value / 2, value / 3});
    }
    const Float3 z = normalize(Float3{1, 2, -2}), x = normalize(Float3{2, -1, 0});
    rows[0] = {{x, -cross(z, x), z}, 0, 0, width, height, 0, 0};
    if (kind == LightKind::projection) {
      const Float2 half = projected_half_size(width, height, tangent);
      rows[0].half_width = half.x, rows[0].half_height = half.y;
    }
    rows[0].integral = static_cast<float>(light_image_integral(images(), rows[0]));
    light.kind = kind, light.radiance = {2, 3, 4}, light.position = {1, 2, 3}, light.edge1 = z, light.image = 1;
  }
  [[nodiscard]] LightImages images() const { return {rows, texels}; }
  [[nodiscard]] Rgb along(Float3 local) const {
    const LightImage& r = rows[0];
    return light_image_value(images(), r, normalize(r.axis[0] * local.x + r.axis[1] * local.y + r.axis[2] * local.z));
  }

  std::vector<Rgb> texels;
  std::vector<LightImage> rows = std::vector<LightImage>(1);
  Light light{};
};

TEST(ImageLight, a_goniometric_light_has_its_texels_around_it) {
  const Thrown thrown(LightKind::goniometric, 8, 8);
  for (uint32_t y = 0; y < 8; ++y)
    for (uint32_t x = 0; x < 8; ++x) {
      const Float2 middle{(static_cast<float>(x) + 0.5f) / 8, (static_cast<float>(y) + 0.5f) / 8};
      EXPECT_EQ(thrown.along(equal_area_direction(middle)), thrown.texels[8 * y + x]) << x << ' ' << y;
    }
}

TEST(ImageLight, a_projection_has_its_texels_before_it_and_nothing_beside) {
  constexpr uint32_t kWidth = 6, kHeight = 3;
  constexpr float kTangent = 0.5f;  // of the shorter side
  const Thrown thrown(LightKind::projection, kWidth, kHeight, kTangent);
  for (uint32_t y = 0; y < kHeight; ++y)
    for (uint32_t x = 0; x < kWidth; ++x) {
      const float across = (2 * (static_cast<float>(x) + 0.5f) / kWidth - 1) * kTangent * 2;
      const float down = (2 * (static_cast<float>(y) + 0.5f) / kHeight - 1) * kTangent;
      EXPECT_EQ(thrown.along({across, down, 1}), thrown.texels[kWidth * y + x]) << x << ' ' << y;
      EXPECT_EQ(thrown.along({across, down, -1}), (Rgb{0, 0, 0}));
    }
  for (const Float3 beside : {Float3{1.01f, 0, 1}, {-1.01f, 0, 1}, {0, 0.51f, 1}, {0, -0.51f, 1}, {1, 0, 0}})
    EXPECT_EQ(thrown.along(beside), (Rgb{0, 0, 0}));
  EXPECT_FALSE(is_black(thrown.along({0.99f, 0.49f, 1})));
}

// Against the mean over directions that are spread evenly. A texel's edge blurs the sum by a part of a cell.
TEST(ImageLight, its_integral_is_that_over_all_directions) {
  for (const Thrown& thrown : {Thrown(LightKind::goniometric, 16, 16), Thrown(LightKind::projection, 6, 3, 0.5f),
                               Thrown(LightKind::projection, 3, 8, 2.0f)}) {
    constexpr int kSteps = 1500;
    double sum = 0;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const Float2 u{(static_cast<float>(i % kSteps) + 0.5f) / kSteps,
                     (static_cast<float>(i / kSteps) + 0.5f) / kSteps};
      sum += luminance(light_image_value(thrown.images(), thrown.rows[0], uniform_direction(u)));
    }
    const double integral = 4 * M_PI * sum / (kSteps * kSteps);
    EXPECT_NEAR(thrown.rows[0].integral / integral, 1, 1e-3);
    EXPECT_FLOAT_EQ(light_power(thrown.light, 1, thrown.rows[0].integral),
                    luminance(thrown.light.radiance) * thrown.rows[0].integral);
  }
}

// A square pyramid of full angle a has the solid angle 4 asin(sin^2(a / 2)).
TEST(ImageLight, a_white_projection_has_the_solid_angle_of_its_pyramid) {
  for (const double degrees : {1.0, 60.0, 90.0, 170.0}) {
    Thrown thrown(LightKind::projection, 5, 5, static_cast<float>(std::tan(degrees * M_PI / 360)));
    std::fill(thrown.texels.begin(), thrown.texels.end(), Rgb{1, 1, 1});
    const double sine = std::sin(degrees * M_PI / 360), expected = 4 * std::asin(sine * sine);
    EXPECT_NEAR(light_image_integral(thrown.images(), thrown.rows[0]) / expected, 1, 2e-5) << degrees;
  }
}

TEST(ImageLight, what_arrives_is_the_texel_over_the_squared_distance) {
  for (const LightKind kind : {LightKind::goniometric, LightKind::projection}) {
    const Thrown thrown(kind, 8, 8, 1);
    const std::vector<float> cdf{0, 1};
    LightTable table;
    table.lights = {&thrown.light, 1}, table.cdf = cdf, table.first_infinite = 1, table.images = thrown.images();
    test::Random u(7);
    int lit = 0;
    for (int i = 0; i < 2000; ++i) {
      const Float3 receiver = u.point(5);
      const LightSample got = sample_light(table, {receiver}, {u(), 0}, {0.5f, 0.5f});
      const Float3 from_light = receiver - thrown.light.position;
      const Rgb texel = light_image_value(thrown.images(), thrown.rows[0], normalize(from_light));
      const Rgb expected = thrown.light.radiance * texel * (1 / length_squared(from_light));
      ASSERT_TRUE(got.is_delta);
      ASSERT_EQ(got.pdf_solid_angle, 1);
      ASSERT_NEAR(got.radiance.g, expected.g, 1e-5f * expected.g + 1e-12f);
      lit += is_black(got.radiance) ? 0 : 1;
    }
    EXPECT_GT(lit, kind == LightKind::goniometric ? 1999 : 100);
  }
}

}  // namespace
}  // namespace spillway::shading
