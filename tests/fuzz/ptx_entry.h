#pragma once

// A stranger's .ptx file through the reader; see entries.h.

#include <string>
#include <string_view>

#include "pipeline/pack/ptx_file.h"
#include "tests/support/fuzz_folder.h"

namespace spillway::pipeline {

// Opens it, and takes a few faces' texels at two resolutions.
inline std::string fault_of_ptx(std::string_view bytes) {
  const std::filesystem::path path = test::fuzz_folder().write("some.ptx", bytes);
  const PtxFile::Options options{.premultiply = true, .memory_limit_bytes = 64 << 20};
  const Result<PtxFile> file = PtxFile::open(path, options);
  const auto has_place = [](const Error& e) {
    return e.message.find("some.ptx: ") != std::string::npos && e.message.find("byte ") != std::string::npos;
  };
  if (!file) return has_place(file.error()) ? "" : "an error without a place: " + file.error().message;
  // The tables of n bytes unpack to at most 1032 n.
  if (file->faces().size_bytes() > 1032 * bytes.size() + 64) return "more faces than the file justifies";
  for (uint32_t f = 0; f < file->faces().size() && f < 8; ++f) {
    const cache::FaceInfo& face = file->faces()[f];
    if (first_inconsistent_edge(file->faces(), file->info().shape, f) != cache::kNoFace)
      return "neighbours that do not agree";
    if (face.ulog2 + face.vlog2 > 12) continue;
    for (const uint32_t less : {0u, 1u}) {
      if (face.ulog2 < less || face.vlog2 < less) continue;
      const auto texels = file->texels(f, face.ulog2 - less, face.vlog2 - less);
      if (!texels && !has_place(texels.error())) return "an error without a place: " + texels.error().message;
      if (texels && texels->size() != (size_t{file->texel_bytes()} << (face.ulog2 + face.vlog2 - 2 * less)))
        return "a wrong number of texels";
    }
  }
  return {};
}

}  // namespace spillway::pipeline
