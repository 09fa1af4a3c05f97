// Materials, textures and lights: what their directives say to the sink.

#include "tools/import/import_pbrt.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

using pipeline::MaterialKind;
using pipeline::TextureKind;

// Rounding of a 32-bit float near one, a few times over.
constexpr float kRounding = 1e-6f;

void expect_near(Float3 got, Float3 want, float tolerance = kRounding) {
  EXPECT_NEAR(got.x, want.x, tolerance);
  EXPECT_NEAR(got.y, want.y, tolerance);
  EXPECT_NEAR(got.z, want.z, tolerance);
}

void expect_rgb(Rgb got, Rgb want, float tolerance = kRounding) {
  EXPECT_NEAR(got.r, want.r, tolerance);
  EXPECT_NEAR(got.g, want.g, tolerance);
  EXPECT_NEAR(got.b, want.b, tolerance);
}

bool has_warning(const Imported& imported, std::string_view text) {
  for (const std::string& warning : imported.report.warnings) {
    if (warning.find(text) != std::string::npos) return true;
  }
  return false;
}

const std::string kTri(kTriangle);

// ---- materials and textures ----

pipeline::Material material_of(const std::string& text, Imported* result = nullptr) {
  Imported imported = import_world("Material " + text + "\n" + kTri);
  EXPECT_EQ(imported.error, "") << text;
  const pipeline::Material material =
      imported.sink.materials.empty() ? pipeline::Material{} : imported.sink.materials.back();
  if (result != nullptr) *result = std::move(imported);
  return material;
}

TEST(pbrt, materials_have_pbrts_defaults) {
  EXPECT_EQ(material_of("\"diffuse\"").reflectance.constant.g, 0.5f);
  const auto copper = material_of("\"conductor\"");
  EXPECT_FLOAT_EQ(copper.conductor_eta.constant.r, 0.2459f);
  EXPECT_FLOAT_EQ(copper.conductor_k.constant.b, 2.4572f);
  EXPECT_EQ(copper.uses_reflectance, 0u);
  EXPECT_EQ(copper.remap_roughness, 1u);
  EXPECT_EQ(copper.u_roughness.constant.r, 0);
  EXPECT_EQ(material_of("\"dielectric\"").eta, 1.5f);
  EXPECT_EQ(material_of("\"thindielectric\"").kind, MaterialKind::thin_dielectric);
  const auto coated = material_of("\"coateddiffuse\"");
  EXPECT_EQ(coated.reflectance.constant.r, 0.5f);
  EXPECT_EQ(coated.eta, 1.5f);
  EXPECT_EQ(coated.u_roughness.constant.r, 0);
  EXPECT_EQ(material_of("\"coatedconductor\"").kind, MaterialKind::coated_conductor);
}

TEST(pbrt, translucent_sheets_are_scaled_on_both_sides) {
  const auto plain = material_of("\"diffusetransmission\"");
  EXPECT_EQ(plain.kind, MaterialKind::diffuse_transmission);
  EXPECT_EQ(plain.transmittance.constant.b, 0.25f);
  const auto scaled = material_of("\"diffusetransmission\" \"rgb reflectance\" [0.5 0.25 0] \"float scale\" 0.5");
  EXPECT_EQ(scaled.reflectance.constant.r, 0.25f);
  EXPECT_EQ(scaled.transmittance.constant.r, 0.125f);
}

TEST(pbrt, a_reflectance_may_be_a_spectrum) {
  const auto grey = material_of("\"diffuse\" \"spectrum reflectance\" [300 0.25 900 0.25]").reflectance.constant;
  EXPECT_NEAR(grey.r, 0.25f, 1e-3f);
  EXPECT_NEAR(grey.g, 0.25f, 1e-3f);
  EXPECT_NEAR(grey.b, 0.25f, 1e-3f);
  const auto red = material_of("\"diffuse\" \"spectrum reflectance\" [300 0 590 0 610 0.8 900 0.8]").reflectance.constant;
  EXPECT_GT(red.r, 0.6f);
  EXPECT_LT(std::max(red.g, red.b), 0.1f);
}

