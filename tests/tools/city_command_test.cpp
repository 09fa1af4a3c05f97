// `spillway city` as people use it: what it leaves behind, what it refuses.

#include <gtest/gtest.h>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/run_command.h"
#include "tests/support/small_scene.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;

using test::Ended;

class CityCommand : public testing::Test {
 protected:
  Ended spillway(const std::string& arguments) {
    return test::run_command("cd " + folder_.string() + " && " SPILLWAY_PROGRAM " " + arguments);
  }
  void expect_refused(const std::string& arguments, const std::string& part, int code = 3) {
    const Ended ended = spillway("city -o refused " + arguments);
    EXPECT_EQ(ended.code, code) << arguments << ": " << ended.said;
    EXPECT_NE(ended.said.find(part), std::string::npos) << arguments << ": " << ended.said;
    EXPECT_FALSE(fs::exists(folder_ / "refused")) << arguments;
  }
  nlohmann::json manifest(const std::string& city) const {
    std::ifstream file(folder_ / city / "manifest.json");
    return nlohmann::json::parse(file);
  }

  test::TemporaryDirectory directory_;
  const fs::path folder_ = directory_.path();
};

TEST_F(CityCommand, text_and_store_are_rendered_and_counted_alike) {
  const std::string options =
      " --buildings 30 --street-lights 60 --trees 20 --cars 10 --detail 900 --time dusk --camera street --tessellate";
  const Ended text = spillway("city -o text" + options), store = spillway("city -o packed --format store" + options);
  ASSERT_EQ(text.code, 0) << text.said;
  ASSERT_EQ(store.code, 0) << store.said;
  EXPECT_NE(text.said.find("30 buildings"), std::string::npos) << text.said;
  EXPECT_EQ(manifest("text"), manifest("packed"));
  EXPECT_EQ(manifest("text")["street_lights"], 60);
  const Ended info = spillway("info packed/city.store --json");
  EXPECT_EQ(nlohmann::json::parse(info.said)["triangles"], manifest("packed")["triangles"]["unique"]) << info.said;
  const std::string render = " --resolution 48x27 --spp 2 -q";
  EXPECT_EQ(spillway("render packed/city.store -o a.exr" + render).code, 0);
  const Ended second = spillway("render text/city.pbrt -o b.exr" + render);
  EXPECT_EQ(second.code, 0) << second.said;
}

TEST_F(CityCommand, fog_is_a_file_that_text_names_and_stores_take_in) {
  const std::string options = " --buildings 12 --trees 0 --cars 0 --texels-per-metre 0 --fog-cells 48 --fog=fog,cloud -q";
  const Ended text = spillway("city -o text" + options), store = spillway("city -o packed --format store" + options);
  ASSERT_EQ(text.code, 0) << text.said;
  ASSERT_EQ(store.code, 0) << store.said;
  EXPECT_TRUE(fs::exists(folder_ / "text/air.vdb"));
  EXPECT_GT(fs::file_size(folder_ / "packed/city.store/volumes.bricks"), 1u << 20);
  EXPECT_EQ(manifest("packed")["air"]["media"], 1);
  EXPECT_EQ(manifest("packed")["air"], manifest("text")["air"]);
  const std::string render = " --resolution 32x18 --spp 1 -q";
  EXPECT_EQ(spillway("render packed/city.store -o a.exr" + render).code, 0);
  const Ended second = spillway("render text/city.pbrt -o b.exr" + render);
  EXPECT_EQ(second.code, 0) << second.said;
}

TEST_F(CityCommand, a_plan_writes_nothing) {
  const Ended plan = spillway("city --dry-run -q --buildings 200");
  ASSERT_EQ(plan.code, 0) << plan.said;
  EXPECT_EQ(nlohmann::json::parse(plan.said)["buildings"], 200);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(CityCommand, the_predicted_size_is_nearly_the_size) {
  ASSERT_EQ(spillway("city -o big --format store --buildings 400 --time night -q").code, 0);
  uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(folder_ / "big/city.store"))
    if (entry.is_regular_file()) bytes += entry.file_size();
  EXPECT_NEAR(static_cast<double>(bytes), manifest("big")["predicted_store_bytes"].get<double>(),
              0.12 * static_cast<double>(bytes));
}

TEST_F(CityCommand, bytes_make_a_city_of_that_size) {
  const Ended plan = spillway("city --dry-run -q --geometry 300MiB");
  ASSERT_EQ(plan.code, 0) << plan.said;
  const auto json = nlohmann::json::parse(plan.said);
  EXPECT_NEAR(json["predicted_store_bytes"].get<double>(), 300.0 * (1 << 20), 30.0 * (1 << 20));
  const Ended finer = spillway("city --dry-run -q --geometry 150MiB --buildings 1000");
  ASSERT_EQ(finer.code, 0) << finer.said;
  EXPECT_EQ(nlohmann::json::parse(finer.said)["buildings"], 1000);
}

TEST_F(CityCommand, a_flight_has_a_camera_a_frame) {
  const Ended flight = spillway("city -o flight --buildings 5 --camera flight --frames 7-9 -q");
  ASSERT_EQ(flight.code, 0) << flight.said;
  for (const char* file : {"city.pbrt", "city.0007.pbrt", "city.0009.pbrt"})
    EXPECT_TRUE(fs::exists(folder_ / "flight" / file)) << file;
  EXPECT_FALSE(fs::exists(folder_ / "flight/city.0006.pbrt"));
}

TEST_F(CityCommand, what_makes_no_sense_is_refused_before_anything_is_written) {
  expect_refused("--buildings 10 --street-lights 1000000", "at most");
  expect_refused("--buildings 10 --cars 100000", "places");
  expect_refused("--buildings 99999999999", "at most");
  expect_refused("--buildings 500 --detail 900000", "can have");
  expect_refused("--buildings 20 --geometry 40GiB", "can have");
  expect_refused("--geometry 12parsecs", "size", 2);
  expect_refused("--buildings 5 --textures 20GiB --tessellate", "--textures", 2);
  expect_refused("--frames 1-4", "flight", 2);
  expect_refused("--camera flight --frames 9-4", "FIRST-LAST", 2);
  expect_refused("--camera flight --frames 1-999", "FIRST-LAST", 2);
  expect_refused("--buildings 5 --memory 1GiB", "--format store", 2);
  expect_refused("--buildings 5 --edge-length-px 2", "--format store", 2);
  expect_refused("--buildings 5 --format store --edge-length-px nan", "--edge-length-px", 2);
  expect_refused("--time noon", "--time", 2);
  expect_refused("--terrain mars", "--terrain", 2);
  expect_refused("--unique 2", "--unique", 2);
  expect_refused("--buildings 5 --fog=mist", "fog, cloud and smoke", 2);
  expect_refused("--buildings 5 --fog --tessellate", "--fog", 2);
  expect_refused("--buildings -5", "at most");
  const Ended nameless = spillway("city --buildings 5");
  EXPECT_EQ(nameless.code, 2);
}

TEST_F(CityCommand, none_and_one_are_cities_too) {
  for (const char* count : {"0", "1"}) {
    const Ended ended = spillway(std::string("city -q --format store -o few") + count + " --buildings " + count);
    ASSERT_EQ(ended.code, 0) << ended.said;
    const Ended render =
        spillway(std::string("render few") + count + "/city.store -o few.exr --resolution 32x18 --spp 1 -q");
    EXPECT_EQ(render.code, 0) << render.said;
  }
}

}  // namespace
}  // namespace spillway::tools
