#pragma once

// Files with explicit reads and writes, counted by what they are for.
//
// Owns: file descriptors.
// Memory: none beyond the caller's buffers (a direct read of an unaligned range goes through a bounce buffer).
// Threads: a ReadFile may be read from any number of threads at once; a WriteFile belongs to one thread at a time.
// Fails: every call returns an error naming the file and the byte offset; a WriteFile that is not committed leaves
//        nothing behind (its temporary name is unlinked).

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "cache/base/result.h"

namespace spillway::cache {

enum class IoPurpose : uint8_t { scene, pages, attributes, textures, volumes, paths, hits, film, pack, count };
inline constexpr int kIoPurposeCount = static_cast<int>(IoPurpose::count);
[[nodiscard]] const char* name(IoPurpose purpose);

struct IoUse {
  uint64_t read_bytes = 0;
  uint64_t read_count = 0;
  uint64_t written_bytes = 0;
  uint64_t write_count = 0;
};
[[nodiscard]] IoUse io_use(IoPurpose purpose);

// The kernel's own account of this process: /proc/self/io rchar, wchar, read_bytes, write_bytes.
struct ProcessIo {
  uint64_t read_chars = 0, written_chars = 0, device_read_bytes = 0, device_written_bytes = 0;
};
[[nodiscard]] ProcessIo process_io();

inline constexpr size_t kDirectAlignment = 4096;

class ReadFile {
 public:
  // direct: bypass the page cache where the file system can (O_DIRECT), else drop what was read from the page cache
  // (posix_fadvise DONTNEED). `direct_effective()` says which it became.
  struct Options {
    IoPurpose purpose = IoPurpose::scene;
    bool direct = false;
  };
  static Result<ReadFile> open(const std::filesystem::path& path, Options options);

  ReadFile(ReadFile&&) noexcept;
  ReadFile& operator=(ReadFile&&) noexcept;
  ~ReadFile();

  // Reads exactly bytes.size() bytes at offset, or fails. Fast when buffer, offset and size are 4096-aligned.
  Status read(uint64_t offset, std::span<std::byte> bytes) const;
  [[nodiscard]] uint64_t size_bytes() const { return size_bytes_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] bool direct_effective() const { return direct_; }

 private:
  ReadFile() = default;
  std::filesystem::path path_;
  int descriptor_ = -1;
  uint64_t size_bytes_ = 0;
  IoPurpose purpose_ = IoPurpose::scene;
  bool direct_ = false;
  bool drop_cache_ = false;
};

// Written under `path` + a temporary suffix; commit() syncs and renames. Destruction without commit removes it.
// What is aligned (place, memory and size, to kDirectAlignment) bypasses the page cache where the file system can.
class WriteFile {
 public:
  static Result<WriteFile> create(const std::filesystem::path& path, IoPurpose purpose);
  WriteFile(WriteFile&&) noexcept;
  WriteFile& operator=(WriteFile&&) noexcept;
  ~WriteFile();

  Status append(std::span<const std::byte> bytes);
  Status pad_to(uint64_t alignment_bytes);  // zeros up to the next multiple
  [[nodiscard]] uint64_t size_bytes() const { return size_bytes_; }
  Status commit();

 private:
  WriteFile() = default;
  std::filesystem::path path_, temporary_path_;
  int descriptor_ = -1;
  int direct_descriptor_ = -1;  // the same file; -1 where it has no direct writes
  uint64_t size_bytes_ = 0;
  IoPurpose purpose_ = IoPurpose::pack;
};

// A directory of unlinked-on-exit scratch files: their names vanish from the directory as soon as they are open, so that
// a killed process leaves nothing behind. Total bytes in use and their peak are counted. Writes that fail for lack of
// space say how much the scratch held and how much more was asked for.
class Scratch {
 public:
  // limit_bytes: most bytes in use at a time; 0: what the disk has.
  static Result<std::unique_ptr<Scratch>> create(const std::filesystem::path& directory, uint64_t limit_bytes = 0);

  // A new empty file, open for reading and writing at explicit offsets; direct I/O where possible.
  class File;
  Result<std::unique_ptr<File>> create_file(std::string_view what, IoPurpose purpose);

  [[nodiscard]] uint64_t used_bytes() const { return used_bytes_.load(); }
  [[nodiscard]] uint64_t peak_bytes() const { return peak_bytes_.load(); }
  [[nodiscard]] const std::filesystem::path& directory() const { return directory_; }

 private:
  Scratch(std::filesystem::path directory, uint64_t limit_bytes)
      : directory_(std::move(directory)), limit_bytes_(limit_bytes) {}
  Status claim(uint64_t bytes, std::string_view what);
  Error full(uint64_t bytes, std::string_view what) const;

  std::filesystem::path directory_;
  uint64_t limit_bytes_;
  std::atomic<uint64_t> used_bytes_{0}, peak_bytes_{0};
  friend class File;
};

class Scratch::File {
 public:
  ~File();  // gives the bytes back
  // Any number of threads may write and read at once, in places of their own.
  Status write(uint64_t offset, std::span<const std::byte> bytes);  // 4096-aligned offset, size and buffer
  Status read(uint64_t offset, std::span<std::byte> bytes) const;   // the same

 private:
  friend class Scratch;
  File() = default;
  Scratch* scratch_ = nullptr;
  std::string what_;
  int descriptor_ = -1;
  std::mutex growing_;
  std::atomic<uint64_t> size_bytes_{0};
  IoPurpose purpose_ = IoPurpose::paths;
};

}  // namespace spillway::cache
