// Places, sizes and meshes at which intersections and self-intersections go wrong. docs/failures.md has the table.
//
// Most of these are furnaces: a closed room whose walls emit one and return one half is two wherever one looks, and
// less for every path that leaks into the dark outside.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/closed_forms.h"
#include "tests/support/random.h"

namespace spillway::test {
namespace {

const std::string kGlowing = diffuse(0.5) + "AreaLightSource \"diffuse\" \"rgb L\" [1 1 1] \"bool twosided\" true\n";

std::string triangles(const std::vector<Vec>& points, const std::vector<int>& indices) {
  std::string text = "Shape \"trianglemesh\" \"point3 P\" [";
  for (const Vec& p : points) text += fmt::format("{:.9g} {:.9g} {:.9g} ", p.x, p.y, p.z);
  text += "] \"integer indices\" [";
  for (const int i : indices) text += fmt::format("{} ", i);
  return text + "]\n";
}

// A room around `centre`, turned or not; coordinates are rounded to what floats hold there.
std::string glowing_room(Vec centre, double half, const std::string& turn) {
  return fmt::format("AttributeBegin {} Translate {:.17g} {:.17g} {:.17g} {}", kGlowing, centre.x, centre.y, centre.z,
                     turn) +
         room({-half, -half, -half}, {half, half, half}) + "AttributeEnd\n";
}

// Hard: a million away from the origin neighbouring numbers lie a sixteenth apart, a thousandth of this room.
TEST(Failures, a_furnace_a_million_away) {
  const Vec centre{1e6 - 64, -1e6 + 128, 1e6 - 256};
  for (const char* turn : {"", "Rotate 33 1 2 3 "}) {
    const FailureScene scene(view_from(centre, {centre.x + 1, centre.y + 2, centre.z - 3}, {0, 0, 1}, 90, 60) +
                             glowing_room(centre, 32, turn));
    scene.expect_same_bits();
    expect_unbiased(scene, 2, {.seeds = 12, .samples = 32});
  }
}

// Hard: lengths of 10^-4, where steps meant for a room leave it. Something far makes the scene large all the same.
TEST(Failures, a_furnace_of_a_ten_thousandth) {
  for (const char* far : {"", "AttributeBegin Translate 1000 0 0 Shape \"sphere\" AttributeEnd\n"}) {
    const FailureScene scene(view_from({1e-5, 2e-5, 0}, {1e-5, 2e-5, -1}, {0, 1, 0}, 90, 60) +
                             glowing_room({1e-5, 0, 3e-5}, 1e-4, "Rotate 33 1 2 3 ") + diffuse(0.5) + far);
    scene.expect_same_bits();
    expect_unbiased(scene, 2, {.seeds = 12, .samples = 32});
  }
}

// A lamp of 2 x 2 at height one over a floor: the mean over a small square below its middle.
double below_a_lamp(double half_width) {
  return 0.5 / M_PI * 4 * mean_over_square(half_width, 1, [](double x, double y) {
           return mean_over_square(1, 4, [&](double u, double v) {
             const double squared = (u - x) * (u - x) + (v - y) * (v - y) + 1;
             return 1 / (squared * squared);
           });
         });
}

// Floor, lamp and, where asked for, a sheet close below the lamp; all times `size`, at a place.
std::string lamp_over_floor(Vec at, double size, bool shaded) {
  const auto there = [&](Vec v) { return at + v * size; };
  const auto flat = [&](double half, double z, bool down) {
    const Vec x{2 * half * size, 0, 0}, y{0, 2 * half * size, 0};
    return sheet(there({-half, -half, z}), down ? y : x, down ? x : y);
  };
  return view_along(there({0, 0, 0.5}), there({0, 0, 0}), {0, 1, 0}, 0.125 * size, 1) + diffuse(0.5) +
         flat(2, 0, false) + emitter(1, flat(1, 1, true)) + (shaded ? diffuse(0) + flat(1.5, 0.875, false) : "");
}

// Hard: the distance to the lamp is known to a sixteenth only. Light must arrive, and no light past what is in its way.
TEST(Failures, a_lamp_a_million_away_and_what_shades_it) {
  for (const double size : {32.0, 256.0}) {
    const Vec at{1e6 - 1024, 5e5, -1e6 + 2048};
    const FailureScene lit(lamp_over_floor(at, size, false));
    lit.expect_same_bits();
    // Rays leave the floor by half a unit, what eight roundings are there, and so see the lamp a little larger.
    expect_unbiased(lit, below_a_lamp(0.125), {.seeds = 12, .rounding = 0.5 / size});
    const FailureScene shaded(lamp_over_floor(at, size, true));
    shaded.expect_same_bits();
    EXPECT_EQ(shaded.render(1, 256).mean, 0) << size;
  }
}

TEST(Failures, a_lamp_of_a_ten_thousandth_and_what_shades_it) {
  for (const char* far : {"", "AttributeBegin Translate 1000 0 0 Shape \"sphere\" AttributeEnd\n"}) {
    const FailureScene lit(lamp_over_floor({0, 0, 0}, 1e-4, false) + far);
    lit.expect_same_bits();
    expect_unbiased(lit, below_a_lamp(0.125), {.seeds = 12});
    const FailureScene shaded(lamp_over_floor({0, 0, 0}, 1e-4, true) + far);
    shaded.expect_same_bits();
    EXPECT_EQ(shaded.render(1, 256).mean, 0);
  }
}

// Hard: the nearest of two equal distances. The first that the scene names wins, and it is not in its own shadow.
TEST(Failures, of_coincident_faces_the_first_is_seen) {
  const std::string bright = diffuse(0.8) + sheet({-9, -9, 0}, {18, 0, 0}, {0, 18, 0});
  const std::string dark = diffuse(0.2) + sheet({-9, -9, 0}, {0, 18, 0}, {18, 0, 0});
  const std::string view = view_down(1, 0.5, 1) + sky(1);
  for (const bool bright_first : {true, false}) {
    const FailureScene scene(view + (bright_first ? bright + dark : dark + bright));
    scene.expect_same_bits();
    expect_unbiased(scene, bright_first ? 0.8 : 0.2);
  }
}

// Walls that run through each other, and through the room.
TEST(Failures, a_furnace_of_overlapping_walls) {
  const FailureScene scene(view_from({0, 0, 0}, {1, 2, 3}, {0, 0, 1}, 90, 60) + glowing_room({0, 0, 0}, 1, "") +
                           glowing_room({0.3, 0.2, 0.1}, 0.9, "Rotate 33 1 2 3 ") + kGlowing +
                           sheet({-1.5, -0.5, -0.99}, {2, 0, 0}, {0, 2, 0}) +
                           sheet({0.98, -0.7, -1.5}, {0, 1.1, 0}, {0, 0, 2.2}));
  scene.expect_same_bits();
  expect_unbiased(scene, 2, {.seeds = 12});
}

// What cannot be right is finite and has the same bits all the same. Of two lamps in one place each is lit towards, and
// chance finds the first alone; one that lies in a wall shines through it.
TEST(Failures, coincident_lamps_are_lit_towards_one_by_one) {
  const std::string floor = diffuse(0.5) + sheet({-9, -9, 0}, {18, 0, 0}, {0, 18, 0});
  const std::string shape = sheet({-1, -1, 1}, {0, 2, 0}, {2, 0, 0}), lamp = emitter(1, shape);
  const FailureScene one(view_down(0.5, 0.1, 1) + floor + lamp), two(view_down(0.5, 0.1, 1) + floor + lamp + lamp);
  const FailureScene hidden(view_down(0.5, 0.1, 1) + floor + shape + lamp);
  two.expect_same_bits();
  hidden.expect_same_bits();
  const double bright = one.render(1, 64).mean;
  EXPECT_GT(two.render(1, 64).mean, 1.02 * bright);
  EXPECT_GT(hidden.render(1, 64).mean, 0.1 * bright);
}

// Two blocks of glass with a face each in one place: of both one is met, the first that the scene names, and the other
// is passed over. Here a path enters twice and leaves once, so that its radiance is divided by the square of the index
// twice.
TEST(Failures, touching_blocks_of_glass_take_each_other_for_air) {
  const std::string glass = sky(1) + "Material \"dielectric\" \"float eta\" 1.5 ReverseOrientation\n";
  const FailureScene touching(view_down(3, 0.1, 60) + glass + room({-1, -1, -1}, {1, 1, 0}) +
                              room({-1, -1, 0}, {1, 1, 1}));
  touching.expect_same_bits();
  EXPECT_LT(touching.render(1, 64).mean, 0.8);
  const FailureScene apart(view_down(3, 0.1, 60) + glass + room({-1, -1, -1}, {1, 1, -0.01}) +
                           room({-1, -1, 0}, {1, 1, 1}));
  apart.expect_same_bits();
  expect_unbiased(apart, 1, {.seeds = 12});
}

// One wall of the room z = -1, cut into a tall half and strips that meet it between its corners; then slivers and
// triangles of no area. Each page holds sixteen triangles, so that the joints lie between pages too.
std::string patched_floor(test::Random& random) {
  std::string text;
  std::vector<Vec> points{{-1, -1, -1}, {0, -1, -1}, {0, 1, -1}, {-1, 1, -1}};
  text += triangles(points, {0, 1, 2, 0, 2, 3});
  double y = -1;
  for (int i = 0; i < 40 && y < 1; ++i) {  // of heights from 10^-6 to 10^-1
    const double next = i == 39 ? 1 : std::min(1.0, y + std::pow(10.0, random.in(-6, -1)));
    text += triangles({{0, y, -1}, {1, y, -1}, {1, next, -1}, {0, next, -1}}, {0, 1, 2, 0, 2, 3});
    y = static_cast<double>(static_cast<float>(next));
  }
  if (y < 1) text += triangles({{0, y, -1}, {1, y, -1}, {1, 1, -1}, {0, 1, -1}}, {0, 1, 2, 0, 2, 3});
  for (int i = 0; i < 30; ++i) {  // lines and points
    const double x = random.in(-1, 1), z = random.in(-1, 1);
    text += triangles({{x, z, -1}, {x, z, -1}, {0, 0, -1}}, {0, 1, 2, 0, 0, 0});
  }
  return text;
}

TEST(Failures, a_furnace_of_slivers_and_joints_between_pages) {
  test::Random random(5);
  std::string walls = kGlowing;
  for (const char* turn :
       {"", "Rotate 180 1 0 0 ", "Rotate 90 1 0 0 ", "Rotate -90 1 0 0 ", "Rotate 90 0 1 0 ", "Rotate -90 0 1 0 "})
    walls += std::string("AttributeBegin ") + turn + patched_floor(random) + "AttributeEnd\n";
  const FailureScene scene(view_from({0.1, 0.2, 0.3}, {1, 2, 3}, {0, 0, 1}, 90, 60) + walls);
  ASSERT_EQ(scene.error(), "");
  EXPECT_GT(scene.store().pages().size(), 12u);
  scene.expect_same_bits();
  expect_unbiased(scene, 2, {.seeds = 12});
}

// A ball of slivers: a thousand needles around the poles, turned so that no edge is along an axis.
TEST(Failures, a_furnace_of_needles) {
  constexpr int kNeedles = 1500;
  std::vector<Vec> points{{0, 0, 1}, {0, 0, -1}};
  std::vector<int> indices;
  for (int i = 0; i < kNeedles; ++i) {
    const double a = 2 * M_PI * i / kNeedles;
    points.push_back({std::cos(a), std::sin(a), 0.1 * std::sin(7 * a)});
    const int here = 2 + i, next = 2 + (i + 1) % kNeedles;
    for (const int corner : {0, here, next, 1, next, here}) indices.push_back(corner);
  }
  const FailureScene scene(view_from({0.1, 0.2, 0.1}, {0, 0, 3}, {0, 1, 0}, 60, 60) + kGlowing + "Rotate 33 1 2 3 " +
                           triangles(points, indices));
  scene.expect_same_bits();
  expect_unbiased(scene, 2, {.seeds = 12});
}

// Cages whose vertices have three, five and eight edges, with creases that stay sharp, end, and fade: no crack,
// whatever the rates, or light is lost.
TEST(Failures, a_furnace_of_extraordinary_vertices_and_creases) {
  const std::string cube =
      "\"point3 P\" [-1 -1 -1 1 -1 -1 1 1 -1 -1 1 -1 -1 -1 1 1 -1 1 1 1 1 -1 1 1] \"integer indices\" "
      "[0 3 2 1 4 5 6 7 0 1 5 4 2 3 7 6 0 4 7 3 1 2 6 5] ";
  std::string bipyramid = "\"point3 P\" [0 0 1.2 0 0 -1.2 ";
  std::string faces, counts;
  for (int i = 0; i < 8; ++i) {
    bipyramid += fmt::format("{:.9g} {:.9g} {:.9g} ", std::cos(M_PI * i / 4), std::sin(M_PI * i / 4), 0.2 * (i % 2));
    faces += fmt::format("0 {} {} 1 {} {} ", 2 + i, 2 + (i + 1) % 8, 2 + (i + 1) % 8, 2 + i), counts += "3 3 ";
  }
  bipyramid += "] \"integer nvertices\" [" + counts + "] \"integer indices\" [" + faces + "] ";
  const std::string creases =
      "\"integer creaseindices\" [0 1 2 2 6 3 7] \"integer creaselengths\" [3 2 2] \"float "
      "creasesharpness\" [10 2.5 1] \"integer cornerindices\" [5] \"float cornersharpness\" [10] ";
  for (const std::string& cage :
       {cube, cube + creases, bipyramid,
        bipyramid + "\"integer creaseindices\" [0 2 3 4] \"integer creaselengths\" [4] \"float "
                    "creasesharpness\" [10] "}) {
    const std::string shape = kGlowing + "Rotate 33 1 2 3 Shape \"subdivmesh\" " + cage + "\n";
    const FailureScene scene(view_from({0.05, 0.1, 0.02}, {1, 2, 3}, {0, 0, 1}, 90, 60, 16) + shape, {}, 256);
    scene.expect_same_bits();
    // Shading normals are the surface's, not the triangles': light between the two sorts of horizon is lost, the less
    // the finer the dicing.
    expect_unbiased(scene, 2, {.seeds = 8, .samples = 32, .rounding = 5e-3});
    // What the camera sees itself has no such excuse: a quarter of a million rays, and no crack.
    const FailureScene seen(view_from({0.05, 0.1, 0.02}, {1, 2, 3}, {0, 0, 1}, 90, 0, 32) + shape);
    EXPECT_NEAR(seen.render(1, 256).mean, 1, 1e-6);
  }
}

// One triangle, half of the picture.
TEST(Failures, a_scene_with_one_triangle) {
  const FailureScene scene(view_down(1, 1, 5) + sky(1) + diffuse(0.5) +
                           triangles({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}}, {0, 1, 2}));
  scene.expect_same_bits();
  expect_unbiased(scene, 0.75);
}

TEST(Failures, a_scene_with_none) {
  const FailureScene dark(view_down(1, 1, 5)), lit(view_down(1, 1, 5) + sky(3));
  dark.expect_same_bits();
  lit.expect_same_bits();
  EXPECT_EQ(dark.render(1, 4).mean, 0);
  EXPECT_NEAR(lit.render(1, 4).mean, 3, 1e-5);
  const FailureScene points_only(view_down(1, 1, 5) + sky(3) + triangles({{0, 0, 0}}, {0, 0, 0}));
  points_only.expect_same_bits();
  EXPECT_NEAR(points_only.render(1, 4).mean, 3, 1e-5);
}

}  // namespace
}  // namespace spillway::test
