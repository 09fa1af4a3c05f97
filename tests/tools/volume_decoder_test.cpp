#include "pipeline/pack/volume_decoder.h"

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>

#include <iostream>  // which the next headers leave to their user

#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>

#include <fstream>
#include <functional>
#include <random>

#include "cache/file.h"
#include "cache/volume_table.h"
#include "tests/support/file_bytes.h"
#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

namespace fs = std::filesystem;

// A ball of smoke with a ripple, around the lattice's origin: samples of both signs of coordinates, halves all.
openvdb::FloatGrid::Ptr smoke(float value_at_center = 1) {
  openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0);
  grid->setName("density");
  auto values = grid->getAccessor();
  for (int z = -40; z <= 40; ++z)
    for (int y = -20; y <= 20; ++y)
      for (int x = -20; x <= 20; ++x)
        if (const int r = x * x + y * y + z * z / 4; r < 400)
          values.setValue({x, y, z}, value_at_center * static_cast<float>((400 - r) / 8) / 64);
  openvdb::math::Transform::Ptr transform = openvdb::math::Transform::createLinearTransform(0.25);
  transform->postRotate(0.3, openvdb::math::Y_AXIS);
  transform->postTranslate({1, 2, 3});
  grid->setTransform(transform);
  return grid;
}

void write_vdb(const fs::path& file, const openvdb::GridPtrVec& grids) {
  openvdb::initialize();
  openvdb::io::File(file.string()).write(grids);
}

class VolumeDecoder : public testing::Test {
 protected:
  [[nodiscard]] fs::path file(const std::string& name) const { return directory_.path() / name; }
  // The message of what must fail.
  [[nodiscard]] std::string refused(const fs::path& source, const std::string& grid = "density") const {
    const auto decoded = decode_volume(source, grid, file("refused.bricks"), {});
    EXPECT_FALSE(fs::exists(file("refused.bricks")));
    return decoded ? "" : decoded.error().message;
  }

  test::TemporaryDirectory directory_;
};

// The bricks of a file, by the lattice.
class Bricks {
 public:
  Bricks(const fs::path& file, int32_t voxels) : size_(cache::brick_size_bytes(voxels, cache::VoxelType::half_float)) {
    std::ifstream in(file, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(in), {});
    voxels_ = voxels;
    if (!bytes_.empty()) size_ = reinterpret_cast<const cache::VolumeBrickHeader*>(bytes_.data())->size_bytes;
    for (size_t at = 0; at + size_ <= bytes_.size(); at += size_) {
      const std::span brick(reinterpret_cast<const std::byte*>(bytes_.data()) + at, size_);
      EXPECT_TRUE(cache::validate_volume_brick(brick, "brick"));
      views_.emplace_back(brick);
    }
  }
  [[nodiscard]] size_t count() const { return views_.size(); }
  [[nodiscard]] const cache::VolumeBrickView& brick(size_t i) const { return views_.at(i); }
  [[nodiscard]] cache::VoxelType type() const { return views_.at(0).header().type; }
  [[nodiscard]] float at(Float3 p) const {
    for (const cache::VolumeBrickView& view : views_) {
      bool inside = true;
      for (int a = 0; a < 3; ++a) {
        const float from = p[a] - static_cast<float>(view.header().corner[a]);
        inside = inside && from >= 0 && from < static_cast<float>(voxels_);
      }
      if (inside) return view.interpolate(p);
    }
    return 0;
  }

 private:
  std::vector<char> bytes_;
  std::vector<cache::VolumeBrickView> views_;
  size_t size_;
  int32_t voxels_;
};

