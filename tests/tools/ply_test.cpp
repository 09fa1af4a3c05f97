// PLY files of the three formats, whole, cut short, flipped and hostile.

#include "tools/import/gunzip.h"
#include "tools/import/ply.h"

#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

enum class Format { ascii, little, big };

std::string format_name(Format format) {
  return format == Format::ascii ? "ascii" : format == Format::little ? "binary_little_endian" : "binary_big_endian";
}

// Appends a value as the format writes it.
template <class T>
void put(std::string& bytes, Format format, T value) {
  if (format == Format::ascii) {
    bytes += fmt::format("{} ", value);
    return;
  }
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (format == Format::big) std::reverse(raw, raw + sizeof(T));
  bytes.append(raw, sizeof(T));
}

// Five vertices with normals, uvs and a property to skip; one triangle, one quad; elements to skip before and after.
std::string sample(Format format) {
  std::string b =
      "ply\nformat " + format_name(format) +
      " 1.0\ncomment by hand\nobj_info nothing\nelement camera 1\n"
      "property list uchar double view\nelement vertex 5\nproperty float x\nproperty double y\nproperty float z\n"
      "property uchar red\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float u\nproperty float "
      "v\n"
      "element face 2\nproperty int face_indices\nproperty list uchar int vertex_indices\nproperty list uint8 short "
      "flags\n"
      "element edge 1\nproperty ushort a\nelement nothing 1000000000000\nend_header\n";
  put(b, format, uint8_t{2}), put(b, format, 0.5), put(b, format, 1.5);
  for (int i = 0; i < 5; ++i) {
    const float f = static_cast<float>(i);
    put(b, format, f), put(b, format, -2.0 * i), put(b, format, 0.25f * f), put(b, format, uint8_t(200 + i));
    put(b, format, 0.0f), put(b, format, 0.0f), put(b, format, 1.0f), put(b, format, f / 8), put(b, format, 1 - f / 8);
  }
  put(b, format, int32_t{7}), put(b, format, uint8_t{3});
  for (const int32_t i : {0, 1, 2}) put(b, format, i);
  put(b, format, uint8_t{1}), put(b, format, int16_t{-3});
  put(b, format, int32_t{8}), put(b, format, uint8_t{4});
  for (const int32_t i : {1, 2, 3, 4}) put(b, format, i);
  put(b, format, uint8_t{0});
  put(b, format, uint16_t{65535});
  if (format == Format::ascii) b.back() = '\n';
  return b;
}

class PlyFormats : public ::testing::TestWithParam<Format> {};
INSTANTIATE_TEST_SUITE_P(, PlyFormats, ::testing::Values(Format::ascii, Format::little, Format::big),
                         [](const auto& instance) { return format_name(instance.param); });

std::filesystem::path file_of(const std::string& bytes) {
  const std::filesystem::path path =
      std::filesystem::path(::testing::TempDir()) / ("spillway_ply_" + std::to_string(::getpid()) + ".ply");
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return path;
}

std::string error_of(const std::string& bytes) {
  const Result<PlyMesh> mesh = read_ply(file_of(bytes));
  return mesh ? "" : mesh.error().message;
}

TEST_P(PlyFormats, reads_vertices_and_splits_quads) {
  const Result<PlyMesh> mesh = read_ply(file_of(sample(GetParam())));
  ASSERT_TRUE(mesh) << mesh.error().message;
  ASSERT_EQ(mesh->positions.size(), 5u);
  ASSERT_EQ(mesh->normals.size(), 5u);
  ASSERT_EQ(mesh->uvs.size(), 5u);
  for (uint32_t i = 0; i < 5; ++i) {
    const float f = static_cast<float>(i);
    EXPECT_EQ(mesh->positions[i], (Float3{f, -2 * f, f / 4}));
    EXPECT_EQ(mesh->normals[i], (Float3{0, 0, 1}));
    EXPECT_EQ(mesh->uvs[i].x, f / 8);
    EXPECT_EQ(mesh->uvs[i].y, 1 - f / 8);
  }
  EXPECT_EQ(mesh->indices, (std::vector<uint32_t>{0, 1, 2, 1, 2, 3, 1, 3, 4}));
}

