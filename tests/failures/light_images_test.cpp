// Lights whose images say what they shine: answers known by integration, the same bits however they are streamed.

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/closed_forms.h"

namespace spillway::test {
namespace {

constexpr double kBig = 20, kAlbedo = 0.5;
const std::string kFloor = diffuse(kAlbedo) + sheet({-kBig, -kBig, 0}, {2 * kBig, 0, 0}, {0, 2 * kBig, 0});

// Grey texels, row by row from the top.
FailureScene::MakeFiles image(int width, int height, std::vector<float> texels) {
  return [=](const std::filesystem::path& folder) {
    std::vector<float> rgb;
    for (const float t : texels) rgb.insert(rgb.end(), {t, t, t});
    const std::string path = (folder / "a.exr").string();
    const auto output = OIIO::ImageOutput::create(path);
    ASSERT_TRUE(output && output->open(path, OIIO::ImageSpec(width, height, 3, OIIO::TypeFloat)));
    ASSERT_TRUE(output->write_image(OIIO::TypeFloat, rgb.data()) && output->close());
  };
}

// Of a square of half `half` on the floor around (x, y).
std::string view_of(double x, double y, double half, int depth = 1) {
  return view_along({x, y, 1}, {x, y, 0}, {0, 1, 0}, half, depth);
}

// A light of one place at `height` above the origin: mean over the square seen of I cos / d^2, times albedo / pi.
double below_a_point(double x0, double y0, double half, double height, double intensity) {
  const double e = mean_over_square(half, 4, [&](double x, double y) {
    const double squared = (x + x0) * (x + x0) + (y + y0) * (y + y0) + height * height;
    return intensity * height / (squared * std::sqrt(squared));
  });
  return kAlbedo / M_PI * e;
}

// 2 x 2 texels: columns by the sign of the light's x, rows by that of its z (pbrt's pole is y). Here y is up.
TEST(LightImages, a_goniometric_light_shines_its_texels_into_their_directions) {
  const std::vector<float> texels{1, 3, 7, 17};
  for (const auto& [x, y, row, column] :
       {std::tuple(-1, -1, 1, 0), std::tuple(1, -1, 1, 1), std::tuple(-1, 1, 0, 0), std::tuple(1, 1, 0, 1)})
    for (const bool is_power : {false, true}) {
      // The light's z along -y of the world.
      const FailureScene scene(view_of(x, y, 0.5) + kFloor +
                                   "AttributeBegin Translate 0 0 2 Rotate 90 1 0 0\n"
                                   "LightSource \"goniometric\" \"string filename\" \"a.exr\" \"float scale\" 3 " +
                                   (is_power ? "\"float power\" 50" : "\"rgb I\" [2 2 2]") + " AttributeEnd\n",
                               image(2, 2, texels));
      const double value = texels[static_cast<size_t>(2 * row + column)], mean = 7;
      const double intensity = 3 * (is_power ? 50 * value / (4 * M_PI * mean) : 2 * value);
      expect_unbiased(scene, below_a_point(x, y, 0.5, 2, intensity), {.seeds = 8, .largest_error = 1e-3});
      if (x == 1 && y == 1) scene.expect_same_bits();
    }
}

// Down from above, so that the image's top is at -y of the world, its left at -x.
TEST(LightImages, a_projection_shines_its_texels_into_their_directions) {
  const std::vector<float> texels{1, 3, 7, 17};
  const double solid_angle = 4 * std::asin(0.25);  // of a square pyramid of 60 degrees
  for (const auto& [x, y, row, column] :
       {std::tuple(-1, -1, 0, 0), std::tuple(1, -1, 0, 1), std::tuple(-1, 1, 1, 0), std::tuple(1, 1, 1, 1)})
    for (const bool is_power : {false, true}) {
      const FailureScene scene(
          view_of(0.5 * x, 0.5 * y, 0.25) + kFloor +
              "AttributeBegin Translate 0 0 2 Rotate 180 1 0 0\n"
              "LightSource \"projection\" \"string filename\" \"a.exr\" \"float fov\" 60 \"float scale\" 3" +
              (is_power ? " \"float power\" 50" : "") + " AttributeEnd\n",
          image(2, 2, texels));
      const double value = texels[static_cast<size_t>(2 * row + column)], mean = 7;
      const double intensity = 3 * (is_power ? 50 * value / (solid_angle * mean) : value);
      expect_unbiased(scene, below_a_point(0.5 * x, 0.5 * y, 0.25, 2, intensity), {.seeds = 8, .largest_error = 1e-3});
      if (x == 1 && y == 1) scene.expect_same_bits();
    }
  const FailureScene beside(
      view_of(1.5, 0, 0.25) + kFloor +
          "AttributeBegin Translate 0 0 2 Rotate 180 1 0 0\n"
          "LightSource \"projection\" \"string filename\" \"a.exr\" \"float fov\" 60 AttributeEnd\n",
      image(2, 2, texels));
  EXPECT_EQ(beside.render(1, 16).mean, 0);
}

// ---- emission by an image ----

// 4 x 4 texels, no symmetry in them.
const std::vector<float> kPicture{1, 0, 0, 0, 2, 0, 5, 0, 4, 0, 0, 9, 8, 3, 0, 0};
constexpr double kPictureMean = 2;  // of all texels

// Between texels' middles bilinear, clamped; rows from the top, v up.
double picture(double u, double v) {
  const auto at = [](int x, int y) {
    return static_cast<double>(kPicture[static_cast<size_t>(4 * std::clamp(y, 0, 3) + std::clamp(x, 0, 3))]);
  };
  const double x = 4 * u - 0.5, y = 4 * (1 - v) - 0.5, fx = x - std::floor(x), fy = y - std::floor(y);
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  return (1 - fy) * ((1 - fx) * at(i, j) + fx * at(i + 1, j)) + fy * ((1 - fx) * at(i, j + 1) + fx * at(i + 1, j + 1));
}

constexpr double kHeight = 0.7, kX = 0.3, kY = 0.2;  // the lamp is [kX, kX + 1] x [kY, kY + 1] at kHeight

// Irradiance below it, of what emitted(u, v) says.
double below_the_lamp(double x, double y, const std::function<double(double, double)>& emitted) {
  return integral(0, 1, 16, [&](double u) {
    return integral(0, 1, 16, [&](double v) {
      const double dx = kX + u - x, dy = kY + v - y, squared = dx * dx + dy * dy + kHeight * kHeight;
      return emitted(u, v) * kHeight * kHeight / (squared * squared);
    });
  });
}
double answer_below(const std::function<double(double, double)>& emitted) {
  return kAlbedo / M_PI * mean_over_square(0.1, 1, [&](double x, double y) { return below_the_lamp(x, y, emitted); });
}

// The lamp, downwards: by its winding, or by its orientation; corner and edges as said. A cage of one face stays that
// square, whose uvs stay even over it, whatever it is diced into.
std::string lamp(const std::string& light, Vec corner, Vec edge, bool reversed, const std::string& more = "",
                 bool is_cage = false) {
  const std::string points = fmt::format("[{0} {1} {2}  {3} {1} {2}  {3} {4} {2}  {0} {4} {2}]", corner.x, corner.y,
                                         corner.z, corner.x + edge.x, corner.y + edge.y);
  const std::string shape = std::string("Shape \"") + (is_cage ? "subdivmesh" : "trianglemesh") + "\"";
  const std::string light_on =
      "Material \"diffuse\" \"rgb reflectance\" [0 0 0] AreaLightSource \"diffuse\" " + light +
      (reversed ? " ReverseOrientation\n" : "\n") + shape + " \"point3 P\" " + points +
      " \"point2 uv\" [0 0 1 0 1 1 0 1] ";
  const bool is_upward = (edge.x > 0) == reversed;
  if (is_cage) {
    const std::string corners = is_upward ? "[0 1 2 3]" : "[0 3 2 1]";
    return light_on + "\"integer indices\" " + corners + " \"integer uvindices\" " + corners + more + "\n";
  }
  return light_on + "\"integer indices\" " + (is_upward ? "[0 1 2 0 2 3]" : "[0 2 1 0 3 2]") + more + "\n";
}
const std::string kEmits = "\"string filename\" \"a.exr\" \"float scale\" 2";

std::string placed(int kind, const std::string& light, const std::string& more = "") {
  const Vec here{kX, kY, kHeight}, edge{1, 1, 0};
  switch (kind) {
    case 0:
      return "AttributeBegin " + lamp(light, here, edge, false, more) + "AttributeEnd\n";
    case 1:
      return "AttributeBegin " + lamp(light, here, edge, true, more) + "AttributeEnd\n";
    case 2:  // an instance
      return "ObjectBegin \"lamp\" " + lamp(light, {0, 0, 0}, edge, false, more) +
             "ObjectEnd AttributeBegin Translate " + fmt::format("{} {} {}", kX, kY, kHeight) +
             " ObjectInstance \"lamp\" AttributeEnd\n";
    case 4:
      return "AttributeBegin " + lamp(light, here, edge, false, more, true) + "AttributeEnd\n";
    case 5:  // the same, turned over by its orientation, in a mirrored instance
      return "ObjectBegin \"lamp\" " + lamp(light, {0, 0, 0}, {-1, 1, 0}, true, more, true) +
             "ObjectEnd AttributeBegin Translate " + fmt::format("{} {} {}", kX, kY, kHeight) +
             " Scale -1 1 1 ObjectInstance \"lamp\" AttributeEnd\n";
    default:  // a mirrored one, of a lamp that lies on the other side, wound the other way
      return "ObjectBegin \"lamp\" " + lamp(light, {0, 0, 0}, {-1, 1, 0}, true, more) +
             "ObjectEnd AttributeBegin Translate " + fmt::format("{} {} {}", kX, kY, kHeight) +
             " Scale -1 1 1 ObjectInstance \"lamp\" AttributeEnd\n";
  }
}

const pipeline::Estimator kEstimators[] = {pipeline::Estimator::mis_power, pipeline::Estimator::light,
                                           pipeline::Estimator::bsdf};

// Each strategy alone, and both together.
void expect_by_all(FailureScene& scene, double answer, double largest_error = 0.01, uint32_t samples = 128) {
  ASSERT_EQ(scene.error(), "");
  for (const pipeline::Estimator estimator : kEstimators) {
    scene.use(estimator);
    expect_unbiased(scene, answer, {.seeds = 8, .samples = samples, .largest_error = largest_error});
    scene.expect_same_bits();
  }
}

TEST(LightImages, a_lamp_with_an_image_is_found_alike_by_lights_and_by_chance) {
  const double answer = answer_below([](double u, double v) { return 2 * picture(u, v); });
  for (const int kind : {0, 1, 2, 3}) {
    SCOPED_TRACE(kind);
    FailureScene scene(view_of(0, 0, 0.1) + kFloor + placed(kind, kEmits), image(4, 4, kPicture));
    expect_by_all(scene, answer, 0.02);
  }
}

// Every triangle that a cage is diced into is an emitter, chosen by what the image is on it.
TEST(LightImages, a_cage_with_an_image_is_found_alike_by_lights_and_by_chance) {
  const double answer = answer_below([](double u, double v) { return 2 * picture(u, v); });
  for (const int kind : {4, 5}) {
    SCOPED_TRACE(kind);
    FailureScene scene(view_of(0, 0, 0.1) + kFloor + placed(kind, kEmits), image(4, 4, kPicture));
    ASSERT_EQ(scene.error(), "");
    EXPECT_GT(scene.store().emitters().size(), 2u);
    expect_by_all(scene, answer, 0.02);
  }
  const FailureScene bare(view_of(0, 0, 0.1) + "AreaLightSource \"diffuse\" " + kEmits +
                              "\nShape \"subdivmesh\" \"point3 P\" [0 0 1 1 0 1 1 1 1 0 1 1] "
                              "\"integer indices\" [0 1 2 3]\n",
                          image(4, 4, kPicture));
  EXPECT_NE(bare.error().find("emits by an image, and has no uvs"), std::string::npos) << bare.error();
}

// Power is spread by the mean of all texels, for each triangle by itself, as in pbrt.
TEST(LightImages, the_power_of_a_lamp_with_an_image_is_what_it_emits) {
  const double answer =
      answer_below([](double u, double v) { return 30 / (M_PI * 0.5) * picture(u, v) / kPictureMean; });
  FailureScene scene(view_of(0, 0, 0.1) + kFloor + placed(0, "\"string filename\" \"a.exr\" \"float power\" 30"),
                     image(4, 4, kPicture));
  expect_by_all(scene, answer, 0.02);
}

// Many of them: a tree, whose energies are the image's on each triangle. The others lie below the floor.
TEST(LightImages, a_tree_of_lamps_with_images_finds_the_one_that_counts) {
  std::string others;
  for (int i = 0; i < 12; ++i) others += "AttributeBegin Translate 0 0 -2 " + placed(0, kEmits) + "AttributeEnd\n";
  FailureScene scene(view_of(0, 0, 0.1) + kFloor + placed(0, kEmits) + others, image(4, 4, kPicture));
  ASSERT_EQ(scene.error(), "");
  EXPECT_FALSE(scene.store().light_table().tree.empty());
  expect_by_all(scene, answer_below([](double u, double v) { return 2 * picture(u, v); }), 0.03);
}

// In gas that does nothing but stand in the way: what arrives is weighed once, and looked up at the same place.
TEST(LightImages, a_lamp_with_an_image_shines_through_media_and_interfaces) {
  constexpr double kSigma = 0.8, kThick = 0.2;
  const std::string slab = fmt::format(
                               "MakeNamedMedium \"grey\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [{0} {0} {0}] "
                               "\"rgb sigma_s\" [0 0 0]\n",
                               kSigma) +
                           "AttributeBegin MediumInterface \"grey\" \"\" Material \"interface\"\n" +
                           sheet({-kBig, -kBig, 0.5}, {2 * kBig, 0, 0}, {0, 2 * kBig, 0}) +
                           sheet({-kBig, -kBig, 0.5 - kThick}, {0, 2 * kBig, 0}, {2 * kBig, 0, 0}) + "AttributeEnd\n";
  FailureScene scene(view_of(0, 0, 0.1) + slab + kFloor + placed(0, kEmits), image(4, 4, kPicture));
  // The eye is above the slab, and looks straight down through it.
  const double seen = std::exp(-kSigma * kThick);
  const double e = mean_over_square(0.1, 1, [&](double x, double y) {
    return integral(0, 1, 16, [&](double u) {
      return integral(0, 1, 16, [&](double v) {
        const double dx = kX + u - x, dy = kY + v - y, squared = dx * dx + dy * dy + kHeight * kHeight;
        const double through = std::exp(-kSigma * kThick * std::sqrt(squared) / kHeight);
        return 2 * picture(u, v) * through * kHeight * kHeight / (squared * squared);
      });
    });
  });
  expect_by_all(scene, kAlbedo / M_PI * e * seen, 0.03);
}

// ---- masks ----

// Where it is not opaque a lamp does not shine, whoever asks.
TEST(LightImages, a_lamp_shines_as_far_as_it_is_opaque) {
  FailureScene half(view_of(0, 0, 0.1) + kFloor + placed(0, "\"rgb L\" [2 2 2]", " \"float alpha\" 0.25"));
  expect_by_all(half, answer_below([](double, double) { return 2 * 0.25; }), 0.02, 512);
  FailureScene cut(
      view_of(0, 0, 0.1) + kFloor +
          "Texture \"mask\" \"float\" \"imagemap\" \"string filename\" \"a.exr\" \"string wrap\" \"clamp\"\n" +
          placed(3, "\"rgb L\" [2 2 2]", " \"texture alpha\" \"mask\""),
      image(2, 1, {0, 1}));
  const auto ramp = [](double u) { return std::clamp(2 * u - 0.5, 0.0, 1.0); };
  expect_by_all(cut, answer_below([&](double u, double) { return 2 * ramp(u); }), 0.02, 512);
}

// Shadow rays and paths pass masks and meet the lamp once: two grey masks take a share each, one with an image by where
// it is met. Where a lamp has an image, what its shadow ray is to find waits behind the masks.
TEST(LightImages, a_lamp_behind_alpha_masks_is_met_once) {
  const auto mask = [](double height, const std::string& alpha) {
    return "AttributeBegin " + diffuse(0) +
           fmt::format(
               "Shape \"trianglemesh\" \"point3 P\" [-4 -4 {0}  4 -4 {0}  4 4 {0}  -4 4 {0}] \"point2 uv\" [0 0 1 0 1 "
               "1 0 1] "
               "\"integer indices\" [0 1 2 0 2 3] {1} AttributeEnd\n",
               height, alpha);
  };
  // The eye is below both.
  const std::string view = view_along({0, 0, 0.1}, {0, 0, 0}, {0, 1, 0}, 0.1, 1);
  FailureScene grey(
      view + kFloor + mask(0.3, "\"float alpha\" 0.4") + mask(0.5, "\"float alpha\" 0.25") + placed(0, kEmits),
      image(4, 4, kPicture));
  expect_by_all(grey, answer_below([](double u, double v) { return 2 * picture(u, v) * 0.6 * 0.75; }), 0.03, 512);
  FailureScene cut(
      view + kFloor +
          "Texture \"mask\" \"float\" \"imagemap\" \"string filename\" \"a.exr\" \"string wrap\" \"clamp\"\n" +
          mask(0.35, "\"texture alpha\" \"mask\"") + placed(0, "\"rgb L\" [2 2 2]"),
      image(2, 1, {0, 1}));
  const double e = mean_over_square(0.1, 1, [&](double x, double y) {
    return below_the_lamp(x, y, [&](double u, double) {
      const double met = x + (kX + u - x) * 0.35 / kHeight;  // where the mask is met: there its image rises evenly
      return 2 * (1 - (2 * (met + 4) / 8 - 0.5));
    });
  });
  expect_by_all(cut, kAlbedo / M_PI * e, 0.02, 512);
}

}  // namespace
}  // namespace spillway::test
