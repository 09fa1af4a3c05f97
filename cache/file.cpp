#include "cache/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "cache/base/memory.h"
#include "cache/trace_log.h"

namespace spillway::cache {
namespace {

struct PurposeCounters {
  std::atomic<uint64_t> read_bytes{0}, read_count{0}, written_bytes{0}, write_count{0};
};
std::array<PurposeCounters, kIoPurposeCount> counters;

PurposeCounters& counter(IoPurpose purpose) { return counters[static_cast<size_t>(purpose)]; }

void count_read(IoPurpose purpose, uint64_t bytes) {
  counter(purpose).read_bytes += bytes;
  ++counter(purpose).read_count;
}
void count_write(IoPurpose purpose, uint64_t bytes) {
  counter(purpose).written_bytes += bytes;
  ++counter(purpose).write_count;
}

Error system_error(const char* what, const std::filesystem::path& path, uint64_t offset) {
  return error("{}: {} failed at byte {}: {}", path.string(), what, offset, std::strerror(errno));
}

// Reads until `size` bytes are there, the file ends or the system refuses. Returns the bytes read, or -1.
int64_t read_fully(int descriptor, uint64_t offset, std::byte* to, uint64_t size) {
  uint64_t done = 0;
  while (done < size) {
    const ssize_t got = pread(descriptor, to + done, size - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return -1;
    if (got == 0) break;
    done += static_cast<uint64_t>(got);
  }
  return static_cast<int64_t>(done);
}

bool write_fully(int descriptor, uint64_t offset, const std::byte* from, uint64_t size) {
  uint64_t done = 0;
  while (done < size) {
    const ssize_t put = pwrite(descriptor, from + done, size - done, static_cast<off_t>(offset + done));
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) return false;
    done += static_cast<uint64_t>(put);
  }
  return true;
}

bool is_aligned(uint64_t offset, const void* bytes, uint64_t size) {
  return (offset | reinterpret_cast<uintptr_t>(bytes) | size) % kDirectAlignment == 0;
}

void sync_directory(const std::filesystem::path& path) {
  const auto parent = path.parent_path().empty() ? std::filesystem::path(".") : path.parent_path();
  const int descriptor = ::open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  fsync(descriptor);
  ::close(descriptor);
}

}  // namespace

const char* name(IoPurpose purpose) {
  static constexpr const char* kNames[kIoPurposeCount] = {"scene", "pages", "attributes", "textures",
                                                          "volumes", "paths", "hits",  "film",       "pack"};
  return kNames[static_cast<size_t>(purpose)];
}

IoUse io_use(IoPurpose purpose) {
  const PurposeCounters& c = counter(purpose);
  return {c.read_bytes, c.read_count, c.written_bytes, c.write_count};
}

ProcessIo process_io() {
  ProcessIo io;
  std::ifstream file("/proc/self/io");
  std::string key;
  uint64_t value = 0;
  while (file >> key >> value) {
    if (key == "rchar:") io.read_chars = value;
    if (key == "wchar:") io.written_chars = value;
    if (key == "read_bytes:") io.device_read_bytes = value;
    if (key == "write_bytes:") io.device_written_bytes = value;
  }
  return io;
}

// ---- ReadFile ----

Result<ReadFile> ReadFile::open(const std::filesystem::path& path, Options options) {
  ReadFile file;
  file.path_ = path;
  file.purpose_ = options.purpose;
  if (options.direct) file.descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_DIRECT);
  file.direct_ = file.descriptor_ >= 0;
  if (!file.direct_) file.descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  file.drop_cache_ = options.direct && !file.direct_;
  if (file.descriptor_ < 0) return error("{}: cannot be opened: {}", path.string(), std::strerror(errno));
  struct stat facts {};
  if (fstat(file.descriptor_, &facts) != 0) return system_error("stat", path, 0);
  if (!S_ISREG(facts.st_mode)) return error("{}: is not a regular file", path.string());
  file.size_bytes_ = static_cast<uint64_t>(facts.st_size);
  return file;
}

ReadFile::ReadFile(ReadFile&& other) noexcept { *this = std::move(other); }

ReadFile& ReadFile::operator=(ReadFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(size_bytes_, other.size_bytes_);
  std::swap(purpose_, other.purpose_);
  std::swap(direct_, other.direct_);
  std::swap(drop_cache_, other.drop_cache_);
  return *this;
}

