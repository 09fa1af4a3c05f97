#include "pipeline/light_validation.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/store_validation.h"

namespace spillway::pipeline {
namespace {

using shading::kLightNodeWidth;
using shading::kNoLightNode;
using shading::LightChild;
using shading::LightNode;

// Axes come from 32-bit normalisation, some roundings of 6e-8, and may have been through a transform or a text file.
constexpr float kUnitTolerance = 1e-4f;
// Energies are shares of their tree's, each rounded, as is their sum.
constexpr float kMostEnergy = 1.0001f;

int light_rank(const shading::Light& light) { return light.kind == shading::LightKind::infinite ? 1 : 0; }

bool is_emission(Rgb l) { return is_finite(l) && l.r >= 0 && l.g >= 0 && l.b >= 0; }

Status validate_cdf(const StoreTables& t, std::string_view where) {
  const size_t choices = (t.light_nodes.empty() ? t.emitters.size() : 1) + t.lights.size();
  if (t.light_cdf.size() != choices + 1)
    return damaged(where, section::kLightCdf, 0, "{} numbers for {} choices", t.light_cdf.size(), choices);
  for (size_t i = 0; i < t.light_cdf.size(); ++i) {
    const float least = i == 0 ? 0 : t.light_cdf[i - 1];
    const float most = i == 0 ? 0 : 1;
    if (!(t.light_cdf[i] >= least && t.light_cdf[i] <= most))
      return damaged(where, section::kLightCdf, i, "{} is not between {} and {}", t.light_cdf[i], least, most);
  }
  if (choices > 0 && t.light_cdf[choices] != 1)
    return damaged(where, section::kLightCdf, choices, "ends at {}, not 1", t.light_cdf[choices]);
  return {};
}

Status validate_emission(const StoreTables& t, size_t i, std::string_view where) {
  const shading::Emission& emission = t.emissions[i];
  if (!is_emission(emission.radiance))
    return damaged(where, section::kEmissions, i, "emission must be finite and not negative");
  if (emission.texture == shading::kNoEmissionTexture) return {};
  if (emission.texture >= t.textures.size() || !is_image_by_uv(t.textures[emission.texture]))
    return damaged(where, section::kEmissions, i, "texture {} of {} is no image", uint32_t{emission.texture},
                   t.textures.size());
  return {};
}

Status validate_light_image(const shading::LightImage& image, size_t texel_count, std::string_view where) {
  const uint64_t texels = uint64_t{image.width} * image.height;
  if (image.width == 0 || image.height == 0 || image.width > kMaxLightImageSize || image.height > kMaxLightImageSize ||
      image.first_texel + texels > texel_count)
    return error("{}: {} x {} texels from {} of {}", where, image.width, image.height, image.first_texel, texel_count);
  const bool is_projection = image.half_width > 0 && image.half_height > 0;
  if (!std::isfinite(image.half_width) || !std::isfinite(image.half_height) ||
      (!is_projection && (image.half_width != 0 || image.half_height != 0)))
    return error("{}: is thrown on {} by {}", where, image.half_width, image.half_height);
  if (!is_projection && image.width != image.height)
    return error("{}: {} x {} texels are no square", where, image.width, image.height);
  if (!std::isfinite(image.integral) || image.integral < 0)
    return error("{}: has a light of {}", where, image.integral);
  for (const Float3 axis : image.axis)
    if (!(std::fabs(length_squared(axis) - 1) <= kUnitTolerance))
      return error("{}: has an axis of length {}, not one", where, length(axis));
  return {};
}

Status validate_light_images(const StoreTables& t, std::string_view where) {
  for (size_t i = 0; i < t.light_images.size(); ++i)
    SPILLWAY_TRY(validate_light_image(t.light_images[i], t.light_texels.size(),
                                      fmt::format("{}: section '{}', item {}", where, section::kLightImages, i)));
  for (size_t i = 0; i < t.light_texels.size(); ++i)
    if (!is_emission(t.light_texels[i])) return damaged(where, section::kLightTexels, i, "is negative or not finite");
  for (size_t i = 0; i < t.lights.size(); ++i) {
    const shading::Light& light = t.lights[i];
    if (!shading::throws_image(light)) continue;
    if (light.image == 0 || light.image > t.light_images.size())
      return damaged(where, section::kLights, i, "image {} of {}", light.image, t.light_images.size());
    const bool is_projection = t.light_images[light.image - 1].half_width > 0;
    if (is_projection != (light.kind == shading::LightKind::projection))
      return damaged(where, section::kLights, i, "throws an image of the other kind");
  }
  return {};
}

Status validate_emitters(const StoreTables& t, std::string_view where) {
  for (size_t i = 0; i < t.emissions.size(); ++i) SPILLWAY_TRY(validate_emission(t, i, where));
  for (size_t i = 0; i < t.emitters.size(); ++i) {
    const shading::TriangleShape& s = t.emitters[i].shape;
    if (!is_finite(s.position) || !std::isfinite(length_squared(cross(s.edge1, s.edge2))))
      return damaged(where, section::kEmitters, i, "has a number that is not finite");
    if (t.emitters[i].emission >= t.emissions.size())
      return damaged(where, section::kEmitters, i, "emission {} of {}", t.emitters[i].emission, t.emissions.size());
  }
  return {};
}

// Of which object each emitter is; emitters follow their meshes.
std::vector<uint32_t> objects_of_emitters(const StoreTables& t) {
  std::vector<uint32_t> objects;
  objects.reserve(t.emitters.size());
  for (const Mesh& mesh : t.meshes)
    if (mesh.light_base != LightId::kNone) objects.insert(objects.end(), mesh.face_count, mesh.object);
  return objects;
}

Status check_node(const LightNode& node, std::string_view where, size_t index) {
  const auto wrong = [&](std::string_view what) { return damaged(where, section::kLightNodes, index, "{}", what); };
  for (int a = 0; a < 3; ++a)
    if (!std::isfinite(node.origin[a]) || !(node.scale[a] >= 0) || !std::isfinite(node.origin[a] + 255 * node.scale[a]))
      return wrong("a box that is not finite");
  if (node.child_count == 0 || node.child_count > kLightNodeWidth) return wrong("an impossible number of children");
  if (node.two_sided >> node.child_count != 0) return wrong("children to both sides that it does not have");
  for (int i = 0; i < kLightNodeWidth; ++i) {
    const bool used = i < node.child_count;
    if (used ? !(node.energy[i] > 0 && node.energy[i] <= kMostEnergy) : node.energy[i] != 0)
      return wrong("an impossible energy");
    if (node.axis[0][i] == 0 && node.axis[1][i] == 0 && node.axis[2][i] == 0) return wrong("an axis without length");
    if (node.cone[i] > 65534) return wrong("an impossible cone");
    for (int a = 0; a < 3; ++a)
      if (node.lower[a][i] > node.upper[a][i]) return wrong("a box inside out");
  }
  return {};
}

class LightTreeWalk {
 public:
  LightTreeWalk(const StoreTables& tables, std::string_view where)
      : t_(tables),
        where_(where),
        object_of_(objects_of_emitters(tables)),
        node_seen_(tables.light_nodes.size()),
        light_seen_(tables.lights.size()) {}

