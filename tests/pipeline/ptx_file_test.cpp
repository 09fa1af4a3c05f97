// .ptx files: those of the reference library against what it answers, others by the writer of tests/support.

#include "pipeline/pack/ptx_file.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "pipeline/pack/ptx_writer.h"
#include "tests/fuzz/ptx_entry.h"
#include "tests/support/ptex_filter.h"
#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

using cache::FaceInfo;
using cache::FaceShape;
using cache::FaceTexelType;
using nlohmann::json;
using test::PtexFilterKind;




// All that the library was asked lies beside some copies of this repository.
std::filesystem::path values_file(const std::string& name) {
  const std::filesystem::path source = SPILLWAY_SOURCE_DIR, all = source / "../shared/ptex" / (name + ".json");
  return std::filesystem::exists(all) ? all : source / "tests/data/ptex" / (name + ".json");
}

json values_of(const std::string& name) {
  std::ifstream stream(values_file(name));
  return json::parse(stream);
}

PtxFile open_reference(const std::string& name, bool premultiply = false) {
  const auto path = std::filesystem::path(SPILLWAY_SOURCE_DIR) / "tests/data/ptex" / (name + ".ptx");
  auto file = PtxFile::open(path, {.premultiply = premultiply});
  if (!file) throw std::runtime_error(file.error().message);
  return std::move(*file);
}

uint32_t fnv1a(const std::vector<std::byte>& bytes) {
  uint32_t hash = 2166136261u;
  for (const std::byte b : bytes) hash = (hash ^ static_cast<uint32_t>(b)) * 16777619u;
  return hash;
}

struct Reference {
  const char* values;
  const char* file;
  bool premultiply;
  double most_at_corners = 0.5 / 255;  // of the range: where no four quads meet, see docs/facetex.md
};

class ReferencePtx : public testing::TestWithParam<Reference> {
 protected:
  json values_ = values_of(GetParam().values);
  PtxFile file_ = open_reference(GetParam().file, GetParam().premultiply);
};

TEST_P(ReferencePtx, faces_have_the_sizes_flags_neighbours_and_texels_of_the_library) {
  ASSERT_EQ(file_.faces().size(), values_["faces"].size());
  for (const json& wanted : values_["faces"]) {
    const uint32_t f = wanted["id"];
    const FaceInfo& face = file_.faces()[f];
    EXPECT_EQ(face.ulog2, wanted["ulog2"]);
    EXPECT_EQ(face.vlog2, wanted["vlog2"]);
    EXPECT_EQ(face.flags, wanted["flags"]);
    for (uint32_t e = 0; e < cache::edge_count(file_.info().shape); ++e) {
      EXPECT_EQ(static_cast<int32_t>(face.adjacent_faces[e]), wanted["adjfaces"][e]);
      EXPECT_EQ(face.adjacent_edge(e), wanted["adjedges"][e]);
    }
    const auto texels = file_.texels(f);
    ASSERT_TRUE(texels) << texels.error().message;
    EXPECT_EQ(fnv1a(*texels), wanted["fnv1a_rawbytes"]) << "face " << f;
  }
}

TEST_P(ReferencePtx, texels_of_every_resolution_are_those_of_the_library) {
  test::PtexFilter filter(file_);
  for (const json& wanted : values_["pixels"]) {
    const auto got = filter.texel(wanted["face"], wanted["ulog2"], wanted["vlog2"], wanted["ui"], wanted["vi"]);
    for (size_t c = 0; c < got.size(); ++c)
      EXPECT_FLOAT_EQ(static_cast<float>(got[c]), wanted["value"][c].get<float>()) << wanted.dump();
  }
}

PtexFilterKind kind_of(const std::string& name) {
  if (name == "point") return PtexFilterKind::point;
  if (name == "bilinear") return PtexFilterKind::bilinear;
  return name == "box" ? PtexFilterKind::box : PtexFilterKind::bspline;
}

test::PtexLookup lookup_of(const json& s) {
  return {s["face"], s["u"],           s["v"],     s["uw1"], s["vw1"], s["uw2"], s["vw2"], kind_of(s["filter"]),
          s["lerp"], s["noedgeblend"], s["width"], s["blur"]};
}

