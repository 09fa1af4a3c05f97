// Shapes that are diced: triangles keep to the surface they stand for, and face the way it does.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>

#include "tests/tools/import_text.h"
#include "tools/import/bilinear_mesh.h"
#include "tools/import/quadrics.h"

namespace spillway::tools {
namespace {

RecordedMesh mesh_of(const std::string& shape) {
  Imported imported = import_world("Shape " + shape);
  EXPECT_EQ(imported.error, "");
  if (imported.sink.meshes.size() != 1) return {};
  return imported.sink.meshes[0];
}

// Calls body(triangle's corners, their indices).
template <class Body>
void for_each_triangle(const RecordedMesh& mesh, const Body& body) {
  for (size_t t = 0; t + 2 < mesh.indices.size(); t += 3)
    body(mesh.positions[mesh.indices[t]], mesh.positions[mesh.indices[t + 1]], mesh.positions[mesh.indices[t + 2]], t);
}

double area(const RecordedMesh& mesh) {
  double sum = 0;
  for_each_triangle(mesh, [&](Float3 a, Float3 b, Float3 c, size_t) { sum += length(cross(b - a, c - a)) / 2; });
  return sum;
}

// Every triangle's winding agrees with the normals of its corners.
void expect_consistent(const RecordedMesh& mesh) {
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  for_each_triangle(mesh, [&](Float3 a, Float3 b, Float3 c, size_t t) {
    for (size_t k = 0; k < 3; ++k) ASSERT_GT(dot(cross(b - a, c - a), mesh.normals[mesh.indices[t + k]]), 0) << t;
  });
}

TEST(shapes, a_sphere_keeps_to_its_chord_error_and_closes) {
  const RecordedMesh mesh = mesh_of("\"sphere\" \"float radius\" 2");
  expect_consistent(mesh);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    ASSERT_NEAR(length(mesh.positions[i]), 2, 1e-6);
    ASSERT_NEAR(dot(mesh.positions[i], mesh.normals[i]), 2, 1e-6);
  }
  for_each_triangle(mesh, [&](Float3 a, Float3 b, Float3 c, size_t) {
    for (const Float3 middle : {(a + b) * 0.5f, (b + c) * 0.5f, (c + a) * 0.5f})
      ASSERT_GT(length(middle), 2 * (1 - 2.01 * kChordError));  // a diagonal spans two steps at right angles
  });
  EXPECT_NEAR(area(mesh), 16 * M_PI, 16 * M_PI * 2 * kChordError);
  // Closed: each edge is met once in each direction, by position.
  std::map<std::array<float, 6>, int> edges;
  for_each_triangle(mesh, [&](Float3 a, Float3 b, Float3 c, size_t) {
    for (const auto& [p, q] : {std::pair{a, b}, {b, c}, {c, a}}) {
      ++edges[{p.x, p.y, p.z, q.x, q.y, q.z}];
      --edges[{q.x, q.y, q.z, p.x, p.y, p.z}];
    }
  });
  for (const auto& [edge, count] : edges) ASSERT_EQ(count, 0);
}

TEST(shapes, a_part_of_a_sphere_has_pbrts_u_and_v) {
  const RecordedMesh mesh = mesh_of("\"sphere\" \"float zmin\" -0.5 \"float zmax\" 0.25 \"float phimax\" 90");
  expect_consistent(mesh);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const Float3 p = mesh.positions[i];
    const double theta_low = std::acos(-0.5), theta = theta_low + mesh.uvs[i].y * (std::acos(0.25) - theta_low);
    ASSERT_NEAR(p.z, std::cos(theta), 1e-6);
    ASSERT_NEAR(std::atan2(p.y, p.x), mesh.uvs[i].x * M_PI / 2, 1e-6);
    ASSERT_GE(p.z, -0.5 - 1e-6);
    ASSERT_LE(p.z, 0.25 + 1e-6);
  }
}

