#include "tests/support/reference_integrator.h"

#include <tbb/enumerable_thread_specific.h>

#include <mutex>

#include "cache/base/parallel.h"
#include "pipeline/evaluate_texture.h"
#include "pipeline/render/attribute_store.h"
#include "pipeline/render/resolve_material.h"
#include "pipeline/render/select_lights.h"
#include "pipeline/render/select_tables.h"
#include "pipeline/render/shade_hits.h"
#include "pipeline/render/route_hits.h"
#include "pipeline/render/shade_path.h"
#include "pipeline/render/track_media.h"

namespace spillway::test {
namespace {

using namespace pipeline;

// A file's parts, all of them resident.
template <class Locations>
Result<std::unique_ptr<cache::PartStore>> load_all(const std::filesystem::path& path, const Locations& locations,
                                                   MemoryTag tag, const cache::PartStore::Validate& validate) {
  std::vector<cache::Part> parts;
  std::vector<uint32_t> all;
  for (const auto& location : locations) {
    all.push_back(static_cast<uint32_t>(parts.size()));
    parts.push_back({location.offset_bytes, location.size_bytes});
  }
  SPILLWAY_ASSIGN(auto store, cache::PartStore::open(path, std::move(parts), {.tag = tag}, validate));
  SPILLWAY_TRY(store->sweep(all, [](uint32_t, std::span<const std::byte>) -> Status { return {}; }));
  return store;
}

class KernelTracer final : public Tracer {
 public:
  KernelTracer(const Store& store, std::unique_ptr<cache::PartStore> parts)
      : tree_(store.page_tree()), parts_(std::move(parts)), views_(*parts_) {}

  cache::TraceHit nearest(const cache::TraceRay& ray) const override {
    cache::TraceHit hit = cache::no_hit(ray);
    cache::TraceCounters work;
    cache::DueVisits none;
    cache::trace_resident<cache::TraceMode::nearest>(tree_, views_.resident(), ray, hit, work, none);
    return hit;
  }
  cache::TraceHit occlusion(const cache::TraceRay& ray) const override {
    cache::TraceHit hit = cache::no_hit(ray);
    cache::TraceCounters work;
    cache::DueVisits none;
    cache::trace_resident<cache::TraceMode::occlusion>(tree_, views_.resident(), ray, hit, work, none);
    return hit;
  }

 private:
  cache::PageTree tree_;
  std::unique_ptr<cache::PartStore> parts_;
  PageViews views_;
};

// One thread's walk down paths.
class Walker {
 public:
  struct Shared {
    const Tracer& tracer;
    const ShadeInputs& inputs;
    const AttributeStore& attributes;
    const MediaInputs& media;
    Film& film;
  };
  explicit Walker(const Shared& shared) : s_(shared) {}

  Status follow(cache::TraceRay ray, PathRecord path) {
    while (true) {
      const cache::TraceHit found = s_.tracer.nearest(ray);
      if (path.medium != kNoMedium) {
        MediumSegment segment;
        const SegmentResult medium = through_medium(ray, found, path, segment);
        if (!is_black(medium.emitted))
          splat({path.sink, path.sample, emission_event(path.bounce), path.throughput * medium.emitted});
        path.throughput *= medium.weight;
        if (is_black(path.throughput)) return {};
        if (medium.distance < INFINITY) {
          const ShadedVertex vertex = shade_medium(s_.inputs.settings, medium_hit(ray, path, medium.distance));
          if (vertex.has_shadow) SPILLWAY_TRY(follow_shadow(vertex.shadow_ray, vertex.shadow, vertex.shadow_end));
          if (!vertex.has_path) return {};
          ray = vertex.path_ray, path = vertex.path;
          continue;
        }
      }
      if (found.prim == PrimId::kNone) {
        if (shading::has_infinite_light(s_.inputs.settings.lights))
          splat(escaped_splat(s_.inputs.settings, path, ray.direction_world));
        return {};
      }
      const HitRecord hit{found, ray.direction_world, ray.t_max, path, 0};
      SPILLWAY_TRY(resolve(hit));
      if (!query_.stopped) {
        path.medium = medium_beyond(point_, ray.direction_world);
        ray = ray_beyond(hit, point_);
        path.cone_width = point_.width_world;
        continue;
      }
      const ShadedVertex vertex = shade_vertex(s_.inputs.settings, hit, point_, query_.values);
      if (s_.inputs.wants_aovs && path.bounce == 0) {
        const AovRecord aovs = first_hit_aovs(query_);
        s_.film.add_aovs({&aovs, 1});
      }
      if (vertex.has_splat) splat(vertex.splat);
      if (vertex.has_shadow) SPILLWAY_TRY(follow_shadow(vertex.shadow_ray, vertex.shadow, vertex.shadow_end));
      if (!vertex.has_path) return {};
      ray = vertex.path_ray, path = vertex.path;
    }
  }