  Status walk() {
    for (uint32_t o = 0; o < t_.light_roots.size(); ++o) {
      object_ = o;
      const uint32_t root = t_.light_roots[o];
      if (root == kNoLightNode) continue;
      if (root >= t_.light_nodes.size()) return damaged(where_, section::kLightRoots, o, "node {}", root);
      SPILLWAY_TRY(visit(root, kNoLightNode, 1));
    }
    for (size_t i = 0; i < node_seen_.size(); ++i)
      if (!node_seen_[i]) return damaged(where_, section::kLightNodes, i, "is in no tree");
    SPILLWAY_TRY(check_leaves(t_.emitter_leaves, LightChild::emitter, section::kEmitterLeaves));
    return check_leaves(t_.instance_leaves, LightChild::instance, section::kInstanceLeaves);
  }

 private:
  Status visit(uint32_t index, uint32_t parent, uint32_t depth) {
    const LightNode& node = t_.light_nodes[index];
    if (node_seen_[index] || node.parent != parent)
      return damaged(where_, section::kLightNodes, index, "is not where its parent says");
    if (depth > shading::kMaxLightTreeDepth) return damaged(where_, section::kLightNodes, index, "is too deep");
    node_seen_[index] = true;
    SPILLWAY_TRY(check_node(node, where_, index));
    for (uint32_t slot = 0; slot < node.child_count; ++slot) {
      const uint32_t place = shading::light_place(index, slot);
      const uint32_t child = shading::light_child_index(node.child[slot]);
      if (shading::light_child_kind(node.child[slot]) != LightChild::node) {
        SPILLWAY_TRY(check_child(shading::light_child_kind(node.child[slot]), child, index));
      } else if (child >= t_.light_nodes.size()) {
        return damaged(where_, section::kLightNodes, index, "child {}", child);
      } else {
        SPILLWAY_TRY(visit(child, place, depth + 1));
      }
    }
    return {};
  }

