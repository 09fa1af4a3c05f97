#pragma once

// Packs the face textures of a scene into few files: one for each kind of texel, a new one when it is large.
//
// Owns: the files while they are written, under temporary names.
// Memory: as cache/facetex_writer.h, of each kind of texel.
// Threads: one caller; compresses on all threads of the current arena.
// Fails: files that cannot be read or hold something else, with their byte; a full disk. Then nothing is left behind.
// Order: the files depend on what was said and in which order, not on threads.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cache/facetex_writer.h"
#include "cache/texture_cache.h"
#include "pipeline/pack/scene_sink.h"

namespace spillway::pipeline {

struct PackedFaceTextures {
  std::vector<cache::FaceContainerInfo> containers;
  std::vector<cache::FaceTextureInfo> textures;
};

class FaceTexturePacker {
 public:
  FaceTexturePacker(std::filesystem::path textures_directory, uint64_t max_container_bytes, cache::FaceTexCodec codec)
      : directory_(std::move(textures_directory)), max_container_bytes_(max_container_bytes), codec_(codec) {}

  // Of a .ptx file more than four channels are cut to the first three and the alpha; colours are multiplied by it.
  Result<FaceTextureId> add_file(const std::filesystem::path& file, TexelCurve encoding);
  // format.codec is the packer's.
  Result<FaceTextureId> begin(cache::FaceTexFormat format, cache::FaceTextureShape texture);
  Status add_face(std::span<const std::byte> texels);
  // Commits the files.
  Result<PackedFaceTextures> finish();

  // What a mesh must agree with.
  struct Requirements {
    std::string name;
    uint32_t face_count = 0;
    cache::FaceShape shape = cache::FaceShape::quad;
    bool has_subfaces = false;
  };
  [[nodiscard]] const Requirements& requirements(uint32_t texture) const { return requirements_[texture]; }
  [[nodiscard]] size_t size() const { return requirements_.size(); }

 private:
  struct Container {
    std::string file_name;
    std::unique_ptr<cache::FaceTexWriter> writer;
  };
  Result<uint32_t> container_for(const cache::FaceTexFormat& format);
  Status copy_ptx(const std::filesystem::path& file, TexelCurve encoding);
  Status copy_face_tex(const std::filesystem::path& file);

  std::filesystem::path directory_;
  uint64_t max_container_bytes_;
  cache::FaceTexCodec codec_;
  std::vector<Container> containers_;
  std::vector<cache::FaceTextureInfo> textures_;
  std::vector<Requirements> requirements_;
  std::map<std::pair<std::string, TexelCurve>, FaceTextureId> files_;
};

// "faces-00000.facetex", perhaps with what a killed process leaves after it.
[[nodiscard]] bool is_face_container_name(std::string_view name);

}  // namespace spillway::pipeline
