#pragma once

// What holds for each item of a scene by itself: asked while packing, before anything is written, and of every store
// that is opened. `where` names the item for the message.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "cache/base/result.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

Status check_settings(const SceneSettings& settings, std::string_view where);
// Ascending frames, cameras as the settings' own and of its resolution.
Status check_camera_path(std::span<const FrameCamera> path, const SceneSettings& settings, std::string_view where);
// image_count, face_texture_count: of the scene.
Status check_texture(const TextureNode& node, size_t index, size_t image_count, size_t face_texture_count,
                     std::string_view where);
// What evaluating a texture costs, in nodes. Graphs share nodes: a short one may stand for a tree beyond all bounds.
class TextureCosts {
 public:
  static constexpr uint64_t kMost = 65536;
  // Of the next node, which check_texture has accepted.
  Status add(const TextureNode& node, std::string_view where);

 private:
  std::vector<uint32_t> costs_;
};
Status check_material(const Material& material, size_t index, size_t texture_count, std::string_view where);
// Numbers that are finite and in their ranges; volumes that are there.
Status check_medium(const Medium& medium, size_t volume_count, std::string_view where);

}  // namespace spillway::pipeline
