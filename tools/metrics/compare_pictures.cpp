#include "tools/metrics/compare_pictures.h"

#include <cmath>

#include "tools/metrics/flip.h"

namespace spillway::tools {
namespace {

double mean_inside(std::span<const float> values, std::span<const uint8_t> mask) {
  double sum = 0;
  uint64_t count = 0;
  for (size_t i = 0; i < values.size(); ++i)
    if (mask[i]) sum += values[i], ++count;
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

// The first limit that is missed, or nothing.
std::optional<std::string> missed_limit(const PictureComparison& c, const CompareLimits& limits) {
  if (c.not_finite_pixels > 0 && !limits.same_bits) return fmt::format("{} pixels are not finite", c.not_finite_pixels);
  if (limits.same_bits && c.differing_pixels > 0) return fmt::format("{} pixels differ in bits", c.differing_pixels);
  if (limits.rel_mse && !(c.rel_mse <= *limits.rel_mse))
    return fmt::format("relMSE {:.3g} is above {:.3g}", c.rel_mse, *limits.rel_mse);
  if (limits.flip && !(c.flip_mean <= *limits.flip))
    return fmt::format("FLIP {:.3g} is above {:.3g}", c.flip_mean, *limits.flip);
  if (limits.correlation && !(c.blocks.correlation >= *limits.correlation))
    return fmt::format("correlation {:.4f} is below {:.4f}", c.blocks.correlation, *limits.correlation);
  if (limits.mean_deviation && !(std::fabs(c.mean_ratio - 1) <= *limits.mean_deviation))
    return fmt::format("mean ratio {:.4f} is more than {:.3g} from 1", c.mean_ratio, *limits.mean_deviation);
  if (limits.statistical && !c.equality->equal)
    return fmt::format("statistically different: {} blocks, {} pixels fail, {} connected", c.equality->failing_blocks,
                       c.equality->failing_pixels, c.equality->largest_cluster);
  return std::nullopt;
}

void judge(PictureComparison& c, CompareLimits limits) {
  const bool by_default = !limits.any();
  if (by_default && c.differing_pixels == 0) {
    c.equal = true, c.reason = "equal bits";
    return;
  }
  if (by_default) limits.statistical = c.equality.has_value(), limits.same_bits = !limits.statistical;
  const auto missed = missed_limit(c, limits);
  c.equal = !missed.has_value();
  c.reason = missed.value_or(limits.same_bits     ? "equal bits"
                             : limits.statistical ? "statistically equal"
                                                  : "within limits");
}

}  // namespace

Result<PictureComparison> compare_pictures(const Picture& a, const Picture& b, const ComparePicturesOptions& options) {
  if (a.width != b.width || a.height != b.height)
    return error("the pictures differ in size: {} x {} and {} x {}", a.width, a.height, b.width, b.height);
  if (options.block_size < 1 || options.equality.block_size < 1) return error("blocks must have at least one pixel");
  const bool halves = a.has_halves() && b.has_halves();
  if (options.limits.statistical && !halves)
    return error("statistical equality needs half buffers in both files; render them with half buffers");
  const std::vector<uint8_t> mask = metric_mask(a, b, options.excluded);
  PictureComparison c;
  c.mse = mse(a, b, mask), c.rel_mse = rel_mse(a, b, mask), c.mean_ratio = mean_ratio(a, b, mask);
  if (b.has_halves()) c.reference_noise = noise_rel_mse(b, mask);
  c.largest = largest_difference(a, b, mask);
  c.blocks = compare_blocks(a, b, mask, options.block_size);
  c.differing_pixels = differing_pixels(a, b);
  c.not_finite_pixels = not_finite_pixels(a) + not_finite_pixels(b);
  c.flip = flip(a, b, {.exposure_stops = options.exposure_stops});
  c.flip_mean = mean_inside(c.flip, mask);
  if (halves) c.equality = statistical_equality(a, b, mask, options.equality);
  judge(c, options.limits);
  return c;
}

}  // namespace spillway::tools
