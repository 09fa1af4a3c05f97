#include "cache/volume_brick.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "cache/base/hash.h"
#include "cache/volume_table.h"

namespace spillway::cache {
namespace {

using Corner = std::array<int32_t, 3>;

// A field over the whole lattice, whose values are halves.
float field(int32_t x, int32_t y, int32_t z) {
  const uint64_t h =
      hash_combine(static_cast<uint32_t>(x) | uint64_t{static_cast<uint32_t>(y)} << 32, static_cast<uint32_t>(z));
  return static_cast<float>(h % 1024) / 1024;
}

std::vector<float> samples_at(const Corner& corner, int32_t voxels) {
  std::vector<float> samples;
  for (int32_t z = 0; z <= voxels; ++z)
    for (int32_t y = 0; y <= voxels; ++y)
      for (int32_t x = 0; x <= voxels; ++x) samples.push_back(field(corner[0] + x, corner[1] + y, corner[2] + z));
  return samples;
}

Buffer<std::byte> brick_at(const Corner& corner, int32_t voxels, VoxelType type = VoxelType::half_float) {
  return build_volume_brick(corner, voxels, type, samples_at(corner, voxels));
}

TEST(VolumeBrick, interpolates_between_lattice_points) {
  for (const VoxelType type : {VoxelType::half_float, VoxelType::single_float}) {
    const Buffer<std::byte> bytes = brick_at({-8, 0, 8}, 8, type);
    ASSERT_TRUE(validate_volume_brick(bytes, "brick"));
    const VolumeBrickView brick{bytes};
    EXPECT_EQ(brick.interpolate({-3, 2, 9}), field(-3, 2, 9));
    EXPECT_EQ(brick.interpolate({0, 8, 16}), field(0, 8, 16));
    EXPECT_NEAR(brick.interpolate({-2.75f, 2, 9}), 0.75f * field(-3, 2, 9) + 0.25f * field(-2, 2, 9), 1e-6);
    double mean = 0;
    for (int i = 0; i < 8; ++i) mean += field(-3 + (i & 1), 2 + (i >> 1 & 1), 9 + (i >> 2)) / 8;
    EXPECT_NEAR(brick.interpolate({-2.5f, 2.5f, 9.5f}), mean, 1e-6);
  }
}

TEST(VolumeBrick, three_channels_are_three_volumes_in_one_and_cells_bound_all_of_them) {
  std::vector<float> samples = samples_at({0, 8, 0}, 8);
  const size_t count = samples.size();
  for (const float scale : {0.5f, 2.0f})
    for (size_t i = 0; i < count; ++i) samples.push_back(scale * samples[i]);
  const Buffer<std::byte> bytes = build_volume_brick({0, 8, 0}, 8, VoxelType::half_float, samples);
  EXPECT_EQ(bytes.size(), brick_size_bytes(8, VoxelType::half_float, 3));
  ASSERT_TRUE(validate_volume_brick(bytes, "brick"));
  const VolumeBrickView color{bytes};
  const Buffer<std::byte> first = brick_at({0, 8, 0}, 8);
  const VolumeBrickView grey{first};
  const Float3 p{3.25f, 9.5f, 4.75f};
  const float value = grey.interpolate(p);
  EXPECT_EQ(color.interpolate(p), value);
  EXPECT_EQ(color.interpolate_color(p), (Rgb{value, 0.5f * value, 2 * value}));
  EXPECT_EQ(grey.interpolate_color(p), (Rgb{value, value, value}));
  EXPECT_EQ(color.cell_max()[0], 2 * grey.cell_max()[0]);
}

TEST(VolumeBrick, the_size_of_bricks_does_not_show) {
  const Buffer<std::byte> large = brick_at({-64, -64, 0}, 64);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> u(0, 64);
  for (const int32_t voxels : {8, 16, 32}) {
    for (int i = 0; i < 300; ++i) {
      const Float3 p{u(random) - 64, u(random) - 64, u(random)};
      Corner corner;
      for (int a = 0; a < 3; ++a)
        corner[a] = static_cast<int32_t>(std::floor(p[a] / static_cast<float>(voxels))) * voxels;
      const Buffer<std::byte> small = brick_at(corner, voxels);
      ASSERT_EQ(VolumeBrickView{small}.interpolate(p), VolumeBrickView{large}.interpolate(p));
    }
  }
}

TEST(VolumeBrick, cells_know_the_largest_value_that_interpolation_finds_in_them) {
  const Buffer<std::byte> bytes = brick_at({0, 0, 0}, 16);
  const VolumeBrickView brick{bytes};
  std::mt19937 random(4);
  std::uniform_real_distribution<float> u(0, 16);
  for (int i = 0; i < 20000; ++i) {
    const Float3 p{u(random), u(random), u(random)};
    const int cell = static_cast<int>(p.z / 8) * 4 + static_cast<int>(p.y / 8) * 2 + static_cast<int>(p.x / 8);
    ASSERT_LE(brick.interpolate(p), brick.cell_max()[cell] * (1 + 1e-6f));
  }
}

TEST(VolumeBrick, every_prefix_and_every_flipped_byte_is_refused) {
  const Buffer<std::byte> bytes = brick_at({0, 0, 0}, 8);
  for (size_t size = 0; size < bytes.size(); ++size)
    ASSERT_FALSE(validate_volume_brick({bytes.data(), size}, "brick")) << size;
  std::vector<std::byte> copy(bytes.begin(), bytes.end());
  for (std::byte& b : copy) {
    b ^= std::byte{0x10};
    ASSERT_FALSE(validate_volume_brick(copy, "brick"));
    b ^= std::byte{0x10};
  }
}

TEST(VolumeBrick, impossible_contents_are_refused_under_a_right_checksum) {
  const auto damaged = [](size_t offset, auto value) {
    const Buffer<std::byte> bytes = brick_at({0, 0, 0}, 8, VoxelType::single_float);
    std::vector<std::byte> copy(bytes.begin(), bytes.end());
    std::memcpy(copy.data() + offset, &value, sizeof value);
    const size_t from = offsetof(VolumeBrickHeader, size_bytes);
    const uint64_t sum = checksum(copy.data() + from, copy.size() - from);
    std::memcpy(copy.data() + offsetof(VolumeBrickHeader, checksum), &sum, sizeof sum);
    return validate_volume_brick(copy, "v.bricks: brick 3");
  };
  EXPECT_TRUE(damaged(offsetof(VolumeBrickHeader, corner), int32_t{8}));
  for (const Status& status :
       {damaged(offsetof(VolumeBrickHeader, corner), int32_t{3}), damaged(offsetof(VolumeBrickHeader, corner), 1 << 30),
        damaged(offsetof(VolumeBrickHeader, voxels), int32_t{16}), damaged(offsetof(VolumeBrickHeader, voxels), -8),
        damaged(offsetof(VolumeBrickHeader, type), uint32_t{7}),
        damaged(offsetof(VolumeBrickHeader, channels), uint32_t{3}),
        damaged(offsetof(VolumeBrickHeader, channels), uint32_t{0}), damaged(sizeof(VolumeBrickHeader), -1.0f),
        damaged(sizeof(VolumeBrickHeader) + 4, NAN), damaged(sizeof(VolumeBrickHeader) + 400, INFINITY)}) {
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().message.find("v.bricks: brick 3: "), 0u) << status.error().message;
  }
}

TEST(VolumeTable, finds_bricks_and_majorants) {
  VolumeTablesBuilder builder;
  builder.begin_grid({-20, 0, 0}, {40, 16, 8}, 16);
  EXPECT_EQ(builder.grids[0].corner[0], -64);
  EXPECT_EQ(builder.grids[0].brick_count[0], (40 + 64 + 15) / 16);
  const Corner corners[] = {{-32, 0, 0}, {32, 0, 0}};
  for (const Corner& corner : corners) {
    const Buffer<std::byte> bytes = brick_at(corner, 16);
    ASSERT_TRUE(builder.add_brick(VolumeBrickView{bytes}, {builder.bricks.size() * 65536, bytes.size()}, "a"));
  }
  const VolumeTables tables = builder.view();
  ASSERT_TRUE(validate_volume_tables(tables, "manifest"));
  const VolumeGrid& grid = tables.grids[0];
  EXPECT_EQ(tables.brick_of(grid, {(-32 + 64) / 8, 0, 0}), 0u);
  EXPECT_EQ(tables.brick_of(grid, {(-24 + 64) / 8, 1, 1}), 0u);
  EXPECT_EQ(tables.brick_of(grid, {(0 + 64) / 8, 0, 0}), kNoBrick);
  EXPECT_EQ(tables.brick_of(grid, {(32 + 64) / 8, 0, 0}), 1u);
  const Buffer<std::byte> second = brick_at(corners[1], 16);
  EXPECT_EQ(tables.majorant(grid, 1, {(40 + 64) / 8, 1, 0}), VolumeBrickView{second}.cell_max()[3]);

  const Buffer<std::byte> outside = brick_at({64, 0, 0}, 16), again = brick_at(corners[0], 16);
  EXPECT_FALSE(builder.add_brick(VolumeBrickView{outside}, {0, outside.size()}, "a"));
  EXPECT_FALSE(builder.add_brick(VolumeBrickView{again}, {0, again.size()}, "a"));
}

TEST(VolumeTable, tables_that_contradict_each_other_are_refused) {
  const auto damaged = [](const auto& damage) {
    VolumeTablesBuilder builder;
    builder.begin_grid({0, 0, 0}, {16, 16, 16}, 16);
    const Buffer<std::byte> bytes = brick_at({0, 0, 0}, 16);
    EXPECT_TRUE(builder.add_brick(VolumeBrickView{bytes}, {4096, bytes.size()}, "a"));
    damage(builder);
    return static_cast<bool>(validate_volume_tables(builder.view(), "manifest"));
  };
  using Tables = VolumeTablesBuilder;
  EXPECT_TRUE(damaged([](Tables&) {}));
  EXPECT_FALSE(damaged([](Tables& t) { t.grids[0].brick_count[1] = 1 << 30; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.grids[0].brick_count[1] = -1; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.grids[0].corner[2] = 5; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.grids[0].brick_voxels = 0; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.grids[0].first_entry = UINT32_MAX; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.grids[0].brick_total = 2; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.grids[0].value_max = NAN; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.entries[0] = 1; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.cell_max[0] = -1; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.cell_max.pop_back(); }));
  EXPECT_FALSE(damaged([](Tables& t) { t.bricks[0].offset_bytes = 1; }));
  EXPECT_FALSE(damaged([](Tables& t) { t.bricks[0].size_bytes = 0; }));
}

}  // namespace
}  // namespace spillway::cache
