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
    const Imported imported =
        import_text(fmt::format("Film \"rgb\" \"integer xresolution\" {} \"integer yresolution\" {}\nCamera "
                                "\"perspective\" \"float fov\" 60 {}\nWorldBegin",
                                x, y, more));
    EXPECT_EQ(imported.error, "");
    return imported.sink.settings.camera;
  };
  EXPECT_FLOAT_EQ(camera(400, 200).tan_half_fov_y, tangent);  // landscape
  EXPECT_FLOAT_EQ(camera(400, 200).tan_half_fov_x, 2 * tangent);
  EXPECT_FLOAT_EQ(camera(200, 400).tan_half_fov_x, tangent);  // portrait
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
      "LookAt 1 2 8  3 2 8  0 1 0\nCamera \"perspective\" \"float lensradius\" 0.5 \"float focaldistance\" 7\n"
      "Translate 100 0 0 WorldBegin");
  ASSERT_EQ(imported.error, "");
  const shading::Camera& camera = imported.sink.settings.camera;
  expect_near(camera.world_from_camera.point({0, 0, 0}), {1, 2, 8});
  expect_near(camera.world_from_camera.vector({0, 0, 1}), {1, 0, 0});
  expect_near(camera.world_from_camera.vector({0, 1, 0}), {0, 1, 0});
  expect_near(camera.world_from_camera.vector({1, 0, 0}), {0, 0, -1});  // up x view: left-handed
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
  EXPECT_FLOAT_EQ(
      film("Film \"rgb\" \"float iso\" 200\nCamera \"perspective\" \"float shutterclose\" 0.25").exposure_scale, 0.5f);
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
  for (const char* name : {"zsobol", "halton", "paddedsobol", "pmj02bn"}) {
    const Imported imported =
        import_text(fmt::format("Sampler \"{}\" \"integer pixelsamples\" 9 \"integer seed\" 4\nWorldBegin", name));
    ASSERT_EQ(imported.error, "");
    EXPECT_EQ(imported.sink.settings.render.samples_per_pixel, 9u);
    EXPECT_EQ(imported.sink.settings.render.seed, 4u);
    EXPECT_TRUE(has_warning(imported, fmt::format("scene.pbrt:1:9: sampler \"{}\"", name)));
  }
  const Imported stratified =
      import_text("Sampler \"stratified\" \"integer xsamples\" 3 \"integer ysamples\" 5\nWorldBegin");
  EXPECT_EQ(stratified.sink.settings.render.samples_per_pixel, 15u);
  const Imported bdpt =
      import_text("Integrator \"bdpt\" \"integer maxdepth\" 9 \"bool visualizestrategies\" false\nWorldBegin");
  EXPECT_EQ(bdpt.error, "");
  EXPECT_EQ(bdpt.sink.settings.render.max_depth, 9u);
  EXPECT_TRUE(has_warning(bdpt, "integrator \"bdpt\": \"path\" is used instead"));
  const Imported path =
      import_text("Integrator \"volpath\" \"bool regularize\" true \"string lightsampler\" \"power\"\nWorldBegin");
  EXPECT_TRUE(has_warning(path, "\"regularize\" is not done"));
  EXPECT_EQ(path.report.warning_count, 1u);
}

TEST(pbrt, options_are_known) {
  const Imported imported = import_text(
      "Option \"integer seed\" 7\nOption \"string rendercoordsys\" \"world\"\nOption \"bool forcediffuse\" false\n"
      "Accelerator \"kdtree\" \"integer maxdepth\" 3\nColorSpace \"srgb\"\nWorldBegin");
  EXPECT_EQ(imported.error, "");
  EXPECT_EQ(imported.sink.settings.render.seed, 7u);
  EXPECT_EQ(imported.report.warning_count, 0u);
}

