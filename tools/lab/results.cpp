#include "tools/lab/results.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>

namespace spillway::tools::lab {
namespace {

constexpr const char* kPeerHeader = "scene,renderer,spp,seed,seconds,peak_bytes,rel_mse,flip";
constexpr size_t kMostPeerRows = 1 << 20;

// Names may hold commas and quotes.
std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c);
  return result + '"';
}

// False: a quote is not closed.
bool split(const std::string& line, std::vector<std::string>& fields) {
  fields.assign(1, {});
  bool inside = false;
  for (size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (inside && c == '"' && i + 1 < line.size() && line[i + 1] == '"')
      fields.back() += line[++i];
    else if (c == '"')
      inside = !inside;
    else if (c == ',' && !inside)
      fields.emplace_back();
    else if (c != '\r')
      fields.back() += c;
  }
  return !inside;
}

// Numbers from zero on; a name of a number that is none is left in `what`.
bool read_numbers(const std::vector<std::string>& fields, PeerRow& row, std::string& what) {
  const auto number = [&](size_t i, const char* name, double& value) {
    char* end = nullptr;
    value = std::strtod(fields[i].c_str(), &end);
    if (!fields[i].empty() && *end == 0 && std::isfinite(value) && value >= 0) return true;
    what = name;
    return false;
  };
  double spp = 0, seed = 0;
  if (!number(2, "spp", spp) || !number(3, "seed", seed) || !number(4, "seconds", row.seconds) ||
      !number(5, "peak_bytes", row.peak_bytes) || !number(6, "rel_mse", row.rel_mse) || !number(7, "flip", row.flip))
    return false;
  if (spp < 1 || spp > 1e9 || seed > 1e9) return what = "spp", false;
  row.spp = static_cast<uint32_t>(spp), row.seed = static_cast<uint32_t>(seed);
  return true;
}

}  // namespace

std::string rows_csv(std::span<const SceneResult> scenes) {
  std::string text =
      "scene,axis,configuration,spp,seed,samples,seconds,rel_mse,flip,read_bytes,written_bytes,peak_bytes,image_hash\n";
  for (const SceneResult& scene : scenes)
    for (const Measurement& m : scene.rows)
      text += fmt::format("{},{},{},{},{},{:.0f},{:.6g},{:.9g},{:.6g},{},{},{},{}\n", quoted(m.scene), m.axis,
                          quoted(m.configuration), m.spp, m.seed, m.samples, m.seconds, m.rel_mse, m.flip, m.read_bytes,
                          m.written_bytes, m.peak_bytes, m.image_hash);
  return text;
}

std::string summary_csv(std::span<const SceneResult> scenes) {
  std::string text =
      "scene,axis,configuration,spp,seconds,seconds_low,seconds_high,rel_mse,rel_mse_low,rel_mse_high,flip,variance,"
      "efficiency,"
      "read_bytes,written_bytes,peak_bytes,above_reference_noise,slope,slope_half_width,equal_error,equal_error_"
      "seconds\n";
  for (const SceneResult& scene : scenes)
    for (const AxisResult& axis : scene.axes)
      for (const Curve& c : axis.curves)
        for (const CurvePoint& p : c.points)
          text += fmt::format(
              "{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.0f},{:.0f},{:.0f},{},{},{}"
              ",{:.6g},{}\n",
              quoted(scene.name), axis.axis.name, quoted(c.name), p.spp, p.seconds.mean, p.seconds.low, p.seconds.high,
              p.rel_mse.mean, p.rel_mse.low, p.rel_mse.high, p.flip.mean, p.variance, p.efficiency, p.read_bytes,
              p.written_bytes, p.peak_bytes, p.is_above_reference_noise ? 1 : 0,
              c.slope.is_known ? fmt::format("{:.4f}", c.slope.value) : "",
              c.slope.is_known ? fmt::format("{:.4f}", c.slope.half_width) : "", axis.equal_error,
              c.equal_error_seconds > 0 ? fmt::format("{:.6g}", c.equal_error_seconds) : "");
  return text;
}

Result<std::vector<PeerRow>> read_peers(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line;
  if (!file || !std::getline(file, line)) return error("{}: cannot be read", path.string());
  if (!line.empty() && line.back() == '\r') line.pop_back();
  if (line != kPeerHeader) return error("{}:1: the header must be {}", path.string(), kPeerHeader);
  std::vector<PeerRow> rows;
  std::vector<std::string> fields;
  for (size_t number = 2; std::getline(file, line); ++number) {
    if (line.empty()) continue;
    if (!split(line, fields) || fields.size() != 8)
      return error("{}:{}: a line has eight fields", path.string(), number);
    PeerRow row{fields[0], fields[1]};
    if (std::string what; !read_numbers(fields, row, what))
      return error("{}:{}: {} is no such number", path.string(), number, what);
    rows.push_back(std::move(row));
    if (rows.size() > kMostPeerRows) return error("{}: more than {} lines", path.string(), kMostPeerRows);
  }
  return rows;
}

}  // namespace spillway::tools::lab
