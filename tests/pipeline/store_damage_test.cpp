// Stores whose manifest is cut short or changed: refused with a word that says where, or harmless.

#include <fstream>

#include "shading/light_tree.h"
#include "tests/pipeline/store_fixture.h"

namespace spillway::pipeline::test {
namespace {

TEST_F(StoreTest, every_prefix_of_the_manifest_is_refused) {
  for (size_t size = 0; size < manifest_.size(); ++size) {
    write_manifest(manifest_.substr(0, size));
    ASSERT_FALSE(Store::open(store_)) << size;
  }
  write_manifest(manifest_);
  EXPECT_TRUE(Store::open(store_));
}

TEST_F(StoreTest, flipped_bytes_of_light_trees_are_refused_or_harmless) {
  pack_lit();
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->light_table().tree.nodes.size(), 2u);
  use(*store);
  const auto counts = flip_all({section::kEmitters, section::kEmissions, section::kLightNodes, section::kLightRoots,
                                section::kEmitterLeaves, section::kInstanceLeaves, section::kLightCdf});
  EXPECT_GT(counts.tried, 1500u);
  EXPECT_GT(counts.refused, counts.tried / 5);
}

TEST_F(StoreTest, damaged_tables_of_media_are_refused_or_harmless) {
  replace(pack_gas(store_));
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->medium_tables().media.size(), 2u);
  const auto counts = flip_all({section::kMedia, section::kVolumeGrids, section::kVolumeBricks});
  EXPECT_GT(counts.tried, 700u);
  EXPECT_GT(counts.refused, counts.tried / 5);
  for (size_t size = 0; size < manifest_.size(); size += size < 4096 ? 1 : 97) {
    write_manifest(manifest_.substr(0, size));
    ASSERT_FALSE(Store::open(store_)) << size;
  }
}

TEST_F(StoreTest, each_law_of_media_is_checked) {
  replace(pack_gas(store_));
  const uint32_t nan = 0x7fc00000;
  const Damage cases[] = {
      {section::kSettings, offsetof(SceneSettings, render) + offsetof(RenderSettings, camera_medium), 2},
      {section::kMedia, offsetof(Medium, sigma_a), nan},
      {section::kMedia, offsetof(Medium, g), 0x3f800000},  // 1
      {section::kMedia, offsetof(Medium, density_volume), 0},
      {section::kMedia, sizeof(Medium) + offsetof(Medium, density_volume), 2},
      {section::kMedia, sizeof(Medium) + offsetof(Medium, glow_volume), Medium::kNoVolume},
      {section::kMedia, sizeof(Medium) + offsetof(Medium, kelvin_scale), nan},
      {section::kMedia, sizeof(Medium) + offsetof(Medium, density_from_world), nan},
      {section::kMeshes, offsetof(Mesh, medium_inside), 2},
      {section::kMeshes, offsetof(Mesh, flags), 0},  // media of a mesh that divides none
  };
  expect_refused(cases);
}

TEST_F(StoreTest, flipped_bytes_under_right_checksums_are_refused_or_harmless) {
  const auto counts =
      flip_all({section::kSettings, section::kMeshes, section::kMaterials, section::kTextures, section::kLights,
                section::kLightCdf, section::kPages, section::kTreeNodes, section::kTreeEntries, section::kTreeObjects,
                section::kInstances, section::kAttributes, section::kNames, section::kSources});
  EXPECT_GT(counts.tried, 4000u);
  EXPECT_GT(counts.refused,
            counts.tried / 10);  // most bytes are fractions of floats, colours and names, of which any is possible
}