TEST(pbrt, normal_maps_are_linear_images) {
  const Imported imported = import_world("Material \"diffuse\" \"string normalmap\" \"n.png\"\n" + kTri);
  ASSERT_EQ(imported.error, "");
  const pipeline::TextureNode& map = imported.sink.textures.at(imported.sink.materials.at(0).normal_map);
  EXPECT_EQ(map.kind, TextureKind::image);
  EXPECT_EQ(imported.sink.images.at(map.image).second, cache::TexelEncoding::linear);
}

TEST(pbrt, an_infinite_light_may_have_an_image_in_its_own_frame) {
  const Imported imported = import_world(
      "Rotate 90 0 0 1 Scale 2 2 2 LightSource \"infinite\" \"string filename\" \"sky.exr\" \"float scale\" 3 "
      "\"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]");
  ASSERT_EQ(imported.error, "");
  const shading::Light& light = imported.sink.lights.at(0);
  EXPECT_EQ(light.image, 1u);
  EXPECT_EQ(light.radiance.g, 3);
  // Where the world's x is seen in the light: its axes are rows of the inverse rotation.
  EXPECT_LT(length(Float3{light.position.x, light.edge1.x, light.edge2.x} - Float3{0, -1, 0}), 1e-6f);
  EXPECT_EQ(imported.sink.environments.size(), 1u);
  EXPECT_EQ(imported.sink.images.at(0).second, cache::TexelEncoding::linear);
  EXPECT_TRUE(starts_with(import_world("Scale 1 2 1 LightSource \"infinite\" \"string filename\" \"sky.exr\"").error,
                          "scene.pbrt:2:"));
}

TEST(pbrt, a_portal_is_where_the_world_has_it) {
  const Imported imported =
      import_world("Translate 5 5 5 LightSource \"infinite\" \"point3 portal\" [0 0 1 0 3 1 2 3 1 2 0 1]");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.portals.size(), 1u);
  const shading::Portal& portal = imported.sink.portals[0];
  expect_near(portal.corner, {0, 0, 1});
  expect_near(portal.edge1, {2, 0, 0});
  expect_near(portal.edge2, {0, 3, 0});
  EXPECT_EQ(imported.report.warning_count, 0u);
}

TEST(pbrt, checkerboards_and_bilerps_have_pbrts_defaults) {
  const Imported imported = import_world(
      "Texture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" 8 \"rgb tex2\" [0.1 0.2 0.3]\n"
      "Texture \"b\" \"float\" \"bilerp\" \"float v10\" 0.5\n"
      "Material \"coateddiffuse\" \"texture reflectance\" \"c\" \"texture roughness\" \"b\"\n" + kTri);
  ASSERT_EQ(imported.error, "");
  const auto& textures = imported.sink.textures;
  const pipeline::TextureNode& checker = textures.at(imported.sink.materials.at(0).reflectance.texture);
  ASSERT_EQ(checker.kind, TextureKind::checkerboard);
  EXPECT_EQ(checker.uv_scale[0], 8);
  EXPECT_EQ(textures[checker.child[0]].value[2], 1);
  EXPECT_EQ(textures[checker.child[1]].value[2], 0.3f);
  const pipeline::TextureNode& bilerp = textures.at(imported.sink.materials.at(0).u_roughness.texture);
  ASSERT_EQ(bilerp.kind, TextureKind::bilerp);
  const float wanted[] = {0, 1, 0.5f, 1};
  for (int c = 0; c < 4; ++c) EXPECT_EQ(textures[bilerp.child[c]].value[0], wanted[c]);
}

