#include "tools/lab/page_axis.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/render/plan.h"
#include "tools/lab/page.h"
#include "tools/lab/png.h"
#include "tools/lab/summarize.h"

namespace spillway::tools::lab {
namespace {

// For text; charts have their own.
std::string number(double value) { return value == 0 ? "0" : fmt::format("{:.3g}", value); }

std::string bytes(double value) { return pipeline::bytes_text(static_cast<uint64_t>(value)); }

std::string time_to_error(const AxisResult& result, const Curve& curve) {
  const double seconds = curve.equal_error_seconds, first = result.curves.front().equal_error_seconds;
  if (!(seconds > 0)) return "<td>-</td>";
  const std::string ratio = first > 0 ? fmt::format(" <small>×{:.2f}</small>", seconds / first) : "";
  return fmt::format("<td>{}{}</td>", number(seconds), ratio);
}

// At the largest number of samples.
std::string row(const AxisResult& result, const Curve& curve) {
  const CurvePoint& p = curve.points.back();
  const std::string slope = !curve.slope.is_known ? "-"
                            : curve.slope.half_width > 0
                                ? fmt::format("{:.2f} ± {:.2f}", curve.slope.value, curve.slope.half_width)
                                : fmt::format("{:.2f}", curve.slope.value);
  return fmt::format(
      "<tr><th>{}<br><small>{}</small></th><td>{} <small>{}–{}</small></td><td>{}</td><td>{} <small>{}–{}</small></td>"
      "<td>{}</td><td>{}</td>{}<td>{}</td><td>{}</td><td>{}</td></tr>\n",
      escaped(curve.name), escaped(curve.about), number(p.rel_mse.mean), number(p.rel_mse.low), number(p.rel_mse.high),
      number(p.flip.mean), number(p.seconds.mean), number(p.seconds.low), number(p.seconds.high), slope,
      p.efficiency > 0 ? number(p.efficiency) : "-", time_to_error(result, curve), bytes(p.read_bytes),
      bytes(p.written_bytes), bytes(p.peak_bytes));
}

std::string table(const AxisResult& result) {
  std::string text = fmt::format(
      "<table><caption>At {} samples a "
      "pixel</caption><thead><tr><th></th><th>relMSE</th><th>FLIP</th><th>seconds</th><th>slope</th>"
      "<th title=\"1 / (variance x seconds)\">efficiency</th><th>seconds to relMSE {}</th><th>read</th><th>written</th>"
      "<th>peak resident</th></tr></thead><tbody>\n",
      result.curves.front().points.back().spp, result.equal_error > 0 ? number(result.equal_error) : "of the first");
  for (const Curve& curve : result.curves) text += row(result, curve);
  return text + "</tbody></table>\n";
}

std::string image(const Picture& size, const std::vector<uint8_t>& rgb, const std::string& about) {
  const int enlarged = std::max(1, 320 / size.width);  // whole times: pixels stay square
  return fmt::format("<img width=\"{}\" height=\"{}\" alt=\"{}\" src=\"{}\">", size.width * enlarged,
                     size.height * enlarged, escaped(about), data_url(png(size.width, size.height, rgb)));
}

// The picture and, beside it, where the eye would see a difference.
std::string pictures(const AxisResult& result) {
  const float exposure = exposure_of(result.reference);
  std::string text = fmt::format("<div class=\"pictures\"><figure>{}<figcaption>reference: {}</figcaption></figure>\n",
                                 image(result.reference, screen_bytes(result.reference, exposure), "reference"),
                                 escaped(result.reference_about));
  if (result.axis.keeps_bits) return text + "</div>\n";
  for (const Curve& curve : result.curves) {
    if (curve.picture.pixels.empty()) continue;
    const CurvePoint& p = curve.points.back();
    text += fmt::format("<figure>{}{}<figcaption>{}: {} samples a pixel, {} s, FLIP {}</figcaption></figure>\n",
                        image(curve.picture, screen_bytes(curve.picture, exposure), curve.name),
                        image(curve.picture, heat_bytes(curve.flip), curve.name + ", FLIP"), escaped(curve.name), p.spp,
                        number(p.seconds.mean), number(p.flip.mean));
  }
  return text + "</div>\n";
}

}  // namespace

std::string axis_html(const AxisResult& result, const std::string& anchor) {
  std::string text = fmt::format("<section id=\"{}\"><h3>{}</h3>\n<p>{}</p>\n", anchor, escaped(result.axis.title),
                                 escaped(result.axis.about));
  if (!result.left_out.empty())
    return text + fmt::format("<p class=\"remark\">Left out: {}.</p></section>\n", escaped(result.left_out));
  if (const std::string words = verdict(result); !words.empty())
    text += fmt::format("<p class=\"verdict\">{}</p>\n", escaped(words));
  for (const std::string& remark : result.remarks) {
    const bool is_defect = remark.starts_with("DEFECT");
    text += fmt::format("<p class=\"{}\">{}</p>\n", is_defect ? "defect" : "remark", escaped(remark));
  }
  text += "<div class=\"charts\">\n";
  for (const NamedChart& named : charts_of(result)) text += to_svg(named.chart);
  return text + "</div>\n" + table(result) + pictures(result) + "</section>\n";
}

}  // namespace spillway::tools::lab