TEST_F(StoreTest, each_law_of_the_light_trees_is_checked) {
  pack_lit();
  const uint32_t nan = 0x7fc00000, none = shading::kNoLightNode;
  const auto child = [](int node, int slot) {
    return node * sizeof(shading::LightNode) + offsetof(shading::LightNode, child) + 4 * slot;
  };
  // Node 0 is the prototype's, with the faces 2 and 3; node 1 the world's, with the lamp, the spot and two instances.
  const Damage cases[] = {
      {section::kLightRoots, 0, 0},     // the prototype's tree, in the world too
      {section::kLightRoots, 0, 2},     // no such node
      {section::kLightRoots, 0, none},  // the world has lights
      {section::kLightRoots, 4, none},  // the prototype stands somewhere
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::node, 0)},      // itself
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::node, 1)},      // its own parent
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::node, 9)},      // beyond
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::emitter, 9)},   // beyond
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::emitter, 0)},   // of the world
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::instance, 1)},  // in a prototype
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::light, 0)},     // in a prototype
      {section::kLightNodes, child(1, 0), shading::light_child(shading::LightChild::instance, 0)},  // the world
      {section::kLightNodes, child(1, 0), shading::light_child(shading::LightChild::light, 1)},     // has no place
      {section::kLightNodes, offsetof(shading::LightNode, parent), 0},
      {section::kLightNodes, offsetof(shading::LightNode, child_count), 0},
      {section::kLightNodes, offsetof(shading::LightNode, child_count), 9},
      {section::kLightNodes, offsetof(shading::LightNode, energy), nan},
      {section::kLightNodes, offsetof(shading::LightNode, energy), 0},
      {section::kLightNodes, offsetof(shading::LightNode, energy), 0x7f800000},  // infinite
      {section::kLightNodes, offsetof(shading::LightNode, origin), nan},
      {section::kLightNodes, offsetof(shading::LightNode, scale), 0xbf800000},  // negative
      {section::kLightNodes, offsetof(shading::LightNode, cone), 0xffffffff},
      {section::kEmitterLeaves, 0, 0},
      {section::kEmitterLeaves, 0, none},
      {section::kEmitterLeaves, 0, 1u << 30},
      {section::kInstanceLeaves, 0, 8},  // the world is no instance
      {section::kInstanceLeaves, 4, none},
      {section::kMeshes, sizeof(Mesh) + offsetof(Mesh, object), 0},  // whose faces stand in the tree of the other
  };
  expect_refused(cases);
}

TEST_F(StoreTest, each_law_of_settings_and_cameras_is_checked) {
  const uint32_t nan = 0x7fc00000;
  const Damage cases[] = {
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, resolution_x_px), 0},
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, resolution_y_px), 65537},
      {section::kSettings, offsetof(SceneSettings, camera) + 4, nan},
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, tan_half_fov_x), nan},
      {section::kSettings, offsetof(SceneSettings, filter), 5},
      {section::kSettings, offsetof(SceneSettings, filter) + 4, 0},
      {section::kSettings, offsetof(SceneSettings, film) + offsetof(FilmSettings, crop_x0), 70},
      {section::kSettings, offsetof(SceneSettings, film) + offsetof(FilmSettings, exposure_scale), nan},
      {section::kSettings, offsetof(SceneSettings, render), 0},
      {section::kSettings, offsetof(SceneSettings, statistics) + offsetof(SceneStatistics, bounds_world), 0},
      {section::kCameraPath, offsetof(FrameCamera, frame), 8},  // twice
      {section::kCameraPath, offsetof(FrameCamera, medium), 2},
      {section::kCameraPath, offsetof(FrameCamera, camera) + offsetof(shading::Camera, resolution_x_px), 63},
      {section::kCameraPath, offsetof(FrameCamera, camera) + offsetof(shading::Camera, focal_distance), nan},
      {section::kCameraPath, offsetof(FrameCamera, camera) + offsetof(shading::Camera, motion), 1},
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, motion), 3},
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, shutter_open),
       0x40000000},                                                       // after
      {section::kSettings, offsetof(SceneSettings, motion), 0x40000000},  // ends before it starts
  };
  expect_refused(cases);
}

TEST_F(StoreTest, each_law_of_meshes_and_pages_is_checked) {
  const uint32_t nan = 0x7fc00000;
  const Damage cases[] = {
      {section::kMeshes, offsetof(Mesh, prim_base), 1},
      {section::kMeshes, offsetof(Mesh, face_count), 0},
      {section::kMeshes, offsetof(Mesh, material), 2},
      {section::kMeshes, offsetof(Mesh, material), 1},  // the next has 0
      {section::kMeshes, offsetof(Mesh, object), 2},
      {section::kMeshes, offsetof(Mesh, light_base), 1},
      {section::kMeshes, offsetof(Mesh, alpha_texture), 2},
      {section::kMeshes, offsetof(Mesh, flags), 1u << 7},
      {section::kMeshes, offsetof(Mesh, flags), kMeshIsInterface},
      {section::kMeshes, offsetof(Mesh, medium_inside), 0x00ff},
      {section::kPages, offsetof(cache::PageLocation, offset_bytes), 4096},
      {section::kPages, offsetof(cache::PageLocation, size_bytes), 100},
      {section::kPages, offsetof(cache::PageLocation, triangle_count), 9},
      {section::kPages, offsetof(cache::PageLocation, object), 1},
      {section::kTreeEntries, offsetof(cache::PageTreeEntry, kind), 2},
      {section::kTreeEntries, offsetof(cache::PageTreeEntry, index), 9},
      {section::kTreeEntries, offsetof(cache::PageTreeEntry, index), 0},  // the world's page, now twice
      {section::kTreeObjects, offsetof(cache::PageObject, root), cache::kNoChild},
      {section::kTreeObjects, offsetof(cache::PageObject, bounds_object), nan},
      {section::kAttributes, offsetof(AttributeLocation, first_prim), 1},
      {section::kAttributes, offsetof(AttributeLocation, prim_count), 11},
      {section::kAttributes, offsetof(AttributeLocation, size_bytes), 4097},
  };
  expect_refused(cases);
}

