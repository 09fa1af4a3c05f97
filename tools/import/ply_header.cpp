#include "tools/import/ply_header.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <system_error>

namespace spillway::tools {
namespace {

constexpr size_t kPieceBytes = 256 << 10;
// Of a header. Far above any exporter's; a bomb otherwise.
constexpr size_t kMaxLineBytes = 4096, kMaxLines = 4096, kMaxElements = 64, kMaxProperties = 256;

constexpr std::string_view kNoPly = "not a PLY file: its first line is not \"ply\"";

Result<std::string> read_line(PlyBytes& bytes) {
  std::string line;
  const uint64_t first = bytes.offset();
  for (;;) {
    SPILLWAY_ASSIGN(const unsigned char* byte, bytes.take(1));
    if (*byte == '\n') break;
    if (line.size() == kMaxLineBytes) return bytes.fail_at(first, "header line without end: not a PLY file?");
    line.push_back(static_cast<char>(*byte));
  }
  if (line.ends_with('\r')) line.pop_back();
  return line;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t at = 0; at < line.size();) {
    const size_t end = std::min(line.find_first_of(" \t", at), line.size());
    if (end > at) words.push_back(line.substr(at, end - at));
    at = end + 1;
  }
  return words;
}

struct TypeName {
  std::string_view name;
  PlyType type;
};
constexpr std::array kTypeNames = {
    TypeName{"char", PlyType::int8},       TypeName{"int8", PlyType::int8},       TypeName{"uchar", PlyType::uint8},
    TypeName{"uint8", PlyType::uint8},     TypeName{"short", PlyType::int16},     TypeName{"int16", PlyType::int16},
    TypeName{"ushort", PlyType::uint16},   TypeName{"uint16", PlyType::uint16},   TypeName{"int", PlyType::int32},
    TypeName{"int32", PlyType::int32},     TypeName{"uint", PlyType::uint32},     TypeName{"uint32", PlyType::uint32},
    TypeName{"float", PlyType::float32},   TypeName{"float32", PlyType::float32}, TypeName{"double", PlyType::float64},
    TypeName{"float64", PlyType::float64},
};

bool find_type(std::string_view name, PlyType& type) {
  for (const TypeName& known : kTypeNames) {
    if (known.name != name) continue;
    type = known.type;
    return true;
  }
  return false;
}

// What is wrong with a line, or nothing.
using Complaint = std::string;

Complaint read_format(const std::vector<std::string_view>& words, PlyHeader& header) {
  if (words.size() != 3 || words[2] != "1.0") return "PLY 1.0 is read, nothing else";
  if (words[1] == "ascii")
    header.format = PlyFormat::ascii;
  else if (words[1] == "binary_little_endian")
    header.format = PlyFormat::little;
  else if (words[1] == "binary_big_endian")
    header.format = PlyFormat::big;
  else
    return "unknown format";
  return {};
}

Complaint read_element(const std::vector<std::string_view>& words, PlyHeader& header) {
  if (words.size() != 3) return "write element <name> <count>";
  PlyElement element{std::string(words[1]), 0, {}};
  for (const PlyElement& other : header.elements) {
    if (other.name == element.name) return "element given twice";
  }
  const char* last = words[2].data() + words[2].size();
  const auto [end, code] = std::from_chars(words[2].data(), last, element.count);
  if (code != std::errc() || end != last) return "the count is no whole number";
  if (header.elements.size() == kMaxElements) return "too many elements";
  header.elements.push_back(std::move(element));
  return {};
}

Complaint read_property(const std::vector<std::string_view>& words, PlyHeader& header) {
  if (header.elements.empty()) return "property before the first element";
  PlyProperty property;
  property.is_list = words.size() > 1 && words[1] == "list";
  const size_t type_at = property.is_list ? 3 : 1;
  if (words.size() != type_at + 2) return "write property [list <count type>] <type> <name>";
  if (!find_type(words[type_at], property.type)) return "unknown type";
  if (property.is_list && !find_type(words[2], property.count_type)) return "unknown count type";
  if (property.is_list && !is_integer(property.count_type)) return "the count of a list must be of a whole type";
  property.name = words[type_at + 1];
  std::vector<PlyProperty>& properties = header.elements.back().properties;
  for (const PlyProperty& other : properties) {
    if (other.name == property.name) return "property given twice";
  }
  if (properties.size() == kMaxProperties) return "too many properties";
  properties.push_back(std::move(property));
  return {};
}

Complaint read_header_line(const std::vector<std::string_view>& words, PlyHeader& header, bool& has_format) {
  if (words.empty() || words[0] == "comment" || words[0] == "obj_info") return {};
  if (words[0] == "element") return read_element(words, header);
  if (words[0] == "property") return read_property(words, header);
  if (words[0] != "format") return "unknown keyword in the header";
  if (has_format) return "format given twice";
  has_format = true;
  return read_format(words, header);
}

// The least that one item can take in the file.
uint64_t least_bytes(const PlyElement& element, PlyFormat format) {
  uint64_t bytes = 0;
  for (const PlyProperty& property : element.properties) {
    if (format == PlyFormat::ascii)
      bytes += 2;  // a digit and what ends it
    else
      bytes += size_bytes(property.is_list ? property.count_type : property.type);
  }
  return bytes;
}

Status check_counts(const PlyHeader& header, const PlyBytes& bytes) {
  uint64_t left = bytes.remaining();
  for (const PlyElement& element : header.elements) {
    const uint64_t least = least_bytes(element, header.format);
    if (least == 0) continue;
    if (element.count > left / least) {
      return bytes.fail(fmt::format("{} items of element \"{}\" cannot lie in the {} bytes left: file cut short?",
                                    element.count, element.name, left));
    }
    left -= element.count * least;
  }
  return {};
}

}  // namespace

