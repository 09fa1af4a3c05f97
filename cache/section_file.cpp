#include "cache/section_file.h"

#include <algorithm>
#include <cstring>

#include "cache/base/check.h"
#include "cache/base/hash.h"
#include "cache/file.h"

// Format, little endian:
//   FileHeader
//   SectionEntry[section_count]
//   the sections' bytes, each 64-aligned, in the order of the entries
// The header's checksum covers header and entries; each entry's checksum covers its bytes; what is between is zero.

namespace spillway::cache {
namespace {

constexpr uint64_t kAlignment = 64;
constexpr uint32_t kLargestSectionCount = 4096;

struct FileHeader {
  char kind[8];
  uint32_t version;
  uint32_t section_count;
  uint64_t file_bytes;
  uint64_t checksum;  // of the header with this field zero, and of the entries
};

struct SectionEntry {
  char name[32];
  uint64_t offset_bytes;
  uint64_t size_bytes;
  uint64_t checksum;
};

uint64_t aligned(uint64_t n) { return (n + kAlignment - 1) / kAlignment * kAlignment; }

uint64_t header_checksum(FileHeader header, std::span<const SectionEntry> entries) {
  header.checksum = 0;
  const uint64_t first = checksum(&header, sizeof header);
  return checksum(entries.data(), entries.size_bytes(), first);
}

bool is_terminated(const SectionEntry& entry) { return std::memchr(entry.name, 0, sizeof entry.name) != nullptr; }

}  // namespace

SectionWriter::SectionWriter(std::string kind, uint32_t version) : kind_(std::move(kind)), version_(version) {
  SPILLWAY_CHECK(kind_.size(), ==, sizeof FileHeader::kind);
}

void SectionWriter::add(std::string name, std::span<const std::byte> bytes) {
  SPILLWAY_CHECK(name.size(), <, sizeof SectionEntry::name);
  sections_.emplace_back(std::move(name), std::vector<std::byte>(bytes.begin(), bytes.end()));
}

Status SectionWriter::write(const std::filesystem::path& path) const {
  FileHeader header{};
  std::memcpy(header.kind, kind_.data(), sizeof header.kind);
  header.version = version_;
  header.section_count = static_cast<uint32_t>(sections_.size());
  std::vector<SectionEntry> entries(sections_.size());
  uint64_t offset = aligned(sizeof header + entries.size() * sizeof(SectionEntry));
  for (size_t i = 0; i < sections_.size(); ++i) {
    const auto& [name, bytes] = sections_[i];
    std::memcpy(entries[i].name, name.data(), name.size());
    entries[i].offset_bytes = offset, entries[i].size_bytes = bytes.size();
    entries[i].checksum = checksum(bytes.data(), bytes.size());
    offset = aligned(offset + bytes.size());
  }
  header.file_bytes = offset;
  header.checksum = header_checksum(header, entries);
  SPILLWAY_ASSIGN(WriteFile file, WriteFile::create(path, IoPurpose::scene));
  SPILLWAY_TRY(file.append(std::as_bytes(std::span(&header, 1))));
  SPILLWAY_TRY(file.append(std::as_bytes(std::span(entries))));
  SPILLWAY_TRY(file.pad_to(kAlignment));
  for (const auto& [name, bytes] : sections_) {
    SPILLWAY_TRY(file.append(bytes));
    SPILLWAY_TRY(file.pad_to(kAlignment));
  }
  return file.commit();
}

Result<SectionReader> SectionReader::read(const std::filesystem::path& path, std::string_view kind, uint32_t version,
                                          MemoryTag tag) {
  SPILLWAY_ASSIGN(const ReadFile file, ReadFile::open(path, {.purpose = IoPurpose::scene}));
  FileHeader header{};
  if (file.size_bytes() < sizeof header)
    return error("{}: has {} bytes, less than a header; it is damaged or no file of ours", path.string(),
                 file.size_bytes());
  SPILLWAY_TRY(file.read(0, std::as_writable_bytes(std::span(&header, 1))));
  if (std::string_view(header.kind, sizeof header.kind) != kind)
    return error("{}: byte 0: is no file of kind '{}'", path.string(), kind);
  if (header.version != version)
    return error("{}: byte 8: is of version {}, this program reads version {}; make it anew", path.string(),
                 header.version, version);
  if (header.file_bytes != file.size_bytes())
    return error("{}: byte 16: should have {} bytes but has {}; it was cut short or written only in part",
                 path.string(), header.file_bytes, file.size_bytes());
  if (header.section_count > kLargestSectionCount ||
      sizeof header + header.section_count * sizeof(SectionEntry) > file.size_bytes())
    return error("{}: byte 12: claims {} sections, more than the file can hold", path.string(), header.section_count);

  SectionReader reader;
  reader.path_ = path;
  reader.tag_ = tag;
  reader.file_ = Buffer<std::byte>(tag, file.size_bytes());
  SPILLWAY_TRY(file.read(0, reader.file_));
  const auto* entries = reinterpret_cast<const SectionEntry*>(reader.file_.data() + sizeof header);
  const std::span table(entries, header.section_count);
  if (header_checksum(header, table) != header.checksum)
    return error("{}: byte 24: the checksum of the header does not match; the file is damaged", path.string());
  uint64_t end = sizeof header + table.size_bytes();
  for (const SectionEntry& entry : table) {
    if (!is_terminated(entry) || entry.offset_bytes > header.file_bytes ||
        entry.size_bytes > header.file_bytes - entry.offset_bytes || entry.offset_bytes % kAlignment != 0)
      return error("{}: a section lies outside the file; the file is damaged", path.string());
    SPILLWAY_TRY(reader.check_gap(end, entry.offset_bytes));
    end = entry.offset_bytes + entry.size_bytes;
    const std::span<const std::byte> bytes(reader.file_.data() + entry.offset_bytes, entry.size_bytes);
    if (checksum(bytes.data(), bytes.size()) != entry.checksum)
      return error("{}: byte {}: the checksum of section '{}' does not match; the file is damaged", path.string(),
                   entry.offset_bytes, entry.name);
    if (!reader.sections_.emplace(entry.name, bytes).second)
      return error("{}: section '{}' is there twice; the file is damaged", path.string(), entry.name);
  }
  SPILLWAY_TRY(reader.check_gap(end, file.size_bytes()));
  return reader;
}

Status SectionReader::check_gap(uint64_t end, uint64_t next) const {
  const bool is_next = next == aligned(end);
  if (is_next && std::all_of(file_.begin() + end, file_.begin() + next, [](std::byte b) { return b == std::byte{0}; }))
    return {};
  return error("{}: byte {}: something is between two sections; the file is damaged", path_.string(), end);
}

uint64_t SectionReader::checksum_without(std::initializer_list<std::string_view> names) const {
  uint64_t sum = 0;
  for (const auto& [section, bytes] : sections_) {
    if (std::find(names.begin(), names.end(), section) != names.end()) continue;
    sum = checksum(section.data(), section.size(), sum);
    sum = checksum(bytes.data(), bytes.size(), sum);
  }
  return sum;
}

bool SectionReader::has(std::string_view name) const { return sections_.contains(name); }

Result<std::span<const std::byte>> SectionReader::bytes(std::string_view name) const {
  const auto found = sections_.find(name);
  if (found == sections_.end()) return error("{}: has no section '{}'; the file is damaged", path_.string(), name);
  return found->second;
}

}  // namespace spillway::cache
