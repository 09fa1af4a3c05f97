#include "pipeline/pack/pack_report.h"

#include <fmt/format.h>

#include <algorithm>

#include "cache/base/memory.h"
#include "cache/file.h"
#include "pipeline/json_text.h"
#include "pipeline/render/plan.h"

namespace spillway::pipeline {
namespace {

cache::IoUse pack_io() {
  cache::IoUse sum = cache::io_use(cache::IoPurpose::pack);
  const cache::IoUse scene = cache::io_use(cache::IoPurpose::scene);
  sum.read_bytes += scene.read_bytes, sum.written_bytes += scene.written_bytes;
  return sum;
}

double millions_per_second(uint64_t count, double seconds) {
  return seconds > 0 ? static_cast<double>(count) / seconds * 1e-6 : 0;
}

}  // namespace

PackStep& PackReport::step(const std::string& name) {
  const auto found = std::ranges::find(steps, name, &PackStep::name);
  if (found != steps.end()) return *found;
  return steps.emplace_back(PackStep{.name = name});
}

PackStepTimer::PackStepTimer(PackReport& report, const std::string& name) : report_(report), name_(name) {
  report_.step(name_);
  const cache::IoUse io = pack_io();
  read_bytes_ = io.read_bytes, written_bytes_ = io.written_bytes;
}

PackStepTimer::~PackStepTimer() {
  PackStep& step = report_.step(name_);
  step.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  const cache::IoUse io = pack_io();
  step.read_bytes += io.read_bytes - read_bytes_, step.written_bytes += io.written_bytes - written_bytes_;
}

std::string report_json(const PackReport& r) {
  nlohmann::json steps = nlohmann::json::array();
  for (const PackStep& s : r.steps)
    steps.push_back({{"step", s.name},
                     {"seconds", s.seconds},
                     {"thread_seconds", s.thread_seconds},
                     {"read_bytes", s.read_bytes},
                     {"written_bytes", s.written_bytes}});
  return json_text(nlohmann::json{{"steps", steps},
                                  {"seconds", r.seconds},
                                  {"triangles", r.triangle_count},
                                  {"triangles_per_second", millions_per_second(r.triangle_count, r.seconds) * 1e6},
                                  {"meshes", r.mesh_count},
                                  {"instances", r.instance_count},
                                  {"pages", r.page_count},
                                  {"attribute_blocks", r.attribute_block_count},
                                  {"sets", r.set_count},
                                  {"passes", r.pass_count},
                                  {"largest_set_triangles", r.largest_set_triangles},
                                  {"diced_cages", r.dice.cage_count},
                                  {"diced_triangles", r.dice.triangle_count},
                                  {"diced_cages_found", r.dice.cached_cage_count},
                                  {"diced_triangles_found", r.dice.cached_triangle_count},
                                  {"notes", r.notes},
                                  {"pack_tag_peak_bytes", memory_use(MemoryTag::pack).peak_bytes},
                                  {"resident_peak_bytes", resident_memory().peak_bytes}});
}

std::string report_table(const PackReport& r) {
  std::string text = fmt::format("{} triangles, {} meshes, {} instances in {} pages: {:.2f} s, {:.2f} M triangles/s\n",
                                 r.triangle_count, r.mesh_count, r.instance_count, r.page_count, r.seconds,
                                 millions_per_second(r.triangle_count, r.seconds));
  text += fmt::format("  {:<16} {:>8} {:>7} {:>9} {:>12} {:>12}\n", "step", "seconds", "share", "threads'", "read",
                      "written");
  for (const PackStep& s : r.steps)
    text += fmt::format("  {:<16} {:>8.2f} {:>5.1f} % {:>9} {:>12} {:>12}\n", s.name, s.seconds,
                        r.seconds > 0 ? 100 * s.seconds / r.seconds : 0.0,
                        s.thread_seconds > 0 ? fmt::format("{:.2f}", s.thread_seconds) : "", bytes_text(s.read_bytes),
                        bytes_text(s.written_bytes));
  if (r.dice.cage_count > 0)
    text += fmt::format("  {} cages into {} triangles; of these {} into {} were diced before\n", r.dice.cage_count,
                        r.dice.triangle_count, r.dice.cached_cage_count, r.dice.cached_triangle_count);
  return text + fmt::format("  {} sets of at most {} triangles held, {} passes to cut them; {} resident at most\n",
                            r.set_count, r.largest_set_triangles, r.pass_count,
                            bytes_text(resident_memory().peak_bytes));
}

}  // namespace spillway::pipeline