// As pbrt writes and compares them: a name, and a value.
TEST(pbrt, options_have_a_name_and_a_value) {
  const Imported quiet = import_text(
      "Option \"seed\" -3\nOption \"wavefront\" true\nOption \"Render_Coord-Sys\" \"camera\"\nOption \"pixelstats\" "
      "true\n"
      "Option \"msereferenceimage\" \"a.exr\"\nOption \"msereferenceout\" \"b.txt\"\n"
      "Option \"disablewavelengthjitter\" true\nOption \"disablepixeljitter\" false\nWorldBegin");
  EXPECT_EQ(quiet.error, "");
  EXPECT_EQ(quiet.report.warning_count, 0u);
  EXPECT_EQ(quiet.sink.settings.render.seed, static_cast<uint32_t>(-3));
  const Imported warned = import_text(
      "Option \"disablepixeljitter\" true\nOption \"disabletexturefiltering\" true\nOption \"forcediffuse\" true\n"
      "Option \"displacementedgescale\" 2\nWorldBegin");
  EXPECT_EQ(warned.error, "");
  EXPECT_EQ(warned.report.warning_count, 4u);
}

TEST(pbrt, independent_samples_can_be_asked_for) {
  EXPECT_EQ(import_text("Sampler \"independent\" \"integer pixelsamples\" 9 WorldBegin").sink.settings.render.sampler,
            shading::SamplerKind::independent);
  EXPECT_EQ(import_text("Sampler \"halton\" WorldBegin").sink.settings.render.sampler, shading::SamplerKind::sobol);
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
  const Imported imported = import_world("Scale 2 2 2 Transform " + move + kTri + "Scale 2 2 2 ConcatTransform " +
                                         move + kTri + "Identity " + kTri);
  ASSERT_EQ(imported.error, "");
  expect_near(imported.sink.meshes[0].positions[0], {5, 6, 7});
  expect_near(imported.sink.meshes[1].positions[0], {15, 18, 21});
  expect_near(imported.sink.meshes[2].positions[1], {1, 0, 0});
}

TEST(pbrt, an_orthographic_camera_sees_its_window) {
  const auto camera = import_text(
      "Camera \"orthographic\" \"float screenwindow\" [-2 6 -1 1]\nFilm \"rgb\" \"integer xresolution\" 400 "
      "\"integer yresolution\" 100\nWorldBegin\n").sink.settings.camera;
  EXPECT_EQ(camera.is_orthographic, 1u);
  EXPECT_EQ(camera.tan_half_fov_x, 4);
  EXPECT_EQ(camera.tan_half_fov_y, 1);
  EXPECT_EQ(camera.screen_center_x, 2);
  EXPECT_TRUE(starts_with(import_text("Camera \"orthographic\" \"float fov\" 30\nWorldBegin").error, "scene.pbrt:1:"));
}

TEST(pbrt, scopes_keep_what_is_inside_inside) {
  const Imported imported = import_world(
      "AttributeBegin\n Translate 1 0 0 ReverseOrientation Material \"conductor\" AreaLightSource \"diffuse\"\n" +
      kTri + "AttributeEnd\n" + kTri + "TransformBegin Translate 0 0 3\n" + kTri + "TransformEnd\n" + kTri);
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
      "CoordSysTransform \"here\"\n" + kTri + "CoordSysTransform \"camera\"\n" + kTri +
      "CoordSysTransform \"world\"\n" + kTri);
  ASSERT_EQ(imported.error, "");
  EXPECT_EQ(imported.sink.meshes[1].positions[0].x, 3);
  EXPECT_EQ(imported.sink.meshes[2].positions[0].z, -5);  // world from camera
  expect_near(imported.sink.meshes[3].positions[0], {0, 0, 0});
}

