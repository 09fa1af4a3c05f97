#pragma once

// Line charts as SVG text: logarithmic axes, bands of confidence, a legend. Inline in HTML or a file of their own; no
// scripts, no fonts to load, colours that the colour-blind tell apart (Okabe and Ito 2008), and a marker a series
// besides.

#include <string>
#include <vector>

namespace spillway::tools::lab {

struct ChartPoint {
  double x = 0, y = 0;
  double low = 0, high = 0;  // the band; both 0: none
  bool is_hollow = false;
  std::string hint = {};  // shown under the pointer
};

struct Series {
  std::string name;
  std::vector<ChartPoint> points;
  bool is_dashed = false;  // theory rather than measurement: no markers
};

struct Chart {
  std::string title, x_title, y_title;
  std::vector<Series> series;
  bool is_log_x = true, is_log_y = true;
  double floor = 0;  // a horizontal line, such as the noise of the reference; 0: none
  std::string floor_name = {};
};

// Points that a logarithmic axis cannot show are left out. A chart without points says so.
[[nodiscard]] std::string to_svg(const Chart& chart);

// Three digits at most; very large and small ones as powers of ten with an SVG superscript.
[[nodiscard]] std::string short_number(double value);

// <, > and & as HTML and SVG want them.
[[nodiscard]] std::string escaped(const std::string& text);

}  // namespace spillway::tools::lab
