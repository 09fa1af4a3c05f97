#include "shading/medium.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <set>
#include <vector>

#include "shading/grid_walk.h"

namespace spillway::shading {
namespace {

TEST(Exponential, exp_and_log_are_those_of_the_c_library_within_their_stated_errors) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> u(-80, 80);
  for (int i = 0; i < 100000; ++i) {
    const float x = u(random), y = std::exp(x);
    ASSERT_NEAR(exp_of(x) / y, 1, 2e-6) << x;  // the argument's own rounding is half an ulp of 80
    ASSERT_NEAR(log2_of(y), std::log2(static_cast<double>(y)), 4e-11 + 1e-15 * std::fabs(x)) << y;
  }
  EXPECT_EQ(exp_of(0), 1);
  EXPECT_EQ(log_of(1), 0);
  EXPECT_EQ(exp_of(-INFINITY), 0);
  EXPECT_EQ(exp2_of(-149.5), 0);
}

TEST(OrderlessProduct, is_the_product_in_any_order) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> u(0.3f, 1.5f);
  std::vector<float> factors(200);
  double wanted = 1;
  for (float& f : factors) f = u(random), wanted *= f;
  const auto product = [&] {
    OrderlessProduct p;
    for (const float f : factors) p.multiply(f);
    return p.value();
  };
  const float first = product();
  EXPECT_NEAR(first / wanted, 1, 1e-6);
  for (int i = 0; i < 20; ++i) {
    std::shuffle(factors.begin(), factors.end(), random);
    ASSERT_EQ(product(), first);
  }
  factors.push_back(0);
  EXPECT_EQ(product(), 0);
}

TEST(HenyeyGreenstein, integrates_to_one_with_mean_cosine_g) {
  for (const float g : {-0.9f, -0.3f, 0.0f, 5e-4f, 0.5f, 0.95f}) {
    constexpr int kSteps = 200000;
    double sum = 0, mean = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double cosine = -1 + (i + 0.5) * 2 / kSteps;
      const double value = henyey_greenstein(g, static_cast<float>(cosine)) * 2 * std::numbers::pi * 2 / kSteps;
      sum += value, mean += value * cosine;
    }
    EXPECT_NEAR(sum, 1, 1e-4) << g;
    EXPECT_NEAR(mean, g, 1e-4) << g;
  }
}

TEST(HenyeyGreenstein, samples_follow_the_density) {
  constexpr int kBins = 32, kSide = 512;
  const Float3 flight = normalize(Float3{0.3f, -0.5f, 0.8f});
  for (const float g : {-0.7f, 0.0f, 0.4f, 0.9f}) {
    std::vector<double> seen(kBins, 0), wanted(kBins, 0);
    for (int i = 0; i < kSide * kSide; ++i) {
      const Float2 u{(static_cast<float>(i % kSide) + 0.5f) / kSide, (static_cast<float>(i / kSide) + 0.5f) / kSide};
      const Float3 w = sample_henyey_greenstein(g, flight, u);
      ASSERT_NEAR(length(w), 1, 1e-5);
      seen[std::min(kBins - 1, static_cast<int>((dot(w, flight) + 1) / 2 * kBins))] += 1.0 / (kSide * kSide);
    }
    for (int i = 0; i < kBins * 1000; ++i) {
      const double cosine = -1 + (i + 0.5) * 2 / (kBins * 1000);
      wanted[i / 1000] += henyey_greenstein(g, static_cast<float>(cosine)) * 4 * std::numbers::pi / (kBins * 1000);
    }
    // Points on a lattice: a bin is off by at most a row of it at each end.
    for (int b = 0; b < kBins; ++b) EXPECT_NEAR(seen[b], wanted[b], 2.0 / kSide) << g << ' ' << b;
  }
}

double channel(Rgb c, int i) { return i == 0 ? c.r : i == 1 ? c.g : c.b; }

// A mean and four standard errors of it.
struct Estimate {
  double sum = 0, squares = 0;
  int count = 0;
  void add(double x) { sum += x, squares += x * x, ++count; }
  [[nodiscard]] double mean() const { return sum / count; }
  [[nodiscard]] double tolerance() const {
    return 4 * std::sqrt(std::max(0.0, squares / count - mean() * mean()) / count) + 1e-6;
  }
};

// Two shares may add up to a rounding less than one: the third must not be taken for it.
TEST(FreePath, a_channel_that_carries_nothing_is_never_followed) {
  for (float r = 1; r < 30; ++r)
    for (float g = 1; g < 30; ++g) {
      const FreePath path = sample_free_path({1, 1, 1e-7f}, {r, g, 0}, 1e6f, {0x1.fffffep-1f, 0.5f});
      ASSERT_TRUE(path.distance < 1e3f && is_finite(path.weight)) << r << ' ' << g;
    }
}

