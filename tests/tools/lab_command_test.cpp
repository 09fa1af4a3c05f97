// `spillway lab` as people use it, at a small size: the page, its numbers, and what is refused.

#include <gtest/gtest.h>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/support/run_command.h"
#include "tests/support/small_scene.h"
#include "tools/metrics/picture.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;

using test::Ended;

class LabCommand : public testing::Test {
 protected:
  Ended lab(const std::string& arguments) const {
    return test::run_command("cd " + folder_.string() + " && " SPILLWAY_PROGRAM " lab " + arguments);
  }
  [[nodiscard]] std::string text(const std::string& name) const {
    std::ifstream file(folder_ / name, std::ios::binary);
    std::ostringstream stream;
    stream << file.rdbuf();
    return stream.str();
  }
  void expect_refused(const std::string& arguments, int code, const std::string& part) const {
    const Ended ended = lab(arguments);
    EXPECT_EQ(ended.code, code) << arguments << ": " << ended.said;
    EXPECT_NE(ended.said.find(part), std::string::npos) << part << " in: " << ended.said;
    EXPECT_FALSE(fs::exists(folder_ / "out" / "index.html")) << arguments;
  }

  test::TemporaryDirectory directory_;
  const fs::path folder_ = directory_.path();
  const std::string box_ = SPILLWAY_SOURCE_DIR "/tests/twins/box.pbrt ";
  const std::string courtyard_ = SPILLWAY_SOURCE_DIR "/tests/data/courtyard/courtyard.pbrt ";
  const std::string small_ = "-o out --spp 1,4 --seeds 2 --reference-spp 64 --resolution 24x16 ";
};

std::vector<std::vector<std::string>> table(const std::string& csv) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    rows.emplace_back();
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(field);
  }
  return rows;
}

// The page without the letters that its pictures are written in: they may spell anything.
std::string without_pictures(const std::string& page) {
  const std::string begin = "data:image/png;base64,";
  std::string rest;
  size_t from = 0;
  for (size_t at; (at = page.find(begin, from)) != std::string::npos; from = page.find('"', at)) {
    rest += page.substr(from, at - from);
    if (page.find('"', at) == std::string::npos) return rest;
  }
  return rest + page.substr(from);
}

