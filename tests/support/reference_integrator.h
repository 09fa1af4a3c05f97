#pragma once

// The depth-first reference: one path after the other, from the camera to its end, everything in memory, no sorting, no
// waves, no streams. The same vertex function, resolver, random numbers and film as the stages; so the streamed image
// must equal its image bit for bit. How rays are traced is a parameter: our kernel here, Embree in the benchmark.

#include <functional>
#include <memory>

#include "pipeline/render/render_image.h"

namespace spillway::test {

// Nearest hit of a path ray, or the occlusion result of a shadow ray (cache/trace_kernel.h, TraceMode).
struct Tracer {
  virtual ~Tracer() = default;
  virtual cache::TraceHit nearest(const cache::TraceRay& ray) const = 0;
  virtual cache::TraceHit occlusion(const cache::TraceRay& ray) const = 0;
};

struct ReferenceOptions {
  pipeline::SceneSettings settings;
  bool aov_layers = false;
};

// Our kernel over all pages of the store, loaded whole.
Result<std::unique_ptr<Tracer>> kernel_tracer(const pipeline::Store& store);

// Renders on the threads of the calling arena, tiles of pixels in parallel.
Result<std::unique_ptr<pipeline::Film>> render_reference(const pipeline::Store& store, const Tracer& tracer,
                                                         const ReferenceOptions& options);

}  // namespace spillway::test
