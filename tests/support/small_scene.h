#pragma once

// A small scene built in code that uses every part of the renderer: textures, a mix, an alpha mask, bumps, glass, metal,
// coats, instances (one mirrored), an area light, lamps as instances (one mirrored, one sheared), a spot, a constant sky,
// on request motion of all that can move; a few thousand triangles in several pages.

#include <filesystem>
#include <memory>

#include "pipeline/pack/scene_packer.h"
#include "pipeline/store.h"

namespace spillway::test {

// A directory of its own for one test, removed with everything in it.
class TemporaryDirectory {
 public:
  TemporaryDirectory();
  ~TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

struct SmallSceneOptions {
  uint32_t max_triangles_per_page = 128;
  uint32_t max_faces_per_attribute_block = 512;
  pipeline::BuildOptions tree{};
  uint32_t resolution_x_px = 48, resolution_y_px = 32;
  uint32_t samples_per_pixel = 4;
  bool moves = false;      // instances and the camera
  bool has_lamps = true;   // without: so few lights that there is no tree
  bool has_media = false;  // haze around everything, a coloured fire and a grid of colours that
                           // glows in boxes without walls, milk in a ball of glass
  bool emits_image = false;  // the area light: its emission is looked up
  int32_t volume_brick_voxels = 8;
  uint32_t face_tile_log2 = 6;
  uint32_t frame_count = 0;  // of a camera path, from frame 1 on; each a little further to the right
};

// Packs the scene below `directory` and opens it.
Result<pipeline::Store> pack_small_scene(const std::filesystem::path& directory, const std::string& name,
                                         const SmallSceneOptions& options);

}  // namespace spillway::test
