// `render --frames` as scripts use it: what is rendered, what is skipped, what one failure does to the others.

#include "tools/render_frames.h"

#include <gtest/gtest.h>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/run_command.h"
#include "tests/support/small_scene.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class RenderFramesTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto store = test::pack_small_scene(folder_, "shot", {.frame_count = 4});
    ASSERT_TRUE(store) << store.error().message;
  }
  int spillway(const std::string& arguments, const std::string& launcher = "") {
    const test::Ended ended =
        test::run_command("cd " + folder_.string() + " && " + launcher + SPILLWAY_PROGRAM " " + arguments);
    said_ = ended.said;
    return ended.code;
  }
  // The frames' ends, such as "rendered rendered skipped", from the summary.
  std::string ends(const std::string& arguments, int code = 0) {
    EXPECT_EQ(spillway("render shot.store --report summary.json " + arguments), code) << said_;
    std::string text;
    summary_ = read("summary.json");
    for (const json& frame : summary_["frames"]) {
      if (!text.empty()) text += ' ';
      text += frame["end"].get<std::string>();
    }
    return text;
  }
  json read(const std::string& name) {
    std::ifstream file(folder_ / name);
    return json::parse(file, nullptr, false);
  }

  test::TemporaryDirectory directory_;
  const fs::path folder_ = directory_.path();
  std::string said_;
  json summary_;
};

TEST_F(RenderFramesTest, frames_have_the_bits_of_frames_rendered_alone) {
  EXPECT_EQ(ends("--frames 1-3 -o f.###.exr -q"), "rendered rendered rendered");
  for (const int frame : {1, 2, 3}) {
    const std::string number = std::to_string(frame);
    ASSERT_EQ(spillway("render shot.store --frames " + number + " -o alone.exr --threads 1 --wave-paths 777 -q"), 0)
        << said_;
    EXPECT_EQ(spillway("compare f.00" + number + ".exr alone.exr"), 0) << said_;
  }
  EXPECT_NE(summary_["frames"][0]["image_hash"], summary_["frames"][1]["image_hash"]);
}

TEST_F(RenderFramesTest, what_is_resident_stays_from_frame_to_frame) {
  ASSERT_EQ(ends("--frames 1-3 -o f.###.exr -q"), "rendered rendered rendered");
  EXPECT_GT(summary_["frames"][0]["bytes_read"], 100000);
  const uint64_t first = summary_["frames"][0]["bytes_read"], third = summary_["frames"][2]["bytes_read"];
  EXPECT_LT(third, first / 4);
}

TEST_F(RenderFramesTest, finished_frames_are_known_by_what_they_were_made_from) {
  ASSERT_EQ(ends("--frames 1-2 -o f.###.exr -q"), "rendered rendered");
  EXPECT_EQ(ends("--frames 1-3 -o f.###.exr -q"), "skipped skipped rendered");
  EXPECT_EQ(summary_["skipped"], 2);
  EXPECT_EQ(ends("--frames 1-3 -o f.###.exr --threads 1 --memory 1GiB -q"), "skipped skipped skipped");
  EXPECT_EQ(ends("--frames 1 -o f.###.exr --spp 8 -q"), "rendered");
  EXPECT_EQ(ends("--frames 1 -o f.###.exr --spp 8 --aov -q"), "rendered");
  EXPECT_EQ(ends("--frames 2 -o f.###.exr --seed 7 -q"), "rendered");
  // A picture of another frame under this one's name, and one that is cut short.
  fs::copy_file(folder_ / "f.003.exr", folder_ / "f.002.exr", fs::copy_options::overwrite_existing);
  EXPECT_EQ(ends("--frames 2-3 -o f.###.exr -q"), "rendered skipped");
  fs::resize_file(folder_ / "f.003.exr", 100);
  EXPECT_EQ(ends("--frames 2-3 -o f.###.exr -q"), "skipped rendered");
  // Another scene with the same cameras.
  const auto store = test::pack_small_scene(folder_, "shot", {.max_triangles_per_page = 100, .frame_count = 4});
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(ends("--frames 2-3 -o f.###.exr -q"), "rendered rendered");
}