Result<PlyBytes> PlyBytes::open(const std::filesystem::path& file) {
  PlyBytes bytes;
  bytes.name_ = file.string();
  std::error_code code;
  bytes.size_ = std::filesystem::file_size(file, code);
  if (code) return error("{}: {}: check the path", bytes.name_, code.message());
  if (file.extension() == ".gz") {
    SPILLWAY_ASSIGN(bytes.packed_, GzipFile::open(file));
    bytes.size_ = bytes.packed_->size_bytes();
  } else {
    bytes.stream_.reset(std::fopen(file.c_str(), "rb"));
  }
  if (!bytes.stream_ && !bytes.packed_) return error("{}: {}: check the path", bytes.name_, std::strerror(errno));
  bytes.piece_.resize(std::min(kPieceBytes, std::max<size_t>(bytes.size_, kMaxTake)));
  return bytes;
}

Error PlyBytes::fail_at(uint64_t offset, std::string_view what) const {
  return error("{}: byte {}: {}", name_, offset, what);
}

bool PlyBytes::fill(size_t count) {
  if (last_ - first_ >= count) return true;
  std::memmove(piece_.data(), piece_.data() + first_, last_ - first_);
  last_ -= first_, first_ = 0;
  unsigned char* const free = piece_.data() + last_;
  const size_t room = piece_.size() - last_;
  last_ += packed_ ? packed_->read(free, room) : std::fread(free, 1, room, stream_.get());
  return last_ >= count;
}

Result<const unsigned char*> PlyBytes::take(size_t count) {
  if (count > remaining()) return fail_at(size_, "the file ends too early: write it again");
  if (!fill(count)) return fail("cannot read on: check the disk");
  const unsigned char* taken = piece_.data() + first_;
  first_ += count, offset_ += count;
  return taken;
}

int PlyBytes::peek() { return remaining() > 0 && fill(1) ? piece_[first_] : -1; }

size_t size_bytes(PlyType type) {
  constexpr size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<size_t>(type)];
}

Result<PlyHeader> read_ply_header(PlyBytes& bytes) {
  if (bytes.peek() == 0x1f) return bytes.fail("is gzip-compressed, or no PLY file: decompress it first");
  if (bytes.peek() >= 0 && bytes.peek() != 'p') return bytes.fail(kNoPly);
  SPILLWAY_ASSIGN(const std::string magic, read_line(bytes));
  if (magic != "ply") return bytes.fail_at(0, kNoPly);
  PlyHeader header;
  bool has_format = false;
  for (size_t i = 0; i < kMaxLines; ++i) {
    const uint64_t offset = bytes.offset();
    SPILLWAY_ASSIGN(const std::string line, read_line(bytes));
    const std::vector<std::string_view> words = words_of(line);
    if (words.size() == 1 && words[0] == "end_header") {
      if (!has_format) return bytes.fail_at(offset, "header without a format line");
      SPILLWAY_TRY(check_counts(header, bytes));
      return header;
    }
    const Complaint complaint = read_header_line(words, header, has_format);
    if (!complaint.empty()) return bytes.fail_at(offset, fmt::format("\"{}\": {}", line.substr(0, 100), complaint));
  }
  return bytes.fail("header without end");
}

}  // namespace spillway::tools
