#pragma once

// Strong 32-bit indices. Ids order as their values do; kNone is "no such thing".

#include <compare>
#include <cstdint>

namespace spillway {

template <class Tag>
struct Id {
  static constexpr uint32_t kNone = 0xffffffffu;
  uint32_t value = kNone;

  [[nodiscard]] bool valid() const { return value != kNone; }
  auto operator<=>(const Id&) const = default;
};

using MeshId = Id<struct MeshTag>;
using MaterialId = Id<struct MaterialTag>;
using TextureId = Id<struct TextureTag>;  // a node of the texture graph
using ImageId = Id<struct ImageTag>;      // a packed image file
using FaceTextureId = Id<struct FaceTextureTag>;
using InstanceId = Id<struct InstanceTag>;
using LightId = Id<struct LightTag>;
using PageId = Id<struct PageTag>;

// A triangle of the scene: prim_base of its mesh plus its face. Orders like (mesh, face), whatever the page layout.
using PrimId = Id<struct PrimTag>;

}  // namespace spillway
