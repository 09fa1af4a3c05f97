#pragma once

// The sampled paths of a log, ray after ray: what a replay sends through its waves.
//
// Owns: their rays, and what these need. Memory: some 16 bytes a ray, and the needs. Order: a function of the log.

#include <initializer_list>
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
  // What single rays of the log needed, and no sample of their waves and kinds: beside which ray of a sample. A ray's
  // needs, or a page whose box it meets.
  struct Single {
    uint32_t beside, what;
    bool is_box;
  };

  static Result<ReplayPaths> of(const AccessLog& log);

  [[nodiscard]] uint32_t path_count() const { return static_cast<uint32_t>(first_.size() - 1); }
  [[nodiscard]] double rays_a_sample() const { return rays_a_sample_; }
  [[nodiscard]] const Ray& ray(uint32_t ray) const { return rays_[ray]; }
  [[nodiscard]] const NeedsRow& needs(uint32_t ray) const { return samples_.needs[rays_[ray].needs]; }
  [[nodiscard]] uint32_t needs_number(uint32_t ray) const { return rays_[ray].needs; }
  [[nodiscard]] RayKind kind(uint32_t ray) const { return needs(ray).kind; }
  [[nodiscard]] const RaySamples& samples() const { return samples_; }
  [[nodiscard]] uint32_t camera_ray(uint32_t path) const { return first_[path]; }
  // Rays that the hit of this one sends, by their numbers; shadow rays that pass masks come with those that sent them.
  [[nodiscard]] std::pair<uint32_t, uint32_t> sent_by(uint32_t ray) const;
  [[nodiscard]] std::span<const Single> beside(uint32_t ray) const;

 private:
  void order_paths(std::span<const SampleRow> rows);
  [[nodiscard]] std::vector<uint32_t> boxes_of_none(
      const std::vector<uint32_t>& pages, std::initializer_list<const std::vector<uint32_t>*> lists) const;
  void add_singles(const AccessLog& log, std::span<const SampleRow> rows);

  RaySamples samples_;
  std::vector<Ray> rays_;        // by path, wave and kind
  std::vector<uint32_t> first_;  // of each path, and the end
  std::vector<Single> singles_;  // by the ray that they are beside
  std::vector<bool> has_singles_;
  double rays_a_sample_ = 1;
};

}  // namespace spillway::pipeline
