#pragma once

// .ptx, .facetex and EXR files of one face texture into each other.
//
// The middle is .facetex. As EXR each size of face is a part, its faces as in a .facetex image, in linear light: half
// for 8 bit and half, float for the others, from which the same texels come back; a text attribute holds the rest. An
// EXR without it, both sides powers of two, becomes one quad.
// Memory: tag none: of .ptx the whole texture, of EXR one part.
// Fails: files that cannot be read or written, and files of several textures; nothing is left under the new name.

#include <filesystem>

#include "pipeline/pack/scene_sink.h"

namespace spillway::pipeline {

struct ConvertOptions {
  TexelCurve encoding;  // of the integers of a .ptx file, which does not say
  cache::FaceTexCodec codec = cache::FaceTexCodec::lz4;
};

// What the files are follows from their names: .ptx, .facetex, .exr.
Status convert_face_texture(const std::filesystem::path& from, const std::filesystem::path& to,
                            const ConvertOptions& options);

}  // namespace spillway::pipeline