TEST_P(ReferencePtx, filtered_values_are_within_half_an_8_bit_step_away_from_extraordinary_corners) {
  test::PtexFilter filter(file_);
  const double largest = file_.info().type == FaceTexelType::half ? 4 : 1;
  double worst = 0, worst_at_corners = 0;
  size_t count = 0, at_corners = 0, off_at_corners = 0;
  for (const json& s : values_["samples"]) {
    const std::string name = s["filter"];
    if (name != "point" && name != "bilinear" && name != "box" && name != "bspline") continue;
    const auto got = filter.value(lookup_of(s));
    double difference = 0;
    for (size_t c = 0; c < got.size(); ++c)
      difference = std::max(difference, std::fabs(got[c] - s["value"][c].get<double>()));
    ++count;
    if (filter.met_extraordinary_corner()) {
      ++at_corners, off_at_corners += difference > 0.5 / 255 * largest;
      worst_at_corners = std::max(worst_at_corners, difference);
      continue;
    }
    worst = std::max(worst, difference);
    EXPECT_LE(difference, 0.5 / 255 * largest) << s.dump();
  }
  std::printf(
      "%s: %zu values, off by at most %.5f; %zu at extraordinary corners, %zu of them off by more than half a step, "
      "at most %.4f\n",
      GetParam().values, count, worst, at_corners, off_at_corners, worst_at_corners);
  EXPECT_GT(count, at_corners);
  EXPECT_LE(worst_at_corners, GetParam().most_at_corners * largest);
}

