#include "cache/section_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <numeric>

#include "cache/base/hash.h"
#include "tests/support/small_scene.h"

namespace spillway::cache {
namespace {

class SectionFileTest : public testing::Test {
 protected:
  void SetUp() override {
    std::iota(numbers_.begin(), numbers_.end(), 7u);
    SectionWriter writer("TESTFILE", 3);
    writer.add_array("numbers", std::span<const uint32_t>(numbers_));
    writer.add("empty", {});
    const Status written = writer.write(path_);
    ASSERT_TRUE(written) << written.error().message;
    std::ifstream stream(path_, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(stream), {});
  }
  Status read(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    const auto reader = SectionReader::read(path_, "TESTFILE", 3, MemoryTag::scene);
    return reader ? Status{} : Status(reader.error());
  }

  test::TemporaryDirectory directory_;
  const std::filesystem::path path_ = directory_.path() / "file";
  std::vector<uint32_t> numbers_ = std::vector<uint32_t>(300);
  std::string bytes_;
};

TEST_F(SectionFileTest, sections_come_back) {
  const auto reader = SectionReader::read(path_, "TESTFILE", 3, MemoryTag::scene);
  ASSERT_TRUE(reader) << reader.error().message;
  const auto numbers = reader->array<uint32_t>("numbers");
  ASSERT_TRUE(numbers);
  EXPECT_TRUE(std::equal(numbers_.begin(), numbers_.end(), numbers->begin(), numbers->end()));
  EXPECT_TRUE(reader->has("empty"));
  EXPECT_FALSE(reader->bytes("missing"));
  struct Odd {
    char bytes[7];
  };
  EXPECT_FALSE(reader->array<Odd>("numbers"));  // 1200 bytes are no multiple of 7
}

TEST_F(SectionFileTest, every_prefix_and_every_flipped_byte_is_refused_by_name) {
  for (size_t size = 0; size < bytes_.size(); ++size) {
    const Status status = read(bytes_.substr(0, size));
    ASSERT_FALSE(status) << size;
    ASSERT_NE(status.error().message.find(path_.string()), std::string::npos);
    // Once there is a header the size decides, before anything is followed that it says.
    ASSERT_TRUE(size < 32 || status.error().message.find("cut short") != std::string::npos) << status.error().message;
  }
  for (size_t i = 0; i < bytes_.size(); ++i) {
    std::string damaged = bytes_;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    ASSERT_FALSE(read(damaged)) << i;
  }
  EXPECT_TRUE(read(bytes_));
}

// Under a right checksum of the header: what lies outside must not even be looked at.
TEST_F(SectionFileTest, a_section_that_leaves_the_file_is_refused) {
  constexpr size_t kChecksumAt = 24, kHeaderBytes = 32, kEntryBytes = 56, kOffsetAt = 32, kSizeAt = 40;
  for (const size_t field : {kOffsetAt, kSizeAt})
    for (const uint64_t value : {uint64_t{bytes_.size()} + 64, uint64_t{1} << 40, UINT64_MAX - 63}) {
      std::string damaged = bytes_;
      std::memcpy(damaged.data() + kHeaderBytes + field, &value, sizeof value);
      std::memset(damaged.data() + kChecksumAt, 0, sizeof(uint64_t));
      const uint64_t sum = checksum(damaged.data() + kHeaderBytes, 2 * kEntryBytes, checksum(damaged.data(), kHeaderBytes));
      std::memcpy(damaged.data() + kChecksumAt, &sum, sizeof sum);
      const Status status = read(damaged);
      ASSERT_FALSE(status) << field << ' ' << value;
      EXPECT_NE(status.error().message.find("outside the file"), std::string::npos) << status.error().message;
    }
}

TEST_F(SectionFileTest, another_kind_or_version_is_said_to_be_one) {
  EXPECT_FALSE(SectionReader::read(path_, "OTHERKND", 3, MemoryTag::scene));
  const auto newer = SectionReader::read(path_, "TESTFILE", 4, MemoryTag::scene);
  ASSERT_FALSE(newer);
  EXPECT_NE(newer.error().message.find("version"), std::string::npos) << newer.error().message;
}

TEST_F(SectionFileTest, a_file_that_cannot_be_finished_leaves_nothing) {
  SectionWriter writer("TESTFILE", 3);
  EXPECT_FALSE(writer.write(directory_.path() / "no folder" / "file"));
  {
    auto file = WriteFile::create(directory_.path() / "half", IoPurpose::scene);
    ASSERT_TRUE(file);
    ASSERT_TRUE(file->append(std::as_bytes(std::span(numbers_))));
  }
  size_t entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(directory_.path())) ++entries;
  EXPECT_EQ(entries, 1u);
}

}  // namespace
}  // namespace spillway::cache