TEST_F(StoreTest, each_law_of_materials_and_textures_is_checked) {
  const uint32_t nan = 0x7fc00000;
  const Damage cases[] = {
      {section::kMaterials, offsetof(Material, kind), 7},
      {section::kMaterials, offsetof(Material, reflectance) + offsetof(Param, texture), 2},
      {section::kMaterials, offsetof(Material, base_u_roughness), nan},
      {section::kMaterials, offsetof(Material, displacement), 2},
      {section::kMaterials, sizeof(Material) + offsetof(Material, mix_material), 1},
      {section::kTextures, sizeof(TextureNode) + offsetof(TextureNode, child), 1},  // itself
      {section::kTextures, offsetof(TextureNode, kind), 4},
      {section::kTextures, offsetof(TextureNode, wrap), 3},
      {section::kTextures, offsetof(TextureNode, filter), 3},
      {section::kTextures, offsetof(TextureNode, uv_scale), nan},
      {section::kTextures, offsetof(TextureNode, kind), static_cast<uint32_t>(TextureKind::image)},  // without image
  };
  expect_refused(cases);
}

TEST_F(StoreTest, each_law_of_lights_is_checked) {
  const uint32_t nan = 0x7fc00000;
  const Damage cases[] = {
      {section::kLights, offsetof(shading::Light, kind), 6},
      {section::kLights, offsetof(shading::Light, radiance), nan},
      {section::kLights, offsetof(shading::Light, kind),
       static_cast<uint32_t>(shading::LightKind::infinite)},            // not last
      {section::kLights, offsetof(shading::Light, edge1), 0x40000000},  // length
      {section::kEmitters, offsetof(shading::Emitter, emission), 1},
      {section::kEmitters, 0, nan},
      {section::kEmissions, 0, 0xbf800000},  // negative
      {section::kEmissions, offsetof(shading::Emission, radiance) + sizeof(Rgb), 0xfffffffc},  // no such texture
      {section::kLightCdf, 0, 0x3c000000},  // not 0
      {section::kLightCdf, 4, nan},
      {section::kLightCdf, 4, 0x3f800001},   // beyond 1
      {section::kLightCdf, 16, 0x3f7fffff},  // the last, just below 1
  };
  expect_refused(cases);
}

TEST_F(StoreTest, each_law_of_instances_and_motions_is_checked) {
  const uint32_t nan = 0x7fc00000;
  const Damage cases[] = {
      {section::kMotions, 0, 0x3f800001},               // not where the camera is
      {section::kMotions, sizeof(Motion), 0x3f800001},  // not where the instance is
      {section::kMotions, offsetof(Motion, rotation), 0x3f000000},
      {section::kMotions, offsetof(Motion, axis), nan},
      {section::kMotions, offsetof(Motion, turns), 0x3f000001},                       // more than half a turn
      {section::kMotions, offsetof(Motion, turns), 0},                                // not as far as the other key
      {section::kMotions, offsetof(Motion, stretch), 0xbf800000},                     // mirrored in one direction
      {section::kMotions, offsetof(Motion, stretch), 0},                              // flat
      {section::kMotions, offsetof(Motion, key) + sizeof(Affine3) + 12, 0x7f000000},  // too far
      {section::kInstances, sizeof(cache::Instance) + offsetof(cache::Instance, motion), 3},
      {section::kInstances, offsetof(cache::Instance, motion), 1},  // the world does not move
      {section::kInstances, 0, 0x3f800001},                         // the world: not the identity
      {section::kInstances, sizeof(cache::Instance), 0x3f900000},   // not the inverse of the other
      {section::kInstances, sizeof(cache::Instance) + offsetof(cache::Instance, object), 0},
  };
  expect_refused(cases);
}

TEST_F(StoreTest, what_is_wrong_is_named_by_section_and_item) {
  set(section::kMeshes, offsetof(Mesh, alpha_texture), 2u);
  EXPECT_NE(Store::open(store_).error().message.find("'meshes', item 0"), std::string::npos);
}

// The first instance stands where the motion of the camera begins.
TEST_F(StoreTest, an_instance_that_emits_does_not_move) {
  pack_lit();
  set(section::kInstances, sizeof(cache::Instance) + offsetof(cache::Instance, motion), 1u);
  const auto store = Store::open(store_);
  ASSERT_FALSE(store);
  EXPECT_NE(store.error().message.find("'instances', item 1: emits light and moves"), std::string::npos)
      << store.error().message;
}

}  // namespace
}  // namespace spillway::pipeline::test