TEST(shapes, cylinders_and_disks_are_where_they_should_be) {
  const RecordedMesh cylinder = mesh_of("\"cylinder\" \"float radius\" 3 \"float zmin\" 1 \"float zmax\" 2");
  expect_consistent(cylinder);
  EXPECT_NEAR(area(cylinder), 6 * M_PI, 6 * M_PI * kChordError);
  for (size_t i = 0; i < cylinder.positions.size(); ++i) {
    ASSERT_NEAR(std::hypot(cylinder.positions[i].x, cylinder.positions[i].y), 3, 1e-6);
    ASSERT_EQ(cylinder.positions[i].z, 1 + cylinder.uvs[i].y);
    ASSERT_EQ(cylinder.normals[i].z, 0);
  }
  const RecordedMesh disk = mesh_of("\"disk\" \"float radius\" 3 \"float innerradius\" 1 \"float height\" 5");
  expect_consistent(disk);
  EXPECT_NEAR(area(disk), 8 * M_PI, 8 * M_PI * 4 * kChordError);
  for (size_t i = 0; i < disk.positions.size(); ++i) {
    ASSERT_EQ(disk.positions[i].z, 5);
    ASSERT_NEAR(std::hypot(disk.positions[i].x, disk.positions[i].y), 3 - 2 * disk.uvs[i].y, 1e-6);
  }
}

TEST(shapes, mirrored_spheres_keep_their_outside_and_reversed_ones_lose_it) {
  const auto side_of = [](const std::string& before) {
    const Imported imported = import_world(before + " Shape \"sphere\"");
    const RecordedMesh& mesh = imported.sink.meshes.at(0);
    const Float3 a = mesh.positions[mesh.indices[0]], b = mesh.positions[mesh.indices[1]],
                 c = mesh.positions[mesh.indices[2]];
    const float winding = dot(cross(b - a, c - a), a) * (mesh.input.flip_normals ? -1.0f : 1.0f);
    EXPECT_GT(winding * dot(mesh.normals[mesh.indices[0]], a), 0);
    return winding > 0;
  };
  EXPECT_TRUE(side_of(""));
  EXPECT_TRUE(side_of("Scale -1 1 2"));
  EXPECT_FALSE(side_of("ReverseOrientation"));
  EXPECT_FALSE(side_of("ReverseOrientation Scale -1 1 2"));
}

TEST(shapes, a_sphere_of_a_given_power_has_it_as_a_whole) {
  const Imported imported = import_world(
      "AreaLightSource \"diffuse\" \"rgb L\" [1 0.5 0.25] \"float power\" 100 Shape \"sphere\" \"float radius\" 3");
  ASSERT_EQ(imported.sink.meshes.size(), 1u);
  const RecordedMesh& mesh = imported.sink.meshes[0];
  EXPECT_NEAR(mesh.input.emission.r * M_PI * area(mesh), 100, 1e-3);
  EXPECT_FLOAT_EQ(mesh.input.emission.b, mesh.input.emission.r / 4);
}

TEST(shapes, quadrics_that_are_none_are_refused) {
  for (const char* shape :
       {"\"sphere\" \"float radius\" 0", "\"sphere\" \"float zmin\" 2 \"float zmax\" 3",
        "\"sphere\" \"float phimax\" 0", "\"cylinder\" \"float zmin\" 1", "\"disk\" \"float radius\" -1",
        "\"disk\" \"float innerradius\" 1", "\"sphere\" \"float radius\" [1 2]"}) {
    const Imported imported = import_world(std::string("Shape ") + shape);
    EXPECT_TRUE(starts_with(imported.error, "scene.pbrt:2:")) << shape << ": " << imported.error;
  }
}

TEST(shapes, a_parallelogram_is_two_triangles_and_a_twisted_patch_keeps_to_its_error) {
  const RecordedMesh flat = mesh_of("\"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]");
  EXPECT_EQ(flat.indices.size(), 6u);
  EXPECT_FALSE(flat.input.flip_normals);
  EXPECT_GT(cross(flat.positions[1] - flat.positions[0], flat.positions[3] - flat.positions[0]).z, 0);
  const RecordedMesh twisted = mesh_of("\"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]");
  EXPECT_GT(twisted.indices.size(), 600u);
  for_each_triangle(twisted, [&](Float3 a, Float3 b, Float3 c, size_t t) {
    const auto uv = [&](size_t k) { return twisted.uvs[twisted.indices[t + k]]; };
    const Float3 middle = (a + b + c) * (1 / 3.0f);
    const Float2 at = (uv(0) + uv(1) + uv(2)) * (1 / 3.0f);
    ASSERT_NEAR(middle.z, at.x * at.y, std::sqrt(3.0) * kPatchError);
    ASSERT_NEAR(middle.x, at.x, 1e-6);
  });
  EXPECT_TRUE(
      starts_with(import_world("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]").error, "scene.pbrt:2:1"));
}

