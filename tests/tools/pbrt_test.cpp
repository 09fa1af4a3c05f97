// What each directive says to the sink.

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

// ---- settings ----

TEST(pbrt, an_empty_world_has_pbrts_defaults) {
  const Imported imported = import_text("WorldBegin");
  ASSERT_EQ(imported.error, "");
  EXPECT_EQ(imported.sink.settings_count, 1);
  EXPECT_EQ(imported.sink.finish_count, 0);  // the caller's
  const pipeline::SceneSettings& s = imported.sink.settings;
  EXPECT_EQ(s.camera.resolution_x_px, 1280u);
  EXPECT_EQ(s.camera.resolution_y_px, 720u);
  EXPECT_FLOAT_EQ(s.camera.tan_half_fov_y, 1);
  EXPECT_FLOAT_EQ(s.camera.tan_half_fov_x, 1280.0f / 720);
  EXPECT_EQ(s.camera.lens_radius, 0);
  EXPECT_EQ(s.camera.focal_distance, 1e6f);
  EXPECT_EQ(s.filter.kind, shading::FilterKind::gaussian);
  EXPECT_EQ(s.filter.radius_px.x, 1.5f);
  EXPECT_EQ(s.filter.a, 0.5f);
  EXPECT_EQ(s.film.exposure_scale, 1);
  EXPECT_EQ(s.render.samples_per_pixel, 16u);
  EXPECT_EQ(s.render.max_depth, 5u);
  EXPECT_EQ(s.render.seed, 0u);
  EXPECT_TRUE(imported.report.warnings.empty());
}

TEST(pbrt, the_field_of_view_is_of_the_shorter_axis) {
  const float tangent = std::tan(30.0f * static_cast<float>(M_PI) / 180);
  const auto camera = [](int x, int y, const std::string& more = "") {
    const Imported imported = import_text(fmt::format(
        "Film \"rgb\" \"integer xresolution\" {} \"integer yresolution\" {}\nCamera \"perspective\" \"float fov\" 60 {}\nWorldBegin",
        x, y, more));
    EXPECT_EQ(imported.error, "");
    return imported.sink.settings.camera;
  };
  EXPECT_FLOAT_EQ(camera(400, 200).tan_half_fov_y, tangent);      // landscape
  EXPECT_FLOAT_EQ(camera(400, 200).tan_half_fov_x, 2 * tangent);
  EXPECT_FLOAT_EQ(camera(200, 400).tan_half_fov_x, tangent);      // portrait
  EXPECT_FLOAT_EQ(camera(200, 400).tan_half_fov_y, 2 * tangent);
  EXPECT_FLOAT_EQ(camera(300, 300).tan_half_fov_x, tangent);
  EXPECT_FLOAT_EQ(camera(300, 300, "\"float frameaspectratio\" 3").tan_half_fov_x, 3 * tangent);
  const shading::Camera window = camera(300, 300, "\"float screenwindow\" [ -1 3 0 1 ]");
  EXPECT_FLOAT_EQ(window.tan_half_fov_x, 2 * tangent);
  EXPECT_FLOAT_EQ(window.tan_half_fov_y, 0.5f * tangent);
  EXPECT_FLOAT_EQ(window.screen_center_x, tangent);
  EXPECT_FLOAT_EQ(window.screen_center_y, 0.5f * tangent);
}

TEST(pbrt, the_camera_is_the_inverse_of_the_transform_before_it) {
  const Imported imported = import_text(
      "LookAt 0 0 5  0 0 0  0 1 0\nCamera \"perspective\" \"float lensradius\" 0.5 \"float focaldistance\" 7\n"
      "Translate 100 0 0 WorldBegin");
  ASSERT_EQ(imported.error, "");
  const shading::Camera& camera = imported.sink.settings.camera;
  expect_near(camera.world_from_camera.point({0, 0, 0}), {0, 0, 5});
  expect_near(camera.world_from_camera.vector({0, 0, 1}), {0, 0, -1});
  expect_near(camera.world_from_camera.vector({0, 1, 0}), {0, 1, 0});
  expect_near(camera.world_from_camera.vector({1, 0, 0}), {-1, 0, 0});  // left-handed: right is -x here
  EXPECT_EQ(camera.lens_radius, 0.5f);
  EXPECT_EQ(camera.focal_distance, 7);
}