ReadFile::~ReadFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Status ReadFile::read(uint64_t offset, std::span<std::byte> bytes) const {
  TraceSpan span("read", name(purpose_));
  span.set_range(offset, bytes.size());
  if (offset > size_bytes_ || bytes.size() > size_bytes_ - offset)
    return error("{}: ends at byte {}, but bytes {} to {} are needed; the file is cut short", path_.string(),
                 size_bytes_, offset, offset + bytes.size());
  if (direct_ && !is_aligned(offset, bytes.data(), bytes.size())) {
    // The kernel wants aligned requests: read the pages around the range, copy the range out.
    const uint64_t first = offset / kDirectAlignment * kDirectAlignment;
    const uint64_t last = (offset + bytes.size() + kDirectAlignment - 1) / kDirectAlignment * kDirectAlignment;
    Buffer<std::byte> around(MemoryTag::streams, last - first);
    const int64_t got = read_fully(descriptor_, first, around.data(), around.size());
    if (got < static_cast<int64_t>(offset - first + bytes.size())) return system_error("read", path_, offset);
    count_read(purpose_, static_cast<uint64_t>(got));
    std::memcpy(bytes.data(), around.data() + (offset - first), bytes.size());
    return {};
  }
  const int64_t got = read_fully(descriptor_, offset, bytes.data(), bytes.size());
  if (got != static_cast<int64_t>(bytes.size())) return system_error("read", path_, offset);
  count_read(purpose_, bytes.size());
  if (drop_cache_)
    posix_fadvise(descriptor_, static_cast<off_t>(offset), static_cast<off_t>(bytes.size()), POSIX_FADV_DONTNEED);
  return {};
}

// ---- WriteFile ----

Result<WriteFile> WriteFile::create(const std::filesystem::path& path, IoPurpose purpose) {
  WriteFile file;
  file.path_ = path;
  file.temporary_path_ = path;
  file.temporary_path_ += fmt::format(".{}.tmp", getpid());
  file.purpose_ = purpose;
  file.descriptor_ = ::open(file.temporary_path_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file.descriptor_ < 0)
    return error("{}: cannot be created: {}", file.temporary_path_.string(), std::strerror(errno));
  file.direct_descriptor_ = ::open(file.temporary_path_.c_str(), O_WRONLY | O_CLOEXEC | O_DIRECT);
  return file;
}

WriteFile::WriteFile(WriteFile&& other) noexcept { *this = std::move(other); }

WriteFile& WriteFile::operator=(WriteFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(temporary_path_, other.temporary_path_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(direct_descriptor_, other.direct_descriptor_);
  std::swap(size_bytes_, other.size_bytes_);
  std::swap(purpose_, other.purpose_);
  return *this;
}

WriteFile::~WriteFile() {
  if (direct_descriptor_ >= 0) ::close(direct_descriptor_);
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(temporary_path_.c_str());
}

Status WriteFile::append(std::span<const std::byte> bytes) {
  const bool direct = direct_descriptor_ >= 0 && is_aligned(size_bytes_, bytes.data(), bytes.size());
  if (!write_fully(direct ? direct_descriptor_ : descriptor_, size_bytes_, bytes.data(), bytes.size())) {
    if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG)
      return error("{}: the disk is full: {} bytes are written and {} more were to follow at once ({}); free space or name "
                   "another place",
                   path_.string(), size_bytes_, bytes.size(), std::strerror(errno));
    return error("{}: writing {} more bytes at byte {} failed: {}", path_.string(), bytes.size(), size_bytes_,
                 std::strerror(errno));
  }
  count_write(purpose_, bytes.size());
  size_bytes_ += bytes.size();
  return {};
}

Status WriteFile::pad_to(uint64_t alignment_bytes) {
  static constexpr std::array<std::byte, kDirectAlignment> kZeros{};
  const uint64_t rest = size_bytes_ % alignment_bytes;
  uint64_t missing = rest == 0 ? 0 : alignment_bytes - rest;
  while (missing > 0) {
    const uint64_t now = std::min<uint64_t>(missing, kZeros.size());
    SPILLWAY_TRY(append(std::span(kZeros).first(now)));
    missing -= now;
  }
  return {};
}

