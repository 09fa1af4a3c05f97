#include "cache/section_file.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "cache/base/alignment.h"
#include "cache/base/check.h"
#include "cache/base/hash.h"

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

uint64_t aligned(uint64_t n) { return spillway::aligned(n, kAlignment); }

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
  add_view(std::move(name), copies_.emplace_back(bytes.begin(), bytes.end()));
}

void SectionWriter::add_view(std::string name, std::span<const std::byte> bytes) {
  SPILLWAY_CHECK(name.size(), <, sizeof SectionEntry::name);
  sections_.push_back({std::move(name), bytes, bytes.size(), {}});
}

void SectionWriter::add_made(std::string name, uint64_t size_bytes, Make make) {
  SPILLWAY_CHECK(name.size(), <, sizeof SectionEntry::name);
  sections_.push_back({std::move(name), {}, size_bytes, std::move(make)});
}

Result<std::span<const std::byte>> SectionWriter::bytes_of(const Section& section, Buffer<std::byte>& made) {
  if (!section.make) return section.bytes;
  made.grow(MemoryTag::streams, section.size_bytes);
  SPILLWAY_TRY(section.make(std::span(made.data(), section.size_bytes)));
  return std::span<const std::byte>(made.data(), section.size_bytes);
}

Status SectionWriter::write(const std::filesystem::path& path) const {
  FileHeader header{};
  std::memcpy(header.kind, kind_.data(), sizeof header.kind);
  header.version = version_;
  header.section_count = static_cast<uint32_t>(sections_.size());
  std::vector<SectionEntry> entries(sections_.size());
  Buffer<std::byte> made;
  uint64_t offset = aligned(sizeof header + entries.size() * sizeof(SectionEntry));
  for (size_t i = 0; i < sections_.size(); ++i) {
    SPILLWAY_ASSIGN(const std::span<const std::byte> bytes, bytes_of(sections_[i], made));
    std::memcpy(entries[i].name, sections_[i].name.data(), sections_[i].name.size());
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
  for (const Section& section : sections_) {
    SPILLWAY_ASSIGN(const std::span<const std::byte> bytes, bytes_of(section, made));
    SPILLWAY_TRY(file.append(bytes));
    SPILLWAY_TRY(file.pad_to(kAlignment));
  }
  return file.commit();
}

namespace {

Result<FileHeader> read_header(const ReadFile& file, std::string_view kind, uint32_t version) {
  const std::string path = file.path().string();
  FileHeader header{};
  if (file.size_bytes() < sizeof header)
    return error("{}: has {} bytes, less than a header; it is damaged or no file of ours", path, file.size_bytes());
  SPILLWAY_TRY(file.read(0, std::as_writable_bytes(std::span(&header, 1))));
  if (std::string_view(header.kind, sizeof header.kind) != kind)
    return error("{}: byte 0: is no file of kind '{}'", path, kind);
  if (header.version != version)
    return error("{}: byte 8: is of version {}, this program reads version {}; make it anew", path, header.version,
                 version);
  if (header.file_bytes != file.size_bytes())
    return error("{}: byte 16: should have {} bytes but has {}; it was cut short or written only in part", path,
                 header.file_bytes, file.size_bytes());
  if (header.section_count > kLargestSectionCount ||
      sizeof header + header.section_count * sizeof(SectionEntry) > file.size_bytes())
    return error("{}: byte 12: claims {} sections, more than the file can hold", path, header.section_count);
  return header;
}

}  // namespace

Status SectionReader::read_table(const ReadFile& file, std::string_view kind, uint32_t version) {
  path_ = file.path();
  SPILLWAY_ASSIGN(const FileHeader header, read_header(file, kind, version));
  std::vector<SectionEntry> table(header.section_count);
  SPILLWAY_TRY(file.read(sizeof header, std::as_writable_bytes(std::span(table))));
  if (header_checksum(header, table) != header.checksum)
    return error("{}: byte 24: the checksum of the header does not match; the file is damaged", path_.string());
  uint64_t end = sizeof header + table.size() * sizeof(SectionEntry);
  for (const SectionEntry& entry : table) {
    if (!is_terminated(entry) || entry.offset_bytes > header.file_bytes ||
        entry.size_bytes > header.file_bytes - entry.offset_bytes || entry.offset_bytes % kAlignment != 0)
      return error("{}: a section lies outside the file; the file is damaged", path_.string());
    SPILLWAY_TRY(check_gap(file, end, entry.offset_bytes));
    end = entry.offset_bytes + entry.size_bytes;
    if (!sections_.emplace(entry.name, Section{entry.offset_bytes, entry.size_bytes, entry.checksum}).second)
      return error("{}: section '{}' is there twice; the file is damaged", path_.string(), entry.name);
  }
  return check_gap(file, end, file.size_bytes());
}

Result<SectionReader> SectionReader::open(const std::filesystem::path& path, std::string_view kind, uint32_t version) {
  SPILLWAY_ASSIGN(ReadFile file, ReadFile::open(path, {.purpose = IoPurpose::scene}));
  SectionReader reader;
  SPILLWAY_TRY(reader.read_table(file, kind, version));
  reader.file_ = std::make_shared<ReadFile>(std::move(file));
  return reader;
}

Result<SectionReader> SectionReader::read(const std::filesystem::path& path, std::string_view kind, uint32_t version,
                                          MemoryTag tag) {
  SPILLWAY_ASSIGN(SectionReader reader, open(path, kind, version));
  reader.tag_ = tag;
  reader.contents_ = Buffer<std::byte>(tag, reader.file_->size_bytes());
  SPILLWAY_TRY(reader.file_->read(0, reader.contents_));
  reader.file_.reset();
  for (const auto& [name, section] : reader.sections_)
    SPILLWAY_TRY(
        reader.check_bytes(name, section, {reader.contents_.data() + section.offset_bytes, section.size_bytes}));
  return reader;
}

Status SectionReader::check_gap(const ReadFile& file, uint64_t end, uint64_t next) const {
  std::array<std::byte, kAlignment> gap{};
  const bool is_next = next == aligned(end);
  if (is_next) SPILLWAY_TRY(file.read(end, std::span(gap).first(next - end)));
  if (is_next && std::ranges::all_of(gap, [](std::byte b) { return b == std::byte{0}; })) return {};
  return error("{}: byte {}: something is between two sections; the file is damaged", path_.string(), end);
}

Status SectionReader::check_bytes(std::string_view name, const Section& section,
                                  std::span<const std::byte> bytes) const {
  if (checksum(bytes.data(), bytes.size()) == section.checksum) return {};
  return error("{}: byte {}: the checksum of section '{}' does not match; the file is damaged", path_.string(),
               section.offset_bytes, name);
}

Status SectionReader::check_items(std::string_view name, uint64_t size, size_t item_bytes) const {
  if (size % item_bytes == 0) return {};
  return error("{}: section '{}' has {} bytes, which is no multiple of {}; the file is damaged", path_.string(), name,
               size, item_bytes);
}

uint64_t SectionReader::checksum_without(std::initializer_list<std::string_view> names) const {
  uint64_t sum = 0;
  for (const auto& [name, section] : sections_) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    sum = checksum(name.data(), name.size(), sum);
    sum = checksum(&section.checksum, sizeof section.checksum, sum);
  }
  return sum;
}

bool SectionReader::has(std::string_view name) const { return sections_.contains(name); }

Result<uint64_t> SectionReader::size_of(std::string_view name) const {
  const auto found = sections_.find(name);
  if (found == sections_.end()) return error("{}: has no section '{}'; the file is damaged", path_.string(), name);
  return found->second.size_bytes;
}

Status SectionReader::load_bytes(std::string_view name, std::span<std::byte> bytes) const {
  const Section& section = sections_.find(name)->second;
  SPILLWAY_TRY(file_->read(section.offset_bytes, bytes));
  return check_bytes(name, section, bytes);
}

Result<std::span<const std::byte>> SectionReader::bytes(std::string_view name) const {
  const auto found = sections_.find(name);
  if (found == sections_.end()) return error("{}: has no section '{}'; the file is damaged", path_.string(), name);
  const Section& section = found->second;
  return std::span<const std::byte>(contents_.data() + section.offset_bytes, section.size_bytes);
}

}  // namespace spillway::cache
