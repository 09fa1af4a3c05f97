#include "cache/attribute_block.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "cache/base/hash.h"
#include "cache/compact_segment.h"

namespace spillway::cache {
namespace {

constexpr size_t kChecksumAt = offsetof(AttributeBlockHeader, checksum);
constexpr size_t kChecksummedFrom = offsetof(AttributeBlockHeader, size_bytes);

AttributeSegmentData quad(uint32_t mesh, uint32_t first_prim, bool normals, bool uvs) {
  AttributeSegmentData data;
  data.mesh = mesh, data.first_prim = first_prim;
  data.indices = {0, 1, 2, 0, 2, 3};
  for (int i = 0; i < 4; ++i) {
    const auto x = static_cast<float>(i), m = static_cast<float>(mesh);
    data.positions.push_back({x, m, 0.1f * x});
    if (normals) data.normals.push_back({0, x, m});
    if (uvs) data.uvs.push_back({x, 100 + m});
  }
  return data;
}

// Three meshes with different columns; prims 10 to 15.
std::vector<AttributeSegmentData> three_quads() {
  return {quad(3, 10, true, true), quad(4, 12, false, true), quad(7, 14, false, false)};
}

// Walls along `up` with a window in each storey, every quad with vertices of its own; 2 * windows * storeys faces.
AttributeSegmentData walls(uint32_t mesh, uint32_t first_prim, int up, int windows, int storeys) {
  AttributeSegmentData data;
  data.mesh = mesh, data.first_prim = first_prim;
  for (int w = 0; w < windows; ++w) {
    for (int s = 0; s < storeys; ++s) {
      const auto first = static_cast<uint16_t>(data.positions.size());
      for (int corner = 0; corner < 4; ++corner) {
        const int along = w + (corner == 1 || corner == 2 ? 1 : 0), above = s + corner / 2;
        Float3 p{};
        p[up] = above == 0 ? -0.0f : 3.1f * static_cast<float>(above);
        p[(up + 1) % 3] = 0.7f * static_cast<float>(along);
        p[(up + 2) % 3] = along == 0 ? -0.0f : 0.3f * static_cast<float>(along);
        data.positions.push_back(p);
      }
      for (const uint16_t corner : {0, 1, 2, 0, 2, 3}) data.indices.push_back(static_cast<uint16_t>(first + corner));
    }
  }
  return data;
}

const AttributeSegment& segment_of(std::span<const std::byte> block, size_t index) {
  return reinterpret_cast<const AttributeSegment*>(block.data() + sizeof(AttributeBlockHeader))[index];
}

void expect_positions(std::span<const std::byte> block, const AttributeSegmentData& data) {
  for (size_t corner = 0; corner < data.indices.size(); ++corner) {
    const TriangleAttributes t =
        triangle_attributes(block, PrimId{data.first_prim + static_cast<uint32_t>(corner / 3)});
    ASSERT_EQ(0, std::memcmp(&t.position_object[corner % 3], &data.positions[data.indices[corner]], sizeof(Float3)))
        << corner;
  }
}

std::vector<std::byte> bytes_of(std::span<const AttributeSegmentData> segments) {
  const Buffer<std::byte> block = build_attribute_block(segments);
  return {block.begin(), block.end()};
}

void set_checksum(std::span<std::byte> block) {
  const uint64_t sum = checksum(block.data() + kChecksummedFrom, block.size() - kChecksummedFrom);
  std::memcpy(block.data() + kChecksumAt, &sum, sizeof sum);
}

// Reads everything a reader could read; under the sanitizers this is the test.
void read_all(std::span<const std::byte> block) {
  const auto& header = *reinterpret_cast<const AttributeBlockHeader*>(block.data());
  for (uint32_t p = 0; p < header.prim_count; ++p) {
    const TriangleAttributes triangle = triangle_attributes(block, PrimId{header.first_prim + p});
    for (const Float3& position : triangle.position_object) EXPECT_TRUE(is_finite(position));
  }
}

TEST(attribute_block, every_triangle_comes_back_bit_equal) {
  const auto segments = three_quads();
  const auto block = bytes_of(segments);
  ASSERT_TRUE(validate_attribute_block(block, "test"));
  for (const AttributeSegmentData& data : segments) {
    for (uint32_t face = 0; face < 2; ++face) {
      const TriangleAttributes t = triangle_attributes(block, PrimId{data.first_prim + face});
      EXPECT_EQ(t.mesh.value, data.mesh);
      EXPECT_EQ(t.has_normals, !data.normals.empty());
      EXPECT_EQ(t.has_uvs, !data.uvs.empty());
      for (int k = 0; k < 3; ++k) {
        const uint16_t v = data.indices[3 * face + k];
        EXPECT_EQ(0, std::memcmp(&t.position_object[k], &data.positions[v], sizeof(Float3)));
        const Float3 normal = data.normals.empty() ? Float3{0, 0, 0} : data.normals[v];
        EXPECT_EQ(0, std::memcmp(&t.normal_object[k], &normal, sizeof(Float3)));
        const Float2 uv = data.uvs.empty() ? Float2{0, 0} : data.uvs[v];
        EXPECT_EQ(0, std::memcmp(&t.uv[k], &uv, sizeof(Float2)));
      }
    }
  }
}

TEST(attribute_block, largest_segment_fits) {
  AttributeSegmentData data;
  data.mesh = 0, data.first_prim = 0;
  for (uint32_t i = 0; i < 3 * kMaxFacesPerAttributeBlock; ++i) {
    data.indices.push_back(static_cast<uint16_t>(i));
    data.positions.push_back({static_cast<float>(i), 0, 1});
  }
  const auto block = bytes_of({&data, 1});
  ASSERT_TRUE(validate_attribute_block(block, "test"));
  const TriangleAttributes last = triangle_attributes(block, PrimId{kMaxFacesPerAttributeBlock - 1});
  EXPECT_EQ(last.position_object[2].x, static_cast<float>(3 * kMaxFacesPerAttributeBlock - 1));
}

TEST(attribute_block, walls_take_less_than_half_and_come_back_bit_equal) {
  for (int up = 0; up < 3; ++up) {
    const AttributeSegmentData data = walls(0, 0, up, 100, 20);
    const auto block = bytes_of({&data, 1});
    ASSERT_TRUE(validate_attribute_block(block, "test"));
    const AttributeSegment& segment = segment_of(block, 0);
    EXPECT_EQ(segment.flags, kNarrowIndices | kPairedPositions | static_cast<uint32_t>(up) << kLoneAxisShift);
    EXPECT_EQ(segment.lone_count, 21u);
    EXPECT_EQ(segment.pair_count, 101u);
    EXPECT_LT(block.size(), data.indices.size() * sizeof(uint16_t) / 2 + data.positions.size() * sizeof(Float3) / 2);
    expect_positions(block, data);
  }
}

TEST(attribute_block, a_vertex_asked_for_long_ago_is_there_twice) {
  // A fan: every face asks for the first vertex. A reach of 208 vertices, and a rim of 1000.
  AttributeSegmentData fan;
  fan.mesh = 0, fan.first_prim = 0;
  for (uint16_t i = 0; i < 1000; ++i) {
    const auto x = static_cast<float>(i);
    fan.positions.push_back({std::cos(x), std::sin(x), x});
    fan.normals.push_back({x, 1, 0});
    if (i > 1) fan.indices.insert(fan.indices.end(), {0, static_cast<uint16_t>(i - 1), i});
  }
  const auto block = bytes_of({&fan, 1});
  ASSERT_TRUE(validate_attribute_block(block, "test"));
  EXPECT_EQ(segment_of(block, 0).flags, kNarrowIndices | kHasNormals);
  EXPECT_GT(segment_of(block, 0).vertex_count, 1003u);
  EXPECT_LT(segment_of(block, 0).vertex_count, 1010u);
  expect_positions(block, fan);
  for (uint32_t f = 0; f < 998; ++f)
    EXPECT_EQ(triangle_attributes(block, PrimId{f}).normal_object[2].x, static_cast<float>(f + 2));
}

TEST(attribute_block, vertices_in_any_order_keep_their_indices) {
  AttributeSegmentData data;
  data.mesh = 0, data.first_prim = 0;
  for (uint32_t i = 0; i < 4000; ++i) {
    const auto x = static_cast<float>(i);
    data.positions.push_back({std::sin(x), std::sin(2 * x), std::sin(3 * x)});
    for (uint32_t k = 1; k < 4; ++k) data.indices.push_back(static_cast<uint16_t>(i * 1237 * k % 4000));
  }
  const auto block = bytes_of({&data, 1});
  ASSERT_TRUE(validate_attribute_block(block, "test"));
  EXPECT_EQ(segment_of(block, 0).flags, 0u);
  expect_positions(block, data);
}

TEST(attribute_block, every_prefix_is_refused) {
  const auto block = bytes_of(three_quads());
  for (size_t size = 0; size < block.size(); ++size) {
    const std::vector<std::byte> prefix(block.begin(), block.begin() + static_cast<ptrdiff_t>(size));
    EXPECT_FALSE(validate_attribute_block(prefix, "test")) << size;
  }
}

TEST(attribute_block, every_flipped_byte_is_refused) {
  auto block = bytes_of(three_quads());
  for (size_t i = 0; i < block.size(); ++i) {
    block[i] ^= std::byte{0x41};
    EXPECT_FALSE(validate_attribute_block(block, "test")) << i;
    block[i] ^= std::byte{0x41};
  }
}

TEST(attribute_block, flipped_bytes_under_a_right_checksum_are_refused_or_can_be_read) {
  auto segments = three_quads();
  segments.push_back(walls(9, 16, 2, 8, 3));
  const auto whole = bytes_of(segments);
  ASSERT_EQ(segment_of(whole, 3).flags, kNarrowIndices | kPairedPositions | 2u << kLoneAxisShift);
  size_t refused = 0;
  for (size_t i = kChecksummedFrom; i < whole.size(); ++i) {
    for (const std::byte flip : {std::byte{0x01}, std::byte{0x80}, std::byte{0xff}}) {
      auto block = whole;
      block[i] ^= flip;
      set_checksum(block);
      if (validate_attribute_block(block, "test"))
        read_all(block);
      else
        ++refused;
    }
  }
  // Nearly every bit of header and segment table matters: 24 and 240 bytes, three flips each, but for first_prim (alone
  // it contradicts the segments) and mesh (any ascending number is possible).
  EXPECT_GT(refused, 3u * (24 + 240 - 4 * 4) - 1);
}

TEST(attribute_block, not_finite_is_refused) {
  auto segments = three_quads();
  for (const float bad : {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    segments[0].positions[2].y = bad;
    EXPECT_FALSE(validate_attribute_block(bytes_of(segments), "test"));
    segments = three_quads();
    segments[0].normals[3].z = bad;
    EXPECT_FALSE(validate_attribute_block(bytes_of(segments), "test"));
    segments = three_quads();
    segments[1].uvs[0].x = bad;
    EXPECT_FALSE(validate_attribute_block(bytes_of(segments), "test"));
    segments = three_quads();
  }
}

TEST(attribute_block, index_beyond_the_vertices_is_refused) {
  auto block = bytes_of(three_quads());
  ASSERT_EQ(segment_of(block, 2).flags, uint32_t{kNarrowIndices});
  block[segment_of(block, 2).indices_offset + 5] = std::byte{4};
  set_checksum(block);
  const Status status = validate_attribute_block(block, "block 7");
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("block 7"), std::string::npos);
  EXPECT_NE(status.error().message.find("index 4 of 4"), std::string::npos);
}

TEST(attribute_block, coordinates_beyond_the_tables_are_refused) {
  const AttributeSegmentData data = walls(0, 0, 2, 8, 3);
  const auto whole = bytes_of({&data, 1});
  const AttributeSegment& segment = segment_of(whole, 0);
  for (const size_t field : {offsetof(PositionCode, pair), offsetof(PositionCode, lone)}) {
    auto block = whole;
    const auto beyond =
        static_cast<uint16_t>(field == offsetof(PositionCode, pair) ? segment.pair_count : segment.lone_count);
    std::memcpy(block.data() + segment.positions_offset + 5 * sizeof(PositionCode) + field, &beyond, sizeof beyond);
    set_checksum(block);
    const Status status = validate_attribute_block(block, "block 7");
    ASSERT_FALSE(status);
    EXPECT_NE(status.error().message.find("a position made of coordinate"), std::string::npos);
  }
}

TEST(attribute_block, meshes_out_of_order_are_refused) {
  auto segments = three_quads();
  segments[1].mesh = 3;
  EXPECT_FALSE(validate_attribute_block(bytes_of(segments), "test"));
}

}  // namespace
}  // namespace spillway::cache
