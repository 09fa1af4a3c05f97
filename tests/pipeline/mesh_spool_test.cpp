#include "pipeline/pack/mesh_spool.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

cache::AttributeSegmentData random_chunk(std::mt19937& random) {
  std::uniform_real_distribution<float> place(-10, 10);
  const size_t faces = 1 + random() % (random() % 20 == 0 ? 16384 : 200), vertices = 3 + random() % (3 * faces);
  cache::AttributeSegmentData data;
  for (size_t i = 0; i < 3 * faces; ++i) data.indices.push_back(static_cast<uint16_t>(random() % vertices));
  const auto point = [&] { return Float3{place(random), place(random), place(random)}; };
  const bool has_normals = random() % 2 == 0, has_uvs = random() % 3 == 0;
  for (size_t v = 0; v < vertices; ++v) {
    data.positions.push_back(point());
    if (has_normals) data.normals.push_back(point());
    if (has_uvs) data.uvs.push_back({place(random), place(random)});
  }
  return data;
}

template <class T>
bool same(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

class MeshSpoolTest : public testing::Test {
 protected:
  void SetUp() override {
    auto scratch = cache::Scratch::create(directory_.path());
    ASSERT_TRUE(scratch);
    scratch_ = std::move(*scratch);
  }
  // Appends chunks of every lane in turn.
  void fill(MeshSpool& spool, uint32_t lanes, size_t count) {
    std::mt19937 random(lanes);
    for (size_t i = 0; i < count; ++i) {
      data_.push_back(random_chunk(random));
      lane_.push_back(static_cast<uint32_t>(i) % lanes);
      const auto chunk = spool.append(data_.back(), lane_.back());
      ASSERT_TRUE(chunk) << chunk.error().message;
      chunks_.push_back(*chunk);
    }
    ASSERT_TRUE(spool.seal());
  }

  test::TemporaryDirectory directory_;
  std::unique_ptr<cache::Scratch> scratch_;
  std::vector<cache::AttributeSegmentData> data_;
  std::vector<uint32_t> lane_;
  std::vector<MeshChunk> chunks_;
};

TEST_F(MeshSpoolTest, every_chunk_comes_back_whatever_the_lane_and_order) {
  for (const uint32_t lanes : {1u, 5u, 200u}) {
    data_.clear(), lane_.clear(), chunks_.clear();
    auto spool = MeshSpool::create(*scratch_);
    ASSERT_TRUE(spool);
    fill(*spool, lanes, 500);
    SpoolReader reader(*spool);
    std::mt19937 random(1);
    for (size_t n = 0; n < 2 * chunks_.size(); ++n) {
      const size_t i = n < chunks_.size() ? n : random() % chunks_.size();
      const auto all = reader.read(chunks_[i], true);
      ASSERT_TRUE(all) << all.error().message;
      EXPECT_TRUE(same<uint16_t>(all->indices, data_[i].indices) && same<Float3>(all->positions, data_[i].positions) &&
                  same<Float3>(all->normals, data_[i].normals) && same<Float2>(all->uvs, data_[i].uvs))
          << i;
      const auto view = reader.view(chunks_[i]);
      ASSERT_TRUE(view);
      EXPECT_TRUE(same<uint16_t>(view->indices, data_[i].indices) && same<Float3>(view->positions, data_[i].positions))
          << i;
    }
  }
}

// Meshes are packed by material: reading lane after lane must not read the file once a lane.
TEST_F(MeshSpoolTest, a_lane_is_read_without_its_neighbours) {
  auto spool = MeshSpool::create(*scratch_);
  ASSERT_TRUE(spool);
  fill(*spool, 20, 4000);
  const uint64_t before = cache::io_use(cache::IoPurpose::pack).read_bytes;
  for (uint32_t lane = 0; lane < 20; ++lane) {
    SpoolReader reader(*spool);
    for (size_t i = 0; i < chunks_.size(); ++i) {
      if (lane_[i] != lane) continue;
      ASSERT_TRUE(reader.read(chunks_[i], true));
    }
  }
  uint64_t bytes = 0;
  for (const MeshChunk& chunk : chunks_) bytes += chunk_bytes(chunk, true);
  // Beyond the bytes themselves: what is left at the end of a region.
  EXPECT_LT(cache::io_use(cache::IoPurpose::pack).read_bytes - before, 2 * bytes);
}

}  // namespace
}  // namespace spillway::pipeline
