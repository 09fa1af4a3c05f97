#include "tools/lab/measure.h"

#include <malloc.h>

#include <chrono>
#include <fstream>

namespace spillway::tools::lab {
namespace {

// The highest resident set counts from here (proc(5), clear_refs). Without the right to, it counts from the start.
void reset_resident_peak() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";
}

double weighed_square(float difference, float reference) {
  const double d = difference, r = reference;
  return d * d / (r * r + 0.01);
}

}  // namespace

Picture picture_of(const pipeline::Film& film) {
  const pipeline::FilmWindow& window = film.shape().window;
  Picture picture;
  picture.width = static_cast<int>(window.width()), picture.height = static_cast<int>(window.height());
  const bool has_halves = film.half_samples(1) > 0;
  for (uint32_t y = window.y0; y < window.y1; ++y)
    for (uint32_t x = window.x0; x < window.x1; ++x) {
      picture.pixels.push_back(film.pixel(x, y));
      if (!has_halves) continue;
      picture.half_a.push_back(film.half_pixel(0, x, y)), picture.half_b.push_back(film.half_pixel(1, x, y));
    }
  picture.weight_a = static_cast<double>(film.half_samples(0)) / film.samples();
  return picture;
}

double noise_of_halves(const Picture& p) {
  if (!p.has_halves()) return 0;
  double sum = 0;
  for (size_t i = 0; i < p.pixels.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const auto channel = [&](const Rgb& v) { return c == 0 ? v.r : c == 1 ? v.g : v.b; };
      sum += weighed_square(channel(p.half_a[i]) - channel(p.half_b[i]), channel(p.pixels[i]));
    }
  return p.weight_a * (1 - p.weight_a) * sum / (3 * static_cast<double>(p.pixels.size()));
}

Result<MeasuredPicture> render_measured(const pipeline::Store& store, const pipeline::RenderOptions& options) {
  reset_resident_peak();
  const uint64_t before = resident_memory().current_bytes, floor = pipeline::memory_floor_bytes();
  const uint64_t beside = before > floor ? before - floor : 0;
  const auto begin = std::chrono::steady_clock::now();
  SPILLWAY_ASSIGN(const pipeline::RenderedImage image, pipeline::render_image(store, options));
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  const pipeline::RenderReport& report = image.report;
  if (report.faults.any())
    return error("{} contributions were not finite and {} out of range: nothing can be measured with them",
                 report.faults.not_finite_count, report.faults.out_of_range_count);
  MeasuredPicture measured{{}, picture_of(*image.film)};
  Measurement& row = measured.row;
  row.spp = report.samples_per_pixel, row.seed = options.settings.render.seed;
  row.samples = static_cast<double>(row.spp) * static_cast<double>(measured.picture.pixels.size());
  row.seconds = seconds.count();
  for (const cache::IoUse& use : report.io) row.read_bytes += use.read_bytes, row.written_bytes += use.written_bytes;
  row.peak_bytes = report.resident.peak_bytes - std::min(report.resident.peak_bytes, beside);
  row.image_hash = report.image_hash;
  return measured;
}

}  // namespace spillway::tools::lab