INSTANTIATE_TEST_SUITE_P(Files, ReferencePtx,
                         testing::Values(Reference{"cube", "cube", false}, Reference{"cube_half", "cube_half", false},
                                         Reference{"cube_rgba", "cube_rgba", false},
                                         Reference{"cube_rgba.premult", "cube_rgba", true},
                                         Reference{"quads60", "quads60", false, 0.163},
                                         Reference{"subface_prism6", "subface_prism6", false, 0.167},
                                         Reference{"tri", "tri", false}),
                         [](const auto& given) {
                           std::string name = given.param.values;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

// ---- what those files do not hold ----

std::vector<std::byte> random_texels(size_t bytes, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::byte> texels(bytes);
  for (std::byte& b : texels) b = static_cast<std::byte>(random() % 100);  // as halves and floats: small numbers
  return texels;
}

PtxFace face_of(const PtxInfo& info, uint8_t ulog2, uint8_t vlog2, PtxEncoding encoding, uint32_t seed) {
  PtxFace face;
  face.info.ulog2 = ulog2, face.info.vlog2 = vlog2, face.encoding = encoding;
  face.texels = random_texels((size_t{1} << (ulog2 + vlog2)) * info.channels * texel_type_bytes(info.type), seed);
  return face;
}

class PtxFileTest : public testing::Test {
 protected:
  Result<PtxFile> open(const std::vector<std::byte>& bytes, PtxFile::Options options = {}) {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return PtxFile::open(path_, options);
  }
  // Two quads side by side, of which one is tiled, in every way that the format has.
  static PtxDescription everything(FaceTexelType type, uint32_t channels) {
    PtxDescription d;
    d.info = {
        FaceShape::quad, type, channels, channels > 3 ? 3 : -1, cache::FaceBorder::black, cache::FaceBorder::periodic};
    d.faces = {face_of(d.info, 3, 2, PtxEncoding::differences, 1), face_of(d.info, 3, 4, PtxEncoding::tiled, 2),
               face_of(d.info, 2, 2, PtxEncoding::deflated, 3), face_of(d.info, 0, 2, PtxEncoding::deflated, 4)};
    d.faces[1].tile_ulog2 = 2, d.faces[1].tile_vlog2 = 2;
    d.faces[0].info.adjacent_faces[1] = 1, d.faces[0].info.adjacent_edges = 3 << 2;
    d.faces[1].info.adjacent_faces[3] = 0, d.faces[1].info.adjacent_edges = 1 << 6;
    d.metadata_bytes = 5000;
    return d;
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path path_ = directory_.path() / "some.ptx";
};

TEST_F(PtxFileTest, every_type_channel_count_and_encoding_is_read_exactly) {
  for (const FaceTexelType type :
       {FaceTexelType::uint8, FaceTexelType::uint16, FaceTexelType::half, FaceTexelType::float32})
    for (const uint32_t channels : {1u, 2u, 3u, 4u, 7u}) {
      PtxDescription d = everything(type, channels);
      for (const PtxEncoding of_tiles : {PtxEncoding::deflated, PtxEncoding::differences}) {
        d.faces[1].tile_encoding = of_tiles;
        const auto file = open(ptx_bytes(d));
        ASSERT_TRUE(file) << file.error().message;
        EXPECT_EQ(file->info().channels, channels);
        EXPECT_EQ(file->info().type, type);
        EXPECT_EQ(file->info().u_border, cache::FaceBorder::black);
        EXPECT_EQ(file->info().v_border, cache::FaceBorder::periodic);
        for (uint32_t f = 0; f < d.faces.size(); ++f) {
          const auto texels = file->texels(f);
          ASSERT_TRUE(texels) << texels.error().message;
          EXPECT_TRUE(*texels == d.faces[f].texels) << f;
        }
      }
    }
}

TEST_F(PtxFileTest, constant_faces_and_constant_blocks_fill_their_face) {
  PtxDescription d = everything(FaceTexelType::uint8, 3);
  d.faces[0].info.flags = cache::kFaceIsConstant;
  d.faces[2].encoding = PtxEncoding::constant;
  d.faces[1].tile_encoding = PtxEncoding::constant;
  const auto file = open(ptx_bytes(d));
  ASSERT_TRUE(file) << file.error().message;
  for (const uint32_t f : {0u, 2u}) {
    const auto texels = file->texels(f);
    ASSERT_TRUE(texels);
    for (size_t i = 0; i < texels->size(); ++i) ASSERT_EQ((*texels)[i], d.faces[f].texels[i % 3]);
  }
  const auto tiled = file->texels(1);
  ASSERT_TRUE(tiled);
  for (uint32_t y = 0; y < 16; ++y)
    for (uint32_t x = 0; x < 8; ++x) {
      const size_t corner = (size_t{y / 4 * 4} * 8 + x / 4 * 4) * 3;
      ASSERT_EQ((*tiled)[(y * 8 + x) * 3], d.faces[1].texels[corner]);
    }
}

TEST_F(PtxFileTest, an_edit_replaces_a_face_and_hides_its_stored_reductions) {
  for (const bool says : {true, false}) {
    PtxDescription d = everything(FaceTexelType::uint16, 1);
    d.faces = {face_of(d.info, 3, 3, PtxEncoding::deflated, 1), face_of(d.info, 3, 3, PtxEncoding::deflated, 2)};
    d.reductions = {{face_of(d.info, 2, 2, PtxEncoding::deflated, 3), face_of(d.info, 2, 2, PtxEncoding::deflated, 4)}};
    PtxFace edit = face_of(d.info, 3, 3, PtxEncoding::differences, 5);
    for (size_t i = 0; i < edit.texels.size(); i += 2) edit.texels[i] = std::byte{7}, edit.texels[i + 1] = std::byte{1};
    PtxFace other = face_of(d.info, 1, 2, PtxEncoding::constant, 6);
    d.edits = {{1, face_of(d.info, 2, 2, PtxEncoding::deflated, 9)}, {1, edit}};
    d.says_where_edits_are = says;
    const auto file = open(ptx_bytes(d));
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_EQ(*file->texels(1), edit.texels);
    EXPECT_EQ(*file->texels(0, 2, 2), d.reductions[0][0].texels);
    const auto reduced = file->texels(1, 2, 2);
    ASSERT_TRUE(reduced) << reduced.error().message;
    for (size_t i = 0; i < reduced->size(); i += 2) EXPECT_EQ((*reduced)[i], std::byte{7});
    EXPECT_NE(file->faces()[1].flags & cache::kFaceHasEdits, 0);
  }
}

TEST_F(PtxFileTest, reductions_that_are_not_there_are_means_rounded_down) {
  PtxDescription d;
  d.info.channels = 1;
  d.faces = {face_of(d.info, 1, 1, PtxEncoding::deflated, 1)};
  for (int i = 0; i < 4; ++i)
    d.faces[0].texels[static_cast<size_t>(i)] = std::byte{static_cast<uint8_t>(i == 0   ? 10
                                                                               : i == 1 ? 13
                                                                               : i == 2 ? 20
                                                                                        : 30)};
  const auto file = open(ptx_bytes(d));
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(*file->texels(0, 0, 1), (std::vector<std::byte>{std::byte{11}, std::byte{25}}));
  EXPECT_EQ(*file->texels(0, 1, 0), (std::vector<std::byte>{std::byte{15}, std::byte{21}}));
}

TEST_F(PtxFileTest, colours_are_multiplied_by_their_alpha_when_asked) {
  PtxDescription d;
  d.info.channels = 4, d.info.alpha_channel = 3;
  d.faces = {face_of(d.info, 1, 0, PtxEncoding::deflated, 1)};
  for (size_t i = 0; i < 8; ++i) d.faces[0].texels[i] = std::byte{static_cast<uint8_t>(i % 4 == 3 ? 128 : 200)};
  const auto file = open(ptx_bytes(d), {.premultiply = true});
  ASSERT_TRUE(file);
  const auto texels = file->texels(0);
  EXPECT_EQ((*texels)[0], std::byte{100});
  EXPECT_EQ((*texels)[7], std::byte{128});
}

// ---- damage ----

std::string fault(const std::vector<std::byte>& bytes) {
  return fault_of_ptx({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

TEST_F(PtxFileTest, every_prefix_is_refused_or_lacks_nothing_that_is_used) {
  PtxDescription d = everything(FaceTexelType::uint8, 4);
  d.metadata_bytes = 0;
  d.edits = {{2, face_of(d.info, 1, 1, PtxEncoding::deflated, 9)}};
  const std::vector<std::byte> whole = ptx_bytes(d);
  for (size_t size = 0; size < whole.size(); ++size) {
    const auto file = open({whole.begin(), whole.begin() + static_cast<ptrdiff_t>(size)});
    ASSERT_FALSE(file) << size;
    EXPECT_NE(file.error().message.find("byte "), std::string::npos) << file.error().message;
  }
  EXPECT_TRUE(open(whole));
}

TEST_F(PtxFileTest, flipped_bits_are_refused_with_a_place_or_read_as_what_they_say) {
  const std::vector<std::byte> whole = ptx_bytes(everything(FaceTexelType::uint16, 3));
  for (size_t at = 0; at < whole.size(); ++at)
    for (int bit = 0; bit < 8; bit += at < 200 ? 1 : 8) {
      std::vector<std::byte> flipped = whole;
      flipped[at] ^= static_cast<std::byte>(1 << bit);
      ASSERT_EQ(fault(flipped), "") << at << ' ' << bit;
    }
}

TEST_F(PtxFileTest, the_fuzzers_corpus_keeps_the_readers_promises) {
  size_t count = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(SPILLWAY_SOURCE_DIR) + "/tests/fuzz/corpus/ptx")) {
    std::ifstream stream(entry.path(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    EXPECT_EQ(fault_of_ptx(bytes), "") << entry.path();
    ++count;
  }
  EXPECT_GE(count, 10u);
}

template <class T>
std::vector<std::byte> with(std::vector<std::byte> bytes, size_t offset, T value) {
  std::memcpy(bytes.data() + offset, &value, sizeof value);
  return bytes;
}

TEST_F(PtxFileTest, absurd_counts_are_refused_before_memory_is_taken) {
  const std::vector<std::byte> whole = ptx_bytes(everything(FaceTexelType::uint8, 3));
  const auto refused = [&](const std::vector<std::byte>& bytes, const char* what) {
    const auto file = open(bytes);
    ASSERT_FALSE(file) << what;
    EXPECT_NE(file.error().message.find(what), std::string::npos) << file.error().message;
    EXPECT_NE(file.error().message.find("some.ptx: byte "), std::string::npos) << file.error().message;
  };
  refused(with(whole, 24, uint32_t{1} << 30), "cannot unpack");     // faces
  refused(with(whole, 20, uint16_t{65535}), "cannot unpack");       // channels
  refused(with(whole, 48, ~uint64_t{0}), "cut short");              // level data
  refused(with(whole, 56, uint32_t{0xffffffff}), "cut short");      // metadata, zipped
  refused(with(whole, 60, uint32_t{0xffffffff}), "cannot unpack");  // metadata, unpacked
  refused(with(whole, 22, uint16_t{9}), "wrong size");              // levels
  refused(with(whole, 0, uint32_t{0}), "is no .ptx");
  refused(with(whole, 4, uint32_t{2}), "version 2");
  PtxDescription wide = everything(FaceTexelType::uint8, 1);
  wide.faces[0].info.flags = cache::kFaceIsConstant, wide.faces[0].info.ulog2 = 30;
  refused(ptx_bytes(wide), "2^30");
  PtxDescription cycle = everything(FaceTexelType::uint8, 1);
  cycle.faces[1].info.adjacent_faces[3] = 2;
  refused(ptx_bytes(cycle), "does not lead back");
  cycle.faces[1].info.adjacent_faces[3] = 77;
  refused(ptx_bytes(cycle), "does not lead back");
  PtxDescription triangle = everything(FaceTexelType::uint8, 1);
  triangle.info.shape = FaceShape::triangle;
  refused(ptx_bytes(triangle), "a triangle");
}

}  // namespace
}  // namespace spillway::pipeline
