#include "tools/lab/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

namespace spillway::tools::lab {
namespace {

constexpr double kWidth = 470, kPlotHeight = 270, kLeft = 62, kRight = 14, kTop = 34, kBottom = 46, kLegendRow = 18;
constexpr std::array<const char*, 8> kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                 "#e69f00", "#56b4e9", "#000000", "#7f7f7f"};

// One axis: values to pixels.
class Scale {
 public:
  Scale(bool is_log, double first_px, double last_px) : is_log_(is_log), first_px_(first_px), last_px_(last_px) {}

  void include(double value) {
    if (!shows(value)) return;
    low_ = std::min(low_, value), high_ = std::max(high_, value);
  }
  [[nodiscard]] bool shows(double value) const { return std::isfinite(value) && (!is_log_ || value > 0); }
  [[nodiscard]] bool is_empty() const { return low_ > high_; }

  // Some room at both ends.
  void finish() {
    if (is_log_) {
      const double room = std::pow(high_ / low_, 0.04) * (high_ > low_ ? 1.0 : 1.5);
      low_ /= room, high_ *= room;
    } else {
      const double room = high_ > low_ ? 0.04 * (high_ - low_) : 0.5;
      low_ = low_ >= 0 && low_ < room ? 0 : low_ - room, high_ += room;
    }
  }
  [[nodiscard]] double px(double value) const {
    const double part = is_log_ ? std::log(value / low_) / std::log(high_ / low_) : (value - low_) / (high_ - low_);
    return first_px_ + (last_px_ - first_px_) * std::clamp(part, 0.0, 1.0);
  }
  [[nodiscard]] std::vector<double> ticks() const { return is_log_ ? log_ticks() : even_ticks(); }

 private:
  // Decades; within less than two of them 2 and 5 too.
  [[nodiscard]] std::vector<double> log_ticks() const {
    const double decades = std::log10(high_ / low_);
    const int step = std::max(1, static_cast<int>(decades / 7));
    std::vector<double> ticks;
    for (int e = static_cast<int>(std::floor(std::log10(low_))); e <= std::log10(high_); ++e)
      for (const double digit : {1.0, 2.0, 5.0}) {
        if ((digit > 1 && decades > 2) || (digit == 1 && e % step != 0)) continue;
        const double value = digit * std::pow(10, e);
        if (value >= low_ && value <= high_) ticks.push_back(value);
      }
    return ticks;
  }
  [[nodiscard]] std::vector<double> even_ticks() const {
    const double rough = (high_ - low_) / 5, size = std::pow(10, std::floor(std::log10(rough)));
    const double step = size * (rough > 5 * size ? 10 : rough > 2 * size ? 5 : rough > size ? 2 : 1);
    std::vector<double> ticks;
    for (double i = std::ceil(low_ / step); i * step <= high_; ++i) ticks.push_back(i * step);
    return ticks;
  }

  bool is_log_;
  double first_px_, last_px_;
  double low_ = INFINITY, high_ = -INFINITY;
};

// A shape of its own for each series, about (x, y).
std::string marker(size_t series, double x, double y, const char* colour, bool is_hollow, const std::string& hint) {
  constexpr double r = 3.6;
  std::string shape;
  switch (series % 4) {
    case 0:
      shape = fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\"", x, y, r);
      break;
    case 1:
      shape = fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\"", x - r, y - r, 2 * r, 2 * r);
      break;
    case 2:
      shape = fmt::format("<path d=\"M{:.1f} {:.1f}l{} {}h{}z\"", x, y - r - 1, r + 1, 2 * r + 1, -2 * (r + 1));
      break;
    default:
      shape = fmt::format("<path d=\"M{0:.1f} {1:.1f}l{2} {2}l-{2} {2}l-{2} -{2}z\"", x, y - r - 1, r + 1);
  }
  return fmt::format("{} fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\"><title>{}</title></{}>", shape,
                     is_hollow ? "#fff" : colour, colour, escaped(hint),
                     series % 4 == 0   ? "circle"
                     : series % 4 == 1 ? "rect"
                                       : "path");
}

class Drawing {
 public:
  explicit Drawing(const Chart& chart)
      : chart_(chart), x_(chart.is_log_x, kLeft, kWidth - kRight), y_(chart.is_log_y, kTop + kPlotHeight, kTop) {
    for (const Series& s : chart.series)
      for (const ChartPoint& p : s.points) {
        if (!is_shown(p)) continue;
        x_.include(p.x);
        for (const double v : {p.y, p.low, p.high})
          if (v != 0 || !chart.is_log_y) y_.include(v == 0 ? p.y : v);
      }
    if (!x_.is_empty()) x_.finish(), y_.finish();
  }

  std::string svg() {
    const size_t rows = (chart_.series.size() + 1) / 2 + (draws_floor() ? 1 : 0);
    const double height = kTop + kPlotHeight + kBottom + kLegendRow * static_cast<double>(rows);
    add("<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" viewBox=\"0 0 {} {}\" width=\"{}\" height=\"{}\" "
        "font-family=\"sans-serif\" font-size=\"12\" role=\"img\"><title>{}</title>",
        kWidth, height, kWidth, height, escaped(chart_.title));
    add("<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>");
    add("<text x=\"{}\" y=\"20\" font-size=\"14\" font-weight=\"bold\">{}</text>", 10, escaped(chart_.title));
    if (x_.is_empty()) {
      add("<text x=\"{}\" y=\"{}\" fill=\"#666\">nothing to show</text></svg>", kLeft, kTop + kPlotHeight / 2);
      return text_;
    }
    grid(), floor();
    for (size_t i = 0; i < chart_.series.size(); ++i) series(i);
    legend();
    add("</svg>\n");
    return text_;
  }