 private:
  void splat(const SplatRecord& record) { s_.film.add({&record, 1}); }

  // What the ray's medium does to it.
  template <class Record>
  SegmentResult through_medium(const cache::TraceRay& ray, const cache::TraceHit& found, const Record& record,
                               MediumSegment& segment) const {
    if (!make_segment(s_.media, ray, found, record, segment)) return {};
    return track_segment(s_.media, segment, std::is_same_v<Record, ShadowRecord>);
  }

  Status follow_shadow(cache::TraceRay ray, ShadowRecord shadow, const shading::LightPlace& end) {
    while (true) {
      const cache::TraceHit found = s_.tracer.occlusion(ray);
      if (found.flags & cache::kHitOccluded) return {};
      if (shadow.medium != kNoMedium) {
        MediumSegment segment;
        shadow.contribution *= through_medium(ray, found, shadow, segment).weight;
      }
      if (found.prim == PrimId::kNone && end.prim == PrimId::kNone) {
        splat({shadow.sink, shadow.sample, shadow_event(shadow.bounce), shadow.contribution});
        return {};
      }
      const bool has_arrived = found.prim == PrimId::kNone;
      const HitRecord hit = has_arrived ? arrived_hit(ray, shadow, end) : shadow_hit(ray, found, shadow, end);
      SPILLWAY_TRY(resolve(hit));
      if (has_arrived) {
        splat(arrived_splat(hit, query_.values));
        return {};
      }
      if (query_.stopped) return {};
      shadow.medium = medium_beyond(point_, ray.direction_world);
      ray = ray_beyond(hit, point_);
    }
  }

  Status resolve(const HitRecord& hit) {
    const PrimId prim{hit.hit.prim};
    const auto triangle =
        cache::triangle_attributes(s_.attributes.resident(s_.attributes.block_of(prim.value)), prim);
    Pose moved;
    const InstanceTransform transform = instance_transform(s_.inputs, hit, moved);
    const bool flip = s_.inputs.tables.meshes[triangle.mesh.value].flags & kMeshFlipNormals;
    point_ = shading_point(triangle, hit, transform, flip);
    set_media(s_.inputs.tables.meshes[triangle.mesh.value], hit.path.medium, point_);
    if (triangle.has_face) {
      face_ = face_point(triangle, hit, transform, point_.width_world, s_.inputs.settings.seed);
      point_.face = &face_;
    }
    query_ = SurfaceQuery{&hit, &point_, triangle.mesh.value, true, 0, {}};
    return s_.inputs.resolver->resolve({&query_, 1}, scratch_);
  }