// The file is read in pieces of a quarter of a megabyte.
TEST_P(PlyFormats, files_of_many_pieces_lose_nothing) {
  constexpr int kCount = 60000;
  std::string b = "ply\nformat " + format_name(GetParam()) +
                  " 1.0\nelement vertex 60000\nproperty float x\nproperty double y\nproperty uchar of\nproperty float z\n"
                  "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  for (int i = 0; i < kCount; ++i) {
    const float f = static_cast<float>(i);
    put(b, GetParam(), f), put(b, GetParam(), -2.0 * i), put(b, GetParam(), uint8_t{7}), put(b, GetParam(), 0.25f * f);
  }
  put(b, GetParam(), uint8_t{3});
  for (const int32_t i : {0, 1, kCount - 1}) put(b, GetParam(), i);
  if (GetParam() == Format::ascii) b.back() = '\n';
  ASSERT_GT(b.size(), size_t{900} << 10);
  const auto mesh = read_ply(file_of(b));
  ASSERT_TRUE(mesh) << mesh.error().message;
  ASSERT_EQ(mesh->positions.size(), size_t{kCount});
  for (int i = 0; i < kCount; ++i) {
    const Float3 p = mesh->positions[static_cast<size_t>(i)];
    const float f = static_cast<float>(i);
    ASSERT_TRUE(p.x == f && p.y == -2 * f && p.z == 0.25f * f) << i;
  }
  EXPECT_EQ(mesh->indices, (std::vector<uint32_t>{0, 1, kCount - 1}));
}

TEST_P(PlyFormats, every_prefix_is_refused_with_a_byte) {
  const std::string bytes = sample(GetParam());
  for (size_t size = 0; size < bytes.size(); ++size) {
    const std::string message = error_of(bytes.substr(0, size));
    EXPECT_NE(message.find(": byte "), std::string::npos) << "prefix of " << size << " bytes said: " << message;
  }
}

// A flip may make another valid mesh; it must never crash, hang or give an index without a vertex.
TEST_P(PlyFormats, every_flipped_bit_is_survived) {
  const std::string bytes = sample(GetParam());
  const size_t header_bits = 8 * bytes.find("end_header");
  size_t refused = 0, tried = 0;
  for (size_t bit = 0; bit < 8 * bytes.size();
       bit += bit < header_bits ? 3 : 1) {  // a header flip breaks a word anyway
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
    const Result<PlyMesh> mesh = read_ply(file_of(damaged));
    refused += !mesh, ++tried;
    if (!mesh) continue;
    for (const uint32_t index : mesh->indices) ASSERT_LT(index, mesh->positions.size()) << "bit " << bit;
    ASSERT_TRUE(mesh->normals.empty() || mesh->normals.size() == mesh->positions.size());
    ASSERT_TRUE(mesh->uvs.empty() || mesh->uvs.size() == mesh->positions.size());
  }
  EXPECT_GT(refused, tried / 4);  // the header's; flipped coordinates are coordinates
}

std::string gzipped(const std::string& bytes) {
  std::string packed(compressBound(bytes.size()) + 64, '\0');
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);  // 16: gzip's header
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

TEST_P(PlyFormats, gzipped_files_are_read_and_damaged_ones_refused) {
  const std::string packed = gzipped(sample(GetParam()));
  const auto read = [&](const std::string& bytes) { return read_ply(write_file("mesh.ply.gz", bytes)); };
  const Result<PlyMesh> mesh = read(packed);
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(mesh->indices, (std::vector<uint32_t>{0, 1, 2, 1, 2, 3, 1, 3, 4}));
  for (size_t size = 0; size < packed.size(); ++size) EXPECT_FALSE(read(packed.substr(0, size))) << size;
  for (size_t at = 10; at < packed.size(); ++at) {  // the first ten bytes hold a date and the like
    std::string damaged = packed;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    const Result<PlyMesh> other = read(damaged);
    EXPECT_FALSE(other) << at;
    EXPECT_TRUE(other || other.error().message.find("mesh.ply.gz") != std::string::npos);
  }
  EXPECT_FALSE(read(sample(GetParam())));
}