TEST(pbrt, the_film_has_crops_and_an_exposure) {
  const auto film = [](const std::string& text) {
    const Imported imported = import_text(text + "\nWorldBegin");
    EXPECT_EQ(imported.error, "");
    return imported.sink.settings.film;
  };
  const std::string small = "Film \"rgb\" \"integer xresolution\" 10 \"integer yresolution\" 20 ";
  EXPECT_EQ(film(small).crop_x1, 0u);
  const auto part = film(small + "\"float cropwindow\" [ 0.25 0.5 0 0.51 ]");
  EXPECT_EQ(part.crop_x0, 3u);  // rounded up at both ends
  EXPECT_EQ(part.crop_x1, 5u);
  EXPECT_EQ(part.crop_y0, 0u);
  EXPECT_EQ(part.crop_y1, 11u);
  const auto pixels = film(small + "\"integer pixelbounds\" [ 2 4 -5 99 ]");
  EXPECT_EQ(pixels.crop_x0, 2u);
  EXPECT_EQ(pixels.crop_x1, 4u);
  EXPECT_EQ(pixels.crop_y0, 0u);
  EXPECT_EQ(pixels.crop_y1, 20u);
  EXPECT_FLOAT_EQ(film("Film \"rgb\" \"float iso\" 200").exposure_scale, 2);
  EXPECT_FLOAT_EQ(film("Film \"rgb\" \"float iso\" 200\nCamera \"perspective\" \"float shutterclose\" 0.25").exposure_scale, 0.5f);
  EXPECT_FLOAT_EQ(film("Film \"rgb\" \"float exposuretime\" 0.5").exposure_scale, 0.5f);
}

TEST(pbrt, what_the_film_cannot_do_is_a_warning) {
  const Imported imported = import_text(
      "Film \"rgb\" \"string filename\" \"a.exr\" \"string sensor\" \"canon_eos_100d\" \"float whitebalance\" 5000\n"
      " \"float maxcomponentvalue\" 10 \"float diagonal\" 35 \"bool savefp16\" false\nWorldBegin");
  ASSERT_EQ(imported.error, "");
  EXPECT_TRUE(has_warning(imported, "scene.pbrt:1:38: sensor \"canon_eos_100d\" is not simulated"));
  EXPECT_TRUE(has_warning(imported, "no white balance"));
  EXPECT_TRUE(has_warning(imported, "scene.pbrt:2:2: samples are not clamped"));
  EXPECT_EQ(imported.report.warning_count, 3u);
  EXPECT_EQ(imported.report.film_file_name, "a.exr");
}

TEST(pbrt, five_filters_have_their_defaults) {
  const auto filter = [](const std::string& text) {
    const Imported imported = import_text("PixelFilter " + text + "\nWorldBegin");
    EXPECT_EQ(imported.error, "");
    return imported.sink.settings.filter;
  };
  EXPECT_EQ(filter("\"box\"").radius_px.x, 0.5f);
  EXPECT_EQ(filter("\"triangle\"").radius_px.y, 2);
  EXPECT_EQ(filter("\"gaussian\" \"float sigma\" 0.25").a, 0.25f);
  EXPECT_EQ(filter("\"mitchell\"").kind, shading::FilterKind::mitchell);
  EXPECT_FLOAT_EQ(filter("\"mitchell\"").a, 1.0f / 3);
  EXPECT_FLOAT_EQ(filter("\"mitchell\" \"float C\" 0.5").b, 0.5f);
  EXPECT_EQ(filter("\"sinc\"").radius_px.x, 4);
  EXPECT_EQ(filter("\"sinc\"").a, 3);
  EXPECT_EQ(filter("\"box\" \"float yradius\" 3").radius_px.y, 3);
}