TEST_F(VolumeDecoder, a_grid_comes_out_as_the_library_interpolates_it) {
  for (const bool as_half : {true, false}) {
    const openvdb::FloatGrid::Ptr grid = smoke();
    grid->setSaveFloatAsHalf(as_half);
    write_vdb(file("smoke.vdb"), {grid});
    for (const int32_t voxels : {8, 32}) {
      VolumeDecoderOptions options;
      options.brick_voxels = voxels;
      const auto decoded = decode_volume(file("smoke.vdb"), "density", file("smoke.bricks"), options);
      ASSERT_TRUE(decoded) << decoded.error().message;
      const Bricks bricks(file("smoke.bricks"), voxels);
      EXPECT_GT(bricks.count(), voxels == 8 ? 100u : 7u);
      EXPECT_EQ(bricks.type(), as_half ? cache::VoxelType::half_float : cache::VoxelType::single_float);
      std::mt19937 random(7);
      std::uniform_real_distribution<float> u(-45, 45);
      for (int i = 0; i < 3000; ++i) {
        const Float3 p{u(random) / 2, u(random) / 2, u(random)};
        const double wanted =
            openvdb::tools::BoxSampler::sample(grid->getConstAccessor(), openvdb::Vec3R(p.x, p.y, p.z));
        ASSERT_NEAR(bricks.at(p), wanted, 1e-6);
        const openvdb::Vec3d world = grid->indexToWorld(openvdb::Vec3d(p.x, p.y, p.z));
        const Float3 ours = decoded->point(p);
        ASSERT_NEAR(ours.x, world.x(), 1e-4);
        ASSERT_NEAR(ours.y, world.y(), 1e-4);
        ASSERT_NEAR(ours.z, world.z(), 1e-4);
      }
    }
  }
}

// With or without a box of it, or of where grids begin; as one of several of that name; with another's samples.
TEST_F(VolumeDecoder, a_grid_is_the_same_however_its_file_is_written) {
  const openvdb::FloatGrid::Ptr grid = smoke(), other = smoke(0.5f);
  write_vdb(file("smoke.vdb"), {grid});
  openvdb::io::File bare(file("bare.vdb").string());
  bare.setGridStatsMetadataEnabled(false);
  bare.write({grid});
  std::ofstream stream(file("stream.vdb"), std::ios::binary);
  openvdb::io::Stream(stream).write(openvdb::GridCPtrVec{openvdb::Vec3SGrid::create(), other, grid});
  stream.close();
  write_vdb(file("several.vdb"), {other, grid});
  const openvdb::GridBase::Ptr sharing = grid->copyGrid();
  sharing->setName("sharing");
  write_vdb(file("shared.vdb"), {other, grid, sharing});
  const auto bytes = [&](const char* name, const char* of) {
    const auto decoded = decode_volume(file(name), of, file("out.bricks"), {});
    EXPECT_TRUE(decoded) << decoded.error().message;
    return test::bytes_of(file("out.bricks"));
  };
  const std::string wanted = bytes("smoke.vdb", "density"), unlike = bytes("several.vdb", "density");
  EXPECT_NE(wanted, unlike);
  EXPECT_EQ(bytes("bare.vdb", "density"), wanted);
  EXPECT_EQ(bytes("stream.vdb", "density[1]"), wanted);
  EXPECT_EQ(bytes("stream.vdb", "density"), unlike);
  EXPECT_EQ(bytes("several.vdb", "density[0]"), unlike);
  EXPECT_EQ(bytes("several.vdb", "density[1]"), wanted);
  EXPECT_EQ(bytes("shared.vdb", "sharing"), wanted);
}

TEST_F(VolumeDecoder, a_nanovdb_file_gives_the_same_samples) {
  const openvdb::FloatGrid::Ptr grid = smoke();
  write_vdb(file("smoke.vdb"), {grid});
  const auto handle = nanovdb::openToNanoVDB(*grid);
  nanovdb::io::writeGrid(file("smoke.nvdb").string(), handle, nanovdb::io::Codec::NONE);
  const auto from_vdb = decode_volume(file("smoke.vdb"), "density", file("a.bricks"), {});
  const auto from_nano = decode_volume(file("smoke.nvdb"), "density", file("b.bricks"), {});
  ASSERT_TRUE(from_vdb && from_nano) << from_nano.error().message;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) EXPECT_NEAR(from_vdb->m[row][column], from_nano->m[row][column], 1e-6);
  const Bricks a(file("a.bricks"), 32), b(file("b.bricks"), 32);
  EXPECT_EQ(a.count(), b.count());
  std::mt19937 random(8);
  std::uniform_real_distribution<float> u(-20, 20);
  for (int i = 0; i < 1000; ++i) {
    const Float3 p{u(random), u(random), 2 * u(random)};
    ASSERT_EQ(a.at(p), b.at(p));
  }
}

