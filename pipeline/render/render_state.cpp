#include "pipeline/render/render_state.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "pipeline/render/used_parts.h"

namespace spillway::pipeline {
namespace {

constexpr uint64_t kProbePages = 16;  // in memory while the tops of all are read: reads are as far ahead as in sweeps

std::vector<cache::Part> page_parts(const Store& store) {
  std::vector<cache::Part> parts;
  for (const cache::PageLocation& page : store.pages()) parts.push_back({page.offset_bytes, page.size_bytes});
  return parts;
}

std::vector<cache::Part> attribute_parts(const Store& store) {
  std::vector<cache::Part> parts;
  for (const AttributeLocation& block : store.attributes()) parts.push_back({block.offset_bytes, block.size_bytes});
  return parts;
}

// Tells the log of every visit of a sweep.
std::function<void(uint32_t, bool)> access_log(const RenderState& state, bool of_pages) {
  AccessLog* const log = state.options.access_log;
  if (log == nullptr) return {};
  return [log, of_pages](uint32_t part, bool read) {
    if (log->waves.empty() || log->is_over) return;
    WaveAccess& wave = log->wave();
    if (of_pages) wave.swept_pages.push_back(part);
    if (read) (of_pages ? wave.read_pages : wave.read_attribute_blocks).push_back(part);
  };
}

cache::PartStore::Options part_options(const RenderState& state, MemoryTag tag, cache::IoPurpose purpose,
                                       uint64_t limit) {
  return {.tag = tag, .purpose = purpose, .memory_limit_bytes = limit,
          .read_ahead_bytes = state.plan.read_ahead_bytes,
          .reads_ahead = state.options.read_ahead ? UINT32_MAX : 0u, .direct = state.options.direct_io,
          .access_log = access_log(state, tag == MemoryTag::pages)};
}

// Of each page; none when pages are small.
uint32_t top_nodes(const RenderState& state) {
  if (state.store.pages().empty()) return 0;
  return static_cast<uint32_t>(state.plan.page_top_bytes / state.store.pages().size() / sizeof(cache::TraceNode));
}

// The tops of all pages, for any budget, read through some pages of memory.
Status open_needs(RenderState& state) {
  if (state.options.access_log == nullptr || state.options.log_parked) return {};
  const Store& store = state.store;
  const std::vector<cache::Part> parts = page_parts(store);
  cache::PartStore::Options options{.tag = MemoryTag::trace_log, .purpose = cache::IoPurpose::pages,
                                    .memory_limit_bytes = kProbePages * cache::PartStore::smallest_limit_bytes(parts),
                                    .read_ahead_bytes = state.plan.read_ahead_bytes, .direct = state.options.direct_io};
  SPILLWAY_ASSIGN(const auto pages, cache::PartStore::open(store.trace_pages_path(), parts, options, cache::validate_trace_page));
  state.needs = std::make_unique<NeedsLog>(store.page_tree(), *state.options.access_log,
                                           NeedsLog::sampled_of(state.options.access_log->facts.scene));
  return state.needs->read_tops(*pages, top_nodes(state));
}

Status open_geometry(RenderState& state) {
  const Store& store = state.store;
  SPILLWAY_ASSIGN(state.page_parts,
                  cache::PartStore::open(store.trace_pages_path(), page_parts(store),
                                         part_options(state, MemoryTag::pages, cache::IoPurpose::pages,
                                                      state.plan.page_bytes),
                                         cache::validate_trace_page));
  state.pages = std::make_unique<PageViews>(
      *state.page_parts, state.plan.pages_fit || !state.options.page_tops ? 0 : top_nodes(state));
  SPILLWAY_TRY(open_needs(state));
  SPILLWAY_ASSIGN(auto attributes,
                  cache::PartStore::open(store.attributes_path(), attribute_parts(store),
                                         part_options(state, MemoryTag::attributes, cache::IoPurpose::attributes,
                                                      state.plan.attribute_bytes),
                                         cache::validate_attribute_block));
  state.attributes = std::make_unique<AttributeStore>(std::move(attributes), store.attributes());
  return {};
}

// A scene without grids has no store of bricks.
Status open_volumes(RenderState& state) {
  state.medium_tables = SelectedMedia(state.store, state.options.settings.render.majorants);
  const MediumTables& tables = state.medium_tables.tables();
  state.media = {tables, nullptr, state.options.settings.render.seed};
  if (tables.volumes.bricks.empty()) return {};
  std::vector<cache::Part> parts;
  for (const cache::VolumeBrickLocation& brick : tables.volumes.bricks) parts.push_back({brick.offset_bytes, brick.size_bytes});
  auto options = part_options(state, MemoryTag::volumes, cache::IoPurpose::volumes, state.plan.volume_bytes);
  SPILLWAY_ASSIGN(auto store, cache::PartStore::open(state.store.volumes_path(), std::move(parts), options,
                                                     cache::validate_volume_brick));
  state.volumes = std::make_unique<VolumeStore>(std::move(store));
  state.media.volumes = state.volumes.get();
  if (!state.volumes->parts().fits()) return {};
  // All of it is in memory from here on: segments find their bricks without sweeps.
  std::vector<uint32_t> all(tables.volumes.bricks.size());
  std::iota(all.begin(), all.end(), 0u);
  return state.volumes->parts().sweep(all, [](uint32_t, std::span<const std::byte>) -> Status { return {}; });
}

std::filesystem::path scratch_directory(const RenderState& state) {
  const std::filesystem::path& asked = state.options.scratch_directory;
  return asked.empty() ? std::filesystem::temp_directory_path() : asked;
}

// A scene that looks up no images has no texture cache.
Status open_textures(RenderState& state) {
  const Store& store = state.store;
  if (looks_up_images(store)) {
    const cache::TextureCache::Options options{state.plan.texture_bytes, state.options.direct_io,
                                               state.options.access_log != nullptr};
    SPILLWAY_ASSIGN(state.textures, cache::TextureCache::open(store.textures_path(), store.images(), options,
                                                              store.face_containers(), store.face_textures()));
    if (AccessLog* const log = state.options.access_log)
      SPILLWAY_TRY(log->tiles.open(scratch_directory(state), state.textures->file_bytes_of_tiles()));
  }
  state.texture_nodes = SelectedTextures(store, state.options.settings.render.texture_filter);
  state.evaluator = std::make_unique<TextureEvaluator>(state.texture_nodes.nodes(), state.textures.get());
  return {};
}

Status open_scratch(RenderState& state) {
  if (!state.plan.spills && state.options.hit_sort_bytes == 0) return {};
  SPILLWAY_ASSIGN(state.scratch, cache::Scratch::create(scratch_directory(state), state.options.scratch_limit_bytes));
  return {};
}

void connect(RenderState& state) {
  const Store& store = state.store;
  const SceneSettings& settings = state.options.settings;
  ShadeInputs& in = state.inputs;
  state.lights = SelectedLights(store, settings.render);
  // And the shutter of the frame.
  in.settings = {state.lights.table(), std::min(settings.render.max_depth, kMostBounces), settings.render.seed,
                 settings.render.sampler};
  in.settings.media = store.medium_tables().media;
  in.settings.estimator = settings.render.estimator, in.settings.roulette = settings.render.roulette != 0;
  in.tables = {store.meshes(), store.materials(), state.evaluator.get()};
  if (const shading::LightTable& lights = in.settings.lights; !lights.places.empty())
    in.tables.emissions = lights.emissions, in.tables.emitters = lights.emitters;
  in.instances = store.page_tree().instances;
  in.motions = store.motions();
  state.resolver = std::make_unique<MaterialResolver>(in.tables, settings.render.seed);
  in.resolver = state.resolver.get();
  in.wants_aovs = state.options.aov_layers;
  in.hits_are_sorted = state.options.sort_hits, in.hits_come_in_runs = state.options.hit_batch_rays != 0;
  in.stages_face_textures =
      state.options.read_ahead_textures && state.textures && state.textures->has_face_textures();
}

}  // namespace

Status open_render_state(RenderState& state) {
  const RenderOptions& options = state.options;
  PlanOptions& plan_options = state.plan_options;
  plan_options = options.plan;
  plan_options.floor_bytes = memory_floor_bytes();
  // A log speaks for any budget: its waves must not depend on what is in memory.
  plan_options.parks = options.park_rays && (options.access_log == nullptr || options.log_parked);
  state.facts = scene_facts(state.store, options);
  SPILLWAY_ASSIGN(state.plan, plan_render(state.facts, plan_options));
  // A log foretells waves no smaller than its own.
  if (options.access_log != nullptr && plan_options.wave_paths == 0 && state.plan.pages_fit) {
    plan_options.wave_paths = std::min(state.plan.wave_paths, kInCoreWavePaths);
    SPILLWAY_ASSIGN(state.plan, plan_render(state.facts, plan_options));
  }
  if (AccessLog* const log = options.access_log) {
    log->facts.scene = state.facts;
    log->facts.rays_are_parked = options.log_parked ? 1 : 0;
    log->facts.scene.table_bytes -= memory_use(MemoryTag::trace_log).current_bytes;  // of this run
  }
  if (options.hit_sort_bytes != 0) state.plan.hit_bytes = options.hit_sort_bytes;
  SPILLWAY_TRY(open_scratch(state));
  SPILLWAY_TRY(open_geometry(state));
  SPILLWAY_TRY(open_textures(state));
  SPILLWAY_TRY(open_volumes(state));
  connect(state);
  return {};
}

Status open_film(RenderState& state) {
  const RenderOptions& options = state.options;
  SPILLWAY_ASSIGN(Film film, Film::create(film_shape(options.settings, options.aov_layers),
                                          film_identity(state.store, options.settings)));
  state.film = std::make_unique<Film>(std::move(film));
  if (options.cost_layers)
    state.costs = std::make_unique<PixelCosts>(
        state.film->shape(), state.store.meshes().size(),
        cache::TextureCache::tile_count(state.store.images(), state.store.face_containers()));
  state.inputs.costs = state.costs.get();
  return {};
}

CountersBefore::CountersBefore(const RenderState& state)
    : pages(state.page_parts->counters()), attributes(state.attributes->parts().counters()) {
  if (state.textures) textures = state.textures->counters_by_texture();
  if (state.volumes) volumes = state.volumes->parts().counters();
}

std::array<cache::IoUse, cache::kIoPurposeCount> CountersBefore::io() {
  std::array<cache::IoUse, cache::kIoPurposeCount> use;
  for (int i = 0; i < cache::kIoPurposeCount; ++i) use[i] = cache::io_use(static_cast<cache::IoPurpose>(i));
  return use;
}

namespace {

void fill_io(const CountersBefore& before, RenderReport& report) {
  report.io = CountersBefore::io();
  for (int i = 0; i < cache::kIoPurposeCount; ++i) {
    cache::IoUse& use = report.io[i];
    const cache::IoUse& then = before.by_purpose[i];
    use.read_bytes -= then.read_bytes, use.read_count -= then.read_count;
    use.written_bytes -= then.written_bytes, use.write_count -= then.write_count;
  }
  const cache::ProcessIo now = cache::process_io();
  report.process_io = {now.read_chars - before.process.read_chars, now.written_chars - before.process.written_chars,
                       now.device_read_bytes - before.process.device_read_bytes,
                       now.device_written_bytes - before.process.device_written_bytes};
}

cache::PartStoreCounters gained(cache::PartStoreCounters now, const cache::PartStoreCounters& before) {
  now.parts_read -= before.parts_read, now.parts_read_again -= before.parts_read_again;
  now.parts_evicted -= before.parts_evicted, now.bytes_read -= before.bytes_read;
  now.unique_bytes -= before.unique_bytes, now.wait_seconds -= before.wait_seconds;
  return now;
}

// What would hold the tiles of a wave. A larger budget may come with larger waves: then, all that the frame touched.
std::string texture_advice(const RenderState& state) {
  const uint64_t of_waves = state.textures->limit_for_waves(), of_frame = state.textures->limit_for_touched();
  const auto whole_mib = [](uint64_t bytes) { return (bytes + (1 << 20) - 1) >> 20; };
  if (state.plan_options.texture_bytes != 0) return fmt::format("--texture-share {}MiB", whole_mib(of_waves));
  PlanOptions options = state.plan_options;
  options.memory_bytes = budget_for_textures(state.facts, options, of_waves);
  const Result<Plan> plan = plan_render(state.facts, options);
  const bool has_larger_waves = plan && plan->wave_paths > state.plan.wave_paths;
  return fmt::format("--memory {}MiB", whole_mib(has_larger_waves ? budget_for_textures(state.facts, options, of_frame)
                                                                  : options.memory_bytes));
}

void fill_texture_report(const RenderState& state, const CountersBefore& before, RenderReport& report) {
  const std::vector<cache::TextureCounters> now = state.textures->counters_by_texture();
  const size_t image_count = state.store.images().size();
  for (size_t i = 0; i < now.size(); ++i) {
    const bool is_face = i >= image_count;
    const uint32_t index = static_cast<uint32_t>(is_face ? i - image_count : i);
    std::string name =
        is_face ? state.store.name_of("face_texture", index) : std::string(state.store.images()[i].file_name);
    report.by_texture.push_back({std::move(name), is_face, cache::gained(now[i], before.textures[i])});
    report.textures += report.by_texture.back().counters;
  }
  const bool thrashes = report.textures.tiles_read_again * 20 > report.textures.wave_tiles_touched;
  if (thrashes) report.texture_advice = texture_advice(state);
}

// The first ten of what cost most, ties in order.
void keep_dearest(std::vector<NamedCost>& costs) {
  std::ranges::stable_sort(costs, std::ranges::greater{}, &NamedCost::count);
  costs.resize(std::min<size_t>(costs.size(), 10));
}

void fill_costs(const RenderState& state, RenderReport& report) {
  for (uint32_t c = 0; c < kCostCount; ++c)
    report.costs.push_back({name(static_cast<Cost>(c)), state.costs->total(static_cast<Cost>(c))});
  std::vector<std::pair<uint64_t, uint32_t>> meshes;
  const std::span<const uint64_t> by_mesh = state.costs->by_mesh();
  for (uint32_t mesh = 0; mesh < by_mesh.size(); ++mesh)
    if (by_mesh[mesh] > 0) meshes.emplace_back(by_mesh[mesh], mesh);
  std::ranges::sort(meshes, [](const auto& a, const auto& b) { return a.first != b.first ? a.first > b.first : a.second < b.second; });
  meshes.resize(std::min<size_t>(meshes.size(), 10));
  for (const auto& [count, mesh] : meshes)
    report.dearest_meshes.push_back({fmt::format("{} {}", mesh, state.store.name_of("mesh", mesh)), count});
  for (const TextureReport& t : report.by_texture)
    if (t.counters.lookups > 0) report.dearest_textures.push_back({t.name, t.counters.lookups});
  keep_dearest(report.dearest_textures);
}

}  // namespace

Status fill_log(const RenderState& state, const RenderReport& report) {
  AccessLog& log = *state.options.access_log;
  log.is_over = true;
  if (state.needs) SPILLWAY_TRY(state.needs->find_occluders(*state.page_parts));
  log.facts.wave_paths = state.plan.wave_paths;
  log.facts.memory_bytes = state.options.plan.memory_bytes;
  log.facts.page_bytes_read = report.pages.bytes_read, log.facts.attribute_bytes_read = report.attributes.bytes_read;
  log.facts.seconds = report.seconds, log.facts.log_seconds = report.log_seconds;
  log.facts.page_wait_seconds = report.pages.wait_seconds, log.facts.attribute_wait_seconds = report.attributes.wait_seconds;
  log.page_bytes.clear(), log.attribute_bytes.clear();
  for (const cache::PageLocation& page : state.store.pages()) log.page_bytes.push_back(page.size_bytes);
  for (const AttributeLocation& block : state.store.attributes()) log.attribute_bytes.push_back(block.size_bytes);
  return {};
}

void fill_report(const RenderState& state, const CountersBefore& before, RenderReport& report) {
  report.plan = state.plan;
  report.pages = gained(state.page_parts->counters(), before.pages);
  report.attributes = gained(state.attributes->parts().counters(), before.attributes);
  if (state.volumes) report.volumes = gained(state.volumes->parts().counters(), before.volumes);
  report.has_textures = state.textures != nullptr;
  if (state.textures) fill_texture_report(state, before, report);
  if (state.scratch) report.scratch_peak_bytes = state.scratch->peak_bytes();
  report.direct_io = state.options.direct_io;
  fill_io(before, report);
  for (int i = 0; i < kMemoryTagCount; ++i) report.memory[i] = memory_use(static_cast<MemoryTag>(i));
  report.memory_total = memory_total();
  report.resident = resident_memory();
  report.floor_bytes = memory_floor_bytes();
  const uint64_t known = report.memory_total.peak_bytes + report.floor_bytes;
  report.untagged_bytes = report.resident.peak_bytes > known ? report.resident.peak_bytes - known : 0;
  report.faults = state.film->faults();
  report.image_hash = state.film->hash();
  report.parts = used_parts(state, report);
  if (state.costs) fill_costs(state, report);
}

}  // namespace spillway::pipeline
