#pragma once

// Pages in a replay: what the rays of a wave need that is not in memory, which of it is read at once, and what the rays
// that wait for the rest need when their lot is swept.
//
// Owns: the policy of residency, rows of pages, the rays of the wave, and what is needed of those in the lot.
// Order: serial, a function of the calls. Based on: sweep_pages.cpp and park_rays.h, whose rules these are, of rays that
// stand for others. What rays meet of pages whose tops are not known, some tell for all: those that wait for nothing else
// make as many others wait, the next ones of their kind.

#include <array>
#include <span>
#include <vector>

#include "cache/residency.h"
#include "pipeline/render/plan.h"
#include "pipeline/render/replay_paths.h"

namespace spillway::pipeline {

// Of paths, and of shadow rays.
struct ReplayRays {
  double paths = 0, shadows = 0;
  [[nodiscard]] double sum() const { return paths + shadows; }
};

struct ReplayRead {
  uint64_t first_bytes = 0, again_bytes = 0;
  [[nodiscard]] uint64_t bytes() const { return first_bytes + again_bytes; }
};

class ReplayPages {
 public:
  ReplayPages(const AccessLog& log, const ReplayPaths& paths, const Plan& plan);

  // A wave of these rays, by their numbers.
  void begin(std::span<const uint32_t> paths, std::span<const uint32_t> shadows);
  [[nodiscard]] double waiting() const { return waiting_; }
  // Chooses the pages that few rays wait for; returns how many wait for them.
  ReplayRays choose_late();
  // Those of them that no other page serves go to the lot, and the late pages are not read in this wave. Of the wave's
  // paths, then of its shadow rays: which are parked.
  std::vector<bool> park();
  // All that the wave's rays wait for, or what park() left.
  ReplayRead sweep();
  // What the rays in the lot need; they leave it.
  ReplayRead sweep_lot();
  void rebalance();

 private:
  using Set = std::vector<bool>;
  using List = std::vector<uint32_t>;
  // A ray that is not at its end.
  struct Ray {
    uint32_t place = 0, needs = 0;      // in the wave; by number
    uint32_t stops = 0;                 // before its stops end: those as far as one in memory, where the hit is not
    bool is_single = false;             // it stands for itself, beside the ray of its place
    bool hit_is_open = false;           // of a path whose hit is in no page that was visited
    bool waits = false;                 // for pages that are known, or
    bool waits_by_box = false;          // for others that it meets by their box
  };
  void add_ray(uint32_t place, uint32_t needs, bool is_single);
  void add_visit(uint32_t page, double count);
  // Calls visit(page) for what is not in memory of what the ray needs.
  template <class Visit>
  void for_each_top(const Ray& ray, const Set& seen, const Visit& visit) const;
  template <class Visit>
  void for_each_box(const Ray& ray, const Set& seen, const Visit& visit) const;
  [[nodiscard]] const NeedsRow& needs_of(const Ray& ray) const { return paths_.samples().needs[ray.needs]; }
  [[nodiscard]] bool is_path(const Ray& ray) const { return needs_of(ray).kind != RayKind::shadow; }
  [[nodiscard]] double count_of(const Ray& ray) const { return ray.is_single ? 1 : rays_a_sample_; }
  [[nodiscard]] bool stops_in(const Ray& ray, const Set& pages) const;
  void read(uint32_t page, ReplayRead& sum);
  ReplayRead sweep_windows();

  const AccessLog& log_;
  const ReplayPaths& paths_;
  const double rays_a_sample_, rays_a_box_;  // that a sample stands for, and one that knows boxes
  const double park_pairs_, most_pairs_;
  const bool parks_;
  cache::Residency residency_;
  Set resident_, known_, was_read_;
  // Of the lot: its rays; pages of single rays; in memory since it was swept last, so that its rays have seen them.
  std::vector<Ray> lot_;
  Set lot_seldom_, kept_;
  // Of the wave.
  size_t ray_count_ = 0, path_count_ = 0;
  std::vector<Ray> rays_;
  std::vector<double> visits_;  // of pages that are not in memory
  List early_;                  // enough wait for them, in this order
  double pairs_ = 0, waiting_ = 0;
  Set late_, seldom_;
};

}  // namespace spillway::pipeline