  Shared s_;
  ShadingPoint point_;
  FacePoint face_{};
  SurfaceQuery query_;
  MaterialResolver::Scratch scratch_;
};

struct ReferenceState {
  std::unique_ptr<AttributeStore> attributes;
  std::unique_ptr<cache::TextureCache> textures;
  SelectedTextures texture_nodes;
  std::unique_ptr<TextureEvaluator> evaluator;
  std::unique_ptr<MaterialResolver> resolver;
  std::unique_ptr<VolumeStore> volumes;
  SelectedMedia medium_tables;
  MediaInputs media;
  SelectedLights lights;
  ShadeInputs inputs;
};

Status open(const Store& store, const ReferenceOptions& options, ReferenceState& state) {
  SPILLWAY_ASSIGN(auto parts, load_all(store.attributes_path(), store.attributes(), MemoryTag::attributes,
                                       cache::validate_attribute_block));
  state.attributes = std::make_unique<AttributeStore>(std::move(parts), store.attributes());
  if (!store.images().empty() || !store.face_textures().empty()) {
    const uint64_t bytes = cache::TextureCache::bytes_for_all(store.images(), store.face_containers());
    SPILLWAY_ASSIGN(state.textures,
                    cache::TextureCache::open(store.textures_path(), store.images(), {.memory_limit_bytes = bytes},
                                              store.face_containers(), store.face_textures()));
  }
  state.texture_nodes = SelectedTextures(store, options.settings.render.texture_filter);
  state.evaluator = std::make_unique<TextureEvaluator>(state.texture_nodes.nodes(), state.textures.get());
  const RenderSettings& render = options.settings.render;
  state.lights = SelectedLights(store, render);
  state.inputs.settings = {state.lights.table(), std::min(render.max_depth, kMostBounces), render.seed, render.sampler,
                           ray_times(store, options.settings).shutter};
  state.inputs.tables = {store.meshes(), store.materials(), state.evaluator.get()};
  if (const shading::LightTable& lights = state.inputs.settings.lights; !lights.places.empty())
    state.inputs.tables.emissions = lights.emissions, state.inputs.tables.emitters = lights.emitters;
  state.inputs.instances = store.page_tree().instances;
  state.inputs.motions = store.motions();
  state.inputs.settings.media = store.medium_tables().media;
  state.inputs.settings.estimator = render.estimator, state.inputs.settings.roulette = render.roulette != 0;
  state.medium_tables = SelectedMedia(store, render.majorants);
  state.media = {state.medium_tables.tables(), nullptr, render.seed};
  if (const auto bricks = store.medium_tables().volumes.bricks; !bricks.empty()) {
    SPILLWAY_ASSIGN(auto volumes, load_all(store.volumes_path(), bricks, MemoryTag::volumes, cache::validate_volume_brick));
    state.volumes = std::make_unique<VolumeStore>(std::move(volumes));
    state.media.volumes = state.volumes.get();
  }
  state.resolver = std::make_unique<MaterialResolver>(state.inputs.tables, render.seed);
  state.inputs.resolver = state.resolver.get();
  state.inputs.wants_aovs = options.aov_layers;
  return {};
}

}  // namespace

Result<std::unique_ptr<Tracer>> kernel_tracer(const Store& store) {
  SPILLWAY_ASSIGN(auto parts, load_all(store.trace_pages_path(), store.pages(), MemoryTag::pages,
                                       cache::validate_trace_page));
  return std::unique_ptr<Tracer>(std::make_unique<KernelTracer>(store, std::move(parts)));
}

Result<std::unique_ptr<Film>> render_reference(const Store& store, const Tracer& tracer,
                                               const ReferenceOptions& options) {
  ReferenceState state;
  SPILLWAY_TRY(open(store, options, state));
  const SceneSettings& settings = options.settings;
  SPILLWAY_ASSIGN(Film empty, Film::create(film_shape(settings, options.aov_layers), film_identity(store, settings)));
  auto film = std::make_unique<Film>(std::move(empty));
  const uint32_t spp = settings.render.samples_per_pixel;
  CameraRays camera(settings.camera, settings.filter, pixel_window(settings), settings.render.seed,
                    settings.render.sampler, ray_times(store, settings), settings.film.exposure_scale,
                    settings.render.camera_medium);
  const Walker::Shared shared{tracer, state.inputs, *state.attributes, state.media, *film};
  tbb::enumerable_thread_specific<Walker> walkers([&] { return Walker(shared); });
  constexpr size_t kBatch = 1 << 16;
  std::vector<cache::TraceRay> rays(kBatch);
  std::vector<PathRecord> paths(kBatch);
  std::mutex mutex;
  Status failure;
  for (const uint32_t half : {0u, 1u}) {
    const uint32_t samples = half == 0 ? (spp + 1) / 2 : spp / 2;
    if (samples == 0) continue;
    camera.begin({half, 0, samples});
    while (!camera.exhausted()) {
      const size_t made = camera.generate_rays(kBatch, rays.data(), paths.data());
      parallel_blocks(made, 256, [&](size_t, size_t first, size_t last) {
        for (size_t i = first; i < last; ++i) {
          if (const Status status = walkers.local().follow(rays[i], paths[i]); !status) {
            const std::lock_guard lock(mutex);
            failure = status;
          }
        }
      });
      if (!failure) return failure.error();
    }
    film->set_half_samples(static_cast<int>(half), samples);
  }
  return film;
}

}  // namespace spillway::test