Status WriteFile::commit() {
  if (fsync(descriptor_) != 0) return system_error("sync", path_, size_bytes_);
  if (direct_descriptor_ >= 0) ::close(std::exchange(direct_descriptor_, -1));
  if (::close(std::exchange(descriptor_, -1)) != 0) {
    ::unlink(temporary_path_.c_str());
    return system_error("close", path_, size_bytes_);
  }
  if (::rename(temporary_path_.c_str(), path_.c_str()) != 0) {
    const Error problem = system_error("rename", path_, 0);
    ::unlink(temporary_path_.c_str());
    return problem;
  }
  sync_directory(path_);
  return {};
}

// ---- Scratch ----

Result<std::unique_ptr<Scratch>> Scratch::create(const std::filesystem::path& directory, uint64_t limit_bytes) {
  std::error_code code;
  std::filesystem::create_directories(directory, code);
  if (!std::filesystem::is_directory(directory, code))
    return error("{}: is no directory for scratch files; name another with --scratch", directory.string());
  return std::unique_ptr<Scratch>(new Scratch(directory, limit_bytes));
}

Error Scratch::full(uint64_t bytes, std::string_view what) const {
  return error("{}: the scratch disk is full: {} bytes are in use and {} needs {} more; free space, name another "
               "directory with --scratch, or allow more with --scratch-limit or --memory",
               directory_.string(), used_bytes(), what, bytes);
}

Status Scratch::claim(uint64_t bytes, std::string_view what) {
  const uint64_t used = used_bytes_.fetch_add(bytes) + bytes;
  if (limit_bytes_ != 0 && used > limit_bytes_) {
    used_bytes_ -= bytes;
    return full(bytes, what);
  }
  uint64_t seen = peak_bytes_.load();
  while (seen < used && !peak_bytes_.compare_exchange_weak(seen, used)) {
  }
  return {};
}

Result<std::unique_ptr<Scratch::File>> Scratch::create_file(std::string_view what, IoPurpose purpose) {
  std::string path = (directory_ / fmt::format("spillway-{}-XXXXXX", getpid())).string();
  const int descriptor = mkostemp(path.data(), O_CLOEXEC);
  if (descriptor < 0) return error("{}: no scratch file can be made: {}", directory_.string(), std::strerror(errno));
  ::unlink(path.c_str());
  fcntl(descriptor, F_SETFL, fcntl(descriptor, F_GETFL) | O_DIRECT);  // where the file system can
  std::unique_ptr<File> file(new File());
  file->scratch_ = this;
  file->what_ = what;
  file->descriptor_ = descriptor;
  file->purpose_ = purpose;
  return file;
}

Scratch::File::~File() {
  ::close(descriptor_);
  scratch_->used_bytes_ -= size_bytes_;
}

Status Scratch::File::write(uint64_t offset, std::span<const std::byte> bytes) {
  TraceSpan span("write", name(purpose_));
  span.set_range(offset, bytes.size());
  const uint64_t end = offset + bytes.size();
  if (end > size_bytes_.load()) {
    const std::lock_guard lock(growing_);
    const uint64_t size = size_bytes_.load();
    if (end > size) {
      SPILLWAY_TRY(scratch_->claim(end - size, what_));
      size_bytes_ = end;
    }
  }
  if (!write_fully(descriptor_, offset, bytes.data(), bytes.size())) {
    if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG) return scratch_->full(bytes.size(), what_);
    return error("{}: writing {} failed at byte {}: {}", scratch_->directory_.string(), what_, offset,
                 std::strerror(errno));
  }
  count_write(purpose_, bytes.size());
  return {};
}

Status Scratch::File::read(uint64_t offset, std::span<std::byte> bytes) const {
  TraceSpan span("read", name(purpose_));
  span.set_range(offset, bytes.size());
  const int64_t got = read_fully(descriptor_, offset, bytes.data(), bytes.size());
  if (got != static_cast<int64_t>(bytes.size()))
    return error("{}: reading {} back failed at byte {}: {}", scratch_->directory_.string(), what_, offset,
                 got < 0 ? std::strerror(errno) : "the file is shorter than what was written");
  count_read(purpose_, bytes.size());
  return {};
}

}  // namespace spillway::cache
