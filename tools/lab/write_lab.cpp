#include "tools/lab/write_lab.h"

#include <fmt/format.h>

#include <algorithm>

#include "tools/write_text.h"

namespace spillway::tools::lab {
namespace {

// Letters and digits of a scene's name; a number keeps names apart.
std::string file_name(const std::string& scene, size_t index, const std::string& axis, const std::string& chart) {
  std::string plain;
  for (const char c : scene) plain += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return fmt::format("{}_{}_{}_{}.svg", index, plain, axis, chart);
}

Status write_charts(const std::filesystem::path& folder, std::span<const SceneResult> scenes) {
  for (size_t i = 0; i < scenes.size(); ++i)
    for (const AxisResult& axis : scenes[i].axes) {
      if (!axis.left_out.empty()) continue;
      for (const NamedChart& named : charts_of(axis))
        SPILLWAY_TRY(
            write_text(folder / file_name(scenes[i].name, i, axis.axis.name, named.name), to_svg(named.chart)));
    }
  return {};
}

}  // namespace

Result<Peers> load_peers(const std::filesystem::path& path) {
  if (path.empty()) return Peers{{}, "Not measured: bench/peers.py does, and --peers shows what it found."};
  SPILLWAY_ASSIGN(auto rows, read_peers(path));
  return Peers{std::move(rows),
               fmt::format("{} holds no row: the other renderers were not there.", path.filename().string())};
}

Status write_lab(const std::filesystem::path& folder, const PageInputs& inputs) {
  std::error_code code;
  const std::filesystem::path page = folder / "index.html", charts = folder / "charts";
  std::filesystem::remove(page, code);
  if (code) return error("{}: cannot be replaced: {}", page.string(), code.message());
  std::filesystem::create_directories(charts, code);
  if (code) return error("{}: cannot be made: {}", charts.string(), code.message());
  SPILLWAY_TRY(write_charts(charts, inputs.scenes));
  SPILLWAY_TRY(write_text(folder / "results.csv", rows_csv(inputs.scenes)));
  SPILLWAY_TRY(write_text(folder / "summary.csv", summary_csv(inputs.scenes)));
  return write_text(page, page_html(inputs));
}

Status write_unfinished(const std::filesystem::path& folder, std::span<const SceneResult> scenes) {
  SPILLWAY_TRY(write_text(folder / "unfinished_results.csv", rows_csv(scenes)));
  return write_text(folder / "unfinished_summary.csv", summary_csv(scenes));
}

bool has_defect(std::span<const SceneResult> scenes) {
  for (const SceneResult& scene : scenes)
    for (const AxisResult& axis : scene.axes)
      if (std::any_of(axis.remarks.begin(), axis.remarks.end(),
                      [](const std::string& r) { return r.starts_with("DEFECT"); }))
        return true;
  return false;
}

}  // namespace spillway::tools::lab