TEST(pbrt, samplers_and_integrators_are_mapped_with_a_warning) {
  for (const char* name : {"zsobol", "halton", "independent", "paddedsobol", "pmj02bn"}) {
    const Imported imported = import_text(fmt::format("Sampler \"{}\" \"integer pixelsamples\" 9 \"integer seed\" 4\nWorldBegin", name));
    ASSERT_EQ(imported.error, "");
    EXPECT_EQ(imported.sink.settings.render.samples_per_pixel, 9u);
    EXPECT_EQ(imported.sink.settings.render.seed, 4u);
    EXPECT_TRUE(has_warning(imported, fmt::format("scene.pbrt:1:9: sampler \"{}\"", name)));
  }
  const Imported stratified = import_text("Sampler \"stratified\" \"integer xsamples\" 3 \"integer ysamples\" 5\nWorldBegin");
  EXPECT_EQ(stratified.sink.settings.render.samples_per_pixel, 15u);
  const Imported bdpt = import_text("Integrator \"bdpt\" \"integer maxdepth\" 9 \"bool visualizestrategies\" false\nWorldBegin");
  EXPECT_EQ(bdpt.error, "");
  EXPECT_EQ(bdpt.sink.settings.render.max_depth, 9u);
  EXPECT_TRUE(has_warning(bdpt, "integrator \"bdpt\": \"path\" is used instead"));
  const Imported path = import_text("Integrator \"volpath\" \"bool regularize\" true \"string lightsampler\" \"power\"\nWorldBegin");
  EXPECT_EQ(path.sink.settings.render.regularize, 1u);
  EXPECT_EQ(path.report.warning_count, 0u);
}

TEST(pbrt, options_are_known) {
  const Imported imported = import_text(
      "Option \"integer seed\" 7\nOption \"string rendercoordsys\" \"world\"\nOption \"bool forcediffuse\" false\n"
      "Accelerator \"kdtree\" \"integer maxdepth\" 3\nColorSpace \"srgb\"\nWorldBegin");
  EXPECT_EQ(imported.error, "");
  EXPECT_EQ(imported.sink.settings.render.seed, 7u);
}

// ---- transforms and scopes ----

TEST(pbrt, transforms_multiply_from_the_right) {
  const Imported imported = import_world("Translate 10 0 0 Scale 2 2 2 Rotate 90 0 0 1\n" + kTri);
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.meshes.size(), 1u);
  expect_near(imported.sink.meshes[0].positions[0], {10, 0, 0});
  expect_near(imported.sink.meshes[0].positions[1], {10, 2, 0});  // x turned to y, doubled, moved
  expect_near(imported.sink.meshes[0].positions[2], {8, 0, 0});
}

TEST(pbrt, transform_replaces_and_concat_multiplies) {
  const std::string move = "[ 1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1 ]\n";
  const Imported imported = import_world("Scale 2 2 2 Transform " + move + kTri + "Scale 2 2 2 ConcatTransform " + move + kTri +
                                         "Identity " + kTri);
  ASSERT_EQ(imported.error, "");
  expect_near(imported.sink.meshes[0].positions[0], {5, 6, 7});
  expect_near(imported.sink.meshes[1].positions[0], {15, 18, 21});
  expect_near(imported.sink.meshes[2].positions[1], {1, 0, 0});
}

TEST(pbrt, scopes_keep_what_is_inside_inside) {
  const Imported imported = import_world(
      "AttributeBegin\n Translate 1 0 0 ReverseOrientation Material \"conductor\" AreaLightSource \"diffuse\"\n" + kTri +
      "AttributeEnd\n" + kTri + "TransformBegin Translate 0 0 3\n" + kTri + "TransformEnd\n" + kTri);
  ASSERT_EQ(imported.error, "");
  const auto& meshes = imported.sink.meshes;
  ASSERT_EQ(meshes.size(), 4u);
  EXPECT_EQ(meshes[0].positions[0].x, 1);
  EXPECT_TRUE(meshes[0].input.flip_normals);
  EXPECT_TRUE(meshes[0].input.emits);
  EXPECT_EQ(imported.sink.materials[meshes[0].input.material.value].kind, MaterialKind::conductor);
  EXPECT_EQ(meshes[1].positions[0].x, 0);
  EXPECT_FALSE(meshes[1].input.flip_normals);
  EXPECT_FALSE(meshes[1].input.emits);
  EXPECT_EQ(imported.sink.materials[meshes[1].input.material.value].kind, MaterialKind::diffuse);
  EXPECT_EQ(meshes[2].positions[0].z, 3);
  EXPECT_EQ(meshes[3].positions[0].z, 0);
  EXPECT_TRUE(has_warning(imported, "TransformBegin is deprecated"));
}