nanovdb::GridHandle<> nano(const openvdb::FloatGrid& grid, nanovdb::ChecksumMode sum = nanovdb::ChecksumMode::Full) {
  return nanovdb::openToNanoVDB(grid, nanovdb::StatsMode::Default, sum);
}

void write_nano(const fs::path& file, const nanovdb::GridHandle<>& handle) {
  nanovdb::io::writeGrid(file.string(), handle, nanovdb::io::Codec::NONE);
}

// Constant regions of every size, a background, leaves far from each other, on both sides of the origin.
TEST_F(VolumeDecoder, a_sparse_nanovdb_file_gives_the_same_samples) {
  const openvdb::FloatGrid::Ptr grid = smoke();
  grid->fill(openvdb::CoordBBox({-128, 128, 0}, {127, 260, 130}), 0.5f);
  grid->fill(openvdb::CoordBBox({-1, -200, -130}, {20, -100, -3}), 0.25f);
  grid->getAccessor().setValue({500, -300, 90}, 1);
  grid->tree().prune();
  write_vdb(file("sparse.vdb"), {grid});
  write_nano(file("sparse.nvdb"), nano(*grid));
  VolumeDecoderOptions options;
  options.brick_voxels = 32;
  ASSERT_TRUE(decode_volume(file("sparse.vdb"), "density", file("a.bricks"), options));
  const auto decoded = decode_volume(file("sparse.nvdb"), "density", file("b.bricks"), options);
  ASSERT_TRUE(decoded) << decoded.error().message;
  // Bricks of halves lose nothing here, but a .nvdb file does not say that they do.
  const Bricks a(file("a.bricks"), 32), b(file("b.bricks"), 32);
  EXPECT_GT(a.count(), 200u);
  ASSERT_EQ(a.count(), b.count());
  for (size_t i = 0; i < a.count(); ++i) {
    const cache::VolumeBrickHeader& header = a.brick(i).header();
    for (int axis = 0; axis < 3; ++axis) ASSERT_EQ(header.corner[axis], b.brick(i).header().corner[axis]);
    for (int j = 0; j < 40; ++j) {
      Float3 p;
      for (int axis = 0; axis < 3; ++axis)
        p[axis] = static_cast<float>(header.corner[axis] + (j * (7 + 4 * axis) + j / 3) % 32) + 0.5f;
      ASSERT_EQ(a.brick(i).interpolate(p), b.brick(i).interpolate(p));
    }
  }
}

TEST_F(VolumeDecoder, damaged_nanovdb_files_are_refused_by_name_or_read) {
  write_nano(file("smoke.nvdb"), nano(*smoke()));
  const std::string whole = test::bytes_of(file("smoke.nvdb"));
  const auto write = [&](const std::string& bytes) {
    std::ofstream(file("damaged.nvdb"), std::ios::binary | std::ios::trunc) << bytes;
  };
  for (const double part : {0.0, 0.0001, 0.001, 0.01, 0.1, 0.5, 0.9, 0.9999}) {
    write(whole.substr(0, static_cast<size_t>(part * static_cast<double>(whole.size()))));
    const std::string message = refused(file("damaged.nvdb"));
    EXPECT_NE(message.find("damaged.nvdb"), std::string::npos) << part << ": " << message;
  }
  // The sum tells of every bit behind it, also of the last leaf's.
  for (const size_t at : {whole.size() / 9, whole.size() / 2, whole.size() - 100}) {
    std::string bytes = whole;
    bytes[at] ^= 1;
    write(bytes);
    EXPECT_NE(refused(file("damaged.nvdb")).find("is damaged"), std::string::npos) << at;
  }
  // Without a sum what is read may be nonsense, but it ends, and well.
  write_nano(file("smoke.nvdb"), nano(*smoke(), nanovdb::ChecksumMode::Disable));
  const std::string unsummed = test::bytes_of(file("smoke.nvdb"));
  std::mt19937 random(10);
  for (int i = 0; i < 12; ++i) {
    std::string bytes = unsummed;
    for (int k = 0; k < 3; ++k) bytes[random() % (i < 6 ? 1500 : bytes.size())] ^= static_cast<char>(1 << random() % 8);
    write(bytes);
    VolumeDecoderOptions options;
    options.time_limit_seconds = 5, options.memory_limit_bytes = 1ull << 30;
    const auto decoded = decode_volume(file("damaged.nvdb"), "density", file("flipped.bricks"), options);
    if (decoded) continue;
    EXPECT_NE(decoded.error().message.find("damaged.nvdb"), std::string::npos) << decoded.error().message;
  }
}

