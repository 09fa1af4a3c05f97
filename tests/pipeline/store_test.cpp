#include "pipeline/store.h"

#include <cmath>
#include <limits>

#include "cache/base/hash.h"
#include "cache/trace_kernel.h"
#include "tests/pipeline/store_fixture.h"

namespace spillway::pipeline::test {
namespace {

TEST_F(StoreTest, a_good_one_opens_and_rays_hit_it) {
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  use(*store);
  EXPECT_EQ(store->settings().statistics.triangle_count, 12u);
  EXPECT_EQ(store->light_table().lights.size(), 2u);
  EXPECT_EQ(store->light_table().emitters.size(), 2u);
  EXPECT_EQ(store->textures_path(), store_ / "textures");
}

TEST_F(StoreTest, the_camera_path_is_kept_and_the_contents_have_a_key) {
  const auto store = Store::open(store_);
  ASSERT_TRUE(store);
  ASSERT_EQ(store->camera_path().size(), 2u);
  EXPECT_EQ(store->camera_path()[1].frame, 8u);
  const shading::Camera camera = small_settings().camera;
  EXPECT_EQ(std::memcmp(&store->camera_path()[1].camera, &camera, sizeof camera), 0);
  const std::filesystem::path other = directory_ / "b.store";
  ASSERT_TRUE(pack_small(other, {directory_ / "a.store" / kManifestFile}));
  EXPECT_EQ(Store::open(other)->content_key(), store->content_key());  // whatever it was made from
  set(section::kMaterials, offsetof(Material, eta), 1.25f);
  EXPECT_NE(Store::open(store_)->content_key(), store->content_key());
}

TEST_F(StoreTest, missing_and_short_files_are_named) {
  for (const char* name : {kTracePagesFile, kAttributesFile}) {
    const std::string whole = file_bytes(store_ / name);
    std::filesystem::resize_file(store_ / name, whole.size() - 1);
    auto store = Store::open(store_);
    ASSERT_FALSE(store);
    EXPECT_NE(store.error().message.find(name), std::string::npos);
    std::filesystem::remove(store_ / name);
    store = Store::open(store_);
    ASSERT_FALSE(store);
    EXPECT_NE(store.error().message.find(name), std::string::npos);
    std::ofstream(store_ / name, std::ios::binary).write(whole.data(), static_cast<std::streamsize>(whole.size()));
    EXPECT_TRUE(Store::open(store_));
  }
  std::filesystem::remove(store_ / kManifestFile);
  const auto store = Store::open(store_);
  ASSERT_FALSE(store);
  EXPECT_NE(store.error().message.find("is no store"), std::string::npos);
}

TEST_F(StoreTest, a_store_is_current_until_a_source_changes) {
  const std::filesystem::path a = directory_ / "scene.pbrt", b = directory_ / "mesh file.ply";
  std::ofstream(a) << "one";
  std::ofstream(b) << "two";
  ASSERT_TRUE(pack_small(store_, {b, a}));
  const auto store = Store::open(store_);
  ASSERT_TRUE(store);
  EXPECT_TRUE(store->is_current(std::vector{a}));
  EXPECT_TRUE(store->is_current(std::vector{a, b}));
  EXPECT_FALSE(store->is_current(std::vector{directory_ / "other.pbrt"}));
  const auto changed = std::filesystem::last_write_time(b);
  std::filesystem::last_write_time(b, changed + std::chrono::seconds(1));
  EXPECT_FALSE(store->is_current(std::vector{a}));  // what the scene includes counts, too
  std::filesystem::last_write_time(b, changed);
  EXPECT_TRUE(store->is_current(std::vector{a}));
  std::ofstream(b) << "three";
  std::filesystem::last_write_time(b, changed);
  EXPECT_FALSE(store->is_current(std::vector{a}));
  std::filesystem::remove(b);
  EXPECT_FALSE(store->is_current(std::vector{a}));
}

TEST_F(StoreTest, a_store_of_unknown_sources_is_never_current) {
  EXPECT_FALSE(Store::open(store_)->is_current({}));
}

TEST_F(StoreTest, an_empty_scene_packs_and_opens) {
  const auto packer = ScenePacker::create(directory_ / "empty", {});
  ASSERT_TRUE(packer);
  (*packer)->set_settings(small_settings());
  const Status packed = (*packer)->finish();
  ASSERT_TRUE(packed) << packed.error().message;
  const auto store = Store::open(directory_ / "empty");
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->settings().statistics.triangle_count, 0u);
  EXPECT_EQ(store->light_table().scene_radius_world, 1);
  use(*store);
}

}  // namespace
}  // namespace spillway::pipeline::test