// A megabyte of zeros is a kilobyte packed: neither memory nor disk are taken for what such a file claims.
TEST(ply, packed_files_that_unpack_out_of_proportion_are_refused) {
  const auto bomb = write_file("bomb.ply.gz", gzipped(std::string(1 << 20, '\0')));
  const auto open = [&](uint64_t always_bytes, uint64_t ratio) { return GzipFile::open(bomb, {always_bytes, ratio}); };
  EXPECT_NE(open(1 << 19, 100).error().message.find("bomb.ply.gz: unpacks to more than 524288 bytes"),
            std::string::npos);
  const auto by_size = open(1 << 20, 100);
  ASSERT_TRUE(by_size);
  EXPECT_EQ(by_size->size_bytes(), 1u << 20);
  EXPECT_TRUE(open(0, 1032));
}

std::string ascii_file(const std::string& vertex_properties, const std::string& vertices,
                       const std::string& face_property, const std::string& faces, int vertex_count = 3,
                       int face_count = 1) {
  return fmt::format("ply\nformat ascii 1.0\nelement vertex {}\n{}element face {}\n{}end_header\n{}{}", vertex_count,
                     vertex_properties, face_count, face_property, vertices, faces);
}
const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";
const std::string kPoints = "0 0 0\n1 0 0\n0 1 0\n";
const std::string kCorners = "property list uchar int vertex_indices\n";

TEST(ply, other_spellings_are_read) {
  for (const auto& [u, v] : std::vector<std::pair<std::string, std::string>>{
           {"u", "v"}, {"s", "t"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}}) {
    const std::string uv = "property float " + u + "\nproperty float " + v + "\n";
    const auto mesh = read_ply(file_of(ascii_file(kXyz + uv, "0 0 0 .5 1\n1 0 0 .5 1\n0 1 0 .5 1\n",
                                                  "property list uint8 uint vertex_index\n", "3 0 1 2\n")));
    ASSERT_TRUE(mesh) << mesh.error().message;
    ASSERT_EQ(mesh->uvs.size(), 3u);
    EXPECT_EQ(mesh->uvs[2].x, 0.5f);
    EXPECT_EQ(mesh->uvs[2].y, 1.0f);
    EXPECT_TRUE(mesh->normals.empty());
  }
}

TEST(ply, windows_lines_and_scattered_values_are_read) {
  std::string text = ascii_file(kXyz, "0 0\n0 1 0 0 0\t1 0\n", kCorners, "3 0 1 2\n\n");
  size_t at = 0;
  while ((at = text.find('\n', at)) != std::string::npos) text.replace(at, 1, "\r\n"), at += 2;
  const auto mesh = read_ply(file_of(text));
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(mesh->positions[2], (Float3{0, 1, 0}));
}

TEST(ply, faces_may_come_before_vertices) {
  const std::string text = "ply\nformat ascii 1.0\nelement face 1\n" + kCorners + "element vertex 3\n" + kXyz +
                           "end_header\n3 2 1 0\n" + kPoints;
  const auto mesh = read_ply(file_of(text));
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(mesh->indices, (std::vector<uint32_t>{2, 1, 0}));
}

TEST(ply, not_a_number_is_left_to_the_reader) {
  const auto mesh = read_ply(file_of(ascii_file(kXyz, "nan 0 0\n1 inf 0\n0 1 0\n", kCorners, "3 0 1 2\n")));
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_TRUE(std::isnan(mesh->positions[0].x));
  EXPECT_TRUE(std::isinf(mesh->positions[1].y));
}

TEST(ply, bad_faces_and_words_are_refused_where_they_are) {
  const auto faces = [](const std::string& text) { return error_of(ascii_file(kXyz, kPoints, kCorners, text)); };
  const size_t at = ascii_file(kXyz, kPoints, kCorners, "").size();
  EXPECT_NE(faces("5 0 1 2 0 1\n").find(fmt::format("byte {}: a face of 5 corners", at)), std::string::npos);
  EXPECT_NE(faces("2 0 1\n").find("a face of 2 corners"), std::string::npos);
  EXPECT_NE(faces("-3 0 1 2\n").find("no whole number"), std::string::npos);
  EXPECT_NE(faces("3 0 1 3\n").find("triangle 0 names vertex 3 of 3"), std::string::npos);
  EXPECT_NE(faces("3 0 1 1.5\n").find(fmt::format("byte {}: a vertex index is 1.5", at + 6)), std::string::npos);
  EXPECT_NE(faces("3 0 one 2\n").find("no number"), std::string::npos);

  EXPECT_NE(faces("3 0 1 2\n77\n").find("3 bytes left after the last element"), std::string::npos);
  EXPECT_NE(faces("3 0 1 " + std::string(100, '0') + "\n").find("no number"), std::string::npos);
}