pipeline::TextureNode texture_of(const std::string& before, const std::string& value, const std::string& text,
                                 Imported* result = nullptr) {
  Imported imported =
      import_world(before + "\nTexture \"t\" \"" + value + "\" " + text + "\nMaterial \"diffuse\" " +
                   (value == "float" ? "\"texture displacement\"" : "\"texture reflectance\"") + " \"t\"\n" + kTri);
  EXPECT_EQ(imported.error, "") << text;
  const pipeline::TextureNode node =
      imported.sink.textures.empty() ? pipeline::TextureNode{} : imported.sink.textures.back();
  if (result != nullptr) *result = std::move(imported);
  return node;
}

TEST(pbrt, textures_of_noise_have_pbrts_defaults) {
  const auto fbm = texture_of("", "float", "\"fbm\""),
             wrinkled = texture_of("", "float", "\"wrinkled\" \"integer octaves\" 3 \"float roughness\" 0.75");
  EXPECT_EQ(fbm.kind, TextureKind::fbm);
  EXPECT_EQ(fbm.mapping, pipeline::TextureMapping::solid);
  EXPECT_EQ(fbm.value[0], 0.5f);
  EXPECT_EQ(fbm.value[1], 8);
  EXPECT_EQ(wrinkled.kind, TextureKind::wrinkled);
  EXPECT_EQ(wrinkled.value[0], 0.75f);
  EXPECT_EQ(wrinkled.value[1], 3);
  EXPECT_EQ(texture_of("", "float", "\"windy\"").kind, TextureKind::windy);
  const auto marble = texture_of("", "spectrum", "\"marble\"");
  EXPECT_EQ(marble.kind, TextureKind::marble);
  EXPECT_EQ(marble.value[2], 1);
  EXPECT_EQ(marble.value[3], 0.2f);
  Imported dotted;
  const auto dots = texture_of("", "spectrum", "\"dots\" \"rgb outside\" [0.1 0.2 0.3] \"float vscale\" 5", &dotted);
  EXPECT_EQ(dots.kind, TextureKind::dots);
  EXPECT_EQ(dots.uv_scale[1], 5);
  EXPECT_EQ(dotted.sink.textures[dots.child[0]].value[1], 1);
  EXPECT_EQ(dotted.sink.textures[dots.child[1]].value[1], 0.2f);
}

// Texture space is the one where the texture was defined, wherever its shapes are.
TEST(pbrt, textures_by_place_keep_the_transform_of_their_definition) {
  const std::string moved = "AttributeBegin Translate 5 0 0 Scale 2 2 4 ";
  const auto at = [](const pipeline::TextureNode& node, Float3 p) { return node.texture_from_world.point(p); };
  const auto fbm = texture_of(moved, "float", "\"fbm\" AttributeEnd");
  expect_near(at(fbm, {7, 2, 8}), {1, 1, 2});
  const auto sphere = texture_of(moved, "spectrum", "\"checkerboard\" \"string mapping\" \"spherical\" AttributeEnd");
  EXPECT_EQ(sphere.mapping, pipeline::TextureMapping::spherical);
  expect_near(at(sphere, {7, 2, 8}), {1, 1, 2});
  EXPECT_EQ(texture_of("", "spectrum", "\"dots\" \"string mapping\" \"cylindrical\"").mapping,
            pipeline::TextureMapping::cylindrical);
  const auto solid = texture_of(moved, "spectrum", "\"checkerboard\" \"integer dimension\" 3 AttributeEnd");
  EXPECT_EQ(solid.mapping, pipeline::TextureMapping::solid);
  expect_near(at(solid, {7, 2, 8}), {1, 1, 2});
  const auto plane = texture_of(moved, "spectrum",
                                "\"bilerp\" \"string mapping\" \"planar\" \"vector3 v1\" [0 0 2] "
                                "\"vector3 v2\" [3 0 0] \"float udelta\" 0.5 \"float vdelta\" -1 AttributeEnd");
  EXPECT_EQ(plane.mapping, pipeline::TextureMapping::planar);
  expect_near(at(plane, {7, 2, 8}), {2 * 2 + 0.5f, 3 * 1 - 1, 0});
  const auto mix = texture_of(moved, "spectrum", "\"directionmix\" \"vector3 dir\" [1 0 1] AttributeEnd");
  EXPECT_EQ(mix.kind, TextureKind::direction_mix);
  expect_near({mix.value[0], mix.value[1], mix.value[2]}, normalize(Float3{2, 0, 4}));
}

