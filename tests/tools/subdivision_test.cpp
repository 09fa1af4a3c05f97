// Shape subdivmesh: what a scene says is what the sink hears, and what is wrong with it is said at its place.

#include <gtest/gtest.h>

#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

constexpr std::string_view kQuad = "\"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0] \"integer indices\" [0 1 2 3] ";

std::string subdivmesh(std::string_view rest, std::string_view head = kQuad) {
  return "Shape \"subdivmesh\" " + std::string(head) + std::string(rest) + "\n";
}

RecordedCage cage_of(const std::string& world) {
  Imported imported = import_world(world);
  EXPECT_EQ(imported.error, "");
  EXPECT_EQ(imported.report.cage_count, 1u);
  if (imported.sink.cages.size() != 1) return {};
  return imported.sink.cages[0];
}

TEST(subdivision, everything_said_arrives) {
  const RecordedCage cage = cage_of(subdivmesh(
      R"("point3 P" [0 0 0 1 0 0 1 1 0 0 1 0 2 0 0] "integer nvertices" [4 3] "integer indices" [0 1 2 3 1 4 2]
         "point2 uv" [0 0 1 0 1 1 0 1] "integer uvindices" [0 1 2 3 0 1 2]
         "integer creaseindices" [0 1 4 2 3] "integer creaselengths" [3 2] "float creasesharpness" [2.5 10]
         "integer cornerindices" [3] "float cornersharpness" [1] "integer holeindices" [1]
         "string interpolateboundary" "edgeOnly" "string facevaryinginterpolate" "all" "string scheme" "catmullclark")",
      ""));
  EXPECT_EQ(cage.positions.size(), 5u);
  EXPECT_EQ(cage.corner_counts, (std::vector<uint32_t>{4, 3}));
  EXPECT_EQ(cage.indices, (std::vector<uint32_t>{0, 1, 2, 3, 1, 4, 2}));
  EXPECT_EQ(cage.uvs.size(), 4u);
  EXPECT_EQ(cage.uv_indices, (std::vector<uint32_t>{0, 1, 2, 3, 0, 1, 2}));
  ASSERT_EQ(cage.sharp_edges.size(), 3u);
  EXPECT_EQ(cage.sharp_edges[1].vertices[0], 1u);
  EXPECT_EQ(cage.sharp_edges[1].vertices[1], 4u);
  EXPECT_EQ(cage.sharp_edges[1].sharpness, 2.5f);
  EXPECT_EQ(cage.sharp_edges[2].sharpness, 10);
  ASSERT_EQ(cage.sharp_vertices.size(), 1u);
  EXPECT_EQ(cage.sharp_vertices[0].vertex, 3u);
  EXPECT_EQ(cage.holes, std::vector<uint32_t>{1});
  EXPECT_EQ(cage.input.boundary, pipeline::BoundaryRule::edges);
  EXPECT_EQ(cage.input.uv_rule, pipeline::UvRule::all);
}

TEST(subdivision, quads_are_assumed_and_rules_have_defaults) {
  const RecordedCage cage = cage_of(subdivmesh(""));
  EXPECT_EQ(cage.corner_counts, std::vector<uint32_t>{4});
  EXPECT_EQ(cage.input.boundary, pipeline::BoundaryRule::edges_and_corners);
  EXPECT_EQ(cage.input.uv_rule, pipeline::UvRule::corners_plus1);
  EXPECT_FALSE(cage.input.cage.flip_normals);
}

TEST(subdivision, mirroring_turns_faces_and_reverse_orientation_the_normals) {
  const RecordedCage mirrored = cage_of("Scale -1 1 1\n" + subdivmesh("\"point2 uv\" [0 0 1 0 1 1 0 1] \"integer uvindices\" [0 1 2 3]"));
  EXPECT_EQ(mirrored.positions[1].x, -1);
  EXPECT_EQ(mirrored.indices, (std::vector<uint32_t>{0, 3, 2, 1}));
  EXPECT_EQ(mirrored.uv_indices, (std::vector<uint32_t>{0, 3, 2, 1}));
  EXPECT_FALSE(mirrored.input.cage.flip_normals);
  const RecordedCage reversed = cage_of("ReverseOrientation\n" + subdivmesh(""));
  EXPECT_EQ(reversed.indices, (std::vector<uint32_t>{0, 1, 2, 3}));
  EXPECT_TRUE(reversed.input.cage.flip_normals);
}

