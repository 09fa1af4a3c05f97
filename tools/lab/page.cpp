#include "tools/lab/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/render/plan.h"
#include "tools/lab/first_principles.h"
#include "tools/lab/page_axis.h"
#include "tools/lab/summarize.h"

namespace spillway::tools::lab {
namespace {

constexpr const char* kStyle = R"(<style>
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1480px; margin: 0 auto; padding: 0 24px 80px;
  background: #fafafa }
h1 { margin: 28px 0 4px } h2 { margin-top: 48px; border-bottom: 2px solid #0072b2 } h3 { margin: 36px 0 4px }
nav { columns: 3; font-size: 14px } nav a, a { color: #0072b2; text-decoration: none }
p { max-width: 92ch } small { color: #666; font-weight: normal } code { background: #eee; padding: 1px 4px }
.charts { display: flex; flex-wrap: wrap; gap: 14px } .chart { border: 1px solid #ddd; border-radius: 4px }
.lesson { width: 470px } .lesson p { font-size: 14px; margin: 6px 2px 18px }
.verdict { font-weight: 600 } .remark { color: #555 } .defect { color: #fff; background: #c00; padding: 4px 10px }
table { border-collapse: collapse; margin: 16px 0; background: #fff } caption { text-align: left; color: #555 }
th, td { border: 1px solid #ddd; padding: 4px 10px; text-align: right; vertical-align: top; white-space: nowrap }
tbody th { text-align: left }
.pictures { display: flex; flex-wrap: wrap; gap: 14px } figure { margin: 0 } figcaption { font-size: 13px; color: #444 }
img { image-rendering: pixelated; margin-right: 3px; max-width: 480px; height: auto }
</style>
)";

constexpr const char* kHow = R"(<section id="how"><h2>How this was measured</h2>
<p><b>relMSE</b> is the mean over pixels and channels of (a - b)²/(b² + 0.01), b the reference; <b>FLIP</b> is what an
eye sees that flips between the two (Andersson et al. 2020), from 0 to 1. <b>Seconds</b> are those of a frame with
opening its files, by the clock on the wall; configurations and seeds take turns. <b>Bytes</b> are what the renderer
read and wrote, <b>peak resident</b> the highest resident set without what the laboratory holds beside the render.</p>
<p><b>Bands</b> and ± are 95 % confidence from the independent seeds (Student's t; of the logarithm). <b>Slopes</b>
are fitted to log error over log samples, seed by seed; points within four times the noise of the reference, which its
two halves tell, are hollow and left out. <b>Efficiency</b> is 1/(variance × seconds), the variance that of a pixel
over the seeds, weighed as relMSE. <b>Seconds to equal error</b> are read off the fitted line of error over time, at
the middle of what the first configuration reached.</p>
</section>
)";

std::string lessons() {
  std::string text =
      "<section id=\"first\"><h2>First principles</h2>\n<p>Answers that are known, to read the other charts by: what a "
      "slope is, "
      "and what only moves a line.</p><div class=\"charts\">\n";
  for (const Lesson& lesson : first_principles())
    text += fmt::format("<div class=\"lesson\">{}<p>{}</p></div>\n", to_svg(lesson.chart), escaped(lesson.text));
  return text + "</div></section>\n";
}

std::string anchor(size_t scene, const std::string& axis) { return fmt::format("scene{}-{}", scene, axis); }

// A line an axis: what the page found, to begin with.
std::string overview(std::span<const SceneResult> scenes) {
  std::string text;
  for (size_t i = 0; i < scenes.size(); ++i) {
    text += fmt::format("<h3>{}</h3><ul>\n", escaped(scenes[i].name));
    for (const AxisResult& axis : scenes[i].axes) {
      std::string words = axis.left_out.empty() ? verdict(axis) : "left out: " + axis.left_out;
      if (axis.axis.keeps_bits && !axis.remarks.empty()) words = axis.remarks.front();
      text += fmt::format("<li><a href=\"#{}\">{}</a>: {}</li>\n", anchor(i, axis.axis.name), escaped(axis.axis.title),
                          escaped(words));
    }
    text += "</ul>\n";
  }
  return text;
}

std::string scene_html(const SceneResult& scene, size_t index) {
  std::string text =
      fmt::format("<h2 id=\"scene{}\">{}</h2>\n<p>{}.</p>\n", index, escaped(scene.name), escaped(scene.facts));
  for (const AxisResult& axis : scene.axes) text += axis_html(axis, anchor(index, axis.axis.name));
  return text;
}

// Seconds of each renderer to an error that both have come to: time to equal error is the figure that counts.
std::string peers_table(const std::string& scene, std::span<const PeerRow> rows) {
  std::vector<std::string> renderers;
  for (const PeerRow& row : rows)
    if (row.scene == scene && std::find(renderers.begin(), renderers.end(), row.renderer) == renderers.end())
      renderers.push_back(row.renderer);
  std::vector<PowerLaw> laws;
  double low = 0, high = INFINITY;
  std::vector<double> peaks;
  for (const std::string& renderer : renderers) {
    std::vector<Point> points;
    double least = INFINITY, most = 0, peak = 0;
    for (const PeerRow& row : rows) {
      if (row.scene != scene || row.renderer != renderer) continue;
      points.push_back({row.seconds, row.rel_mse});
      least = std::min(least, row.rel_mse), most = std::max(most, row.rel_mse), peak = std::max(peak, row.peak_bytes);
    }
    laws.push_back(fit_power_law(points)), peaks.push_back(peak);
    low = std::max(low, least), high = std::min(high, most);
  }
  const double target = std::sqrt(low * std::max(low, high));
  std::string text = fmt::format(
      "<table><thead><tr><th></th><th>seconds to relMSE {:.3g}</th><th>peak resident</th></tr></thead><tbody>\n",
      target);
  for (size_t i = 0; i < renderers.size(); ++i) {
    const bool is_known = laws[i].is_known && laws[i].slope < 0;
    text += fmt::format("<tr><th>{}</th><td>{}</td><td>{}</td></tr>\n", escaped(renderers[i]),
                        is_known ? fmt::format("{:.3g}", laws[i].x_of(target)) : "-",
                        pipeline::bytes_text(static_cast<uint64_t>(peaks[i])));
  }
  return text + "</tbody></table>\n";
}

std::string peers_html(const PageInputs& inputs) {
  std::string text = "<section id=\"peers\"><h2>Beside other renderers</h2>\n";
  if (inputs.peers.empty())
    return text + fmt::format("<p class=\"remark\">{}</p></section>\n", escaped(inputs.peers_remark));
  text +=
      "<p>The same scenes, one after the other on the same machine, each renderer held against the same "
      "reference.</p>\n<div class=\"charts\">\n";
  std::vector<std::string> scenes;
  for (const PeerRow& row : inputs.peers)
    if (std::find(scenes.begin(), scenes.end(), row.scene) == scenes.end()) scenes.push_back(row.scene);
  for (const std::string& scene : scenes)
    text += fmt::format("<div class=\"lesson\">{}{}</div>\n", to_svg(peers_chart(scene, inputs.peers)),
                        peers_table(scene, inputs.peers));
  return text + "</div></section>\n";
}

std::string navigation(const PageInputs& inputs) {
  std::string text = "<nav><ul><li><a href=\"#first\">First principles</a></li>\n";
  for (size_t i = 0; i < inputs.scenes.size(); ++i)
    text += fmt::format("<li><a href=\"#scene{}\">{}</a></li>\n", i, escaped(inputs.scenes[i].name));
  return text +
         "<li><a href=\"#peers\">Beside other renderers</a></li><li><a href=\"#how\">How this was "
         "measured</a></li></ul></nav>\n";
}

}  // namespace

std::string page_html(const PageInputs& inputs) {
  std::string text =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Spillway: the laboratory</title>\n";
  text += kStyle;
  text += "</head><body>\n<h1>Speed against accuracy</h1>\n";
  text += fmt::format(
      "<p><code>{}</code> · {} threads · {} seeds · the numbers: <a href=\"results.csv\">results.csv</a>, "
      "<a href=\"summary.csv\">summary.csv</a></p>\n",
      escaped(inputs.command), inputs.threads, inputs.seed_count);
  text += navigation(inputs) + overview(inputs.scenes) + lessons();
  for (size_t i = 0; i < inputs.scenes.size(); ++i) text += scene_html(inputs.scenes[i], i);
  return text + peers_html(inputs) + kHow + "</body></html>\n";
}

}  // namespace spillway::tools::lab