TEST_F(RenderFramesTest, a_timeline_is_of_all_frames) {
  EXPECT_EQ(ends("--frames 1-2 -o f.###.exr -q --trace t.json"), "rendered rendered");
  EXPECT_GT(read("t.json")["traceEvents"].size(), 20u);
}

TEST_F(RenderFramesTest, one_failure_does_not_end_the_batch) {
  fs::create_directory(folder_ / "f.002.exr");
  EXPECT_EQ(ends("--frames 1-4 -o f.###.exr", 3), "rendered failed rendered rendered");
  EXPECT_NE(said_.find("4 frames in"), std::string::npos) << said_;
  EXPECT_NE(said_.find("1 failed"), std::string::npos) << said_;
  EXPECT_NE(said_.find("f.002.exr"), std::string::npos) << said_;
  fs::remove(folder_ / "f.002.exr");
  EXPECT_EQ(ends("--frames 1-4 -o f.###.exr"), "skipped rendered skipped skipped");
}

TEST_F(RenderFramesTest, an_interrupt_ends_the_batch_and_the_same_command_goes_on) {
  const std::string command = "render shot.store --frames 1-4 -o f.###.exr --spp 20000 --threads 1";
  EXPECT_EQ(spillway(command, "timeout --preserve-status -s INT 2 "), 130) << said_;
  EXPECT_NE(said_.find("goes on"), std::string::npos) << said_;
  EXPECT_FALSE(fs::exists(folder_ / "f.004.exr"));
  // What was interrupted has fewer samples than asked for: it is no finished frame.
  EXPECT_EQ(ends("--frames 1 -o f.###.exr --spp 2 -q"), "rendered");
}

TEST_F(RenderFramesTest, batches_that_make_no_sense_are_refused_before_the_first_frame) {
  const auto refused = [&](const std::string& arguments, const char* said, int code = 2) {
    EXPECT_EQ(spillway("render shot.store " + arguments), code) << arguments;
    EXPECT_NE(said_.find(said), std::string::npos) << said_;
    EXPECT_FALSE(fs::exists(folder_ / "f.001.exr"));
  };
  refused("--frames 1-5 -o f.###.exr", "no frame 5", 3);
  refused("--frames 3-1 -o f.###.exr", "--frames 3-1");
  refused("--frames 1-2 -o f.exr", "run of #");
  refused("--frames 1-2 -o f.#.#.exr", "run of #");
  refused("--frames 1-4 -o f.###.exr --memory 64MiB", "at least", 3);
  const auto still = test::pack_small_scene(folder_, "still", {});
  ASSERT_TRUE(still);
  EXPECT_EQ(spillway("render still.store --frames 1-2 -o f.###.exr"), 3);
  EXPECT_NE(said_.find("no camera path"), std::string::npos) << said_;
}

TEST(FrameNames, lists_of_frames_are_numbers_and_ranges) {
  const auto frames = [](const char* text) { return parse_frames(text); };
  EXPECT_EQ(*frames("7"), (std::vector<uint32_t>{7}));
  EXPECT_EQ(*frames("1-4"), (std::vector<uint32_t>{1, 2, 3, 4}));
  EXPECT_EQ(*frames("9,1-7x3,4"), (std::vector<uint32_t>{1, 4, 7, 9}));
  EXPECT_EQ(frames("4294967294-4294967295")->size(), 2u);
  for (const char* wrong : {"", "1-", "-3", "5-2", "1-9x0", "1,,2", "1-2-3", "x", "1 2", "0-4294967295", "4294967296"})
    EXPECT_FALSE(frames(wrong)) << wrong;
}

TEST(FrameNames, the_number_has_at_least_as_many_digits_as_the_pattern) {
  EXPECT_EQ(*frame_path("a/f.####.exr", 12), "a/f.0012.exr");
  EXPECT_EQ(*frame_path("f#.exr", 123), "f123.exr");
  EXPECT_EQ(*frame_path("####", 5), "0005");
  EXPECT_FALSE(frame_path("a#/f.exr", 1));
  EXPECT_FALSE(frame_path("a#/f#.exr", 1));
}

}  // namespace
}  // namespace spillway::tools
