// Fire of .vdb files as whole pictures, against what quadrature says.

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <fstream>

#include "tests/support/black_body_luminance.h"
#include "tests/tools/rendered.h"

namespace spillway::tools {
namespace {

constexpr int kPixels = 16, kBlocks = 4;
constexpr double kView = 0.9;  // half of what the picture shows of the box

// Linear along each axis, so that the grids return them exactly between their samples, however these stand.
double density_at(double x, double /*y*/, double z) { return 1 + 0.5 * x + 0.3 * z; }
double heat_at(double /*x*/, double y, double z) { return 21 + 6 * y - 4 * z; }
double shine_at(double x, double y, double z) { return 2 + 0.5 * x - y + 0.5 * z; }

using Function = double (*)(double, double, double);

// Samples beyond the box of +-1 on all sides, on a lattice of its own.
openvdb::FloatGrid::Ptr grid_of(const char* name, Function value, const openvdb::math::Transform::Ptr& transform) {
  openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0);
  grid->setName(name), grid->setTransform(transform);
  auto values = grid->getAccessor();
  const openvdb::CoordBBox box =
      transform->worldToIndexNodeCentered(openvdb::BBoxd(openvdb::Vec3d(-1.1), openvdb::Vec3d(1.1)));
  for (auto at = box.begin(); at; ++at) {
    const openvdb::Vec3d p = transform->indexToWorld(*at);
    values.setValue(*at, static_cast<float>(std::max(0.0, value(p.x(), p.y(), p.z()))));
  }
  return grid;
}

openvdb::math::Transform::Ptr lattice(double voxel, double turn, const openvdb::Vec3d& corner) {
  openvdb::math::Transform::Ptr transform = openvdb::math::Transform::createLinearTransform(voxel);
  transform->postRotate(turn, openvdb::math::Y_AXIS);
  transform->postTranslate(corner);
  return transform;
}

void write_fire(const std::filesystem::path& file) {
  openvdb::initialize();
  openvdb::io::File(file.string())
      .write(openvdb::GridPtrVec{grid_of("smoke", density_at, lattice(0.1, 0.3, {0.02, 0.03, 0.04})),
                                 grid_of("heat", heat_at, lattice(0.16, -0.5, {0.3, 0, -0.2})),
                                 grid_of("shine", shine_at, lattice(0.13, 0, {0, 0.05, 0}))});
}

// Seen along -z: what the gas between z = 1 and -1 emits towards the camera, `emits` a unit of what it absorbs.
double radiance(double x, double y, double absorbs, const std::function<double(double, double, double)>& emits) {
  constexpr int kSteps = 200;
  double passes = 1, sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double z = 1 - (i + 0.5) * 2 / kSteps;
    const double through = std::exp(-absorbs * density_at(x, y, z) * 2 / kSteps);
    sum += passes * (1 - through) * emits(x, y, z), passes *= through;
  }
  return sum;
}

// Each block of pixels and their mean are what quadrature says, within four standard errors.
void expect_picture(const std::string& glow, double absorbs, const std::function<double(double, double, double)>& emits,
                    double model_error) {
  const test::TemporaryDirectory directory;
  write_fire(directory.path() / "fire.vdb");
  std::ofstream(directory.path() / "scene.pbrt") << fmt::format(
      "LookAt 0 0 5 0 0 0 0 1 0 Scale -1 1 1 Camera \"orthographic\" \"float screenwindow\" [-{0} {0} -{0} {0}]\n"
      "Film \"rgb\" \"integer xresolution\" {1} \"integer yresolution\" {1} PixelFilter \"box\"\n"
      "Integrator \"path\" \"integer maxdepth\" 4\nWorldBegin\n"
      "MakeNamedMedium \"fire\" \"string type\" \"openvdb\" \"string filename\" \"fire.vdb\" \"string densityname\" "
      "\"smoke\" \"rgb sigma_a\" [{2} {2} {2}] \"rgb sigma_s\" [0 0 0] {3}\n"
      "MediumInterface \"fire\" \"\" Material \"interface\"\nShape \"trianglemesh\" \"point3 P\" "
      "[-1 -1 -1 1 -1 -1 1 1 -1 -1 1 -1 -1 -1 1 1 -1 1 1 1 1 -1 1 1] \"integer indices\" "
      "[0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7]\n",
      kView, kPixels, absorbs, glow);
  const Picture picture = rendered(directory.path() / "scene.pbrt", 4096);
  ASSERT_EQ(picture.pixels.size(), size_t{kPixels * kPixels});
  double all = 0;
  constexpr int kSide = kPixels / kBlocks;
  for (int block = 0; block < kBlocks * kBlocks; ++block) {
    double seen = 0, wanted = 0, variance = 0;
    for (int i = 0; i < kSide * kSide; ++i) {
      const int column = block % kBlocks * kSide + i % kSide, row = block / kBlocks * kSide + i / kSide;
      const size_t pixel = static_cast<size_t>(row) * kPixels + column;
      const double d = luminance(picture.half_a[pixel]) - luminance(picture.half_b[pixel]);
      seen += luminance(picture.pixels[pixel]) / (kSide * kSide);
      variance += picture.weight_a * (1 - picture.weight_a) * d * d / std::pow(kSide, 4);
      wanted += radiance(((column + 0.5) / kPixels * 2 - 1) * kView, (1 - (row + 0.5) / kPixels * 2) * kView, absorbs,
                         emits) /
                (kSide * kSide);
    }
    EXPECT_NEAR(seen, wanted, 4 * std::sqrt(variance) + model_error * wanted) << "block " << block;
    EXPECT_LT(4 * std::sqrt(variance), 0.04 * wanted);
    all += seen / wanted - 1;
  }
  EXPECT_NEAR(all / (kBlocks * kBlocks), 0, 0.003 + model_error);
}

TEST(VolumeAnswers, a_fire_of_a_vdb_file_shines_by_its_heat) {
  const auto emits = [](double x, double y, double z) {
    return 3 * test::luminance_of_a_body((heat_at(x, y, z) - 2) * 100);
  };
  expect_picture(
      "\"string temperaturename\" \"heat\" \"float temperatureoffset\" 2 \"float temperaturescale\" 100 "
      "\"float LeScale\" 3",
      0.8, emits, 0.005);  // the luminosity function of luminance_of_a_body is a fit
}

TEST(VolumeAnswers, a_fire_of_a_vdb_file_shines_by_the_grid_that_says_so) {
  const double color = luminance(Rgb{3, 2, 0.5f}) * 0.5;
  expect_picture(
      "\"string emissionname\" \"shine\" \"rgb Le\" [3 2 0.5] \"float LeScale\" 0.5", 0.8,
      [=](double x, double y, double z) { return color * shine_at(x, y, z); }, 0.001);
}

}  // namespace
}  // namespace spillway::tools
