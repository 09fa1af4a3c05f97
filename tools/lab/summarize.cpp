#include "tools/lab/summarize.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace spillway::tools::lab {
namespace {

double weighed(float squared, float reference) {
  const double r = reference;
  return static_cast<double>(squared) / (r * r + 0.01);
}

template <class Of>
std::vector<double> values_of(std::span<const Measurement> rows, const Of& of) {
  std::vector<double> values;
  for (const Measurement& row : rows) values.push_back(static_cast<double>(of(row)));
  return values;
}

}  // namespace

void PixelVariance::add(const Picture& picture) {
  if (count_ == 0) mean_.assign(picture.pixels.size(), {0, 0, 0}), squares_ = mean_;
  ++count_;
  const float share = 1 / static_cast<float>(count_);
  for (size_t i = 0; i < mean_.size(); ++i) {
    const Rgb before = picture.pixels[i] - mean_[i];
    mean_[i] += before * share;
    squares_[i] += before * (picture.pixels[i] - mean_[i]);
  }
}

double PixelVariance::relative_to(const Picture& reference) const {
  if (count_ < 2) return 0;
  double sum = 0;
  for (size_t i = 0; i < mean_.size(); ++i) {
    const Rgb &s = squares_[i], &r = reference.pixels[i];
    sum += weighed(s.r, r.r) + weighed(s.g, r.g) + weighed(s.b, r.b);
  }
  return sum / (3 * static_cast<double>(mean_.size()) * (count_ - 1));
}

CurvePoint curve_point(std::span<const Measurement> rows, double variance, double reference_noise) {
  CurvePoint point;
  point.spp = rows.front().spp, point.samples = rows.front().samples;
  point.seconds = band_of(values_of(rows, [](const Measurement& m) { return m.seconds; }));
  point.rel_mse = band_of(values_of(rows, [](const Measurement& m) { return m.rel_mse; }));
  point.flip = band_of(values_of(rows, [](const Measurement& m) { return m.flip; }));
  point.variance = variance;
  point.efficiency = variance > 0 ? 1 / (variance * point.seconds.mean) : 0;
  point.read_bytes = mean(values_of(rows, [](const Measurement& m) { return m.read_bytes; }));
  point.written_bytes = mean(values_of(rows, [](const Measurement& m) { return m.written_bytes; }));
  point.peak_bytes = mean(values_of(rows, [](const Measurement& m) { return m.peak_bytes; }));
  point.is_above_reference_noise = point.rel_mse.mean > kAboveReferenceNoise * reference_noise;
  return point;
}

void fit_curve(std::span<const Measurement> rows, Curve& curve) {
  const auto counts = [&](uint32_t spp) {
    const auto found =
        std::find_if(curve.points.begin(), curve.points.end(), [&](const CurvePoint& p) { return p.spp == spp; });
    return found != curve.points.end() && found->is_above_reference_noise;
  };
  std::map<uint32_t, std::vector<Point>> of_seed;
  for (const Measurement& row : rows)
    if (counts(row.spp)) of_seed[row.seed].push_back({row.samples, row.rel_mse});
  std::vector<std::vector<Point>> curves;
  for (auto& [seed, points] : of_seed) curves.push_back(std::move(points));
  curve.slope = slope_of(curves);
  std::vector<Point> by_time;
  for (const CurvePoint& p : curve.points)
    if (p.is_above_reference_noise) by_time.push_back({p.seconds.mean, p.rel_mse.mean});
  curve.error_of_time = fit_power_law(by_time);
}

void compare_at_equal_error(AxisResult& result) {
  // What the first configuration has reached, halfway on the logarithmic axis between its first and last error: within
  // what was measured of it.
  const Curve& first = result.curves.front();
  if (!first.error_of_time.is_known) return;
  double low = INFINITY, high = 0;
  for (const CurvePoint& p : first.points)
    if (p.is_above_reference_noise) low = std::min(low, p.rel_mse.mean), high = std::max(high, p.rel_mse.mean);
  result.equal_error = std::sqrt(low * high);
  for (Curve& curve : result.curves) {
    if (!curve.error_of_time.is_known || !(curve.error_of_time.slope < 0)) continue;
    const double seconds = curve.error_of_time.x_of(result.equal_error);
    if (seconds < kFarthestExtrapolation * curve.points.back().seconds.mean) curve.equal_error_seconds = seconds;
  }
}

std::string equality_of_bits(std::span<const Measurement> rows) {
  std::map<std::pair<uint32_t, uint32_t>, std::set<std::string>> hashes;
  for (const Measurement& row : rows) hashes[{row.spp, row.seed}].insert(row.image_hash);
  size_t differing = 0;
  for (const auto& [key, of_key] : hashes) differing += of_key.size() > 1;
  if (differing == 0) return fmt::format("All {} groups of pictures have the same bits, as they must.", hashes.size());
  return fmt::format("DEFECT: in {} of {} groups the pictures differ, and they must not.", differing, hashes.size());
}

std::string verdict(const AxisResult& result) {
  if (result.curves.empty() || !(result.equal_error > 0)) return {};
  std::vector<const Curve*> known, others;
  for (const Curve& c : result.curves) (c.equal_error_seconds > 0 ? known : others).push_back(&c);
  if (known.empty()) return {};
  std::sort(known.begin(), known.end(),
            [](const Curve* a, const Curve* b) { return a->equal_error_seconds < b->equal_error_seconds; });
  const double best = known.front()->equal_error_seconds;
  std::string text =
      fmt::format("To an error of {:.3g}: {} in {:.3g} s", result.equal_error, known.front()->name, best);
  for (size_t i = 1; i < known.size(); ++i)
    text += fmt::format(", {} in {:.2f} times that", known[i]->name, known[i]->equal_error_seconds / best);
  for (const Curve* curve : others) text += fmt::format(", {} not in anything near", curve->name);
  return text + ".";
}

}  // namespace spillway::tools::lab
