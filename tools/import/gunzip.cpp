#include "tools/import/gunzip.h"

#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

namespace spillway::tools {
namespace {

constexpr size_t kPieceBytes = 256 << 10;

}  // namespace

void GzipFile::Close::operator()(gzFile_s* file) const { gzclose(file); }

Result<GzipFile> GzipFile::open(const std::filesystem::path& file, const GunzipLimits& limits) {
  std::error_code code;
  const uint64_t packed_bytes = std::filesystem::file_size(file, code);
  if (code) return error("{}: {}: check the path", file.string(), code.message());
  GzipFile gzip;
  gzip.file_.reset(gzopen(file.c_str(), "rb"));
  if (!gzip.file_) return error("{}: {}: check the path", file.string(), std::strerror(errno));
  gzbuffer(gzip.file_.get(), kPieceBytes);
  SPILLWAY_TRY(gzip.measure(file.string(), std::max(limits.always_bytes, limits.most_ratio * packed_bytes)));
  if (gzrewind(gzip.file_.get()) != 0) return error("{}: cannot be read twice: check the disk", file.string());
  return gzip;
}

Status GzipFile::measure(const std::string& name, uint64_t most_bytes) {
  std::vector<char> piece(kPieceBytes);
  while (const size_t got = read(piece.data(), piece.size())) {
    size_bytes_ += got;
    if (size_bytes_ > most_bytes)
      return error(
          "{}: unpacks to more than {} bytes, which no mesh of its size does: unpack it yourself if it is meant", name,
          most_bytes);
  }
  int code = Z_OK;
  const char* const what = gzerror(file_.get(), &code);
  if (code != Z_OK && code != Z_STREAM_END)
    return error("{}: damaged after {} unpacked bytes: {}; write it again", name, size_bytes_, what);
  if (gzdirect(file_.get()) != 0) return error("{}: is not a gzip file", name);
  return {};
}

size_t GzipFile::read(void* into, size_t bytes) {
  const int got = gzread(file_.get(), into, static_cast<unsigned>(std::min<size_t>(bytes, 1 << 30)));
  return got > 0 ? static_cast<size_t>(got) : 0;
}

}  // namespace spillway::tools