TEST_F(VolumeDecoder, nodes_of_nanovdb_files_lie_within_them) {
  const int64_t far = int64_t{1} << 40;
  const auto message = [&](const std::function<void(nanovdb::NanoTree<float>&)>& change) {
    auto handle = nano(*smoke(), nanovdb::ChecksumMode::Disable);
    change(handle.grid<float>()->tree());
    write_nano(file("far.nvdb"), handle);
    return refused(file("far.nvdb"));
  };
  write_nano(file("near.nvdb"), nano(*smoke(), nanovdb::ChecksumMode::Disable));
  EXPECT_TRUE(decode_volume(file("near.nvdb"), "density", file("near.bricks"), {}));
  const auto first_child = [](auto& node) {
    for (uint32_t i = 0;; ++i)
      if (node.mChildMask.isOn(i)) return &node.mTable[i].child;
  };
  for (const int64_t step : {far, -far, int64_t{8}}) {
    const std::string said = "far.nvdb: grid 'density' is damaged";
    EXPECT_NE(message([&](auto& tree) { tree.root().data()->tile(0)->child += step; }).find(said), std::string::npos);
    EXPECT_NE(message([&](auto& tree) { *first_child(*tree.getFirstUpper()->data()) += step; }).find(said),
              std::string::npos);
    EXPECT_NE(message([&](auto& tree) { *first_child(*tree.getFirstLower()->data()) += step; }).find(said),
              std::string::npos);
  }
}

#ifndef __SANITIZE_ADDRESS__  // which takes address space as it likes
// The address space in which the decoder packs the grid of the file, in steps of 16 MiB.
uint64_t space_for(const fs::path& source) {
  VolumeDecoderOptions options;
  options.memory_limit_bytes = 0;
  do {
    options.memory_limit_bytes += 16 << 20;
    EXPECT_LT(options.memory_limit_bytes, 2ull << 30);
  } while (options.memory_limit_bytes < 2ull << 30 &&
           !decode_volume(source, "density", source.string() + ".bricks", options));
  return options.memory_limit_bytes;
}

openvdb::FloatGrid::Ptr one_sample() {
  openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0);
  grid->setName("density"), grid->getAccessor().setValue({1, 2, 3}, 1);
  return grid;
}
openvdb::FloatGrid::Ptr filled() {
  openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0);
  grid->setName("density"), grid->denseFill(openvdb::CoordBBox({0, 0, 0}, {255, 255, 255}), 0.5f);
  return grid;
}

// A file of 64 MiB of samples is packed within 24 MiB of what one of a few leaves takes: that it is never held whole.
TEST_F(VolumeDecoder, a_nanovdb_file_is_never_held_whole) {
  write_nano(file("large.nvdb"), nano(*filled()));
  write_nano(file("little.nvdb"), nano(*one_sample()));
  VolumeDecoderOptions options;
  options.memory_limit_bytes = space_for(file("little.nvdb")) + (24 << 20);
  const auto decoded = decode_volume(file("large.nvdb"), "density", file("large.bricks"), options);
  EXPECT_TRUE(decoded) << decoded.error().message;
}

// Whether or not it says where grids lie and how large they are, and however the grid stands.
TEST_F(VolumeDecoder, a_vdb_file_is_never_held_whole) {
  const openvdb::FloatGrid::Ptr large = filled();
  large->transform().postRotate(0.7, openvdb::math::Y_AXIS);
  write_vdb(file("large.vdb"), {large});
  std::ofstream stream(file("stream.vdb"), std::ios::binary);
  openvdb::io::Stream out(stream);
  out.setGridStatsMetadataEnabled(false);
  out.write(openvdb::GridCPtrVec{large});
  stream.close();
  write_vdb(file("little.vdb"), {one_sample()});
  VolumeDecoderOptions options;
  options.memory_limit_bytes = space_for(file("little.vdb")) + (24 << 20);
  for (const char* name : {"large.vdb", "stream.vdb"}) {
    const auto decoded = decode_volume(file(name), "density", file("large.bricks"), options);
    EXPECT_TRUE(decoded) << decoded.error().message;
    EXPECT_GT(fs::file_size(file("large.bricks")), 64u << 20);
  }
}
#endif