TEST(FreePath, weights_are_the_transmittance_and_what_collides) {
  const Rgb sigma{0.2f, 1.0f, 3.0f};
  constexpr float kEnd = 1.5f;
  for (const Rgb shares : {Rgb{1, 1, 1}, Rgb{1, 0.1f, 2}, Rgb{5, 1, 1}}) {
    Estimate passed[3], early[3];
    for (uint32_t i = 0; i < 200000; ++i) {
      const FreePath path = sample_free_path(sigma, shares, kEnd, sample_2d({7, i, 1}, 0));
      for (int c = 0; c < 3; ++c) {
        passed[c].add(path.distance == INFINITY ? channel(path.weight, c) : 0);
        early[c].add(path.distance < kEnd / 3 ? channel(path.weight, c) : 0);
      }
    }
    for (int c = 0; c < 3; ++c) {
      const double s = channel(sigma, c);
      EXPECT_NEAR(passed[c].mean(), std::exp(-s * kEnd), passed[c].tolerance()) << c;
      EXPECT_NEAR(early[c].mean(), 1 - std::exp(-s * kEnd / 3), early[c].tolerance()) << c;
    }
  }
}

// A medium along a line, in cells of one quarter.
struct Line {
  std::function<double(double)> density;
  double largest;
  static constexpr int kCells = 8;
  static constexpr double kCell = 0.25;

  [[nodiscard]] static CellSegment cell(int i) {
    return {static_cast<uint32_t>(i), static_cast<float>(i * kCell), static_cast<float>((i + 1) * kCell)};
  }
  // For rules of one density the first channel counts alone.
  [[nodiscard]] Rgb density_at(const CellStep& step, Rgb scale = {1, 0, 0}) const {
    return scale * static_cast<float>(density(step.distance));
  }
  [[nodiscard]] double optical_depth(double end) const {
    constexpr int kSteps = 20000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) sum += density((i + 0.5) * end / kSteps) * end / kSteps;
    return sum;
  }
};

const Line kLines[] = {{[](double) { return 1.3; }, 1.3},
                       {[](double) { return 1.3; }, 4.0},  // a majorant that is not tight
                       {[](double t) { return 1.5 * t; }, 3.0},
                       {[](double t) { return 2 * std::exp(-t); }, 2.0},
                       {[](double t) { return t > 0.6 && t < 0.7 ? 9.0 : 0.1; }, 9.0}};

// What a segment with this key comes to on the line.
Collisions pass(const Line& line, Rgb sigma, const SegmentKey& key) {
  const StepRule rule(sigma, {1, 1, 1});
  Collisions all;
  for (int c = 0; c < Line::kCells; ++c) {
    CellSteps steps(Line::cell(c), rule.majorant(static_cast<float>(line.largest)), key);
    while (steps.next()) rule.pass(steps.step(), line.density_at(steps.step()), all);
  }
  return all;
}

Collisions track(const Line& line, Rgb sigma, Rgb shares, const SegmentKey& key) {
  const StepRule rule(sigma, shares);
  Collisions all;
  for (int c = 0; c < Line::kCells && !all.collided(); ++c) {
    CellSteps steps(Line::cell(c), rule.majorant(static_cast<float>(line.largest)), key);
    while (!all.collided() && steps.next()) rule.track(steps.step(), line.density_at(steps.step()), all);
  }
  return all;
}

TEST(Cells, ratio_tracking_is_the_transmittance) {
  const Rgb sigma{1, 0.4f, 0};
  for (const Line& line : kLines) {
    Estimate passed[3];
    for (uint32_t i = 0; i < 40000; ++i) {
      const Collisions all = pass(line, sigma, {{3, i, 9}, 77});
      for (int c = 0; c < 3; ++c) passed[c].add(all.weight[c].value());
    }
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(passed[c].mean(), std::exp(-line.optical_depth(2) * channel(sigma, c)), passed[c].tolerance()) << c;
  }
}

// Too few steps would leave out what a tight bound must not. Their number is Poisson's: its variance is its mean.
TEST(Cells, are_passed_in_as_many_steps_as_their_bound_says) {
  constexpr uint32_t kRays = 200000;
  for (const Line& line : kLines) {
    uint64_t steps = 0;
    for (uint32_t i = 0; i < kRays; ++i) steps += pass(line, Rgb{1, 0.4f, 0}, {{3, i, 9}, 77}).steps;
    const double wanted = line.largest * Line::kCells * Line::kCell;
    EXPECT_NEAR(static_cast<double>(steps) / kRays, wanted, 5 * std::sqrt(wanted / kRays));
  }
}