TEST(pbrt, coordinate_systems_are_recalled) {
  const Imported imported = import_text(
      "Translate 0 0 5 Camera \"perspective\" WorldBegin\nTranslate 3 0 0 CoordinateSystem \"here\" Identity\n" + kTri +
      "CoordSysTransform \"here\"\n" + kTri + "CoordSysTransform \"camera\"\n" + kTri + "CoordSysTransform \"world\"\n" + kTri);
  ASSERT_EQ(imported.error, "");
  EXPECT_EQ(imported.sink.meshes[1].positions[0].x, 3);
  EXPECT_EQ(imported.sink.meshes[2].positions[0].z, -5);  // world from camera
  expect_near(imported.sink.meshes[3].positions[0], {0, 0, 0});
}

TEST(pbrt, attributes_add_parameters_and_may_stay_unused) {
  const Imported imported = import_world(
      "Attribute \"shape\" \"float alpha\" 0.5 \"float radius\" 3\nAttribute \"material\" \"rgb reflectance\" [0.1 0.2 0.3]\n"
      "Material \"diffuse\"\n" + kTri + "Material \"diffuse\" \"rgb reflectance\" [1 1 1]\n" + kTri +
      "AttributeBegin Attribute \"shape\" \"float alpha\" 1\n" + kTri + "AttributeEnd\n" + kTri);
  ASSERT_EQ(imported.error, "");
  const auto& sink = imported.sink;
  expect_rgb(sink.materials[0].reflectance.constant, {0.1f, 0.2f, 0.3f});
  expect_rgb(sink.materials[1].reflectance.constant, {1, 1, 1});
  EXPECT_TRUE(sink.meshes[0].input.alpha.valid());
  EXPECT_EQ(sink.textures[sink.meshes[0].input.alpha.value].value[0], 0.5f);
  EXPECT_FALSE(sink.meshes[2].input.alpha.valid());  // said later: opaque
  EXPECT_TRUE(sink.meshes[3].input.alpha.valid());
}

TEST(pbrt, includes_are_read_in_place_and_imports_in_a_scope) {
  write_file("parts/move.pbrt", "Translate 1 2 3\n");
  const Imported imported = import_text("WorldBegin\nImport \"parts/move.pbrt\"\n" + kTri + "Include \"parts/move.pbrt\"\n" + kTri +
                                        "Include \"parts/move.pbrt\"\n" + kTri);
  ASSERT_EQ(imported.error, "");
  expect_near(imported.sink.meshes[0].positions[0], {0, 0, 0});
  expect_near(imported.sink.meshes[1].positions[0], {1, 2, 3});
  expect_near(imported.sink.meshes[2].positions[0], {2, 4, 6});
}

// ---- sides ----

Float3 geometric_normal(const RecordedMesh& mesh, size_t triangle = 0) {
  const uint32_t* i = mesh.indices.data() + 3 * triangle;
  const Float3 n = cross(mesh.positions[i[1]] - mesh.positions[i[0]], mesh.positions[i[2]] - mesh.positions[i[0]]);
  return normalize(mesh.input.flip_normals ? -n : n);
}

TEST(pbrt, geometric_normals_turn_with_orientation_and_stay_outside_under_mirroring) {
  const auto normal = [](const std::string& before) {
    const Imported imported = import_world(before + "\n" + kTri);
    EXPECT_EQ(imported.error, "");
    return geometric_normal(imported.sink.meshes[0]);
  };
  expect_near(normal(""), {0, 0, 1});
  expect_near(normal("ReverseOrientation"), {0, 0, -1});
  expect_near(normal("ReverseOrientation ReverseOrientation"), {0, 0, 1});
  expect_near(normal("Scale -1 1 1"), {0, 0, 1});  // mirrored in x: the front stays in front
  expect_near(normal("Scale 1 1 -1"), {0, 0, -1});
  expect_near(normal("Scale -1 -1 -1"), {0, 0, -1});
  expect_near(normal("Scale -1 1 1 ReverseOrientation"), {0, 0, -1});
  expect_near(normal("Rotate 180 1 0 0"), {0, 0, -1});
}

std::string with_normals(const std::string& n) {
  return "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"normal N\" [" + n + " " + n + " " + n + "]\n";
}