TEST(ply, hostile_headers_are_refused_before_memory_is_taken) {
  const auto count = [](const std::string& vertices, const std::string& faces) {
    return error_of("ply\nformat binary_little_endian 1.0\nelement vertex " + vertices + "\n" + kXyz + "element face " +
                    faces + "\n" + kCorners + "end_header\n" + std::string(64, '\0'));
  };
  EXPECT_NE(count("18446744073709551615", "1").find("cannot lie in the 64 bytes left"), std::string::npos);
  EXPECT_NE(count("4000000000", "1").find("4000000000 items of element \"vertex\""), std::string::npos);
  EXPECT_NE(count("1", "4000000000").find("4000000000 items of element \"face\""), std::string::npos);
  EXPECT_NE(count("5", "5").find("5 items of element \"face\" cannot lie in the 4 bytes left"), std::string::npos);
  EXPECT_NE(count("18446744073709551616", "1").find("no whole number"), std::string::npos);
  EXPECT_NE(count("-1", "1").find("no whole number"), std::string::npos);
}

TEST(ply, malformed_headers_are_refused) {
  const auto header = [](const std::string& lines) { return error_of("ply\n" + lines + "end_header\n"); };
  const std::string ascii = "format ascii 1.0\n";
  EXPECT_NE(error_of("plx\n").find("byte 0: not a PLY file"), std::string::npos);
  EXPECT_NE(error_of(std::string("\x1f\x8b\x08\0", 4)).find("gzip"), std::string::npos);
  EXPECT_NE(header("").find("byte 4: header without a format line"), std::string::npos);
  EXPECT_NE(header("format ascii 2.0\n").find("PLY 1.0"), std::string::npos);
  EXPECT_NE(header("format text 1.0\n").find("unknown format"), std::string::npos);
  EXPECT_NE(header(ascii + ascii).find("byte 21: \"format ascii 1.0\": format given twice"), std::string::npos);
  EXPECT_NE(header(ascii + "property float x\n").find("property before the first element"), std::string::npos);
  EXPECT_NE(header(ascii + "element vertex 0\nproperty half x\n").find("unknown type"), std::string::npos);
  EXPECT_NE(header(ascii + "element vertex 0\nproperty list float int x\n").find("whole type"), std::string::npos);
  EXPECT_NE(header(ascii + "element vertex 0\nelement vertex 0\n").find("element given twice"), std::string::npos);
  EXPECT_NE(header(ascii + "element vertex 0\n" + kXyz + "property float x\n").find("property given twice"),
            std::string::npos);
  EXPECT_NE(header(ascii + "element vertex 0\n" + kXyz).find("no element \"vertex\", or no element \"face\""),
            std::string::npos);
  EXPECT_NE(header(ascii + "element vertex 0\nproperty float x\n").find("without x, y and z"), std::string::npos);
  EXPECT_NE(header(ascii + "element face 0\nproperty int vertex_index\n").find("must be a list"), std::string::npos);
  EXPECT_NE(header(ascii + "element face 0\nproperty list uchar float vertex_index\n").find("must be a list"),
            std::string::npos);
  EXPECT_NE(header(ascii + "element face 0\n").find("without the list"), std::string::npos);
  EXPECT_NE(header(ascii + "element vertex 0\n" + kXyz + "property float u\nproperty float s\n").find("says again"),
            std::string::npos);
  EXPECT_NE(header(ascii + "wibble\n").find("unknown keyword"), std::string::npos);
  EXPECT_NE(header(ascii + "comment " + std::string(5000, 'x') + "\n").find("line without end"), std::string::npos);
  std::string many = ascii;
  for (int i = 0; i < 5000; ++i) many += "comment\n";
  EXPECT_NE(header(many).find("header without end"), std::string::npos);
}

TEST(ply, missing_files_and_folders_are_named) {
  EXPECT_NE(read_ply("no/such/file.ply").error().message.find("no/such/file.ply: No such file"), std::string::npos);
  EXPECT_FALSE(read_ply(::testing::TempDir()));
}

}  // namespace
}  // namespace spillway::tools
