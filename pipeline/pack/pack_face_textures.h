#pragma once

// Packs the face textures of a scene into few files: one for each kind of texel, a new one when it is large.
//
// Owns: the files while they are written, under temporary names.
// Memory: as cache/facetex_writer.h, of one open file for each kind of texel; a hundred bytes a texture.
// Threads: one caller; compresses on all threads of the current arena.
// Fails: files that cannot be read or hold something else, with their byte; a full disk. Then nothing is left behind.
// Order: the files depend on what was said and in which order, not on threads.

#include <map>
#include <memory>
#include <string>
#include <tuple>
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
  FaceTexturePacker(std::filesystem::path textures_directory, uint64_t max_container_bytes, cache::FaceTexCodec codec,
                    uint32_t tile_log2)
      : directory_(std::move(textures_directory)),
        max_container_bytes_(max_container_bytes),
        codec_(codec),
        tile_log2_(tile_log2) {}

  // A .facetex file of several textures is taken over as it is, once, and may hold any number of those that are named.
  // Of a .ptx file more than four channels are cut to the first three and the alpha; colours are multiplied by it.
  Result<FaceTextureId> add_file(const std::filesystem::path& file, TexelCurve encoding, const std::string& name = {});
  // format.codec and format.tile_log2 are the packer's.
  Result<FaceTextureId> begin(cache::FaceTexFormat format, cache::FaceTextureShape texture);
  Status add_face(std::span<const std::byte> texels);
  Status add_faces(std::span<const std::vector<std::byte>> faces);
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
    std::unique_ptr<cache::FaceTexWriter> writer;  // none: complete
    cache::FaceContainerInfo info{};               // of complete ones
    struct Known {
      cache::FaceTextureInfo texture;
      Requirements required;
    };
    std::map<std::string, Known> by_name;  // of those taken over
  };
  Result<std::string> new_container_name() const;
  Status complete(uint32_t index);
  Status describe(Container& container) const;
  Status adopt(const std::filesystem::path& path, const std::string& whole, const cache::FaceTexFile& file);
  Status add_adopted(const std::filesystem::path& path, const std::string& whole, const std::string& name);
  Result<uint32_t> container_for(const cache::FaceTexFormat& format);
  Status copy_ptx(const std::filesystem::path& file, TexelCurve encoding);
  Status copy_face_tex(const std::filesystem::path& file, const std::string& whole, const std::string& name);

  std::filesystem::path directory_;
  uint64_t max_container_bytes_;
  cache::FaceTexCodec codec_;
  uint32_t tile_log2_;
  std::vector<Container> containers_;
  std::vector<cache::FaceTextureInfo> textures_;
  std::vector<Requirements> requirements_;
  std::map<std::tuple<std::string, TexelCurve, std::string>, FaceTextureId> files_;
  std::map<std::string, uint32_t> adopted_;  // containers, by the path of the file they were
};

// "faces-00000.facetex", perhaps with what a killed process leaves after it.
[[nodiscard]] bool is_face_container_name(std::string_view name);

}  // namespace spillway::pipeline