TEST(pbrt, normals_take_the_inverse_transpose_and_lead_the_geometric_side) {
  for (const std::string before : {"", "ReverseOrientation", "Scale 1 1 -1", "Scale -1 2 3", "Scale -1 1 1 ReverseOrientation"}) {
    for (const std::string n : {"0.1 0 1", "0 0.2 -1"}) {
      const Imported imported = import_world(before + "\n" + with_normals(n));
      ASSERT_EQ(imported.error, "");
      const RecordedMesh& mesh = imported.sink.meshes[0];
      EXPECT_NEAR(length(mesh.normals[0]), 1, kRounding);
      EXPECT_GT(dot(geometric_normal(mesh), mesh.normals[0]), 0) << before << " N " << n;
    }
  }
  const Imported squashed = import_world("Scale 2 1 1\n" + with_normals("1 0 1"));
  expect_near(squashed.sink.meshes[0].normals[0], normalize(Float3{0.5f, 0, 1}));
  EXPECT_GT(import_world("Scale -1 1 1\n" + with_normals("0 0 1")).sink.meshes[0].normals[0].z, 0);
  EXPECT_LT(import_world("ReverseOrientation\n" + with_normals("0 0 1")).sink.meshes[0].normals[0].z, 0);
}

TEST(pbrt, rewound_triangles_keep_their_corners_and_attributes) {
  const Imported imported = import_world(
      "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0] \"normal N\" [0 0 1 0 0 1 0 0 1 0 0 1]\n"
      "\"point2 uv\" [0 0 1 0 0 1 1 1] \"integer indices\" [0 1 2 1 2 3]\n");  // the second one is wound backwards
  ASSERT_EQ(imported.error, "");
  const RecordedMesh& mesh = imported.sink.meshes[0];
  EXPECT_EQ(mesh.indices, (std::vector<uint32_t>{0, 1, 2, 1, 3, 2}));
  EXPECT_GT(geometric_normal(mesh, 1).z, 0);
  EXPECT_EQ(mesh.uvs[3].x, 1);
}

TEST(pbrt, normals_of_length_zero_are_replaced_by_their_triangles) {
  const Imported imported = import_world("Rotate 90 1 0 0 ReverseOrientation\n" + with_normals("0 0 0"));
  ASSERT_EQ(imported.error, "");
  expect_near(imported.sink.meshes[0].normals[1], geometric_normal(imported.sink.meshes[0]));
}

// ---- objects ----

TEST(pbrt, objects_keep_their_transform_and_instances_add_theirs) {
  const Imported imported = import_world(
      "Translate 1 0 0 ObjectBegin \"a\" Scale 2 2 2\n" + kTri + "ObjectEnd\n"
      "ObjectInstance \"a\"\nScale -1 1 1 ObjectInstance \"a\"\n");
  ASSERT_EQ(imported.error, "");
  const auto& sink = imported.sink;
  ASSERT_EQ(sink.meshes.size(), 1u);
  EXPECT_EQ(sink.meshes[0].input.object, 1u);
  expect_near(sink.meshes[0].positions[1], {3, 0, 0});
  ASSERT_EQ(sink.instances.size(), 2u);
  expect_near(sink.instances[0].second.point({3, 0, 0}), {4, 0, 0});  // the transform where the instance stands
  expect_near(sink.instances[1].second.point({3, 0, 0}), {-2, 0, 0});
  EXPECT_EQ(imported.report.object_count, 1u);
  EXPECT_EQ(imported.report.instance_count, 2u);
}

TEST(pbrt, empty_objects_are_not_instanced) {
  const Imported imported = import_world("ObjectBegin \"a\" ObjectEnd\nObjectInstance \"a\"");
  EXPECT_EQ(imported.error, "");
  EXPECT_TRUE(imported.sink.instances.empty());
  EXPECT_TRUE(has_warning(imported, "scene.pbrt:3:16: object \"a\" holds nothing"));
}

// ---- materials and textures ----

