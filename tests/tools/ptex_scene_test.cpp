// Face textures in pbrt scenes: which face a polygon is, what its texels mean.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <functional>

#include "pipeline/pack/ptx_writer.h"
#include "tests/support/small_scene.h"
#include "tests/tools/rendered.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::array<int, 3> kTexels = {51, 128, 230};  // of the three faces

// A wall of three squares beside each other, in front of an orthographic camera, under a white sky: a pixel is its
// face's reflectance.
class PtexScene : public testing::Test {
 protected:
  PtexScene() {
    pipeline::PtxDescription paint;
    paint.info.channels = 1;
    for (const int texel : kTexels) {
      pipeline::PtxFace& face = paint.faces.emplace_back();
      face.info.ulog2 = face.info.vlog2 = 2;
      face.texels.assign(16, static_cast<std::byte>(texel));
    }
    const std::vector<std::byte> bytes = pipeline::ptx_bytes(paint);
    std::ofstream(directory_.path() / "wall.ptx", std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
  }

  // The left, middle and right square, which are the faces that face_indices names.
  std::array<double, 3> shown(const std::array<int, 3>& face_indices, const std::string& more) const {
    const fs::path folder = directory_.path();
    std::ofstream ply(folder / "wall.ply");
    ply << "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
        << "element face 3\nproperty int face_indices\nproperty list uchar int vertex_indices\nend_header\n";
    for (int x = 0; x < 4; ++x) ply << x << " 0 0\n" << x << " 1 0\n";
    for (int k = 0; k < 3; ++k)
      ply << face_indices[static_cast<size_t>(k)] << " 4 " << 2 * k << ' ' << 2 * k + 2 << ' ' << 2 * k + 3 << ' '
          << 2 * k + 1 << '\n';
    ply.close();
    std::ofstream(folder / "wall.pbrt")
        << "LookAt 0 0 -5 0 0 0 0 1 0 Camera \"orthographic\" \"float screenwindow\" [0 3 0 1]\n"
        << "Film \"rgb\" \"integer xresolution\" 12 \"integer yresolution\" 4\nPixelFilter \"box\"\nWorldBegin\n"
        << "LightSource \"infinite\" \"rgb L\" [1 1 1]\n"
        << "Texture \"paint\" \"spectrum\" \"ptex\" \"string filename\" \"wall.ptx\" " << more << "\n"
        << "Material \"diffuse\" \"texture reflectance\" \"paint\"\nShape \"plymesh\" \"string filename\" "
           "\"wall.ply\"\n";
    const Picture picture = rendered(folder / "wall.pbrt", 256);
    std::array<double, 3> squares = {0, 0, 0};
    // The middle of each: across an edge lies its neighbour.
    for (size_t y = 1; y < 3; ++y)
      for (size_t x = 0; x < 12; ++x)
        if (x % 4 == 1 || x % 4 == 2) squares[x / 4] += static_cast<double>(picture.pixels[y * 12 + x].g) / 4;
    return squares;
  }

  test::TemporaryDirectory directory_;
};

TEST_F(PtexScene, polygons_are_the_faces_that_their_numbers_name) {
  for (const std::array<int, 3>& faces : {std::array<int, 3>{0, 1, 2}, {2, 0, 1}, {1, 2, 1}}) {
    const std::array<double, 3> got = shown(faces, "\"string encoding\" \"linear\"");
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(got[k], kTexels[static_cast<size_t>(faces[k])] / 255.0, 0.01) << k;
  }
}

TEST_F(PtexScene, texels_are_decoded_as_their_encoding_says_and_scaled) {
  const auto gamma = [](double power) { return [power](double x) { return std::pow(x, power); }; };
  const auto srgb = [](double x) { return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4); };
  const std::pair<const char*, std::function<double(double)>> encodings[] = {
      {"", gamma(2.2)},
      {"\"string encoding\" \"sRGB\"", srgb},
      {"\"string encoding\" \"gamma 1.5\"", gamma(1.5)},
      {"\"string encoding\" \"linear\" \"float scale\" 0.5", [](double x) { return x / 2; }}};
  for (const auto& [text, decode] : encodings) {
    const std::array<double, 3> got = shown({0, 1, 2}, text);
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(got[k], decode(kTexels[k] / 255.0), 0.01) << text << ' ' << k;
  }
}

}  // namespace
}  // namespace spillway::tools
