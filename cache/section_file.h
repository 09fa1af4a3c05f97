#pragma once

// A file of named, checksummed byte sections: the store's manifest and the integer film are such files.
//
// Owns: after open() the file, else nothing. Memory: after read() the file; load() takes a section's own size.
// Fails: a prefix, a flipped byte, an unknown version or an absurd size is refused with the file and byte offset before
//        memory is taken (of a section after open(): when it is loaded); the file is written under a temporary name,
//        synced and renamed.

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/file.h"

namespace spillway::cache {

class SectionWriter {
 public:
  // kind: eight characters that name the format ("SPWSTORE", "SPWFILM "); version: of that kind.
  SectionWriter(std::string kind, uint32_t version);
  void add(std::string name, std::span<const std::byte> bytes);       // copies
  void add_view(std::string name, std::span<const std::byte> bytes);  // which must live until write()
  // Of so many bytes, made while the file is written: twice, first for their checksum, and never two such at a time.
  using Make = std::function<Status(std::span<std::byte> bytes)>;
  void add_made(std::string name, uint64_t size_bytes, Make make);
  template <class T>
  void add_array(std::string name, std::span<const T> items) {
    add(std::move(name), std::as_bytes(items));
  }
  Status write(const std::filesystem::path& path) const;

 private:
  std::string kind_;
  uint32_t version_;
  struct Section {
    std::string name;
    std::span<const std::byte> bytes;  // unless they are made
    uint64_t size_bytes;
    Make make;
  };
  // The section's bytes; `made` keeps those that were made for it.
  static Result<std::span<const std::byte>> bytes_of(const Section& section, Buffer<std::byte>& made);
  std::vector<Section> sections_;
  std::deque<std::vector<std::byte>> copies_;
};

class SectionReader {
 public:
  // All sections in memory, each checked.
  static Result<SectionReader> read(const std::filesystem::path& path, std::string_view kind, uint32_t version,
                                    MemoryTag tag);
  // The table alone; sections are read and checked by load().
  static Result<SectionReader> open(const std::filesystem::path& path, std::string_view kind, uint32_t version);

  [[nodiscard]] bool has(std::string_view name) const;
  // Of names and contents of all sections but those named, by ascending name.
  [[nodiscard]] uint64_t checksum_without(std::initializer_list<std::string_view> names) const;
  Result<std::span<const std::byte>> bytes(std::string_view name) const;  // after read()
  // Fails when the section is missing or its size is no multiple of sizeof(T). Copies into a Buffer of the tag of
  // read().
  template <class T>
  Result<Buffer<T>> array(std::string_view name) const {
    SPILLWAY_ASSIGN(const std::span<const std::byte> raw, bytes(name));
    SPILLWAY_TRY(check_items(name, raw.size(), sizeof(T)));
    Buffer<T> items(tag_, raw.size() / sizeof(T));
    if (!raw.empty()) std::memcpy(items.data(), raw.data(), raw.size());
    return items;
  }
  // The same straight from the file, after open().
  template <class T>
  Result<Buffer<T>> load(std::string_view name, MemoryTag tag) const {
    SPILLWAY_ASSIGN(const uint64_t size, size_of(name));
    SPILLWAY_TRY(check_items(name, size, sizeof(T)));
    Buffer<T> items(tag, size / sizeof(T));
    SPILLWAY_TRY(load_bytes(name, std::as_writable_bytes(std::span<T>(items))));
    return items;
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  struct Section {
    uint64_t offset_bytes, size_bytes, checksum;
  };

  Status read_table(const ReadFile& file, std::string_view kind, uint32_t version);
  Status check_gap(const ReadFile& file, uint64_t end, uint64_t next) const;
  Status check_bytes(std::string_view name, const Section& section, std::span<const std::byte> bytes) const;
  Status check_items(std::string_view name, uint64_t size, size_t item_bytes) const;
  Result<uint64_t> size_of(std::string_view name) const;
  Status load_bytes(std::string_view name, std::span<std::byte> bytes) const;

  std::filesystem::path path_;
  MemoryTag tag_ = MemoryTag::scene;
  Buffer<std::byte> contents_;      // of the whole file, after read()
  std::shared_ptr<ReadFile> file_;  // after open()
  std::map<std::string, Section, std::less<>> sections_;
};

}  // namespace spillway::cache