TEST_F(VolumeDecoder, grids_that_are_no_density_are_refused_by_name) {
  const openvdb::FloatGrid::Ptr negative = smoke(-1), infinite = smoke(INFINITY);
  const auto empty = openvdb::FloatGrid::create(0);
  const auto vectors = openvdb::Vec3SGrid::create();
  negative->setName("negative"), infinite->setName("infinite"), empty->setName("empty"), vectors->setName("vectors");
  vectors->getAccessor().setValue({1, 2, 3}, {1, 1, 1});
  const auto far = openvdb::FloatGrid::create(0);
  far->setName("far");
  far->getAccessor().setValue({1 << 24, 0, 0}, 1);
  const openvdb::FloatGrid::Ptr none = smoke(NAN), frustum = smoke();
  none->setName("none"), frustum->setName("frustum");
  frustum->setTransform(openvdb::math::Transform::createFrustumTransform(
      openvdb::BBoxd(openvdb::Vec3d(0, 0, 0), openvdb::Vec3d(100, 100, 100)), 0.5, 10));
  write_vdb(file("bad.vdb"), {negative, infinite, empty, vectors, far, none, frustum});
  EXPECT_NE(refused(file("bad.vdb"), "negative").find("the sample at ("), std::string::npos);
  EXPECT_NE(refused(file("bad.vdb"), "infinite").find("must be finite"), std::string::npos);
  EXPECT_NE(refused(file("bad.vdb"), "none").find("must be finite"), std::string::npos);
  EXPECT_NE(refused(file("bad.vdb"), "frustum").find("a transform that is not affine"), std::string::npos);
  EXPECT_NE(refused(file("bad.vdb"), "empty").find("is empty"), std::string::npos);
  EXPECT_NE(refused(file("bad.vdb"), "vectors").find("float grids are possible"), std::string::npos);
  EXPECT_NE(refused(file("bad.vdb"), "far").find("between -1048576"), std::string::npos);
  EXPECT_NE(refused(file("bad.vdb"), "density").find("has no grid 'density'; it has 'empty'"), std::string::npos);
  EXPECT_NE(refused(file("missing.vdb")).find("there is no such volume file"), std::string::npos);
}

TEST_F(VolumeDecoder, cut_and_flipped_files_are_refused_by_name_or_read) {
  write_vdb(file("smoke.vdb"), {smoke()});
  std::ifstream in(file("smoke.vdb"), std::ios::binary);
  const std::string whole(std::istreambuf_iterator<char>(in), {});
  const auto write = [&](const std::string& bytes) {
    std::ofstream(file("damaged.vdb"), std::ios::binary | std::ios::trunc) << bytes;
  };
  for (const double part : {0.0, 0.001, 0.01, 0.05, 0.2, 0.5, 0.9, 0.999}) {
    write(whole.substr(0, static_cast<size_t>(part * static_cast<double>(whole.size()))));
    const std::string message = refused(file("damaged.vdb"));
    EXPECT_NE(message.find("damaged.vdb"), std::string::npos) << part << ": " << message;
  }
  std::mt19937 random(9);
  for (int i = 0; i < 8; ++i) {
    std::string bytes = whole;
    for (int k = 0; k < 3; ++k)
      bytes[random() % std::min<size_t>(bytes.size(), 2000)] ^= static_cast<char>(1 << random() % 8);
    write(bytes);
    VolumeDecoderOptions options;
    options.time_limit_seconds = 5, options.memory_limit_bytes = 1ull << 30;
    const auto decoded = decode_volume(file("damaged.vdb"), "density", file("flipped.bricks"), options);
    if (decoded) continue;
    EXPECT_NE(decoded.error().message.find("damaged.vdb"), std::string::npos) << decoded.error().message;
  }
}

}  // namespace
}  // namespace spillway::pipeline