  Status check_child(LightChild kind, uint32_t child, uint32_t index) {
    const auto wrong = [&](std::string_view what) {
      return damaged(where_, section::kLightNodes, index, "{} {}", what, child);
    };
    if (kind == LightChild::emitter)
      return child >= object_of_.size() || object_of_[child] != object_ ? wrong("a foreign emitter") : Status{};
    if (object_ != 0) return wrong("in the tree of a prototype: child");
    if (kind == LightChild::instance) {
      if (child == 0 || child >= t_.instance_leaves.size()) return wrong("an instance that does not emit:");
      return t_.light_roots[t_.instances[child].object] == kNoLightNode ? wrong("an instance without lights:")
                                                                        : Status{};
    }
    if (child >= t_.lights.size() || !shading::has_place(t_.lights[child]) || light_seen_[child])
      return wrong("an impossible light");
    light_seen_[child] = true;
    return {};
  }

  // As many leaves as lights, each found from the other side.
  Status check_leaves(std::span<const uint32_t> leaves, LightChild kind, const char* section) {
    for (uint32_t i = 0; i < leaves.size(); ++i) {
      if (leaves[i] == kNoLightNode) continue;
      const uint32_t node = leaves[i] / kLightNodeWidth, slot = leaves[i] % kLightNodeWidth;
      if (node >= t_.light_nodes.size() || slot >= t_.light_nodes[node].child_count ||
          t_.light_nodes[node].child[slot] != shading::light_child(kind, i))
        return damaged(where_, section, i, "is not at place {}", leaves[i]);
      ++leaf_count_[static_cast<int>(kind)];
    }
    uint64_t in_nodes = 0;
    for (const LightNode& node : t_.light_nodes)
      for (uint32_t slot = 0; slot < node.child_count; ++slot)
        in_nodes += shading::light_child_kind(node.child[slot]) == kind ? 1 : 0;
    if (in_nodes != leaf_count_[static_cast<int>(kind)])
      return damaged(where_, section, leaves.size(), "misses some leaves");
    return {};
  }