TEST(pbrt, attributes_add_parameters_and_may_stay_unused) {
  const Imported imported = import_world(
      "Attribute \"shape\" \"float alpha\" 0.5 \"float radius\" 3\nAttribute \"material\" \"rgb reflectance\" [0.1 0.2 "
      "0.3]\n"
      "Material \"diffuse\"\n" +
      kTri + "Material \"diffuse\" \"rgb reflectance\" [1 1 1]\n" + kTri +
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
  const Imported imported =
      import_text("WorldBegin\nImport \"parts/move.pbrt\"\n" + kTri + "Include \"parts/move.pbrt\"\n" + kTri +
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
  for (const std::string before :
       {"", "ReverseOrientation", "Scale 1 1 -1", "Scale -1 2 3", "Scale -1 1 1 ReverseOrientation"}) {
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
  const Imported turned = import_world("Rotate 90 1 0 0\n" + with_normals("0 0 1"));  // not its own transpose
  expect_near(turned.sink.meshes[0].normals[0], {0, -1, 0});
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
  const Imported imported = import_world("Translate 1 0 0 ObjectBegin \"a\" Scale 2 2 2\n" + kTri +
                                         "ObjectEnd\n"
                                         "ObjectInstance \"a\"\nScale -1 1 1 ObjectInstance \"a\"\n");
  ASSERT_EQ(imported.error, "");
  const auto& sink = imported.sink;
  ASSERT_EQ(sink.meshes.size(), 1u);
  EXPECT_EQ(sink.meshes[0].input.object, 1u);
  expect_near(sink.meshes[0].positions[1], {3, 0, 0});
  ASSERT_EQ(sink.instances.size(), 2u);
  expect_near(sink.instances[0].second.point({3, 0, 0}), {4, 0, 0});  // the transform where the instance stands
  expect_near(sink.instances[1].second.point({3, 0, 0}), {-2, 0, 0});
  EXPECT_EQ(imported.sink.objects.size(), 1u);
  EXPECT_EQ(imported.report.instance_count, 2u);
}

// What emits in an object emits at each of its instances, and stays a mesh of the object.
TEST(pbrt, emitters_of_objects_are_said_once) {
  const Imported imported = import_world("ObjectBegin \"lamp\" Translate 0 0 1\n" + kTri +
                                         "AreaLightSource \"diffuse\" \"rgb L\" [3 2 1]\n" + kTri +
                                         "ObjectEnd\nTranslate 5 0 0 ObjectInstance \"lamp\"\n"
                                         "Scale -1 1 1 ObjectInstance \"lamp\"\n");
  ASSERT_EQ(imported.error, "");
  const auto& meshes = imported.sink.meshes;
  ASSERT_EQ(meshes.size(), 2u);
  EXPECT_FALSE(meshes[0].input.emits);
  EXPECT_TRUE(meshes[1].input.emits);
  EXPECT_EQ(meshes[1].input.emission.g, 2);
  for (const auto& mesh : meshes) EXPECT_EQ(mesh.input.object, 1u);
  expect_near(meshes[1].positions[1], {1, 0, 1});
  EXPECT_EQ(imported.sink.instances.size(), 2u);
}

TEST(pbrt, empty_objects_are_not_instanced) {
  const Imported imported = import_world("ObjectBegin \"a\" ObjectEnd\nObjectInstance \"a\"");
  EXPECT_EQ(imported.error, "");
  EXPECT_TRUE(imported.sink.instances.empty());
  EXPECT_TRUE(has_warning(imported, "scene.pbrt:3:16: object \"a\" holds nothing"));
}

// ---- damage ----

std::string everything() {
  return "# all of it\nOption \"integer seed\" 3\nLookAt 0 0 5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" [ 40 "
         "]\n"
         "Film \"rgb\" \"integer xresolution\" 64 \"float cropwindow\" [ 0 1 0 0.5 ]\nSampler \"sobol\" PixelFilter "
         "\"box\"\n"
         "Integrator \"path\"\nWorldBegin\nTexture \"c\" \"float\" \"constant\" \"float value\" 0.5\n"
         "Texture \"s\" \"float\" \"scale\" \"texture tex\" \"c\"\nMakeNamedMaterial \"m\" \"string type\" "
         "\"conductor\" "
         "\"texture roughness\" \"s\"\nAttributeBegin Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1 ]\nNamedMaterial "
         "\"m\"\n"
         "AreaLightSource \"diffuse\" \"blackbody L\" 3000\n" +
         kTri + "AttributeEnd\nObjectBegin \"o\"\n" + kTri +
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
