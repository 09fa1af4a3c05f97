#pragma once

// The sampled paths of a log, ray after ray: what a replay sends through its waves.
//
// Owns: their rays, and what these need. Memory: some 16 bytes a ray, and the needs. Order: a function of the log.

#include <span>
#include <utility>
#include <vector>

#include "pipeline/render/access_log.h"

namespace spillway::pipeline {

class ReplayPaths {
 public:
  // Paths by number, in the order in which they begin.
  struct Ray {
    uint32_t path, wave, needs;  // wave: of the log
  };
  // A page that one ray of the log needed, and no sample of its wave and kind.
  struct Seldom {
    uint32_t ray, page;
    bool by_box;
  };

  static Result<ReplayPaths> of(const AccessLog& log);

  [[nodiscard]] uint32_t path_count() const { return static_cast<uint32_t>(first_.size() - 1); }
  [[nodiscard]] double rays_a_sample() const { return rays_a_sample_; }
  [[nodiscard]] const Ray& ray(uint32_t ray) const { return rays_[ray]; }
  [[nodiscard]] const NeedsRow& needs(uint32_t ray) const { return samples_.needs[rays_[ray].needs]; }
  [[nodiscard]] RayKind kind(uint32_t ray) const { return needs(ray).kind; }
  [[nodiscard]] const RaySamples& samples() const { return samples_; }
  [[nodiscard]] uint32_t camera_ray(uint32_t path) const { return first_[path]; }
  // Rays that the hit of this one sends, by their numbers; shadow rays that pass masks come with those that sent them.
  [[nodiscard]] std::pair<uint32_t, uint32_t> sent_by(uint32_t ray) const;
  [[nodiscard]] std::span<const Seldom> seldom(uint32_t ray) const;

 private:
  void order_paths();
  void add_seldom(const AccessLog& log);

  RaySamples samples_;
  std::vector<Ray> rays_;        // by path, wave and kind
  std::vector<uint32_t> first_;  // of each path, and the end
  std::vector<Seldom> seldom_;   // by ray
  std::vector<bool> has_seldom_;
  double rays_a_sample_ = 1;
};

}  // namespace spillway::pipeline