TEST(subdivision, faces_of_any_number_of_corners_come_from_a_file) {
  write_file("house.ply",
             "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\nproperty float u\n"
             "property float v\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
             "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n.5 2 0 .5 2\n0 1 0 0 1\n4 0 1 2 4\n3 4 2 3\n");
  const RecordedCage cage = cage_of(subdivmesh("\"string filename\" \"house.ply\"", ""));
  EXPECT_EQ(cage.corner_counts, (std::vector<uint32_t>{4, 3}));
  EXPECT_EQ(cage.indices.size(), 7u);
  EXPECT_EQ(cage.uvs.size(), 5u);
  EXPECT_EQ(cage.input.cage.name, "house.ply");
}

TEST(subdivision, emission_goes_with_the_cage) {
  const RecordedCage cage = cage_of("AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"bool twosided\" true\n" + subdivmesh(""));
  EXPECT_TRUE(cage.input.cage.emits);
  EXPECT_TRUE(cage.input.cage.emits_two_sided);
  const std::string power = "AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"float power\" 5\n" + subdivmesh("");
  EXPECT_TRUE(starts_with(import_world(power).error, "scene.pbrt:3:1: a subdivmesh with \"power\"")) << import_world(power).error;
}

TEST(subdivision, displacement_is_a_texture_or_a_number) {
  const RecordedCage constant = cage_of(subdivmesh("\"float displacement\" 0.5 \"float displacementscale\" 2"));
  EXPECT_TRUE(constant.input.displacement.valid());
  EXPECT_EQ(constant.input.displacement_scale, 2);
  const RecordedCage textured = cage_of("Texture \"bumps\" \"float\" \"wrinkled\"\n" + subdivmesh("\"texture displacement\" \"bumps\""));
  EXPECT_TRUE(textured.input.displacement.valid());
  EXPECT_FALSE(cage_of(subdivmesh("")).input.displacement.valid());
}

TEST(subdivision, what_is_wrong_is_said_at_its_place) {
  const auto refusal = [](std::string_view rest, std::string_view head = kQuad) {
    return import_world(subdivmesh(rest, head)).error;
  };
  EXPECT_EQ(refusal("", ""), "scene.pbrt:2:1: subdivmesh without \"point3 P\" and \"integer indices\", or a file that has them");
  EXPECT_EQ(refusal("", "\"point3 P\" [0 0 0 1] \"integer indices\" [0]"),
            "scene.pbrt:2:20: \"P\" takes 3 numbers an item, not 4 in all");
  EXPECT_EQ(refusal("", "\"point3 P\" [0 0 0] \"integer indices\" [0 0 0]"),
            "scene.pbrt:2:1: subdivmesh without \"integer nvertices\" has faces of four corners, but 3 indices");
  EXPECT_EQ(refusal("", "\"point3 P\" [0 0 0] \"integer indices\" [-1 0 0 0]"),
            "scene.pbrt:2:39: \"indices\" has -1; none may be below zero");
  EXPECT_EQ(refusal("\"integer creaseindices\" [0 1 2]"),
            "scene.pbrt:2:1: \"creaselengths\" add up to 2, but there are 3 \"creaseindices\"");
  EXPECT_EQ(refusal("\"integer creaseindices\" [0] \"integer creaselengths\" [1] \"float creasesharpness\" [1]"),
            "scene.pbrt:2:1: \"creaselengths\" has 1; a crease joins two vertices at least");
  EXPECT_EQ(refusal("\"integer creaseindices\" [0 1]"),
            "scene.pbrt:2:1: subdivmesh has no \"float creasesharpness\" for 1 sharp edges or corners");
  EXPECT_TRUE(starts_with(refusal("\"integer cornerindices\" [0 1] \"float cornersharpness\" [1]"), "scene.pbrt:2:"));
  EXPECT_TRUE(starts_with(refusal("\"string interpolateboundary\" \"sharp\""), "scene.pbrt:2:85: \"interpolateboundary\" is \"sharp\"; it may be \"none\""))
      << refusal("\"string interpolateboundary\" \"sharp\"");
  EXPECT_TRUE(starts_with(refusal("\"string scheme\" \"loop\""), "scene.pbrt:2:1: subdivmesh with scheme \"loop\""));
  EXPECT_TRUE(starts_with(refusal("\"float sharpness\" 1"), "scene.pbrt:2:"));  // not a parameter of it
}

}  // namespace
}  // namespace spillway::tools