TEST(Cells, collisions_come_where_they_should_in_every_channel) {
  for (const Rgb sigma : {Rgb{1, 1, 1}, Rgb{1, 0.5f, 0.2f}})
    for (const Line& line : kLines) {
      Estimate passed[3], early[3];
      for (uint32_t i = 0; i < 60000; ++i) {
        const Collisions all = track(line, sigma, {1, 2, 0.5f}, {{3, i, 9}, 77});
        for (int c = 0; c < 3; ++c) {
          passed[c].add(all.collided() ? 0 : all.weight[c].value());
          early[c].add(all.distance < 0.8f ? all.weight[c].value() : 0);
        }
      }
      for (int c = 0; c < 3; ++c) {
        const double s = channel(sigma, c);
        EXPECT_NEAR(passed[c].mean(), std::exp(-line.optical_depth(2) * s), passed[c].tolerance()) << c;
        EXPECT_NEAR(early[c].mean(), 1 - std::exp(-line.optical_depth(0.8) * s), early[c].tolerance()) << c;
      }
    }
}

// A density a channel, whose ratios are those of coefficients of one density: the same transmittance, and collisions.
TEST(Cells, channels_of_their_own_densities_pass_and_collide_as_they_should) {
  const Rgb scale{1, 0.5f, 0.2f};
  for (const Line& line : kLines) {
    Estimate passed[3], reached[3], early[3];
    const StepRule rule({1, 1, 1}, {1, 2, 0.5f}, true);
    for (uint32_t i = 0; i < 40000; ++i) {
      const SegmentKey key{{3, i, 9}, 77};
      Collisions through, all;
      for (int c = 0; c < Line::kCells; ++c) {
        CellSteps steps(Line::cell(c), rule.majorant(static_cast<float>(line.largest)), key);
        while (steps.next()) {
          const Rgb density = line.density_at(steps.step(), scale);
          rule.pass(steps.step(), density, through);
          if (!all.collided()) rule.track(steps.step(), density, all);
        }
      }
      for (int c = 0; c < 3; ++c) {
        passed[c].add(through.weight[c].value());
        reached[c].add(all.collided() ? 0 : all.weight[c].value());
        early[c].add(all.distance < 0.8f ? all.weight[c].value() : 0);
      }
    }
    for (int c = 0; c < 3; ++c) {
      const double s = channel(scale, c), whole = std::exp(-line.optical_depth(2) * s);
      EXPECT_NEAR(passed[c].mean(), whole, passed[c].tolerance()) << c;
      EXPECT_NEAR(reached[c].mean(), whole, reached[c].tolerance()) << c;
      EXPECT_NEAR(early[c].mean(), 1 - std::exp(-line.optical_depth(0.8) * s), early[c].tolerance()) << c;
    }
  }
}

// A walk that waits for a density goes on where it was.
TEST(Cells, are_taken_up_at_any_step) {
  int steps = 0;
  for (uint32_t i = 0; i < 2000; ++i) {
    const SegmentKey key{{3, i, 9}, 5};
    CellSteps whole(Line::cell(1), 40, key);
    CellProgress progress;
    while (whole.next()) {
      CellSteps taken_up(Line::cell(1), 40, key, progress);
      ASSERT_TRUE(taken_up.next());
      ASSERT_EQ(taken_up.step().distance, whole.step().distance);
      ASSERT_EQ(taken_up.step().decision, whole.step().decision);
      progress = taken_up.progress(), ++steps;
    }
    EXPECT_FALSE(CellSteps(Line::cell(1), 40, key, progress).next());
  }
  EXPECT_NEAR(steps, 2000 * 40 * Line::kCell, 5 * std::sqrt(2000 * 40 * Line::kCell));
}