TEST(pbrt, colors_of_wide_spaces_are_brought_into_rec709) {
  const auto reflectance = [](const std::string& space, const std::string& rgb, Imported* result = nullptr) {
    Imported imported =
        import_world("ColorSpace \"" + space + "\" Material \"diffuse\" \"rgb reflectance\" [" + rgb + "]\n" + kTri);
    EXPECT_EQ(imported.error, "");
    const Rgb color = imported.sink.materials.empty() ? Rgb{} : imported.sink.materials[0].reflectance.constant;
    if (result != nullptr) *result = std::move(imported);
    return color;
  };
  Imported quiet, warned;
  expect_rgb(reflectance("rec2020", "0.5 0.5 0.5", &quiet), {0.5f, 0.5f, 0.5f}, 1e-4f);
  EXPECT_EQ(quiet.report.warning_count, 0u);
  expect_rgb(reflectance("rec2020", "0 1 0", &warned), {0, 1, 0}, 1e-4f);  // (-0.588, 1.133, -0.101)
  EXPECT_TRUE(has_warning(warned, "lies outside of Rec. 709"));
  expect_rgb(reflectance("aces2065-1", "0.5 0.5 0.5"), {0.5f, 0.5f, 0.5f}, 1e-4f);  // white stays white on a surface
  expect_rgb(reflectance("dci-p3", "0.5 0.4 0.3"), {0.5225f, 0.3958f, 0.2882f}, 1e-3f);
  const Imported light = import_world(
      "AttributeBegin ColorSpace \"aces2065-1\" LightSource \"point\" \"rgb I\" [1 1 1] AttributeEnd\n"
      "LightSource \"point\" \"rgb I\" [1 1 1]");
  ASSERT_EQ(light.error, "");
  // The white of D60 is a warm one.
  EXPECT_GT(light.sink.lights[0].radiance.r, 1.02f);
  EXPECT_LT(light.sink.lights[0].radiance.b, 0.95f);
  EXPECT_NEAR(luminance(light.sink.lights[0].radiance), 1, 1e-3);
  expect_rgb(light.sink.lights[1].radiance, {1, 1, 1});
}

TEST(pbrt, spectra_may_lie_in_files) {
  write_file("lamp.spd", "# measured\n300 5\n900 5\n");
  write_file("bad.spd", "300 5\n900 x\n");
  const Imported imported = import_world(
      "LightSource \"point\" \"spectrum I\" \"lamp.spd\"\n"
      "LightSource \"point\" \"spectrum I\" [300 5 900 5]\n"
      "LightSource \"point\" \"spectrum I\" \"stdillum-F11\"");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.lights.size(), 3u);
  EXPECT_EQ(imported.sink.lights[0].radiance, imported.sink.lights[1].radiance);
  EXPECT_NEAR(luminance(imported.sink.lights[2].radiance), 1, 1e-5);
  EXPECT_NE(import_world("LightSource \"point\" \"spectrum I\" \"bad.spd\"").error.find("bad.spd:2:5:"),
            std::string::npos);
}

TEST(pbrt, roughness_is_for_both_axes_unless_they_are_given) {
  const auto one = material_of("\"dielectric\" \"float roughness\" 0.3 \"bool remaproughness\" false");
  EXPECT_EQ(one.u_roughness.constant.r, 0.3f);
  EXPECT_EQ(one.v_roughness.constant.r, 0.3f);
  EXPECT_EQ(one.remap_roughness, 0u);
  const auto two = material_of("\"conductor\" \"float roughness\" 0.3 \"float vroughness\" 0.1");
  EXPECT_EQ(two.u_roughness.constant.r, 0.3f);
  EXPECT_EQ(two.v_roughness.constant.r, 0.1f);
}