pipeline::Material material_of(const std::string& text, Imported* result = nullptr) {
  Imported imported = import_world("Material " + text + "\n" + kTri);
  EXPECT_EQ(imported.error, "") << text;
  const pipeline::Material material = imported.sink.materials.empty() ? pipeline::Material{} : imported.sink.materials.back();
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
      "\"float conductor.uroughness\" 0.2 \"float conductor.vroughness\" 0.4 \"spectrum conductor.eta\" \"metal-Al-eta\"\n"
      "\"spectrum conductor.k\" \"metal-Al-k\" \"integer maxdepth\" 5 \"integer nsamples\" 2 \"float g\" 0 \"rgb albedo\" [.1 0 0]",
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
      "MakeNamedMaterial \"unused\" \"string type\" \"hair\"\nMakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\"\n"
      " [ \"a\" \"b\" ] \"float amount\" 0.25\nMakeNamedMaterial \"a\" \"string type\" \"diffuse\"\n"
      "MakeNamedMaterial \"b\" \"string type\" \"conductor\"\nNamedMaterial \"m\"\n" + kTri + kTri + "NamedMaterial \"a\"\n" + kTri);
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
      "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"tex/a.PNG\" \"string wrap\" \"clamp\" \"string filter\" \"trilinear\"\n"
      " \"float scale\" 2 \"bool invert\" true \"float uscale\" 3 \"float vscale\" -4 \"float udelta\" 0.5 \"float vdelta\" 0.25\n"
      "Texture \"u\" \"float\" \"imagemap\" \"string filename\" \"tex/a.PNG\" \"string encoding\" \"linear\" \"string filter\" \"ewa\"\n"
      "Texture \"v\" \"float\" \"imagemap\" \"string filename\" \"./tex/a.PNG\" \"string encoding\" \"linear\" \"string wrap\" \"black\"\n"
      "Texture \"w\" \"spectrum\" \"imagemap\" \"string filename\" \"b.exr\"\n"
      "Texture \"x\" \"spectrum\" \"imagemap\" \"string filename\" \"unused.exr\"\n"
      "Material \"diffuse\" \"texture reflectance\" \"t\" \"texture displacement\" \"u\"\n" + kTri +
      "Material \"coateddiffuse\" \"texture reflectance\" \"w\" \"texture roughness\" \"v\"\n" + kTri);
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
      "Texture \"c\" \"spectrum\" \"constant\" \"rgb value\" [0.5 0.25 0]\nTexture \"f\" \"float\" \"constant\" \"float value\" 0.75\n"
      "Material \"diffuse\" \"texture reflectance\" \"m\"\n" + kTri);
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
  const Imported imported = import_world(
      "Texture \"f\" \"float\" \"constant\"\nShape \"trianglemesh\" " + points + " \"texture alpha\" \"f\"\n"
      "Shape \"trianglemesh\" " + points + " \"float alpha\" 0.25\nShape \"trianglemesh\" " + points + " \"float alpha\" 1\n");
  ASSERT_EQ(imported.error, "");
  const auto& sink = imported.sink;
  EXPECT_EQ(sink.textures[sink.meshes[0].input.alpha.value].value[0], 1);
  EXPECT_EQ(sink.textures[sink.meshes[1].input.alpha.value].value[0], 0.25f);
  EXPECT_FALSE(sink.meshes[2].input.alpha.valid());
}

TEST(pbrt, ply_meshes_are_named_by_their_file) {
  write_file("models/a.ply", "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
                             "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
                             "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n");
  const Imported imported = import_world("Translate 0 0 2\nShape \"plymesh\" \"string filename\" \"models/a.ply\"\n" + kTri);
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
  const auto plain = light_of("Translate 0 0 1 LightSource \"point\" \"rgb I\" [1 2 3] \"float scale\" 2 \"point3 from\" [5 0 0]");
  EXPECT_EQ(plain.kind, shading::LightKind::point);
  expect_rgb(plain.radiance, {2, 4, 6});
  expect_near(plain.position, {5, 0, 1});
  expect_rgb(light_of("LightSource \"point\" \"float power\" 100").radiance, Rgb{1, 1, 1} * (100 / (4 * static_cast<float>(M_PI))), 1e-5f);
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
  const auto power = light_of("LightSource \"spot\" \"float power\" 10 \"float coneangle\" 90 \"float conedeltaangle\" 90");
  EXPECT_NEAR(power.radiance.g, 10 / (2 * M_PI * 0.5), 1e-5);
}

