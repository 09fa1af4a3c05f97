// An experiment that is stopped has what was finished, and knows what is missing.

#include "tools/lab/experiment.h"

#include <gtest/gtest.h>

#include <atomic>
#include <map>

#include "tests/support/small_scene.h"
#include "tools/lab/results.h"

namespace spillway::tools::lab {
namespace {

class Stopped : public testing::Test {
 protected:
  Stopped() {
    test::SmallSceneOptions scene;
    scene.resolution_x_px = 24, scene.resolution_y_px = 16;
    EXPECT_TRUE(test::pack_small_scene(directory_.path(), "scene", scene));
    options_.axes = {"roulette", "samplers", "wave"};
    options_.spps = {1, 2}, options_.seed_count = 2, options_.reference_spp = 4;
  }
  SceneResult run() const {
    const OpenStore open = [this](float) { return pipeline::Store::open(directory_.path() / "scene.store"); };
    Result<SceneResult> result = run_experiment("scene", open, false, options_);
    EXPECT_TRUE(result) << result.error().message;
    return result ? std::move(*result) : SceneResult{};
  }
  // When this is about to begin.
  SceneResult run_until(const std::string& what) {
    std::atomic<bool> stop{false};
    options_.stop = &stop;
    options_.tell = [&](const std::string& line) {
      if (line.find(what) != std::string::npos) stop = true;
    };
    SceneResult result = run();
    options_.stop = nullptr, options_.tell = [](const std::string&) {};
    return result;
  }
  static std::map<std::string, std::string> hashes(const SceneResult& result) {
    std::map<std::string, std::string> of;
    for (const Measurement& m : result.rows)
      of[m.axis + ' ' + m.configuration + ' ' + std::to_string(m.spp) + ' ' + std::to_string(m.seed)] = m.image_hash;
    return of;
  }

  test::TemporaryDirectory directory_;
  ExperimentOptions options_;
};

TEST_F(Stopped, has_every_render_that_was_finished_and_names_what_is_missing) {
  const SceneResult whole = run();
  EXPECT_TRUE(whole.missing_axes.empty());
  ASSERT_EQ(whole.axes.size(), 3u);
  const SceneResult part = run_until("samplers: 2 samples");
  EXPECT_EQ(part.missing_axes, (std::vector<std::string>{"samplers", "wave"}));
  ASSERT_EQ(part.axes.size(), 2u);
  for (const Curve& curve : part.axes[0].curves) EXPECT_EQ(curve.points.size(), 2u);
  for (const Curve& curve : part.axes[1].curves) EXPECT_EQ(curve.points.size(), 1u);
  EXPECT_EQ(part.rows.size(), 12u);  // of two configurations, two seeds each: two counts, then one
  const auto all = hashes(whole);
  for (const auto& [render, hash] : hashes(part)) {
    ASSERT_TRUE(all.contains(render)) << render;
    EXPECT_EQ(hash, all.at(render)) << render;  // none is a picture of fewer samples
  }
  const SceneResult list[] = {part};
  const std::string rows = rows_csv(list), summary = summary_csv(list);
  EXPECT_EQ(std::count(rows.begin(), rows.end(), '\n'), 13);
  EXPECT_EQ(std::count(summary.begin(), summary.end(), '\n'), 1 + 2 * 2 + 2 * 1);
}

TEST_F(Stopped, before_the_first_render_has_nothing) {
  const SceneResult none = run_until("roulette: reference");
  EXPECT_TRUE(none.rows.empty());
  EXPECT_EQ(none.missing_axes, options_.axes);
  const SceneResult list[] = {none};
  EXPECT_EQ(summary_csv(list).find("roulette"), std::string::npos);
}

}  // namespace
}  // namespace spillway::tools::lab
