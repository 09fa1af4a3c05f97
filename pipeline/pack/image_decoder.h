#pragma once

// Packs images in a child process, one after another.
//
// Decoders of image formats are not ours and not hardened: their crash, or their end by a limit on memory or time, is
// an error that names the file, and the next image gets a new process. The child is the program spillway_decode_image
// beside the running one: a process forked from one with threads could wait for ever on a lock that a thread of it
// held. Not safe to share between threads; several decoders work side by side. Fails: as pack_image, and where the
// program is missing or cannot be started.

#include <sys/types.h>

#include <cstdint>
#include <filesystem>

#include "cache/base/result.h"
#include "cache/texture_cache.h"

namespace spillway::pipeline {

struct ImageDecoderOptions {
  uint64_t memory_limit_bytes = 8ull << 30;  // of the child's address space
  uint32_t time_limit_seconds = 600;         // of its processor time an image; of the clock's, four times that
};

class ImageDecoder {
 public:
  explicit ImageDecoder(const ImageDecoderOptions& options = {}) : options_(options) {}
  ImageDecoder(const ImageDecoder&) = delete;
  ImageDecoder& operator=(const ImageDecoder&) = delete;
  ~ImageDecoder();

  // As pack_image; creates the directory.
  Result<cache::ImageInfo> pack(const std::filesystem::path& source, cache::TexelEncoding encoding,
                                const std::filesystem::path& textures_directory, uint32_t image_index);

 private:
  Status start();
  // Ends the process, by force where asked, and gives its wait status.
  int stop(bool force);

  ImageDecoderOptions options_;
  int socket_ = -1;
  pid_t process_ = -1;
};

// What the child does: serves the requests that come through `socket` until its other end is closed.
void serve_image_decoder(int socket);

}  // namespace spillway::pipeline
