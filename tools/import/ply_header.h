#pragma once

// The parts of read_ply: a file in pieces, and the header's meaning.

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cache/base/result.h"
#include "tools/import/gunzip.h"

namespace spillway::tools {

// A file read forward in pieces; knows its size and where it is.
class PlyBytes {
 public:
  // A file named .gz is unpacked as it is read: offsets are those of what was in it.
  static Result<PlyBytes> open(const std::filesystem::path& file);

  [[nodiscard]] uint64_t offset() const { return offset_; }
  [[nodiscard]] uint64_t remaining() const { return size_ - offset_; }
  [[nodiscard]] Error fail(std::string_view what) const { return fail_at(offset_, what); }
  [[nodiscard]] Error fail_at(uint64_t offset, std::string_view what) const;

  // The next `count` bytes (at most kMaxTake), valid until the next call.
  Result<const unsigned char*> take(size_t count);
  static constexpr size_t kMaxTake = 4096;
  // The next byte without taking it; -1 at the end.
  int peek();

 private:
  bool fill(size_t count);  // makes `count` bytes available, if the file has them

  struct CloseFile {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };

  std::string name_;
  std::unique_ptr<std::FILE, CloseFile> stream_;
  std::optional<GzipFile> packed_;  // instead of the stream
  uint64_t size_ = 0, offset_ = 0;
  std::vector<unsigned char> piece_;
  size_t first_ = 0, last_ = 0;
};

enum class PlyFormat : uint8_t { ascii, little, big };
enum class PlyType : uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
[[nodiscard]] size_t size_bytes(PlyType type);
[[nodiscard]] inline bool is_integer(PlyType type) { return type < PlyType::float32; }

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::float32;
  bool is_list = false;
  PlyType count_type = PlyType::uint8;  // of a list
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  PlyFormat format = PlyFormat::ascii;
  std::vector<PlyElement> elements;
};

// Up to and including end_header. Counts are checked against what is left of the file.
Result<PlyHeader> read_ply_header(PlyBytes& bytes);

}  // namespace spillway::tools
