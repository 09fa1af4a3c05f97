#include "pipeline/render/used_parts.h"

namespace spillway::pipeline {
namespace {

using Parts = std::vector<UsedPart>;

void add_stages(const RenderReport& r, Parts& parts) {
  uint64_t generated = 0;
  for (const WaveReport& wave : r.waves) generated += wave.generated_count;
  const auto stage = [&](const char* name, uint64_t count) { parts.push_back({"stages", name, count}); };
  stage("generate_rays", generated);
  stage("sort_rays", r.sorted_count);
  stage("trace_rays", r.trace.ray_count);
  stage("sweep_pages", r.trace.pages_touched);
  stage("track_media", r.track.segment_count);
  stage("route_hits", r.route.hit_count + r.route.escaped_count + r.route.arrived_count + r.route.occluded_count);
  stage("shade_hits", r.shade.shaded_count);
  stage("sweep_attributes", r.shade.attribute_blocks_touched);
  stage("let_through", r.shade.let_through_count);
}

void add_caches(const RenderReport& r, Parts& parts) {
  uint64_t image_lookups = 0, face_lookups = 0;
  for (const TextureReport& t : r.by_texture) (t.is_face_texture ? face_lookups : image_lookups) += t.counters.lookups;
  parts.push_back({"caches", "pages", r.trace.work.pages});
  parts.push_back({"caches", "attributes", r.memory[static_cast<size_t>(MemoryTag::attributes)].peak_bytes});
  parts.push_back({"caches", "image_tiles", image_lookups});
  parts.push_back({"caches", "face_tiles", face_lookups});
  parts.push_back({"caches", "bricks", r.memory[static_cast<size_t>(MemoryTag::volumes)].peak_bytes});
}

void add_columns(const RenderState& state, const RenderReport& r, Parts& parts) {
  FilmShape shape = state.film->shape();
  const uint32_t layers = shape.layers;
  shape.layers = 0;
  const uint64_t beauty = Film::bytes(shape);
  parts.push_back({"columns", "beauty", beauty});
  const auto layer = [&](const char* name, uint32_t bit) {
    shape.layers = layers & bit;
    parts.push_back({"columns", name, Film::bytes(shape) - beauty});
  };
  layer("depth", kLayerDepth), layer("normal", kLayerNormal), layer("albedo", kLayerAlbedo), layer("ids", kLayerIds);
  parts.push_back({"columns", "costs", state.costs ? state.costs->total(Cost::rays) : 0});
  parts.push_back({"columns", "shadow_rays", r.shade.shadow_count});
  parts.push_back({"columns", "spilled", r.spilled_bytes});
  parts.push_back({"columns", "access_log", state.options.access_log ? state.options.access_log->waves.size() : 0});
}

void add_tables(const RenderState& state, Parts& parts) {
  const Store& store = state.store;
  const auto table = [&](const char* name, size_t rows) { parts.push_back({"tables", name, rows}); };
  table("meshes", store.meshes().size()), table("instances", store.instances().size() - 1);  // the first is the world
  table("materials", store.materials().size()), table("textures", store.textures().size());
  table("images", store.images().size()), table("face_textures", store.face_textures().size());
  table("lights", store.lights().size()), table("light_tree", state.lights.table().tree.nodes.size());
  table("emitters", store.emitters().size()), table("emissions", store.emissions().size());
  table("environment", store.environment().size()), table("portals", store.portals().size());
  table("motions", store.motions().size()), table("media", store.medium_tables().media.size());
  table("bricks", store.medium_tables().volumes.bricks.size());
}

}  // namespace

std::vector<UsedPart> used_parts(const RenderState& state, const RenderReport& report) {
  Parts parts;
  add_stages(report, parts);
  add_caches(report, parts);
  add_columns(state, report, parts);
  add_tables(state, parts);
  return parts;
}

}  // namespace spillway::pipeline
