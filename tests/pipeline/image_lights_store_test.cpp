// Lights with images in a store: what is packed of them, what of it is checked, and that others have nothing of it.

#include <cstddef>

#include "pipeline/render/select_lights.h"
#include "tests/pipeline/store_fixture.h"

namespace spillway::pipeline::test {
namespace {

MeshData quad(float u0, float u1) {
  return {"lamp",
          {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}},
          {},
          {{u0, 0}, {u1, 0}, {u1, 1}, {u0, 1}},
          {0, 1, 2, 0, 2, 3}};
}

// A projection, a goniometric light and a lamp, all of one image: black on the left, white on the right.
Status pack_images(const std::filesystem::path& path, const std::filesystem::path& mask, float u0 = 0, float u1 = 1) {
  write_mask(mask);
  SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(path, {}));
  packer->set_settings(small_settings());
  SPILLWAY_ASSIGN(const ImageId image, packer->add_image(mask, cache::TexelEncoding::linear));
  TextureNode node;
  node.kind = TextureKind::image, node.image = image.value, node.wrap = cache::WrapMode::clamp;
  node.value[0] = node.value[1] = node.value[2] = 1;
  SPILLWAY_ASSIGN(const TextureId texture, packer->add_texture(node));
  SPILLWAY_TRY(packer->add_material(Material{}, "Lamp") ? Status{} : error("material"));
  const MeshData lamp = quad(u0, u1);
  MeshInput input = lamp.input(0);
  input.emits = true, input.emission = {3, 3, 3}, input.emission_texture = texture;
  SPILLWAY_TRY(packer->add_mesh(input));
  for (const shading::LightKind kind : {shading::LightKind::projection, shading::LightKind::goniometric}) {
    const bool is_projection = kind == shading::LightKind::projection;
    SPILLWAY_TRY(packer->add_image_light({"light",
                                          light_of(kind),
                                          image,
                                          {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                                          is_projection ? 0.5f : 0.0f,
                                          is_projection}));
  }
  return packer->finish();
}

class ImageLights : public StoreTest {};

TEST_F(ImageLights, are_packed_with_their_power_and_the_texels_of_an_image_once_a_kind) {
  replace(pack_images(store_, directory_ / "mask.ppm"));
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  ASSERT_EQ(store->light_images().size(), 2u);
  EXPECT_EQ(store->light_texels().size(), 2 * 16u);
  EXPECT_EQ(store->light_images()[1].first_texel, 16u);
  EXPECT_NEAR(store->light_images()[1].integral, 2 * M_PI, 1e-5);
  const shading::Light& projection = store->lights()[0];
  EXPECT_NEAR(projection.radiance.g * store->light_images()[0].integral, 2, 1e-5);  // what was said to be its power
  EXPECT_EQ(store->lights()[1].radiance.g, 2);
  use(*store);
}

// Three quarters of the white half are on the first triangle.
TEST_F(ImageLights, triangles_are_as_strong_as_the_image_on_them) {
  replace(pack_images(store_, directory_ / "mask.ppm"));
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  const std::span<const float> cdf = store->light_table().cdf;
  EXPECT_NEAR(cdf[1] / cdf[2], 0.75, 0.1);
  // Nothing is left without a chance: not even where the image is black.
  replace(pack_images(store_, directory_ / "mask.ppm", 0, 0.25f));
  const auto black = Store::open(store_);
  ASSERT_TRUE(black) << black.error().message;
  EXPECT_GT(black->light_table().cdf[1], 0);
}

TEST_F(ImageLights, cost_nothing_where_there_are_none) {
  EXPECT_EQ(manifest_.find(section::kLightImages), std::string::npos);
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_TRUE(SelectedLights(*store, {}).table().places.empty());
  replace(pack_images(store_, directory_ / "mask.ppm"));
  const auto with = Store::open(store_);
  ASSERT_TRUE(with) << with.error().message;
  EXPECT_EQ(SelectedLights(*with, {}).table().places.size(), 1u);
}

TEST_F(ImageLights, each_law_of_their_tables_is_checked) {
  replace(pack_images(store_, directory_ / "mask.ppm"));
  const uint32_t nan = 0x7fc00000, one = 0x3f800000;
  const Damage cases[] = {
      {section::kLights, offsetof(shading::Light, image), 0},      // throws an image, and has none
      {section::kLights, offsetof(shading::Light, image), 3},      // of two
      {section::kLights, offsetof(shading::Light, image), 2},      // of the other kind
      {section::kLights, offsetof(shading::Light, kind), 6},       // no such kind
      {section::kLights, offsetof(shading::Light, edge1) + 8, 0},  // a projection without an axis
      {section::kLightImages, offsetof(shading::LightImage, width), 0},
      {section::kLightImages, offsetof(shading::LightImage, height), 0xffffffff},
      {section::kLightImages, offsetof(shading::LightImage, first_texel), 17},
      {section::kLightImages, offsetof(shading::LightImage, half_width), nan},
      {section::kLightImages, offsetof(shading::LightImage, half_height), 0},
      {section::kLightImages, offsetof(shading::LightImage, integral), nan},
      {section::kLightImages, offsetof(shading::LightImage, axis) + 4, one},  // of length sqrt(2)
      {section::kLightTexels, 4, nan},
      {section::kLightTexels, 8, 0xbf800000},       // negative
      {section::kEmissions, sizeof(Rgb), 77 << 1},  // no such texture
  };
  expect_refused(cases);
}

TEST_F(ImageLights, damaged_tables_are_refused_or_harmless) {
  replace(pack_images(store_, directory_ / "mask.ppm"));
  const auto counts = flip_all({section::kLights, section::kLightImages, section::kLightTexels, section::kEmissions});
  EXPECT_GT(counts.tried, 400u);
  EXPECT_GT(counts.refused, 50u);
}

}  // namespace
}  // namespace spillway::pipeline::test
