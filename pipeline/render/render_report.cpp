#include "pipeline/render/render_report.h"

#include "pipeline/json_text.h"


namespace spillway::pipeline {
namespace {

using nlohmann::json;

// Before main, after the libraries are linked in: what no option can shed.
const uint64_t floor_at_start = resident_memory().current_bytes;

json parts_json(const cache::PartStoreCounters& c) {
  return {{"read", c.parts_read},          {"read_again", c.parts_read_again}, {"evicted", c.parts_evicted},
          {"bytes_read", c.bytes_read},    {"unique_bytes", c.unique_bytes},   {"wait_seconds", c.wait_seconds}};
}

json plan_json(const Plan& p) {
  return {{"wave_paths", p.wave_paths},
          {"parked_rays", p.parked_rays},
          {"spills", p.spills},
          {"page_bytes", p.page_bytes},
          {"attribute_bytes", p.attribute_bytes},
          {"texture_bytes", p.texture_bytes},
          {"volume_bytes", p.volume_bytes},
          {"memory_bytes", p.memory_bytes},
          {"predicted_seconds", p.predicted_seconds},
          {"predicted_waves", p.predicted_waves},
          {"predicted_page_bytes", p.predicted_page_bytes},
          {"predicted_spill_bytes", p.predicted_spill_bytes},
          {"predicted_scratch_bytes", p.predicted_scratch_bytes}};
}

json textures_json(const cache::TextureCounters& c) {
  return {{"lookups", c.lookups},
          {"tiles_touched", c.tiles_touched},
          {"unique_bytes", c.unique_bytes},
          {"tiles_read", c.tiles_read},
          {"bytes_read", c.bytes_read},
          {"wave_tiles_touched", c.wave_tiles_touched},
          {"wave_unique_bytes", c.wave_unique_bytes},
          {"tiles_read_again", c.tiles_read_again}};
}

json wave_json(const WaveReport& w) {
  json wave = {{"paths", w.path_count},
          {"shadow_rays", w.shadow_count},
          {"generated", w.generated_count},
          {"sort_seconds", w.sort_seconds},
          {"trace_seconds", w.trace_seconds},
          {"route_seconds", w.route_seconds},
          {"shade_seconds", w.shade_seconds},
          {"pages_touched", w.pages_touched},
          {"pairs", w.pair_count},
          {"windows", w.window_count},
          {"partitions", w.partition_count},
          {"spilled_bytes", w.spilled_bytes}};
  if (w.textures.lookups > 0) wave["textures"] = textures_json(w.textures);
  return wave;
}

json stages_json(const RenderReport& r) {
  double sort = 0, trace = 0, route = 0, shade = 0;
  for (const WaveReport& w : r.waves)
    sort += w.sort_seconds, trace += w.trace_seconds, route += w.route_seconds, shade += w.shade_seconds;
  return {{"generate_rays", {{"seconds", r.generate_seconds}}},
          {"sort_rays", {{"seconds", sort}}},
          {"trace_rays",
           {{"seconds", trace},
            {"rays", r.trace.ray_count},
            {"pairs", r.trace.pair_count},
            {"windows", r.trace.window_count},
            {"parked", r.trace.parked_count},
            {"pages_touched", r.trace.pages_touched},
            {"nodes", r.trace.work.nodes},
            {"leaves", r.trace.work.leaves}, {"page_visits", r.trace.work.pages}}},
          {"route_hits",
           {{"seconds", route},
            {"hits", r.route.hit_count},
            {"escaped", r.route.escaped_count},
            {"arrived", r.route.arrived_count},
            {"occluded", r.route.occluded_count},
            {"alpha_shadows", r.route.alpha_shadow_count}}},
          {"shade_hits",
           {{"seconds", shade},
            {"shaded", r.shade.shaded_count},
            {"let_through", r.shade.let_through_count},
            {"paths", r.shade.path_count},
            {"shadow_rays", r.shade.shadow_count},
            {"partitions", r.shade.partition_count},
            {"attribute_blocks_touched", r.shade.attribute_blocks_touched}}}};
}

// Only in scenes that have media.
json track_json(const RenderReport& r) {
  double seconds = 0;
  for (const WaveReport& w : r.waves) seconds += w.track_seconds;
  return {{"seconds", seconds},
          {"segments", r.track.segment_count},
          {"collisions", r.track.collision_count},
          {"runs", r.track.run_count},
          {"steps", r.track.step_count},
          {"rounds", r.track.round_count},
          {"bricks_touched", r.track.bricks_touched},
          {"bounded", r.track.bounded_count},
          {"other_medium", r.shade.other_medium_count}};
}

json error_json(const RenderReport& r) {
  json error = {{"asked", r.error_asked > 0 ? json(r.error_asked) : json()}};
  if (!r.error) return error;
  error["relative_error"] = r.error->relative_error(), error["bound"] = r.error->relative_error_bound();
  error["rel_mse"] = r.error->rel_mse, error["rel_mse_standard_error"] = r.error->standard_error;
  if (r.error_asked > 0) error["reached"] = r.error->relative_error_bound() <= r.error_asked;
  return error;
}

// What ran, with its counts, and what was left out, by kind.
void add_parts(const RenderReport& r, json& report) {
  for (const UsedPart& part : r.parts)
    if (part.count > 0)
      report["ran"][part.kind][part.name] = part.count;
    else
      report["left_out"][part.kind].push_back(part.name);
}

void add_costs(const RenderReport& r, json& report) {
  for (const NamedCost& cost : r.costs) report["costs"]["total"][cost.name] = cost.count;
  for (const NamedCost& mesh : r.dearest_meshes)
    report["costs"]["meshes"].push_back({{"name", mesh.name}, {"scatterings", mesh.count}});
  for (const NamedCost& texture : r.dearest_textures)
    report["costs"]["textures"].push_back({{"name", texture.name}, {"lookups", texture.count}});
}

std::string costs_lines(const RenderReport& r) {
  std::string lines = r.costs.empty() ? "" : "costs\n";
  for (const NamedCost& cost : r.costs) lines += fmt::format("  {:<16} {:>14}\n", cost.name, cost.count);
  for (const NamedCost& mesh : r.dearest_meshes)
    lines += fmt::format("  mesh {}: {} scatterings\n", mesh.name, mesh.count);
  for (const NamedCost& t : r.dearest_textures) lines += fmt::format("  texture {}: {} lookups\n", t.name, t.count);
  return lines;
}

std::string left_out_line(const RenderReport& r) {
  std::string line = "left out\n ";
  for (const UsedPart& part : r.parts)
    if (part.count == 0) line += fmt::format(" {}", part.name);
  return line + "\n";
}

std::string error_line(const RenderReport& r) {
  if (!r.error) return "";
  std::string line = fmt::format("relative error {:.4f}, below {:.4f} with 95 %", r.error->relative_error(),
                                 r.error->relative_error_bound());
  if (r.error_asked > 0) line += fmt::format("; {} was asked for, ended by {}", r.error_asked, name(r.ended_by));
  return line + "\n";
}

json memory_json(const RenderReport& r) {
  json tags;
  for (int i = 0; i < kMemoryTagCount; ++i) tags[name(static_cast<MemoryTag>(i))] = r.memory[i].peak_bytes;
  return {{"peak_by_tag", tags},
          {"tags_peak_bytes", r.memory_total.peak_bytes},
          {"resident_peak_bytes", r.resident.peak_bytes},
          {"floor_bytes", r.floor_bytes},
          {"untagged_bytes", r.untagged_bytes}};
}

json io_json(const RenderReport& r) {
  json purposes;
  for (int i = 0; i < cache::kIoPurposeCount; ++i) {
    const cache::IoUse& use = r.io[i];
    if (use.read_count + use.write_count == 0) continue;
    purposes[name(static_cast<cache::IoPurpose>(i))] = {
        {"read_bytes", use.read_bytes}, {"reads", use.read_count},
        {"written_bytes", use.written_bytes}, {"writes", use.write_count}};
  }
  return {{"by_purpose", purposes},
          {"process_read_bytes", r.process_io.read_chars},
          {"process_written_bytes", r.process_io.written_chars},
          {"device_read_bytes", r.process_io.device_read_bytes},
          {"device_written_bytes", r.process_io.device_written_bytes},
          {"direct", r.direct_io}};
}

std::string stage_line(const char* stage, double seconds, double total) {
  return fmt::format("  {:<14} {:>9.2f} s {:>5.1f} %\n", stage, seconds, total > 0 ? 100 * seconds / total : 0.0);
}

std::string parts_line(const char* what, const cache::PartStoreCounters& c) {
  return fmt::format("  {:<14} {:>10} read, {} unique; {} reads, {} of them again; {} evicted\n", what,
                     bytes_text(c.bytes_read), bytes_text(c.unique_bytes), c.parts_read, c.parts_read_again,
                     c.parts_evicted);
}

}  // namespace

const char* name(RenderEnd end) {
  static constexpr const char* kNames[] = {"samples", "error", "time", "stop"};
  return kNames[static_cast<size_t>(end)];
}

uint64_t memory_floor_bytes() { return floor_at_start; }

std::string report_json(const RenderReport& r, const std::string& scene) {
  json waves = json::array();
  for (const WaveReport& w : r.waves) waves.push_back(wave_json(w));
  json report = {{"scene", scene},
                 {"samples_per_pixel", r.samples_per_pixel},
                 {"half_samples", r.half_samples},
                 {"epochs", r.epoch_count},
                 {"ended_by", name(r.ended_by)},
                 {"stopped_early", r.stopped_early()},
                 {"error", error_json(r)},
                 {"seconds", r.seconds},
                 {"image_hash", r.image_hash},
                 {"not_finite_count", r.faults.not_finite_count},
                 {"out_of_range_count", r.faults.out_of_range_count},
                 {"plan", plan_json(r.plan)},
                 {"stages", stages_json(r)},
                 {"pages", parts_json(r.pages)},
                 {"attributes", parts_json(r.attributes)},
                 {"spilled_bytes", r.spilled_bytes},
                 {"scratch_peak_bytes", r.scratch_peak_bytes},
                 {"memory", memory_json(r)},
                 {"io", io_json(r)},
                 {"waves", waves}};
  add_parts(r, report);
  add_costs(r, report);
  if (r.has_media) {
    report["stages"]["track_media"] = track_json(r);
    report["camera_medium"] = r.camera_medium == kNoMedium ? json() : json(r.camera_medium);
    report["volumes"] = parts_json(r.volumes);
  }
  if (r.has_textures)
    report["textures"] = textures_json(r.textures);
  if (!r.texture_advice.empty()) report["textures"]["advice"] = r.texture_advice;
  for (const TextureReport& t : r.by_texture) {
    if (t.counters.lookups == 0) continue;
    json one = textures_json(t.counters);
    one["name"] = t.name, one["kind"] = t.is_face_texture ? "face" : "image";
    report["textures"]["by_texture"].push_back(one);
  }
  return json_text(report);
}

std::string report_table(const RenderReport& r) {
  double sort = 0, trace = 0, track = 0, route = 0, shade = 0;
  for (const WaveReport& w : r.waves) {
    sort += w.sort_seconds, trace += w.trace_seconds, track += w.track_seconds;
    route += w.route_seconds, shade += w.shade_seconds;
  }
  std::string text = fmt::format("{} samples a pixel in {} epochs, {} waves, {:.2f} s; {:.2f} M rays/s\n",
                                 r.samples_per_pixel, r.epoch_count, r.waves.size(), r.seconds,
                                 r.seconds > 0 ? static_cast<double>(r.trace.ray_count) / r.seconds * 1e-6 : 0.0);
  text += error_line(r) + "stages\n" + stage_line("generate_rays", r.generate_seconds, r.seconds) +
          stage_line("sort_rays", sort, r.seconds) + stage_line("trace_rays", trace, r.seconds) +
          (r.has_media ? stage_line("track_media", track, r.seconds) : "") + stage_line("route_hits", route, r.seconds) + stage_line("shade_hits", shade, r.seconds);
  text += fmt::format("rays\n  {} traced, {} hits shaded, {} escaped, {} shadow rays arrived, {} occluded\n",
                      r.trace.ray_count, r.shade.shaded_count, r.route.escaped_count, r.route.arrived_count,
                      r.route.occluded_count);
  if (r.has_media)
    text += fmt::format("media\n  {} segments, {} collisions, {} steps\n", r.track.segment_count,
                        r.track.collision_count, r.track.step_count);
  if (r.shade.other_medium_count > 0)
    text += fmt::format("  {} times a surface was met in another medium than it says is there: does it close?\n",
                        r.shade.other_medium_count);
  if (r.track.bounded_count > 0)
    text += fmt::format("  {} cells took more than {} steps: their rest was passed as if it were empty, which is too bright\n",
                        r.track.bounded_count, shading::kMaxCellSteps);
  text += "store\n" + parts_line("pages", r.pages) + parts_line("attributes", r.attributes);
  if (r.volumes.unique_bytes > 0) text += parts_line("volumes", r.volumes);
  if (r.has_textures)
    text += fmt::format("  {:<14} {:>10} read, {} unique; {} lookups, {} tiles, {} of them again\n", "textures",
                        bytes_text(r.textures.bytes_read), bytes_text(r.textures.unique_bytes), r.textures.lookups,
                        r.textures.tiles_read, r.textures.tiles_read_again);
  if (!r.texture_advice.empty())
    text += fmt::format("  warning: texture tiles were read again in a wave; {} would stop it\n", r.texture_advice);
  text += fmt::format("spilled\n  {} written, {} of scratch at most\n", bytes_text(r.spilled_bytes),
                      bytes_text(r.scratch_peak_bytes));
  text += costs_lines(r) + left_out_line(r) + "memory, peak\n";
  for (int i = 0; i < kMemoryTagCount; ++i)
    if (r.memory[i].peak_bytes > 0)
      text += fmt::format("  {:<14} {:>10}\n", name(static_cast<MemoryTag>(i)), bytes_text(r.memory[i].peak_bytes));
  text += fmt::format("  {:<14} {:>10}  (floor {}, tags {}, untagged {})\n", "resident",
                      bytes_text(r.resident.peak_bytes), bytes_text(r.floor_bytes),
                      bytes_text(r.memory_total.peak_bytes), bytes_text(r.untagged_bytes));
  return text;
}

}  // namespace spillway::pipeline