  const StoreTables& t_;
  std::string_view where_;
  std::vector<uint32_t> object_of_;
  std::vector<bool> node_seen_, light_seen_;
  uint32_t object_ = 0;
  uint64_t leaf_count_[4] = {};
};

Status check_without_tree(const StoreTables& t, std::string_view where) {
  if (!t.light_roots.empty() || !t.emitter_leaves.empty() || !t.instance_leaves.empty())
    return damaged(where, section::kLightRoots, 0, "a tree without nodes");
  for (size_t i = 0; i < t.meshes.size(); ++i)
    if (t.meshes[i].light_base != LightId::kNone && t.meshes[i].object != 0)
      return damaged(where, section::kMeshes, i, "emits from instances without a tree");
  return {};
}

}  // namespace

Status check_light(const shading::Light& light, std::string_view where) {
  if (light.kind > shading::LightKind::projection) return error("{}: is of no known kind", where);
  if (!is_finite(light.radiance) || light.radiance.r < 0 || light.radiance.g < 0 || light.radiance.b < 0)
    return error("{}: emits ({}, {}, {}); emission must be finite and not negative", where, light.radiance.r,
                 light.radiance.g, light.radiance.b);
  if (!is_finite(light.position) || !is_finite(light.edge1) || !is_finite(light.edge2) ||
      !std::isfinite(light.cos_total) || !std::isfinite(light.cos_falloff))
    return error("{}: has a number that is not finite", where);
  const bool has_axis = light.kind == shading::LightKind::spot || light.kind == shading::LightKind::distant ||
                        light.kind == shading::LightKind::projection;
  if (has_axis && std::fabs(length_squared(light.edge1) - 1) > kUnitTolerance)
    return error("{}: has an axis of length {}, not one", where, length(light.edge1));
  if (light.kind == shading::LightKind::spot && light.cos_falloff < light.cos_total)
    return error("{}: falls off inside an angle larger than its cone", where);
  const bool is_infinite = light.kind == shading::LightKind::infinite;
  if (!shading::throws_image(light) && light.image > (is_infinite ? 1u : 0u))
    return error("{}: has an image, and is no infinite light", where);
  if (is_infinite && light.image == 1)
    for (const Float3 axis : {light.position, light.edge1, light.edge2})
      if (std::fabs(length_squared(axis) - 1) > kUnitTolerance)
        return error("{}: has an axis of length {}, not one", where, length(axis));
  return {};
}

Status check_portal(const shading::Portal& portal, size_t infinite_count, std::string_view where) {
  const Float3 n = cross(portal.edge1, portal.edge2);
  if (!is_finite(portal.corner) || !std::isfinite(length_squared(portal.edge1)) ||
      !std::isfinite(length_squared(portal.edge2)) || !(length_squared(n) > 0) || !std::isfinite(length_squared(n)))
    return error("{}: is no rectangle that 32-bit floats can hold", where);
  if (portal.light >= infinite_count)
    return error("{}: belongs to infinite light {} of {}", where, portal.light, infinite_count);
  return {};
}

Status validate_lights(const StoreTables& t, std::string_view where) {
  const auto infinite =
      static_cast<size_t>(std::count_if(t.lights.begin(), t.lights.end(), [](const shading::Light& l) {
        return l.kind == shading::LightKind::infinite;
      }));
  if (t.portals.size() > 1) return damaged(where, section::kPortals, 1, "is one too many");
  for (const shading::Portal& portal : t.portals)
    SPILLWAY_TRY(check_portal(portal, infinite, fmt::format("{}: section '{}'", where, section::kPortals)));
  for (size_t i = 0; i < t.lights.size(); ++i) {
    SPILLWAY_TRY(check_light(t.lights[i], fmt::format("{}: section '{}', item {}", where, section::kLights, i)));
    if (i > 0 && light_rank(t.lights[i]) < light_rank(t.lights[i - 1]))
      return damaged(where, section::kLights, i, "infinite lights come last");
  }
  SPILLWAY_TRY(validate_light_images(t, where));
  SPILLWAY_TRY(validate_emitters(t, where));
  return validate_cdf(t, where);
}

Status validate_light_trees(const StoreTables& t, std::string_view where) {
  if (t.light_nodes.empty()) return check_without_tree(t, where);
  if (t.light_nodes.size() > shading::kMaxLightNodes)
    return damaged(where, section::kLightNodes, 0, "{} nodes", t.light_nodes.size());
  if (t.light_roots.size() != t.tree_objects.size() || t.light_roots[0] == kNoLightNode)
    return damaged(where, section::kLightRoots, 0, "{} roots of {} objects", t.light_roots.size(),
                   t.tree_objects.size());
  if (t.emitter_leaves.size() != t.emitters.size())
    return damaged(where, section::kEmitterLeaves, 0, "{} leaves of {} emitters", t.emitter_leaves.size(),
                   t.emitters.size());
  if (t.instance_leaves.empty() || t.instance_leaves.size() > t.instances.size() ||
      t.instance_leaves[0] != kNoLightNode)
    return damaged(where, section::kInstanceLeaves, 0, "{} leaves of {} instances", t.instance_leaves.size(),
                   t.instances.size());
  for (size_t i = 1; i < t.instances.size(); ++i)
    if (t.instances[i].motion != 0 && t.light_roots[t.instances[i].object] != kNoLightNode)
      return damaged(where, section::kInstances, i, "emits light and moves, but light trees know one place for each");
  return LightTreeWalk(t, where).walk();
}

}  // namespace spillway::pipeline