TEST_F(LabCommand, all_axes_of_a_scene_become_one_page_that_needs_no_other) {
  const Ended ended = lab(courtyard_ + small_);
  ASSERT_EQ(ended.code, 0) << ended.said;
  const std::string page = text("out/index.html");
  EXPECT_TRUE(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
  for (const char* part :
       {"First principles", "What is sampled at a vertex", "Direct light", "Samplers", "How a light is chosen",
        "Russian roulette", "Texture filters", "Bounds of a medium", "memory limit", "size of a wave", "slope",
        "efficiency", "data:image/png;base64,", "<svg", "have the same bits"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  // Nothing is loaded from elsewhere, nothing runs.
  const std::string read = without_pictures(page);
  for (const char* part : {"<script", "src=\"http", "href=\"http", "@import", "url(", "nan", "DEFECT"})
    EXPECT_EQ(read.find(part), std::string::npos) << part;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "out"))
    EXPECT_EQ(entry.path().string().find(".tmp"), std::string::npos) << entry.path();
}

// The first browser of the path.
std::string browser() {
  for (const char* name : {"chromium", "chromium-browser", "google-chrome"})
    if (std::system(("command -v " + std::string(name) + " > /dev/null 2>&1").c_str()) == 0) return name;
  return {};
}

TEST_F(LabCommand, a_browser_without_a_network_shows_the_page) {
  const std::string program = browser();
  if (program.empty()) GTEST_SKIP() << "no chromium on this machine: the page is not looked at";
  ASSERT_EQ(lab(box_ + small_ + "--axis samplers -q").code, 0);
  const std::string out = (folder_ / "out").string();
  const std::string command =
      program + " --headless --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir=" + out +
      "/profile --host-resolver-rules='MAP * ~NOTFOUND' --window-size=1500,2600 --screenshot=" + out +
      "/page.png file://" + out + "/index.html > /dev/null 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  const auto picture = read_picture(folder_ / "out" / "page.png");
  ASSERT_TRUE(picture) << picture.error().message;
  ASSERT_EQ(picture->width, 1500);
  // What only charts, verdicts and pictures have: the colours of two series, and enough that is not the paper.
  size_t blue = 0, red = 0, ink = 0;
  for (const Rgb& p : picture->pixels) {
    ink += p.g < 0.8f;
    blue += p.r < 0.01f && p.g > 0.15f && p.g < 0.18f && p.b > 0.42f && p.b < 0.47f;  // #0072b2
    red += p.r > 0.63f && p.r < 0.68f && p.g > 0.1f && p.g < 0.12f && p.b < 0.01f;    // #d55e00
  }
  EXPECT_GT(blue, 1000u);
  EXPECT_GT(red, 1000u);
  EXPECT_GT(ink, picture->pixels.size() / 50);
}

TEST_F(LabCommand, rows_say_what_was_rendered_and_seeds_are_independent) {
  const Ended ended = lab(box_ + small_ + "--axis estimators,memory -q");
  ASSERT_EQ(ended.code, 0) << ended.said;
  EXPECT_TRUE(ended.said.empty()) << ended.said;
  const auto rows = table(text("out/results.csv"));
  std::map<std::string, std::map<std::string, int>> hashes;  // of axis
  std::map<std::string, double> error_of_four;
  for (size_t i = 1; i < rows.size(); ++i) {
    ASSERT_EQ(rows[i].size(), 13u);
    ++hashes[rows[i][1]][rows[i][12]];
    if (rows[i][3] == "4") error_of_four[rows[i][2]] += std::stod(rows[i][7]) / 2;
    EXPECT_EQ(std::stod(rows[i][5]), 24 * 16 * std::stod(rows[i][3]));
    EXPECT_GT(std::stod(rows[i][6]), 0);         // seconds
    EXPECT_GT(std::stod(rows[i][9]), 0);         // the store was read
    EXPECT_GT(std::stod(rows[i][11]), 1 << 20);  // resident
    EXPECT_LT(std::stod(rows[i][11]), 4e9);
  }
  // Five estimators, two sample counts, two seeds: no two pictures alike. Memory: four limits and the same four
  // pictures.
  EXPECT_EQ(hashes["estimators"].size(), 20u);
  EXPECT_EQ(hashes["memory"].size(), 4u);
  // Even directions hardly find the lamp: several times the error.
  EXPECT_GT(error_of_four["hemisphere"], 3 * error_of_four["mis-power"]);
}

TEST_F(LabCommand, an_image_of_another_renderer_is_a_reference) {
  const std::string reference = SPILLWAY_SOURCE_DIR "/tests/images/box.exr";
  const Ended ended = lab(box_ + "-o out --spp 1,16 --seeds 2 --axis samplers -q --reference " + reference);
  ASSERT_EQ(ended.code, 0) << ended.said;
  EXPECT_NE(text("out/index.html").find("reference: box.exr"), std::string::npos);
  const auto rows = table(text("out/summary.csv"));
  ASSERT_EQ(rows.size(), 5u);
  EXPECT_LT(std::stod(rows[2][7]),
            std::stod(rows[1][7]) / 8);  // sixteen times the samples: it converges to the other's picture
}

TEST_F(LabCommand, without_a_scene_it_is_the_first_section_alone) {
  ASSERT_EQ(lab("-o out -q").code, 0);
  EXPECT_NE(text("out/index.html").find("Chebyshev"), std::string::npos);
  EXPECT_EQ(table(text("out/results.csv")).size(), 1u);
}

// A cube's cage in a white sky: coarser triangles are another shape. 24 x 16 in the scene, where edges are then half as
// many pixels long as in a picture of 48 x 32.
TEST_F(LabCommand, dicing_is_counted_in_pixels_of_the_picture) {
  std::ofstream(folder_ / "blob.pbrt")
      << "LookAt 3 4 2 0 0 0 0 0 1 Camera \"perspective\" \"float fov\" 25\n"
         "Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 16\nWorldBegin\n"
         "LightSource \"infinite\" \"rgb L\" [1 1 1]\nMaterial \"diffuse\" \"rgb reflectance\" [0.2 0.2 0.2]\n"
         "Shape \"subdivmesh\" \"point3 P\" [-1 -1 -1 1 -1 -1 1 1 -1 -1 1 -1 -1 -1 1 1 -1 1 1 1 1 -1 1 1]\n"
         "\"integer indices\" [0 3 2 1 4 5 6 7 0 1 5 4 1 2 6 5 2 3 7 6 3 0 4 7]\n";
  const Ended ended =
      lab("blob.pbrt -o out --spp 1,16 --seeds 2 --reference-spp 256 --resolution 48x32 --axis dicing,memory -q");
  ASSERT_EQ(ended.code, 0) << ended.said;
  std::map<std::string, double> error_of;
  for (const auto& row : table(text("out/results.csv")))
    if (row[1] == "dicing" && row[3] == "16") error_of[row[2]] += std::stod(row[7]);
  ASSERT_EQ(error_of.size(), 5u);
  EXPECT_GT(error_of["16 px"], 3 * error_of["1 px"]);
  EXPECT_GT(error_of["16 px"], error_of["4 px"]);
  const fs::path stores = folder_ / "out" / "stores";
  for (const char* edge : {"0.25", "0.5", "1", "2", "8"})
    EXPECT_TRUE(fs::exists(stores / (std::string("0_blob_") + edge + ".store"))) << edge;
  EXPECT_FALSE(fs::exists(stores / "0_blob_4.store"));  // the scene's own
}

// The line that a command says before it measures is the sign to interrupt it.
TEST_F(LabCommand, interrupted_it_keeps_what_it_has_and_says_how_to_go_on) {
  fs::create_directories(folder_ / "out");
  std::ofstream(folder_ / "out" / "index.html") << "an older page";
  const Ended ended = test::run_command(
      "cd " + folder_.string() + " && mkfifo said && { " SPILLWAY_PROGRAM " lab " + box_ + courtyard_ +
      "-o out --spp 1,65536 --seeds 2 --reference-spp 4 --resolution 24x16 --axis roulette,samplers 2> said & "
      "pid=$!; while read -r line; do echo \"$line\"; "
      "case \"$line\" in *'roulette: 65536 samples'*) kill -INT $pid;; esac; done < said; wait $pid; }");
  EXPECT_EQ(ended.code, 130) << ended.said;
  EXPECT_EQ(text("out/index.html"), "an older page");
  EXPECT_FALSE(fs::exists(folder_ / "out" / "results.csv"));
  EXPECT_EQ(table(text("out/unfinished_results.csv")).size(), 5u) << ended.said;
  EXPECT_EQ(table(text("out/unfinished_summary.csv")).size(), 3u);
  for (const std::string& part :
       {std::string("interrupted after 4 renders"), "spillway lab " + box_ + "--axis roulette,samplers -o out",
        "spillway lab " + courtyard_ + "--axis roulette,samplers -o out"})
    EXPECT_NE(ended.said.find(part), std::string::npos) << part << " in: " << ended.said;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "out"))
    EXPECT_EQ(entry.path().string().find(".tmp"), std::string::npos) << entry.path();
}

