#include "tools/import/gunzip.h"

#include <zlib.h>

#include <cerrno>
#include <cstring>
#include <vector>

namespace spillway::tools {
namespace {

struct CloseGzip {
  void operator()(gzFile file) const { gzclose(file); }
};

}  // namespace

Result<UnpackedFile> gunzip(const std::filesystem::path& file) {
  const std::unique_ptr<gzFile_s, CloseGzip> packed(gzopen(file.c_str(), "rb"));
  if (!packed) return error("{}: {}: check the path", file.string(), std::strerror(errno));
  UnpackedFile out{FileStream(std::tmpfile()), 0};
  if (!out.stream) return error("{}: no temporary file to unpack it: {}", file.string(), std::strerror(errno));
  std::vector<char> piece(256 << 10);
  while (const int got = gzread(packed.get(), piece.data(), static_cast<unsigned>(piece.size()))) {
    if (got < 0) break;
    if (std::fwrite(piece.data(), 1, static_cast<size_t>(got), out.stream.get()) != static_cast<size_t>(got))
      return error("{}: unpacking it after {} bytes: {}", file.string(), out.size_bytes, std::strerror(errno));
    out.size_bytes += static_cast<uint64_t>(got);
  }
  int code = Z_OK;
  const char* const what = gzerror(packed.get(), &code);
  if (code != Z_OK && code != Z_STREAM_END)
    return error("{}: damaged after {} unpacked bytes: {}; write it again", file.string(), out.size_bytes, what);
  if (gzdirect(packed.get()) != 0) return error("{}: is not a gzip file", file.string());
  if (std::fflush(out.stream.get()) != 0) return error("{}: unpacking it: {}", file.string(), std::strerror(errno));
  std::rewind(out.stream.get());
  return out;
}

}  // namespace spillway::tools