 private:
  template <class... Arguments>
  void add(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Arguments>(arguments)...);
  }
  [[nodiscard]] bool is_shown(const ChartPoint& p) const { return x_.shows(p.x) && y_.shows(p.y); }
  [[nodiscard]] const char* colour(size_t i) const { return kColours[i % kColours.size()]; }

  void grid() {
    const double bottom = kTop + kPlotHeight;
    for (const double v : x_.ticks()) {
      add("<path d=\"M{0:.1f} {1}V{2}\" stroke=\"#e4e4e4\"/><text x=\"{0:.1f}\" y=\"{3}\" text-anchor=\"middle\" "
          "fill=\"#444\">{4}"
          "</text>",
          x_.px(v), kTop, bottom, bottom + 16, short_number(v));
    }
    for (const double v : y_.ticks())
      add("<path d=\"M{} {:.1f}H{}\" stroke=\"#e4e4e4\"/><text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\" "
          "fill=\"#444\">{}</text>",
          kLeft, y_.px(v), kWidth - kRight, kLeft - 6, y_.px(v) + 4, short_number(v));
    add("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#888\"/>", kLeft, kTop,
        kWidth - kLeft - kRight, kPlotHeight);
    add("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>", (kLeft + kWidth - kRight) / 2, bottom + 35,
        escaped(chart_.x_title));
    add("<text transform=\"translate(14 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>", kTop + kPlotHeight / 2,
        escaped(chart_.y_title));
  }

  // Below the plot it would lie on its edge, and say what it does not.
  [[nodiscard]] bool draws_floor() const {
    if (!(chart_.floor > 0) || x_.is_empty()) return false;
    const double px = y_.px(chart_.floor);
    return px < kTop + kPlotHeight && px > kTop;
  }
  void floor() {
    if (!draws_floor()) return;
    add("<path d=\"M{} {:.1f}H{}\" stroke=\"#999\" stroke-dasharray=\"2 3\"/>", kLeft, y_.px(chart_.floor),
        kWidth - kRight);
  }

  void band(const Series& s, const char* fill) {
    std::string upper, lower;
    for (const ChartPoint& p : s.points) {
      if (!is_shown(p) || !(p.high > p.low) || !y_.shows(p.low)) continue;
      upper += fmt::format("{}{:.1f} {:.1f}", upper.empty() ? "M" : "L", x_.px(p.x), y_.px(p.high));
      lower = fmt::format("L{:.1f} {:.1f}", x_.px(p.x), y_.px(p.low)) + lower;
    }
    if (!upper.empty()) add("<path d=\"{}{}Z\" fill=\"{}\" opacity=\"0.18\"/>", upper, lower, fill);
  }

  void series(size_t i) {
    const Series& s = chart_.series[i];
    band(s, colour(i));
    std::string line;
    for (const ChartPoint& p : s.points)
      if (is_shown(p)) line += fmt::format("{}{:.1f} {:.1f}", line.empty() ? "M" : "L", x_.px(p.x), y_.px(p.y));
    if (line.empty()) return;
    add("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"{}/>", line, colour(i),
        s.is_dashed ? " stroke-dasharray=\"6 4\"" : "");
    if (s.is_dashed) return;
    for (const ChartPoint& p : s.points)
      if (is_shown(p)) text_ += marker(i, x_.px(p.x), y_.px(p.y), colour(i), p.is_hollow, p.hint);
  }

  void legend() {
    const double top = kTop + kPlotHeight + kBottom + 4, column = (kWidth - 20) / 2;
    const size_t count = chart_.series.size();
    for (size_t i = 0; i < count; ++i) {
      const double x = 14 + column * static_cast<double>(i % 2), y = top + kLegendRow * static_cast<double>(i / 2);
      add("<path d=\"M{:.1f} {:.1f}h22\" stroke=\"{}\" stroke-width=\"1.8\"{}/>", x, y, colour(i),
          chart_.series[i].is_dashed ? " stroke-dasharray=\"6 4\"" : "");
      if (!chart_.series[i].is_dashed) text_ += marker(i, x + 11, y, colour(i), false, chart_.series[i].name);
      add("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>", x + 28, y + 4, escaped(chart_.series[i].name));
    }
    if (!draws_floor()) return;
    const double y = top + kLegendRow * static_cast<double>((count + 1) / 2);
    add("<path d=\"M14 {0:.1f}h22\" stroke=\"#999\" stroke-dasharray=\"2 3\"/><text x=\"42\" y=\"{1:.1f}\">{2}</text>",
        y, y + 4, escaped(chart_.floor_name));
  }

  const Chart& chart_;
  Scale x_, y_;
  std::string text_;
};

}  // namespace

std::string to_svg(const Chart& chart) { return Drawing(chart).svg(); }

std::string short_number(double value) {
  if (value == 0) return "0";
  const double size = std::fabs(value);
  if (size >= 99.9 && size < 9999) return fmt::format("{:.0f}", value);
  if (size >= 0.00999 && size < 99.9) return fmt::format("{:.3g}", value);
  const int exponent = static_cast<int>(std::floor(std::log10(size) + 1e-9));
  const double digits = value / std::pow(10, exponent);
  const std::string mantissa = std::fabs(digits - 1) < 1e-6 ? "" : fmt::format("{:.2g}·", digits);
  return fmt::format("{}10<tspan dy=\"-4\" font-size=\"9\">{}</tspan>", mantissa, exponent);
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '&':
        result += "&amp;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

}  // namespace spillway::tools::lab
