#include "tools/compare_images.h"

#include <algorithm>
#include <cmath>

#include "pipeline/json_text.h"
#include "tools/commands.h"

namespace spillway::tools {
namespace {

using nlohmann::ordered_json;

ordered_json to_json(const EqualityReport& e) {
  return {{"equal", e.equal},
          {"failing_blocks", e.failing_blocks},
          {"failing_pixels", e.failing_pixels},
          {"largest_cluster", e.largest_cluster},
          {"least_block_p", e.least_block_p},
          {"block_level", e.block_level},
          {"least_pixel_p", e.least_pixel_p},
          {"pixel_level", e.pixel_level},
          {"worst_block", {e.worst_x, e.worst_y}}};
}

ordered_json to_json(const PictureComparison& c) {
  ordered_json json{
      {"equal", c.equal},
      {"reason", c.reason},
      {"rel_mse", c.rel_mse},
      {"mse", c.mse},
      {"mean_ratio", c.mean_ratio},
      {"flip", c.flip_mean},
      {"largest_difference",
       {{"value", c.largest.value}, {"pixel", {c.largest.x, c.largest.y}}, {"channel", c.largest.channel}}},
      {"blocks",
       {{"count", c.blocks.block_count},
        {"correlation", c.blocks.correlation},
        {"scale", c.blocks.scale},
        {"relative_deviation", c.blocks.relative_deviation}}},
      {"differing_pixels", c.differing_pixels},
      {"not_finite_pixels", c.not_finite_pixels}};
  if (c.equality) json["statistical"] = to_json(*c.equality);
  return json;
}

void print_table(const PictureComparison& c, int block_size) {
  const auto line = [](const char* what, const std::string& value) { fmt::print("{:<20}{}\n", what, value); };
  line("relMSE", fmt::format("{:.6g}", c.rel_mse));
  line("MSE", fmt::format("{:.6g}", c.mse));
  line("mean ratio", fmt::format("{:.6f}", c.mean_ratio));
  line("FLIP", fmt::format("{:.5f}", c.flip_mean));
  line("largest difference",
       fmt::format("{:.6g} at {},{} in {}", c.largest.value, c.largest.x, c.largest.y, "RGB"[c.largest.channel]));
  line("block means",
       fmt::format("{0} of {1} x {1}: correlation {2:.5f}, scale {3:.5f}, deviation {4:.4f}", c.blocks.block_count,
                   block_size, c.blocks.correlation, c.blocks.scale, c.blocks.relative_deviation));
  line("differing pixels", fmt::format("{}", c.differing_pixels));
  if (c.not_finite_pixels > 0) line("not finite", fmt::format("{} pixels", c.not_finite_pixels));
  if (c.equality)
    line("statistical", fmt::format("least p {:.2g} of blocks (level {:.2g}), {:.2g} of pixels (level {:.2g}), "
                                    "largest cluster {}",
                                    c.equality->least_block_p, c.equality->block_level, c.equality->least_pixel_p,
                                    c.equality->pixel_level, c.equality->largest_cluster));
  line("verdict", fmt::format("{}: {}", c.equal ? "equal" : "different", c.reason));
}

std::vector<float> relative_difference(const Picture& a, const Picture& b) {
  std::vector<float> values(a.pixels.size());
  for (size_t i = 0; i < values.size(); ++i) {
    const Rgb &p = a.pixels[i], &q = b.pixels[i];
    const auto relative = [](float x, float y) { return std::fabs(x - y) / (std::fabs(y) + 0.1f); };
    const float d = std::max({relative(p.r, q.r), relative(p.g, q.g), relative(p.b, q.b)});
    values[i] = std::isfinite(d) ? d : 1.0f;
  }
  return values;
}

Result<PictureComparison> compare_files(const std::filesystem::path& a, const std::filesystem::path& b,
                                        const CompareImagesOptions& options) {
  SPILLWAY_ASSIGN(const Picture picture_a, read_picture(a));
  SPILLWAY_ASSIGN(const Picture picture_b, read_picture(b));
  SPILLWAY_ASSIGN(PictureComparison comparison, compare_pictures(picture_a, picture_b, options.metrics));
  if (!options.flip_png.empty())
    SPILLWAY_TRY(write_heat_png(options.flip_png, picture_a.width, picture_a.height, comparison.flip));
  if (!options.difference_png.empty())
    SPILLWAY_TRY(write_heat_png(options.difference_png, picture_a.width, picture_a.height,
                                relative_difference(picture_a, picture_b)));
  return comparison;
}

}  // namespace

int compare_images(const std::filesystem::path& a, const std::filesystem::path& b,
                   const CompareImagesOptions& options) {
  const auto comparison = compare_files(a, b, options);
  if (!comparison) return fail(comparison.error().message);
  if (options.json)
    fmt::print("{}\n", pipeline::json_text(to_json(*comparison)));
  else
    print_table(*comparison, options.metrics.block_size);
  return comparison->equal ? kExitOk : kExitDifferent;
}

}  // namespace spillway::tools