TEST(Cells, a_thousand_mean_free_paths_without_absorption_lose_nothing) {
  // A slab of optical depth 1000 with albedo one: what does not come back comes through, after some 10^5 collisions.
  std::mt19937 random(5);
  std::uniform_real_distribution<float> u(0, 1);
  uint64_t collisions = 0;
  int ends = 0;
  for (uint32_t path = 0; path < 200; ++path) {
    float x = 0, direction = 1;
    for (uint32_t segment = 0;; ++segment) {
      ASSERT_LT(segment, 100'000'000u);
      const float end = direction > 0 ? (1000 - x) / direction : x / -direction;
      const FreePath free = sample_free_path({1, 1, 1}, {1, 1, 1}, end, {u(random), u(random)});
      ASSERT_EQ(free.weight.r, 1) << "weights of a grey medium are one";
      if (free.distance == INFINITY) break;
      ++collisions;
      x = std::clamp(x + direction * free.distance, 0.0f, 1000.0f);
      direction = sample_henyey_greenstein(0, {0, 0, 1}, {u(random), u(random)}).z;
    }
    ++ends;
  }
  EXPECT_EQ(ends, 200);
  EXPECT_GT(collisions, 20000u);
}

TEST(SegmentKey, differs_by_where_a_segment_starts) {
  const SegmentKey a = segment_key({1, 2, 3}, 4, false, {1, 2, 3});
  EXPECT_NE(a.segment, segment_key({1, 2, 3}, 4, false, {1, 2, 3.0000002f}).segment);
  EXPECT_NE(a.segment, segment_key({1, 2, 3}, 4, true, {1, 2, 3}).segment);
  EXPECT_NE(a.segment, segment_key({1, 2, 3}, 5, false, {1, 2, 3}).segment);
  EXPECT_EQ(a.segment, segment_key({1, 2, 3}, 4, false, {1, 2, 3}).segment);
}

// Cells that share them would collide together.
TEST(GridWalk, every_cell_has_random_numbers_of_its_own) {
  std::set<uint32_t> keys;
  for (int32_t x = 0; x < 16; ++x)
    for (int32_t y = 0; y < 16; ++y)
      for (int32_t z = 0; z < 16; ++z) keys.insert(cell_key({{x, y, z}}));
  EXPECT_EQ(keys.size(), 4096u);
}

TEST(GridWalk, steps_tile_the_segment_and_lie_in_their_cells) {
  const CellGrid grid{{5, 3, 7}};
  std::mt19937 random(11);
  std::uniform_real_distribution<float> u(-1, 1);
  int entered = 0;
  for (int i = 0; i < 20000; ++i) {
    const Float3 origin{2.5f + 6 * u(random), 1.5f + 4 * u(random), 3.5f + 8 * u(random)};
    Float3 direction{u(random), u(random), u(random)};
    if (i % 5 == 0) direction[i / 5 % 3] = 0;
    const GridWalk walk(origin, direction);
    const float end = 10 * (1 + u(random));
    GridWalk::Step step;
    if (!walk.enter(grid, end, step)) continue;
    ++entered;
    float at = step.begin;
    do {
      ASSERT_EQ(step.begin, at);
      ASSERT_LE(step.begin, step.end);
      const float middle = (step.begin + step.end) / 2;
      for (int a = 0; a < 3; ++a) {
        const float p = origin[a] + direction[a] * middle;
        ASSERT_GE(p, static_cast<float>(step.cell.at[a]) - 2e-5f);
        ASSERT_LE(p, static_cast<float>(step.cell.at[a] + 1) + 2e-5f);
      }
      GridWalk::Step again;
      walk.resume(step.cell, step.begin, end, again);
      ASSERT_EQ(again.end, step.end);
      at = step.end;
    } while (walk.next(grid, end, step));
    // Where it ended the segment ends, or the grid does.
    const Float3 p = origin + direction * at;
    bool at_border = at >= end;
    for (int a = 0; a < 3; ++a) at_border |= p[a] < 1e-4f || p[a] > static_cast<float>(grid.count[a]) - 1e-4f;
    ASSERT_TRUE(at_border);
  }
  EXPECT_GT(entered, 3000);
}

TEST(GridWalk, a_ray_that_misses_or_starts_beyond_enters_nothing) {
  const CellGrid grid{{2, 2, 2}};
  GridWalk::Step step;
  EXPECT_FALSE(GridWalk({-1, 5, 1}, {1, 0, 0}).enter(grid, INFINITY, step));
  EXPECT_FALSE(GridWalk({3, 1, 1}, {1, 0, 0}).enter(grid, INFINITY, step));
  EXPECT_FALSE(GridWalk({-1, 1, 1}, {1, 0, 0}).enter(grid, 0.5f, step));
  ASSERT_TRUE(GridWalk({-1, 1, 1}, {1, 0, 0}).enter(grid, 1.5f, step));
  EXPECT_EQ(step.begin, 1);
  EXPECT_EQ(step.end, 1.5f);
  EXPECT_FALSE(GridWalk({-1, 1, 1}, {1, 0, 0}).next(grid, 1.5f, step));
}

}  // namespace
}  // namespace spillway::shading