TEST(pbrt, conductors_take_names_rgb_pairs_or_a_reflectance) {
  const auto named = material_of("\"conductor\" \"spectrum eta\" \"metal-Au-eta\" \"spectrum k\" \"metal-Au-k\"");
  EXPECT_FLOAT_EQ(named.conductor_k.constant.r, 3.0663f);
  const auto rgb = material_of("\"conductor\" \"rgb eta\" [1.6 0.9 0.5] \"rgb k\" [9.2 6.2 4.8]");
  expect_rgb(rgb.conductor_k.constant, {9.2f, 6.2f, 4.8f});
  const auto pairs = material_of("\"conductor\" \"spectrum eta\" [400 1 700 4] \"rgb k\" [1 1 1]");
  expect_rgb(pairs.conductor_eta.constant, {3.3f, 2.32f, 1.65f});
  const auto plain = material_of("\"conductor\" \"rgb reflectance\" [0.9 0.8 0.7]");
  EXPECT_EQ(plain.uses_reflectance, 1u);
  expect_rgb(plain.reflectance.constant, {0.9f, 0.8f, 0.7f});
}

TEST(pbrt, glasses_have_names_and_no_dispersion) {
  Imported imported;
  EXPECT_FLOAT_EQ(material_of("\"dielectric\" \"spectrum eta\" \"glass-F11\"", &imported).eta, 1.78472f);
  EXPECT_TRUE(has_warning(imported, "colours are not dispersed"));
}

TEST(pbrt, coats_keep_both_layers_apart) {
  Imported imported;
  const auto m = material_of(
      "\"coatedconductor\" \"float interface.roughness\" 0.1 \"float interface.eta\" 1.3 \"float thickness\" 0.1\n"
      "\"float conductor.uroughness\" 0.2 \"float conductor.vroughness\" 0.4 \"spectrum conductor.eta\" "
      "\"metal-Al-eta\"\n"
      "\"spectrum conductor.k\" \"metal-Al-k\" \"integer maxdepth\" 5 \"integer nsamples\" 2 \"float g\" 0 \"rgb "
      "albedo\" [.1 0 0]",
      &imported);
  EXPECT_EQ(m.u_roughness.constant.r, 0.1f);
  EXPECT_EQ(m.base_u_roughness.constant.r, 0.2f);
  EXPECT_EQ(m.base_v_roughness.constant.r, 0.4f);
  EXPECT_EQ(m.eta, 1.3f);
  EXPECT_FLOAT_EQ(m.conductor_eta.constant.r, 1.3571f);
  EXPECT_TRUE(has_warning(imported, "scene.pbrt:4:91: the inside of a coat does not scatter"));
}

TEST(pbrt, only_materials_in_use_are_sent_once_with_parts_first) {
  const Imported imported = import_world(
      "MakeNamedMaterial \"unused\" \"string type\" \"hair\"\nMakeNamedMaterial \"m\" \"string type\" \"mix\" \"string "
      "materials\"\n"
      " [ \"a\" \"b\" ] \"float amount\" 0.25\nMakeNamedMaterial \"a\" \"string type\" \"diffuse\"\n"
      "MakeNamedMaterial \"b\" \"string type\" \"conductor\"\nNamedMaterial \"m\"\n" +
      kTri + kTri + "NamedMaterial \"a\"\n" + kTri);
  ASSERT_EQ(imported.error, "");
  const auto& sink = imported.sink;
  EXPECT_EQ(sink.material_names, (std::vector<std::string>{"a", "b", "m"}));
  EXPECT_EQ(sink.materials[2].mix_material[0], 0u);
  EXPECT_EQ(sink.materials[2].mix_material[1], 1u);
  EXPECT_EQ(sink.materials[2].mix_amount.constant.r, 0.25f);
  EXPECT_EQ(sink.meshes[0].input.material.value, 2u);
  EXPECT_EQ(sink.meshes[2].input.material.value, 0u);
}

