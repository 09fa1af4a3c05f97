// What each scene of the suite makes the renderer run, and what it leaves out, as the report counts it.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "tests/support/small_scene.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kTwins = SPILLWAY_SOURCE_DIR "/tests/twins/";

// kind.name of what is in one of the two lists.
std::set<std::string> names(const json& list) {
  std::set<std::string> found;
  for (const auto& [kind, parts] : list.items())
    for (const auto& [name, value] : parts.items())
      found.insert(kind + "." + (parts.is_array() ? value.get<std::string>() : name));
  return found;
}

std::set<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

// What every picture of triangles under some light needs. Sweeps: all is read when it is first asked for.
const std::string kAlways =
    "stages.generate_rays stages.sort_rays stages.trace_rays stages.sweep_pages stages.route_hits stages.shade_hits "
    "stages.sweep_attributes caches.pages caches.attributes columns.beauty columns.shadow_rays tables.meshes "
    "tables.materials ";
const std::string kLamp = " tables.emitters tables.emissions";  // a mesh that emits
const std::string kLight = " tables.lights";                    // any other light
const std::string kImage = " caches.image_tiles tables.images tables.textures";
const std::string kGas = " stages.track_media tables.media";
const std::string kGrid = " caches.bricks tables.bricks";  // of a medium that differs from place to place

constexpr const char* kView =
    "LookAt 2 2 5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 40\nFilm \"rgb\" \"integer xresolution\" 24 "
    "\"integer yresolution\" 16\nWorldBegin\nLightSource \"infinite\" \"rgb L\" [1 1 1]\n";

class UsedParts : public testing::Test {
 protected:
  json report_of(const std::string& scene, const std::string& more = "") const {
    const std::string report = directory_.path() / "r.json";
    const std::string command =
        fmt::format(SPILLWAY_PROGRAM " render {} --store {} -o {} --spp 1 -q --report {} {}", scene,
                    (directory_.path() / "a.store").string(), (directory_.path() / "a.exr").string(), report, more);
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    std::ifstream file(report);
    return json::parse(file);
  }
  // The scene runs what all do and what `besides` says, and leaves out all else.
  void expect(const std::string& scene, const std::string& besides, const std::string& more = "") const {
    const json report = report_of(scene, more);
    EXPECT_EQ(names(report["ran"]), words(kAlways + besides)) << scene << more;
    std::set<std::string> all = names(report["ran"]);
    const std::set<std::string> left_out = names(report["left_out"]);
    all.insert(left_out.begin(), left_out.end());
    EXPECT_EQ(all.size(), names(report["ran"]).size() + left_out.size()) << "in both lists";
    EXPECT_EQ(all, words(kAll)) << scene;
  }

  static const std::string kAll;
  test::TemporaryDirectory directory_;
};

const std::string UsedParts::kAll =
    kAlways +
    "stages.track_media stages.let_through caches.image_tiles caches.face_tiles caches.bricks "
    "columns.depth columns.normal columns.albedo columns.ids columns.costs columns.spilled columns.access_log "
    "tables.lights "
    "tables.instances tables.textures tables.images tables.face_textures tables.light_tree tables.emitters "
    "tables.emissions "
    "tables.environment tables.portals tables.motions tables.media tables.bricks";

TEST_F(UsedParts, of_the_twins) {
  const std::map<std::string, std::string> besides = {{"box", kLamp},
                                                      {"bulb", kLamp + " tables.light_tree"},
                                                      {"bulb_point", kLight},
                                                      {"glass", kLamp + kLight},
                                                      {"globe", kLamp + kLight + kImage},
                                                      {"instances", kLamp + kLight + " tables.instances"},
                                                      {"lamps", kLamp + " tables.instances tables.light_tree"},
                                                      {"lens", kLamp + kLight},
                                                      {"mirror", kLamp},
                                                      {"motion", kLamp + kLight + " tables.instances tables.motions"},
                                                      {"orthographic", kLamp + kLight},
                                                      {"plastic", kLamp + kLight},
                                                      {"quadrics", kLamp + kLight + " tables.light_tree"},
                                                      {"sky", kLight},
                                                      {"spot", kLight},
                                                      {"sun", kLight},
                                                      {"texture", kLamp + kLight + kImage},
                                                      {"thin_glass", kLamp + kLight},
                                                      {"many_lamps", kLamp + " tables.instances tables.light_tree"},
                                                      {"fog", kLamp + kGas + " stages.let_through tables.light_tree"},
                                                      {"smoke", kLamp + kGas + kGrid + " stages.let_through"},
                                                      {"cloud_in_glass", kLight + kGas + kGrid},
                                                      {"colors", kLamp + kGas + kGrid + " stages.let_through"},
                                                      {"nested", kLamp + kGas + " stages.let_through"},
                                                      {"patches", kLight + " tables.images tables.environment"},
                                                      {"projector", kLight + " tables.images"},
                                                      {"screen", kLamp + kImage}};
  std::set<std::string> twins, listed;
  for (const auto& entry : fs::directory_iterator(kTwins))
    if (entry.path().extension() == ".pbrt") twins.insert(entry.path().stem());
  for (const auto& [name, what] : besides) {
    listed.insert(name);
    expect(kTwins + name + ".pbrt", what);
  }
  EXPECT_EQ(twins, listed);
}

TEST_F(UsedParts, of_the_courtyard) {
  expect(SPILLWAY_SOURCE_DIR "/tests/data/courtyard/courtyard.pbrt --resolution 48x32",
         kLamp + kLight + kImage + " tables.instances tables.light_tree stages.let_through");
}

TEST_F(UsedParts, of_gas_and_of_face_textures) {
  std::ofstream(directory_.path() / "gas.pbrt")
      << kView << "MakeNamedMedium \"gas\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [0 0 0] \"rgb sigma_s\" "
      << "[2 2 2]\nMediumInterface \"gas\" \"\" Material \"interface\" Shape \"sphere\"\n";
  expect(directory_.path() / "gas.pbrt", kLight + " stages.track_media stages.let_through tables.media");
  const std::string cube = SPILLWAY_SOURCE_DIR "/tests/data/ptex/cube";
  std::ofstream(directory_.path() / "face.pbrt")
      << kView << "Texture \"paint\" \"spectrum\" \"ptex\" \"string filename\" \"" << cube
      << ".ptx\"\nMaterial \"diffuse\" \"texture reflectance\" \"paint\"\nShape \"plymesh\" \"string filename\" \""
      << cube << ".ply\"\n";
  expect(directory_.path() / "face.pbrt", kLight + " caches.face_tiles tables.face_textures tables.textures");
}

// Options bring their columns, and nothing else.
TEST_F(UsedParts, of_what_was_asked_for) {
  expect(kTwins + "spot.pbrt", kLight + " columns.depth columns.normal columns.albedo columns.ids", "--aov");
  expect(kTwins + "spot.pbrt", kLight + " columns.costs", "--cost-layers");
  expect(kTwins + "spot.pbrt", kLight + " columns.access_log",
         "--access-log " + (directory_.path() / "a.access").string());
  expect(kTwins + "spot.pbrt", kLight + " columns.spilled", "--spill always --wave-paths 999");
}

}  // namespace
}  // namespace spillway::tools