TEST_F(LabCommand, what_makes_no_sense_is_refused_and_leaves_no_page) {
  fs::create_directories(folder_ / "out");
  std::ofstream(folder_ / "out" / "index.html") << "an older page";
  EXPECT_EQ(lab("none.pbrt " + small_).code, 3);
  EXPECT_EQ(text("out/index.html"), "an older page");  // whole, and of its own numbers
  fs::remove(folder_ / "out" / "index.html");
  expect_refused("none.pbrt " + small_, 3, "none.pbrt: there is no such scene");
  expect_refused(box_ + small_ + "--axis colours", 2, "there are estimators, direct-light");
  expect_refused(box_ + "-o out --seeds 0", 2, "--seeds");
  expect_refused(box_ + "-o out --spp 0", 2, "--spp");
  expect_refused(box_ + "-o out --spp 1,x", 2, "--spp");
  expect_refused(box_ + small_ + "--reference none.exr --axis samplers", 3, "none.exr");
  expect_refused(box_ + small_ + "--reference " SPILLWAY_SOURCE_DIR "/tests/images/box.exr --axis samplers", 3,
                 "48 x 32");
  expect_refused(box_ + box_ + small_ + "--reference a.exr", 2, "--reference is of one scene");
  expect_refused(box_ + small_ + "--peers none.csv", 3, "none.csv");
  expect_refused(box_ + small_ + "--axis memory --memory-limits 1MiB", 3, "this frame needs at least");
  std::ofstream(folder_ / "broken.pbrt") << "WorldBegin\nShape \"sphere\" \"float radius\" [";
  expect_refused("broken.pbrt " + small_, 3, "broken.pbrt:2");
  std::ofstream(folder_ / "file") << "x";
  EXPECT_EQ(lab(box_ + "-o file").code, 3);
}

}  // namespace
}  // namespace spillway::tools