TEST(pbrt, imagemaps_say_everything) {
  const Imported imported = import_world(
      "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"tex/a.PNG\" \"string wrap\" \"clamp\" \"string "
      "filter\" \"trilinear\"\n"
      " \"float scale\" 2 \"bool invert\" true \"float uscale\" 3 \"float vscale\" -4 \"float udelta\" 0.5 \"float "
      "vdelta\" 0.25\n"
      "Texture \"u\" \"float\" \"imagemap\" \"string filename\" \"tex/a.PNG\" \"string encoding\" \"linear\" \"string "
      "filter\" \"ewa\"\n"
      "Texture \"v\" \"float\" \"imagemap\" \"string filename\" \"./tex/a.PNG\" \"string encoding\" \"linear\" "
      "\"string wrap\" \"black\"\n"
      "Texture \"w\" \"spectrum\" \"imagemap\" \"string filename\" \"b.exr\"\n"
      "Texture \"x\" \"spectrum\" \"imagemap\" \"string filename\" \"unused.exr\"\n"
      "Material \"diffuse\" \"texture reflectance\" \"t\" \"texture displacement\" \"u\"\n" +
      kTri + "Material \"coateddiffuse\" \"texture reflectance\" \"w\" \"texture roughness\" \"v\"\n" + kTri);
  ASSERT_EQ(imported.error, "");
  const auto& sink = imported.sink;
  ASSERT_EQ(sink.images.size(), 3u);  // one file in two encodings, and another
  EXPECT_EQ(imported.report.image_count, 3u);
  EXPECT_EQ(sink.images[0], (std::pair<std::string, cache::TexelEncoding>("a.PNG", cache::TexelEncoding::srgb)));
  EXPECT_EQ(sink.images[1].second, cache::TexelEncoding::linear);
  EXPECT_EQ(sink.images[2].second, cache::TexelEncoding::linear);  // floats
  const pipeline::TextureNode& t = sink.textures[sink.materials[0].reflectance.texture];
  EXPECT_EQ(t.kind, TextureKind::image);
  EXPECT_EQ(t.wrap, cache::WrapMode::clamp);
  EXPECT_EQ(t.filter, cache::TexelFilter::trilinear);
  EXPECT_EQ(t.value[0], 2);
  EXPECT_EQ(t.value[3], 1);
  EXPECT_EQ(t.invert, 1u);
  EXPECT_EQ(t.uv_scale[0], 3);
  EXPECT_EQ(t.uv_scale[1], -4);
  EXPECT_EQ(t.uv_offset[0], 0.5f);
  EXPECT_EQ(t.uv_offset[1], 0.25f);
  const pipeline::TextureNode& u = sink.textures[sink.materials[0].displacement];
  EXPECT_EQ(u.wrap, cache::WrapMode::repeat);
  EXPECT_EQ(u.filter, cache::TexelFilter::trilinear);
  EXPECT_TRUE(has_warning(imported, "filter \"ewa\": \"trilinear\" is used instead"));
  const pipeline::TextureNode& v = sink.textures[sink.materials[1].u_roughness.texture];
  EXPECT_EQ(v.wrap, cache::WrapMode::black);
  EXPECT_EQ(v.filter, cache::TexelFilter::bilinear);
  EXPECT_EQ(v.image, u.image);
}

