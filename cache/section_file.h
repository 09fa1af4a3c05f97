#pragma once

// A file of named, checksummed byte sections: the store's manifest and the integer film are such files.
//
// Owns: nothing after the call. Memory: the sections, as Buffers of the given tag.
// Fails: a prefix, a flipped byte, an unknown version or an absurd size is refused with the file and byte offset before
//        memory is taken; the file is written under a temporary name, synced and renamed.

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "cache/base/memory.h"
#include "cache/base/result.h"

namespace spillway::cache {

class SectionWriter {
 public:
  // kind: eight characters that name the format ("SPWSTORE", "SPWFILM "); version: of that kind.
  SectionWriter(std::string kind, uint32_t version);
  void add(std::string name, std::span<const std::byte> bytes);  // copies
  template <class T>
  void add_array(std::string name, std::span<const T> items) {
    add(std::move(name), std::as_bytes(items));
  }
  Status write(const std::filesystem::path& path) const;

 private:
  std::string kind_;
  uint32_t version_;
  std::vector<std::pair<std::string, std::vector<std::byte>>> sections_;
};

class SectionReader {
 public:
  static Result<SectionReader> read(const std::filesystem::path& path, std::string_view kind, uint32_t version,
                                    MemoryTag tag);
  [[nodiscard]] bool has(std::string_view name) const;
  // Of names and contents of all sections but those named, by ascending name.
  [[nodiscard]] uint64_t checksum_without(std::initializer_list<std::string_view> names) const;
  Result<std::span<const std::byte>> bytes(std::string_view name) const;
  // Fails when the section is missing or its size is no multiple of sizeof(T). Copies into a Buffer of the tag.
  template <class T>
  Result<Buffer<T>> array(std::string_view name) const {
    SPILLWAY_ASSIGN(const std::span<const std::byte> raw, bytes(name));
    if (raw.size() % sizeof(T) != 0)
      return error("{}: section '{}' has {} bytes, which is no multiple of {}; the file is damaged", path_.string(),
                   name, raw.size(), sizeof(T));
    Buffer<T> items(tag_, raw.size() / sizeof(T));
    if (!raw.empty()) std::memcpy(items.data(), raw.data(), raw.size());
    return items;
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  Status check_gap(uint64_t end, uint64_t next) const;

  std::filesystem::path path_;
  MemoryTag tag_ = MemoryTag::scene;
  Buffer<std::byte> file_;
  std::map<std::string, std::span<const std::byte>, std::less<>> sections_;
};

}  // namespace spillway::cache
