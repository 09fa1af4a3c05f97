// .facetex files: what is written is what is read, whatever reads it, and nothing else is.

#include "cache/base/parallel.h"
#include "cache/facetex_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <random>

#include "cache/base/hash.h"
#include "cache/facetex_writer.h"
#include "tests/support/face_mesh.h"
#include "tests/support/small_scene.h"

namespace spillway::cache {
namespace {

std::vector<std::byte> random_texels(std::mt19937& random, size_t bytes, FaceTexelType type) {
  std::vector<std::byte> texels(bytes);
  for (size_t i = 0; i < bytes; ++i)
    texels[i] = static_cast<std::byte>(random() % (type == FaceTexelType::uint8 ? 256 : 60));
  return texels;
}

class FaceTexTest : public testing::Test {
 protected:
  struct Face {
    uint8_t ulog2, vlog2;
    bool is_constant;
  };
  // Sizes below, at and above a tile; several faces a class.
  static std::vector<Face> sizes() {
    return {{3, 2, false}, {6, 6, false}, {0, 0, false}, {8, 7, false}, {3, 2, false}, {5, 5, true}, {1, 7, false},
            {7, 1, false}, {3, 2, false}, {6, 6, false}, {2, 8, false}, {5, 0, true},  {3, 2, false}};
  }
  FaceTextureShape shape(const std::vector<Face>& faces) const {
    FaceTextureShape made{"paint", FaceShape::quad, FaceBorder::black, FaceBorder::periodic, {}};
    for (const Face& f : faces) {
      made.faces.emplace_back();
      made.faces.back().ulog2 = f.ulog2, made.faces.back().vlog2 = f.vlog2;
      if (f.is_constant) made.faces.back().flags = kFaceIsConstant;
    }
    return made;
  }
  // Writes two textures; texels_ is what was given.
  void write(const FaceTexFormat& format, uint32_t seed = 1) {
    std::mt19937 random(seed);
    auto writer = FaceTexWriter::create(path_, format);
    ASSERT_TRUE(writer) << writer.error().message;
    texels_.clear();
    for (int t = 0; t < 2; ++t) {
      ASSERT_TRUE((*writer)->begin_texture(shape(sizes())));
      for (const Face& f : sizes()) {
        const size_t count = f.is_constant ? 1 : size_t{1} << (f.ulog2 + f.vlog2);
        texels_.push_back(random_texels(random, count * format.texel_bytes(), format.type));
        const Status added = (*writer)->add_face(texels_.back());
        ASSERT_TRUE(added) << added.error().message;
      }
    }
    const Status finished = (*writer)->finish();
    ASSERT_TRUE(finished) << finished.error().message;
  }
  std::string bytes() const {
    std::ifstream stream(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  void put(const std::string& bytes) const {
    std::ofstream(path_, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path path_ = directory_.path() / "some.facetex";
  std::vector<std::vector<std::byte>> texels_;
};

TEST_F(FaceTexTest, what_is_written_is_read_for_every_type_channel_count_and_codec) {
  for (const FaceTexelType type :
       {FaceTexelType::uint8, FaceTexelType::uint16, FaceTexelType::half, FaceTexelType::float32})
    for (const uint32_t channels : {1u, 2u, 3u, 4u})
      for (const FaceTexCodec codec : {FaceTexCodec::none, FaceTexCodec::lz4, FaceTexCodec::zstd}) {
        // Sizes of tiles by turns.
        const uint32_t tile_log2 = kLeastFaceTileLog2 + (channels + static_cast<uint32_t>(codec)) % 3;
        write({type, channels, channels > 3 ? 3 : -1, FaceTexEncoding::linear, 1, codec, tile_log2});
        const auto file = FaceTexFile::open(path_, {});
        ASSERT_TRUE(file) << file.error().message;
        ASSERT_EQ(file->textures().size(), 2u);
        EXPECT_EQ(file->format().codec, codec);
        EXPECT_EQ(file->format().tile_edge(), 1u << tile_log2);
        EXPECT_EQ(file->images().front().width, std::max(1u << file->images().front().ulog2, 1u << tile_log2));
        EXPECT_EQ(file->textures()[1].v_border, FaceBorder::periodic);
        EXPECT_STREQ(file->textures()[1].name, "paint");
        for (size_t i = 0; i < texels_.size(); ++i) {
          const auto got =
              file->texels(file->textures()[i / sizes().size()], static_cast<uint32_t>(i % sizes().size()), 0);
          ASSERT_TRUE(got) << got.error().message;
          EXPECT_TRUE(*got == texels_[i]) << i;
        }
      }
}

TEST_F(FaceTexTest, coarser_levels_are_means_in_linear_light_rounded_to_the_nearest) {
  const FaceTexFormat format{FaceTexelType::uint8, 1, -1, FaceTexEncoding::gamma, 2, FaceTexCodec::lz4};
  auto writer = FaceTexWriter::create(path_, format);
  ASSERT_TRUE(writer);
  ASSERT_TRUE((*writer)->begin_texture(shape({{1, 1, false}, {2, 0, false}})));
  const auto texels = [](std::vector<int> values) {
    std::vector<std::byte> out;
    for (const int v : values) out.push_back(static_cast<std::byte>(v));
    return out;
  };
  ASSERT_TRUE((*writer)->add_face(texels({0, 100, 200, 255})));
  ASSERT_TRUE((*writer)->add_face(texels({10, 10, 250, 0})));
  ASSERT_TRUE((*writer)->finish());
  const auto file = FaceTexFile::open(path_, {});
  ASSERT_TRUE(file) << file.error().message;
  const auto mean = [](std::vector<double> values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return static_cast<std::byte>(static_cast<int>(std::lround(std::sqrt(sum / static_cast<double>(values.size())))));
  };
  EXPECT_EQ((*file->texels(file->textures()[0], 0, 1))[0], mean({0, 100, 200, 255}));
  const auto second = file->texels(file->textures()[0], 1, 1);
  EXPECT_TRUE(*second == (std::vector<std::byte>{std::byte{10}, mean({250, 0})}));
  EXPECT_EQ((*file->texels(file->textures()[0], 1, 2))[0], mean({10, static_cast<double>((*second)[1])}));
}

TEST_F(FaceTexTest, the_bytes_do_not_depend_on_threads) {
  std::string first;
  for (const int threads : {1, 4}) {
    on_threads(threads, [&] { write({FaceTexelType::uint8, 3}); });
    if (first.empty()) first = bytes();
    EXPECT_TRUE(bytes() == first) << threads;
  }
}

TEST_F(FaceTexTest, small_faces_share_tiles_and_tiles_of_a_large_one_follow_each_other) {
  write({FaceTexelType::uint8, 3});
  const auto file = FaceTexFile::open(path_, {});
  ASSERT_TRUE(file);
  const FaceTexTexture& texture = file->textures()[0];
  const FaceTexImage& small = file->images()[file->first_image(file->faces(texture)[0])];
  EXPECT_EQ(small.face_count, 8u);
  EXPECT_EQ(small.tile_count, 1u);
  const FaceTexImage& large = file->images()[file->first_image(file->faces(texture)[3])];  // 256 x 128, of each texture
  ASSERT_EQ(large.tile_count, 16u);
  for (uint64_t t = large.first_tile; t + 1 < large.first_tile + 16; ++t)
    EXPECT_EQ(file->tiles()[t].offset + file->tiles()[t].size_bytes, file->tiles()[t + 1].offset) << t;
}

TEST_F(FaceTexTest, faces_that_are_wrong_or_missing_are_refused_and_leave_nothing) {
  auto writer = FaceTexWriter::create(path_, {});
  ASSERT_TRUE(writer);
  FaceTextureShape lonely = shape({{2, 2, false}, {2, 2, false}});
  lonely.faces[0].adjacent_faces[1] = 1;
  EXPECT_FALSE((*writer)->begin_texture(lonely));
  ASSERT_TRUE((*writer)->begin_texture(shape({{2, 2, false}})));
  EXPECT_FALSE((*writer)->add_face(std::vector<std::byte>(47)));
  EXPECT_FALSE((*writer)->finish());
  writer->reset();
  EXPECT_TRUE(std::filesystem::is_empty(directory_.path()));
}

// Opens and reads everything; an error must name the file and a byte.
std::string fault(const std::filesystem::path& path) {
  const auto has_place = [](const Error& e) { return e.message.find("some.facetex: byte ") != std::string::npos; };
  const auto file = FaceTexFile::open(path, {});
  if (!file) return has_place(file.error()) ? "" : file.error().message;
  std::vector<std::byte> tile(file->format().tile_bytes());
  for (uint64_t t = 0; t < file->tiles().size(); ++t)
    if (const Status read = file->read_tile(t, tile); !read && !has_place(read.error())) return read.error().message;
  for (const FaceTexTexture& texture : file->textures())
    for (uint32_t f = 0; f < texture.face_count; ++f)
      if (const auto texels = file->texels(texture, f, 0); !texels && !has_place(texels.error()))
        return texels.error().message;
  return {};
}

TEST_F(FaceTexTest, every_prefix_is_refused) {
  write({FaceTexelType::uint8, 1});
  const std::string whole = bytes();
  for (size_t size = 0; size < whole.size(); size += size < 2000 || size + 2000 > whole.size() ? 1 : 97) {
    put(whole.substr(0, size));
    const auto file = FaceTexFile::open(path_, {});
    ASSERT_FALSE(file) << size;
    EXPECT_NE(file.error().message.find("byte "), std::string::npos) << file.error().message;
  }
}

// With the checksums made right again, so that what lies behind them is looked at.
std::string with_right_checksums(std::string bytes) {
  FaceTexTrailer trailer;
  const size_t at = bytes.size() - sizeof trailer;
  std::memcpy(&trailer, bytes.data() + at, sizeof trailer);
  if (trailer.textures_offset < at)
    trailer.tables_checksum = checksum(bytes.data() + trailer.textures_offset, at - trailer.textures_offset);
  trailer.checksum = checksum(reinterpret_cast<const char*>(&trailer) + 8, sizeof trailer - 8);
  std::memcpy(bytes.data() + at, &trailer, sizeof trailer);
  return bytes;
}

TEST_F(FaceTexTest, a_size_of_tiles_that_is_none_is_refused_with_its_place) {
  write({FaceTexelType::uint8, 1});
  const std::string whole = bytes();
  const size_t at = whole.size() - sizeof(FaceTexTrailer);
  for (const uint32_t log2 : {0u, 4u, 8u, 31u, 32u, 0xffffffffu}) {
    std::string changed = whole;
    std::memcpy(changed.data() + at + offsetof(FaceTexTrailer, format.tile_log2), &log2, sizeof log2);
    put(with_right_checksums(changed));
    const auto file = FaceTexFile::open(path_, {});
    ASSERT_FALSE(file) << log2;
    const std::string place = "byte " + std::to_string(at + offsetof(FaceTexTrailer, format));
    EXPECT_NE(file.error().message.find(place), std::string::npos) << file.error().message;
  }
  // Another one of those that are possible has other tiles.
  for (const uint32_t log2 : {5u, 7u}) {
    std::string changed = whole;
    std::memcpy(changed.data() + at + offsetof(FaceTexTrailer, format.tile_log2), &log2, sizeof log2);
    put(with_right_checksums(changed));
    EXPECT_FALSE(FaceTexFile::open(path_, {})) << log2;
  }
}

TEST_F(FaceTexTest, flipped_bits_are_refused_or_harmless_whether_or_not_checksums_notice) {
  write({FaceTexelType::uint8, 1});
  const std::string whole = bytes();
  FaceTexTrailer trailer;
  std::memcpy(&trailer, whole.data() + whole.size() - sizeof trailer, sizeof trailer);
  std::mt19937 random(5);
  for (size_t at = trailer.textures_offset; at < whole.size(); at += 1 + random() % 3) {
    std::string flipped = whole;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << random() % 8));
    put(flipped);
    EXPECT_FALSE(FaceTexFile::open(path_, {})) << at;
    put(with_right_checksums(flipped));
    EXPECT_EQ(fault(path_), "") << at;
  }
  for (size_t at = sizeof(FaceTexFront); at < trailer.textures_offset; at += 400) {
    std::string flipped = whole;
    flipped[at] = static_cast<char>(flipped[at] ^ 4);
    put(flipped);
    const auto file = FaceTexFile::open(path_, {});
    ASSERT_TRUE(file) << file.error().message;
    std::vector<std::byte> tile(file->format().tile_bytes());
    int refused = 0;
    for (uint64_t t = 0; t < file->tiles().size(); ++t) refused += !file->read_tile(t, tile);
    EXPECT_EQ(refused, 1) << at;
  }
}

}  // namespace
}  // namespace spillway::cache