TEST(pbrt, texture_graphs_are_sent_children_first) {
  const Imported imported = import_world(
      "Texture \"m\" \"spectrum\" \"mix\" \"texture tex1\" \"s\" \"rgb tex2\" [0 1 0] \"texture amount\" \"f\"\n"
      "Texture \"s\" \"spectrum\" \"scale\" \"texture tex\" \"c\" \"float scale\" 0.5\n"
      "Texture \"c\" \"spectrum\" \"constant\" \"rgb value\" [0.5 0.25 0]\nTexture \"f\" \"float\" \"constant\" "
      "\"float value\" 0.75\n"
      "Material \"diffuse\" \"texture reflectance\" \"m\"\n" +
      kTri);
  ASSERT_EQ(imported.error, "");
  const auto& textures = imported.sink.textures;
  const pipeline::TextureNode& mix = textures[imported.sink.materials[0].reflectance.texture];
  ASSERT_EQ(mix.kind, TextureKind::mix);
  const pipeline::TextureNode& scale = textures[mix.child[0]];
  ASSERT_EQ(scale.kind, TextureKind::scale);
  EXPECT_EQ(textures[scale.child[0]].value[1], 0.25f);
  EXPECT_EQ(textures[scale.child[1]].value[2], 0.5f);
  EXPECT_EQ(textures[mix.child[1]].value[1], 1);
  EXPECT_EQ(textures[mix.child[2]].value[0], 0.75f);
}

TEST(pbrt, alpha_is_a_number_or_a_texture) {
  const std::string points = "\"point3 P\" [0 0 0 1 0 0 0 1 0]";
  const Imported imported =
      import_world("Texture \"f\" \"float\" \"constant\"\nShape \"trianglemesh\" " + points +
                   " \"texture alpha\" \"f\"\n"
                   "Shape \"trianglemesh\" " +
                   points + " \"float alpha\" 0.25\nShape \"trianglemesh\" " + points + " \"float alpha\" 1\n");
  ASSERT_EQ(imported.error, "");
  const auto& sink = imported.sink;
  EXPECT_EQ(sink.textures[sink.meshes[0].input.alpha.value].value[0], 1);
  EXPECT_EQ(sink.textures[sink.meshes[1].input.alpha.value].value[0], 0.25f);
  EXPECT_FALSE(sink.meshes[2].input.alpha.valid());
}

