// Images whose texels are extreme. docs/failures.md has the table.

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>

#include "cache/facetex_writer.h"
#include "tests/support/closed_forms.h"
#include "tests/support/face_mesh.h"

namespace spillway::test {
namespace {

namespace fs = std::filesystem;

void write_grey(const fs::path& file, int width, int height, const std::vector<float>& values) {
  std::vector<float> texels;
  for (const float v : values) texels.insert(texels.end(), 3, v);
  const auto output = OIIO::ImageOutput::create(file.string());
  ASSERT_TRUE(output);
  ASSERT_TRUE(output->open(file.string(), OIIO::ImageSpec(width, height, 3, OIIO::TypeFloat)));
  ASSERT_TRUE(output->write_image(OIIO::TypeFloat, texels.data()));
  ASSERT_TRUE(output->close());
}

// The direction of a place on an equal-area octahedral map, u and v in [0, 1] (Clarberg 2008).
Vec octahedral(double u, double v) {
  const double x = 2 * u - 1, y = 2 * v - 1, d = 1 - std::fabs(x) - std::fabs(y), r = 1 - std::fabs(d);
  const double phi = r == 0 ? 0 : ((std::fabs(y) - std::fabs(x)) / r + 1) * M_PI / 4;
  const double planar = r * std::sqrt(std::max(0.0, 2 - r * r));
  return {std::copysign(planar * std::cos(phi), x), std::copysign(planar * std::sin(phi), y),
          std::copysign(1 - r * r, d)};
}

// Hard: the whole light of a sky in one texel of four thousand, ten million times as bright as the rest.
TEST(Failures, one_bright_texel_in_a_sky) {
  constexpr int kSize = 64, kX = 37, kY = 24;
  constexpr double kBright = 1e7, kElse = 1;
  std::vector<float> texels(kSize * kSize, kElse);
  texels[kY * kSize + kX] = kBright;
  const FailureScene scene(view_down(1, 0.5, 1) + diffuse(0.5) + sheet({-9, -9, 0}, {18, 0, 0}, {0, 18, 0}) +
                               "LightSource \"infinite\" \"string filename\" \"sky.exr\"\n",
                           [&](const fs::path& folder) { write_grey(folder / "sky.exr", kSize, kSize, texels); });
  scene.expect_same_bits();
  // The mean cosine over the texel, whose solid angle is 4 pi / size^2.
  const auto cosine = [&](double du, double dv) {
    return std::max(0.0, octahedral((kX + 0.5 + du) / kSize, (kY + 0.5 + dv) / kSize).z);
  };
  const double one = mean_over_square(0.5, 2, cosine) * 4 * M_PI / (kSize * kSize);
  expect_unbiased(scene, 0.5 * (kElse + (kBright - kElse) * one / M_PI), {.rounding = 1e-4});
}

// On rough metal the texel is found by light sampling, on polished metal by BSDF sampling too.
TEST(Failures, one_bright_texel_in_a_sky_over_metal) {
  constexpr int kSize = 64;
  std::vector<float> texels(kSize * kSize, 0);
  // Four texels meet at the pole: the mirrored direction.
  for (const int at : {31 * kSize + 31, 31 * kSize + 32, 32 * kSize + 31, 32 * kSize + 32})
    texels[static_cast<size_t>(at)] = 1e4f;
  for (const double alpha : {0.01, 0.3}) {
    const FailureScene scene(view_down(1, 0.5, 1) + metal_words(alpha) + sheet({-9, -9, 0}, {18, 0, 0}, {0, 18, 0}) +
                                 "LightSource \"infinite\" \"string filename\" \"sky.exr\"\n",
                             [&](const fs::path& folder) { write_grey(folder / "sky.exr", kSize, kSize, texels); });
    scene.expect_same_bits();
    const double solid_angle = 4 * 4 * M_PI / (kSize * kSize);
    const double value = mean_over_square(1, alpha < 0.1 ? 40 : 8, [&](double u, double v) {
      const Vec w = octahedral(0.5 + u / kSize, 0.5 + v / kSize);
      return 1e4 * solid_angle * metal({0, 0, 1}, w, alpha, kMetalIndex) * w.z;
    });
    expect_unbiased(scene, value, {.rounding = 3e-4, .largest_error = 0.02});
  }
}

// A light that is infinite has no right picture: it is refused by name and place.
TEST(Failures, a_sky_with_an_infinite_texel_is_refused) {
  for (const float bad : {INFINITY, NAN}) {
    std::vector<float> texels(16, 1);
    texels[6] = bad;
    const FailureScene scene(view_down(1, 0.5, 1) + "LightSource \"infinite\" \"string filename\" \"sky.exr\"\n",
                             [&](const fs::path& folder) { write_grey(folder / "sky.exr", 4, 4, texels); });
    EXPECT_NE(scene.error().find("sky.exr: texel (2, 1)"), std::string::npos) << scene.error();
  }
}

// Hard: infinity times a filter's weight of nought is no number, and one such texel spoils all coarser levels. What is
// above one reflects everything, what is no number or below nought reflects nothing, and neighbours keep their values.
TEST(Failures, a_texture_with_infinite_values) {
  constexpr int kSize = 64;
  std::vector<float> texels(kSize * kSize, 0.25f);
  const auto put = [&](int x, int y, float value) { texels[static_cast<size_t>(y * kSize + x)] = value; };
  for (int i = 0; i < 8; ++i)  // of 64 blocks of 8 x 8 one is infinite, one is none
    for (int j = 0; j < 8; ++j) put(8 + i, 8 + j, INFINITY), put(40 + i, 24 + j, NAN), put(24 + i, 48 + j, -INFINITY);
  const auto scene_of = [&](double half_width, const char* filter) {
    return std::make_unique<FailureScene>(
        view_down(1, half_width, 1) + sky(1) +
            fmt::format(
                "Texture \"paint\" \"spectrum\" \"imagemap\" \"string filename\" \"paint.exr\" \"string encoding\" "
                "\"linear\" \"string filter\" \"{}\"\nMaterial \"diffuse\" \"texture reflectance\" \"paint\"\n",
                filter) +
            "Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 1 1 0 -1 1 0] \"point2 uv\" [0 0 1 0 1 1 0 1] "
            "\"integer "
            "indices\" [0 1 2 0 2 3]\n",
        [&](const fs::path& folder) { write_grey(folder / "paint.exr", kSize, kSize, texels); });
  };
  const auto close = scene_of(0.999, "point");
  close->expect_same_bits();
  expect_unbiased(*close, (61 * 0.25 + 1) / 64, {.seeds = 8, .rounding = 3e-3});
  for (const char* filter : {"bilinear", "trilinear"}) {
    const auto scene = scene_of(0.999, filter);
    scene->expect_same_bits();
    const double mean = scene->render(1, 64).mean;
    EXPECT_GT(mean, 0.2) << filter;
    EXPECT_LT(mean, 0.5) << filter;
  }
  scene_of(20, "trilinear")->expect_same_bits();  // of the coarsest levels
}

// Hard: the texels of one face are as wide as 256 of its neighbour's, and the filter crosses the edge. A ramp stays
// one.
TEST(Failures, neighbouring_faces_of_unlike_resolutions) {
  const FaceGrid grid(2, 1);
  const auto make =
      [&](const fs::path& folder) {
        const cache::FaceTexFormat format{cache::FaceTexelType::float32, 1, -1};
        auto writer = cache::FaceTexWriter::create(folder / "paint.facetex", format);
        ASSERT_TRUE(writer) << writer.error().message;
        const auto faces = grid.faces(
            [](uint32_t f) { return f == 0 ? std::pair<uint8_t, uint8_t>(1, 1) : std::pair<uint8_t, uint8_t>(9, 9); });
        ASSERT_TRUE((*writer)->begin_texture({"paint", cache::FaceShape::quad, {}, {}, faces}));
        for (uint32_t f = 0; f < 2; ++f) {
          const auto ramp = [&](double u, double v, uint32_t) { return (grid.place(f, u, v).x / 2 + v) / 2; };
          ASSERT_TRUE((*writer)->add_face(painted_face(format, faces[f], cache::FaceShape::quad, ramp)));
        }
        ASSERT_TRUE((*writer)->finish());
        std::ofstream(folder / "quads.ply")
            << "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
               "property float z\nelement face 2\nproperty list uchar int vertex_indices\n"
               "end_header\n0 0 0\n1 0 0\n2 0 0\n0 1 0\n1 1 0\n2 1 0\n4 0 1 4 3\n4 1 2 5 4\n";
      };
  for (const double half : {0.02, 0.2}) {
    const FailureScene scene(
        view_along({0.98, 0.5, 1}, {0.98, 0.5, 0}, {0, 1, 0}, half, 1, 16) + sky(1) +
            "Texture \"paint\" \"spectrum\" \"ptex\" \"string filename\" \"paint.facetex\"\nMaterial "
            "\"diffuse\" \"texture reflectance\" \"paint\"\nShape \"plymesh\" \"string filename\" "
            "\"quads.ply\"\n",
        make);
    scene.expect_same_bits();
    expect_unbiased(scene, (0.98 / 2 + 0.5) / 2, {.rounding = 2e-3});
  }
}

}  // namespace
}  // namespace spillway::test