TEST(pbrt, distant_lights_shine_from_one_point_to_another) {
  const auto sun = light_of("Scale 1 1 3 LightSource \"distant\" \"point3 from\" [0 4 1] \"point3 to\" [0 0 0] \"rgb L\" [2 2 2]");
  expect_near(sun.edge1, normalize(Float3{0, -4, -3}));
  expect_rgb(sun.radiance, {2, 2, 2});
  expect_near(light_of("LightSource \"distant\"").edge1, {0, 0, 1});
  expect_rgb(light_of("LightSource \"distant\" \"float illuminance\" 50").radiance, {50, 50, 50});
}

TEST(pbrt, infinite_lights_are_constant) {
  expect_rgb(light_of("LightSource \"infinite\" \"rgb L\" [1 2 3] \"float scale\" 0.5").radiance, {0.5f, 1, 1.5f});
  expect_rgb(light_of("LightSource \"infinite\" \"float illuminance\" 3").radiance, Rgb{1, 1, 1} * (3 / static_cast<float>(M_PI)));
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
  const Imported imported = import_world("AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"float scale\" 2 \"bool twosided\" true\n" + kTri);
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
      "Scale 2 2 2 AreaLightSource \"diffuse\" \"float power\" 10\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 3 3 0]\n"
      "\"integer indices\" [0 1 2 1 3 2]");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.meshes.size(), 2u);
  for (const RecordedMesh& mesh : imported.sink.meshes) {
    const float area = length(cross(mesh.positions[1] - mesh.positions[0], mesh.positions[2] - mesh.positions[0])) / 2;
    EXPECT_NEAR(mesh.input.emission.g * static_cast<float>(M_PI) * area, 10, 1e-5f);  // rounding at ten
  }
}

// ---- damage ----

std::string everything() {
  return "# all of it\nOption \"integer seed\" 3\nLookAt 0 0 5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" [ 40 ]\n"
         "Film \"rgb\" \"integer xresolution\" 64 \"float cropwindow\" [ 0 1 0 0.5 ]\nSampler \"sobol\" PixelFilter \"box\"\n"
         "Integrator \"path\"\nWorldBegin\nTexture \"c\" \"float\" \"constant\" \"float value\" 0.5\n"
         "Texture \"s\" \"float\" \"scale\" \"texture tex\" \"c\"\nMakeNamedMaterial \"m\" \"string type\" \"conductor\" "
         "\"texture roughness\" \"s\"\nAttributeBegin Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1 ]\nNamedMaterial \"m\"\n"
         "AreaLightSource \"diffuse\" \"blackbody L\" 3000\n" + kTri + "AttributeEnd\nObjectBegin \"o\"\n" + kTri +
         "ObjectEnd\nObjectInstance \"o\"\nLightSource \"point\" \"rgb I\" [ 1 1 1 ]\n";
}

TEST(pbrt, every_prefix_imports_or_says_where_it_ends) {
  const std::string text = everything();
  ASSERT_EQ(import_text(text).error, "");
  for (size_t size = 0; size < text.size(); ++size) {
    const Imported imported = import_text(text.substr(0, size));
    if (!imported.error.empty()) {
      EXPECT_TRUE(starts_with(imported.error, "scene.pbrt:")) << imported.error;
    }
  }
}

TEST(pbrt, every_damaged_byte_is_survived) {
  const std::string text = everything();
  for (size_t at = 0; at < text.size(); ++at) {
    for (const char byte : {'"', '[', '9', '\0', '\n', static_cast<char>(text[at] ^ 4)}) {
      std::string damaged = text;
      damaged[at] = byte;
      for (const bool lenient : {false, true}) {
        const Imported imported = import_text(damaged, lenient);
        if (!imported.error.empty()) {
          EXPECT_TRUE(starts_with(imported.error, "scene.pbrt:")) << imported.error;
        }
      }
    }
  }
}

TEST(pbrt, the_same_scene_is_said_the_same_way_twice) {
  const Imported a = import_text(everything()), b = import_text(everything());
  ASSERT_EQ(a.sink.meshes.size(), b.sink.meshes.size());
  for (size_t i = 0; i < a.sink.meshes.size(); ++i) {
    EXPECT_EQ(a.sink.meshes[i].indices, b.sink.meshes[i].indices);
    EXPECT_EQ(a.sink.meshes[i].positions, b.sink.meshes[i].positions);
  }
  EXPECT_EQ(a.sink.material_names, b.sink.material_names);
}

}  // namespace
}  // namespace spillway::tools