TEST(pbrt, ply_meshes_are_named_by_their_file) {
  write_file("models/a.ply",
             "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
             "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
             "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n");
  const Imported imported =
      import_world("Translate 0 0 2\nShape \"plymesh\" \"string filename\" \"models/a.ply\"\n" + kTri);
  ASSERT_EQ(imported.error, "");
  EXPECT_EQ(imported.sink.meshes[0].input.name, "models/a.ply");
  EXPECT_EQ(imported.sink.meshes[0].indices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
  expect_near(imported.sink.meshes[0].positions[2], {1, 1, 2});
  EXPECT_TRUE(imported.sink.meshes[1].input.name.ends_with("scene.pbrt:4:1"));
  EXPECT_EQ(imported.report.triangle_count, 3u);
}

// ---- lights ----

shading::Light light_of(const std::string& text) {
  const Imported imported = import_world(text);
  EXPECT_EQ(imported.error, "") << text;
  EXPECT_EQ(imported.sink.lights.size(), 1u);
  return imported.sink.lights.empty() ? shading::Light{} : imported.sink.lights[0];
}

TEST(pbrt, point_lights_have_intensity_or_power) {
  const auto plain =
      light_of("Translate 0 0 1 LightSource \"point\" \"rgb I\" [1 2 3] \"float scale\" 2 \"point3 from\" [5 0 0]");
  EXPECT_EQ(plain.kind, shading::LightKind::point);
  expect_rgb(plain.radiance, {2, 4, 6});
  expect_near(plain.position, {5, 0, 1});
  expect_rgb(light_of("LightSource \"point\" \"float power\" 100").radiance,
             Rgb{1, 1, 1} * (100 / (4 * static_cast<float>(M_PI))), 1e-5f);
}

TEST(pbrt, spots_have_an_axis_and_two_cosines) {
  const auto spot = light_of("Rotate 90 1 0 0 LightSource \"spot\" \"point3 from\" [0 1 0] \"point3 to\" [0 1 2]");
  EXPECT_EQ(spot.kind, shading::LightKind::spot);
  expect_near(spot.position, {0, 0, 1});
  expect_near(spot.edge1, {0, -1, 0});
  EXPECT_NEAR(spot.cos_total, std::cos(M_PI / 6), kRounding);
  EXPECT_NEAR(spot.cos_falloff, std::cos(25 * M_PI / 180), kRounding);
  expect_rgb(spot.radiance, {1, 1, 1});
  // Power over what the cone's falloff integrates to: a smoothstep in the cosine is one half on average.
  const auto power =
      light_of("LightSource \"spot\" \"float power\" 10 \"float coneangle\" 90 \"float conedeltaangle\" 90");
  EXPECT_NEAR(power.radiance.g, 10 / (2 * M_PI * 0.5), 1e-5);
}

TEST(pbrt, distant_lights_shine_from_one_point_to_another) {
  const auto sun =
      light_of("Scale 1 1 3 LightSource \"distant\" \"point3 from\" [0 4 1] \"point3 to\" [0 0 0] \"rgb L\" [2 2 2]");
  expect_near(sun.edge1, normalize(Float3{0, -4, -3}));
  expect_rgb(sun.radiance, {2, 2, 2});
  expect_near(light_of("LightSource \"distant\"").edge1, {0, 0, 1});
  expect_rgb(light_of("LightSource \"distant\" \"float illuminance\" 50").radiance, {50, 50, 50});
}

TEST(pbrt, infinite_lights_are_constant) {
  expect_rgb(light_of("LightSource \"infinite\" \"rgb L\" [1 2 3] \"float scale\" 0.5").radiance, {0.5f, 1, 1.5f});
  expect_rgb(light_of("LightSource \"infinite\" \"float illuminance\" 3").radiance,
             Rgb{1, 1, 1} * (3 / static_cast<float>(M_PI)));
  const Rgb warm = light_of("LightSource \"infinite\" \"blackbody L\" 2700 \"float scale\" 4").radiance;
  EXPECT_NEAR(luminance(warm), 4, 1e-5f);  // rounding at four
  EXPECT_GT(warm.r, 3 * warm.b);
  expect_rgb(light_of("LightSource \"infinite\" \"spectrum L\" \"stdillum-D65\"").radiance, {1, 1, 1});
}

TEST(pbrt, spots_under_uneven_scales_are_warned_of) {
  const Imported imported = import_world("Scale 1 2 1 LightSource \"spot\"");
  EXPECT_EQ(imported.error, "");
  EXPECT_TRUE(has_warning(imported, "its cone stays round"));
}

TEST(pbrt, area_lights_have_radiance) {
  const Imported imported =
      import_world("AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"float scale\" 2 \"bool twosided\" true\n" + kTri);
  ASSERT_EQ(imported.error, "");
  const auto& input = imported.sink.meshes[0].input;
  EXPECT_TRUE(input.emits);
  EXPECT_TRUE(input.emits_two_sided);
  expect_rgb(input.emission, {2, 4, 6});
  const Imported black = import_world("AreaLightSource \"diffuse\" \"rgb L\" [0 0 0]\n" + kTri);
  EXPECT_FALSE(black.sink.meshes[0].input.emits);
}

TEST(pbrt, area_light_power_is_of_each_triangle) {
  const Imported imported = import_world(
      "Scale 2 2 2 AreaLightSource \"diffuse\" \"float power\" 10\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 "
      "1 0 3 3 0]\n"
      "\"integer indices\" [0 1 2 1 3 2]");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.meshes.size(), 2u);
  for (const RecordedMesh& mesh : imported.sink.meshes) {
    const float area = length(cross(mesh.positions[1] - mesh.positions[0], mesh.positions[2] - mesh.positions[0])) / 2;
    EXPECT_NEAR(mesh.input.emission.g * static_cast<float>(M_PI) * area, 10, 1e-5f);  // rounding at ten
  }
}

}  // namespace
}  // namespace spillway::tools
