#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "pipeline/render/plan.h"
#include "tools/lab/page.h"

namespace spillway::tools::lab {
namespace {

using OfPoint = std::function<double(const CurvePoint&)>;

std::string hint(const Curve& curve, const CurvePoint& p) {
  return fmt::format("{}, {} samples a pixel: relMSE {:.3g}, FLIP {:.3g}, {:.3g} s", curve.name, p.spp, p.rel_mse.mean,
                     p.flip.mean, p.seconds.mean);
}

Series error_series(const Curve& curve, const std::string& name, const OfPoint& x, bool is_flip) {
  Series series{name, {}};
  for (const CurvePoint& p : curve.points) {
    const Band& band = is_flip ? p.flip : p.rel_mse;
    series.points.push_back({x(p), band.mean, band.low, band.high, !p.is_above_reference_noise, hint(curve, p)});
  }
  return series;
}

Chart error_chart(const AxisResult& result, const std::string& title, const std::string& x_title, const OfPoint& x,
                  bool is_flip = false) {
  Chart chart{.title = title, .x_title = x_title, .y_title = is_flip ? "FLIP" : "relMSE", .series = {}};
  for (const Curve& curve : result.curves) chart.series.push_back(error_series(curve, curve.name, x, is_flip));
  if (!is_flip) chart.floor = result.reference_noise, chart.floor_name = "noise of the reference";
  return chart;
}

Chart error_over_samples(const AxisResult& result) {
  Chart chart =
      error_chart(result, "Error over samples", "camera paths", [](const CurvePoint& p) { return p.samples; });
  for (size_t i = 0; i < result.curves.size(); ++i)
    if (const Slope& s = result.curves[i].slope; s.is_known)
      chart.series[i].name += s.half_width > 0 ? fmt::format(": slope {:.2f} ± {:.2f}", s.value, s.half_width)
                                               : fmt::format(": slope {:.2f}", s.value);
  const CurvePoint &first = result.curves.front().points.front(), &last = result.curves.front().points.back();
  Series guide{"slope -1", {}, true};
  for (const double x : {first.samples, last.samples})
    guide.points.push_back({x, first.rel_mse.mean * first.samples / x});
  if (last.samples > first.samples) chart.series.push_back(guide);
  return chart;
}

// A twentieth at least: what is read once and alike by all says nothing on an axis.
bool varies(const AxisResult& result, const OfPoint& of) {
  double low = INFINITY, high = 0;
  for (const Curve& c : result.curves)
    for (const CurvePoint& p : c.points) low = std::min(low, of(p)), high = std::max(high, of(p));
  return high > 1.05 * low;
}

// What an axis that keeps every bit is about: time and bytes over samples.
Chart cost_chart(const AxisResult& result, const std::string& title, const std::string& y_title, const OfPoint& y) {
  Chart chart{.title = title, .x_title = "camera paths", .y_title = y_title, .series = {}};
  for (const Curve& curve : result.curves) {
    Series series{curve.name, {}};
    for (const CurvePoint& p : curve.points) series.points.push_back({p.samples, y(p), 0, 0, false, hint(curve, p)});
    chart.series.push_back(series);
  }
  return chart;
}

}  // namespace

std::vector<NamedChart> charts_of(const AxisResult& result) {
  const OfPoint seconds = [](const CurvePoint& p) { return p.seconds.mean; };
  const OfPoint bytes = [](const CurvePoint& p) { return p.read_bytes + p.written_bytes; };
  const OfPoint peak_mib = [](const CurvePoint& p) { return p.peak_bytes / (1 << 20); };
  std::vector<NamedChart> charts = {{"samples", error_over_samples(result)},
                                    {"seconds", error_chart(result, "Error over time", "seconds", seconds)},
                                    {"flip", error_chart(result, "Error as seen over time", "seconds", seconds, true)}};
  if (varies(result, bytes))
    charts.push_back({"bytes", error_chart(result, "Error over bytes", "bytes read and written", bytes)});
  if (!result.axis.keeps_bits) return charts;
  charts.push_back({"cost", cost_chart(result, "Time over samples", "seconds", seconds)});
  if (varies(result, bytes))
    charts.push_back({"traffic", cost_chart(result, "Bytes over samples", "bytes read and written", bytes)});
  charts.push_back({"memory", cost_chart(result, "Memory over samples", "peak resident, MiB", peak_mib)});
  return charts;
}

Chart peers_chart(const std::string& scene, std::span<const PeerRow> rows) {
  std::map<std::string, std::map<uint32_t, std::vector<const PeerRow*>>> by_renderer;
  for (const PeerRow& row : rows)
    if (row.scene == scene) by_renderer[row.renderer][row.spp].push_back(&row);
  Chart chart{.title = scene + ": error over time", .x_title = "seconds", .y_title = "relMSE", .series = {}};
  for (const auto& [renderer, by_spp] : by_renderer) {
    Series series{renderer, {}};
    for (const auto& [spp, of_spp] : by_spp) {
      std::vector<double> errors, seconds;
      for (const PeerRow* row : of_spp) errors.push_back(row->rel_mse), seconds.push_back(row->seconds);
      const Band band = band_of(errors);
      series.points.push_back(
          {mean(seconds), band.mean, band.low, band.high, false,
           fmt::format("{}, {} samples a pixel: {:.3g} in {:.3g} s", renderer, spp, band.mean, mean(seconds))});
    }
    chart.series.push_back(series);
  }
  return chart;
}

}  // namespace spillway::tools::lab