constexpr const char* kOctahedron =
    "\"loopsubdiv\" \"point3 P\" [1 0 0 -1 0 0 0 1 0 0 -1 0 0 0 1 0 0 -1] \"integer indices\" "
    "[0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5] ";

TEST(shapes, a_subdivided_octahedron_is_round_and_faces_outwards) {
  const RecordedMesh mesh = mesh_of(std::string(kOctahedron) + "\"integer levels\" 4");
  EXPECT_EQ(mesh.indices.size(), 3u * 8 * 256);
  expect_consistent(mesh);
  float least = 10, most = 0;
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    least = std::min(least, length(mesh.positions[i])), most = std::max(most, length(mesh.positions[i]));
    ASSERT_GT(dot(normalize(mesh.positions[i]), mesh.normals[i]), 0.95f);
    ASSERT_NEAR(length(mesh.normals[i]), 1, 1e-5);
  }
  EXPECT_GT(least, 0.5f * most);
  EXPECT_LT(most, 1);
}

// Vertices go to their limits: refining further moves none of them.
TEST(shapes, vertices_of_a_subdivision_lie_on_the_limit_surface) {
  const RecordedMesh coarse = mesh_of(std::string(kOctahedron) + "\"integer levels\" 1");
  const RecordedMesh fine = mesh_of(std::string(kOctahedron) + "\"integer levels\" 3");
  for (const Float3& p : coarse.positions) {
    float nearest = 1;
    for (const Float3& q : fine.positions) nearest = std::min(nearest, length(p - q));
    EXPECT_LT(nearest, 1e-6f);
  }
}

TEST(shapes, patches_take_no_more_memory_than_is_given) {
  ImportOptions options;
  const auto path = write_file("scene.pbrt",
                               "WorldBegin\nShape \"bilinearmesh\" \"point3 P\" [0 0 0 0 1 0 0 1 0 1e-20 0 0] "
                               "\"integer indices\" [0 1 2 3 0 1 2 3]");
  for (const uint64_t most_bytes : {100000, 300000, 400000}) {  // two patches of 182804 bytes
    RecordingSink sink;
    ImportReport report;
    options.most_diced_bytes = most_bytes;
    const Status status = import_pbrt(path, sink, options, report);
    EXPECT_EQ(static_cast<bool>(status), most_bytes == 400000);
    const std::string want = ":2:1: this bilinearmesh takes more than " + std::to_string(most_bytes);
    if (!status) {
      EXPECT_NE(status.error().message.find(want), std::string::npos) << status.error().message;
    }
  }
}

TEST(shapes, subdivisions_that_cannot_be_are_refused) {
  for (const char* more : {"\"integer levels\" -1", "\"integer levels\" 13"})
    EXPECT_TRUE(starts_with(import_world("Shape " + std::string(kOctahedron) + more).error, "scene.pbrt:2:")) << more;
  // Of 280 bytes a triangle in a gigabyte.
  const std::string many = import_world("Shape " + std::string(kOctahedron) + "\"integer levels\" 11").error;
  EXPECT_NE(many.find("at most 3834792 triangles"), std::string::npos) << many;
  // Three triangles at one edge.
  const Imported imported = import_world(
      "Shape \"loopsubdiv\" \"point3 P\" [0 0 0 1 0 0 0 1 0 0 -1 0 0 0 1] \"integer indices\" [0 1 2 0 1 3 0 1 4]");
  EXPECT_TRUE(imported.error.empty() || starts_with(imported.error, "scene.pbrt:2:")) << imported.error;
}

}  // namespace
}  // namespace spillway::tools
