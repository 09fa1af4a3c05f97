#include <algorithm>

#include "cache/base/hash.h"
#include "cache/texture_cache.h"
#include "pipeline/render/render_image.h"
#include "pipeline/render/select_lights.h"
#include "pipeline/render/select_tables.h"

// What is known of a frame before it is rendered: its film, its identity, what the plan asks.

namespace spillway::pipeline {

FilmShape film_shape(const SceneSettings& settings, bool aov_layers) {
  FilmShape shape;
  shape.full_width = settings.camera.resolution_x_px;
  shape.full_height = settings.camera.resolution_y_px;
  const PixelWindow window = pixel_window(settings);
  shape.window = {window.x0, window.y0, window.x1, window.y1};
  shape.layers = aov_layers ? kAllLayers : 0;
  return shape;
}

FilmIdentity film_identity(const Store& store, const SceneSettings& settings) {
  RenderSettings render = settings.render;
  render.samples_per_pixel = 0;  // films of different counts are parts of one image
  uint64_t key = checksum(&settings.camera, sizeof settings.camera);
  key = checksum(&settings.filter, sizeof settings.filter, key);
  key = checksum(&settings.film.exposure_scale, sizeof settings.film.exposure_scale, key);
  key = checksum(&render, sizeof render, key);
  const auto add = [&](const auto& rows) { key = checksum(rows.data(), rows.size_bytes(), key); };
  add(store.lights()), add(store.emitters()), add(store.emissions()), add(store.portals()), add(store.environment());
  add(store.light_images()), add(store.light_texels());
  add(store.materials()), add(store.textures()), add(store.images()), add(store.face_textures());
  add(store.meshes()), add(store.instances());
  add(store.medium_tables().media), add(store.medium_tables().black_bodies);
  if (!store.motions().empty()) {
    key = checksum(&settings.motion, sizeof settings.motion, key);
    add(store.motions());
  }
  return {key, fmt::format("gcc {}, glibc {}.{}", __VERSION__, __GLIBC__, __GLIBC_MINOR__)};
}

PixelWindow pixel_window(const SceneSettings& settings) {
  const FilmSettings& film = settings.film;
  if (film.crop_x1 > film.crop_x0) return {film.crop_x0, film.crop_y0, film.crop_x1, film.crop_y1};
  return {0, 0, settings.camera.resolution_x_px, settings.camera.resolution_y_px};
}

SceneFacts scene_facts(const Store& store, const RenderOptions& options) {
  SceneFacts facts;
  for (const cache::PageLocation& page : store.pages()) {
    facts.trace_bytes += page.size_bytes;
    facts.largest_page_bytes = std::max(facts.largest_page_bytes, page.size_bytes);
  }
  for (const AttributeLocation& block : store.attributes()) {
    facts.attribute_bytes += block.size_bytes;
    facts.largest_attribute_block_bytes = std::max<uint64_t>(facts.largest_attribute_block_bytes, block.size_bytes);
  }
  if (looks_up_images(store))
    facts.texture_bytes = cache::TextureCache::bytes_for_all(store.images(), store.face_containers());
  facts.looks_up_emission =
      std::ranges::any_of(store.meshes(), [&](const Mesh& mesh) { return looks_up_emission(store, mesh); }) ? 1 : 0;
  facts.has_media = store.medium_tables().media.empty() ? 0 : 1;
  for (const cache::VolumeBrickLocation& brick : store.medium_tables().volumes.bricks) {
    facts.volume_bytes += brick.size_bytes;
    facts.largest_brick_bytes = std::max(facts.largest_brick_bytes, brick.size_bytes);
  }
  for (const MemoryTag tag : {MemoryTag::scene, MemoryTag::page_tree, MemoryTag::lights, MemoryTag::trace_log})
    facts.table_bytes += memory_use(tag).current_bytes;  // held since the store was opened
  facts.table_bytes += cache::TextureCache::bytes_beside_tiles(store.images(), store.face_containers());
  facts.film_bytes = Film::bytes(film_shape(options.settings, options.aov_layers));
  if (options.cost_layers) {
    facts.film_bytes += PixelCosts::bytes(film_shape(options.settings, options.aov_layers), store.meshes().size(),
                                          cache::TextureCache::tile_count(store.images(), store.face_containers()));
    facts.has_costs = 1;
  }
  facts.pixel_count = pixel_window(options.settings).pixel_count();
  facts.samples_per_pixel = options.settings.render.samples_per_pixel;
  facts.max_depth = std::min(options.settings.render.max_depth, kMostBounces);
  return facts;
}

std::string frame_key(const Store& store, const RenderOptions& options) {
  const uint64_t content = store.content_key();
  uint64_t key = checksum(&content, sizeof content);
  key = checksum(&options.settings, sizeof options.settings, key);
  const std::string rest = fmt::format("{} {}", options.aov_layers, film_identity(store, options.settings).library_versions);
  return fmt::format("{:016x}", checksum(rest.data(), rest.size(), key));
}

}  // namespace spillway::pipeline
