#pragma once

// Pages in a replay: what the rays of a wave need that is not in memory, which of it is read at once, and what the rays
// that wait for the rest need when their lot is swept.
//
// Owns: the policy of residency, rows of pages, and the rays of a wave that wait, as spans of the log's samples.
// Order: serial, a function of the calls. Based on: sweep_pages.cpp and park_rays.h, whose rules these are, of rays
// that stand for others: a wave's are drawn from the samples of the log's waves that are like it, evenly, in their
// order.

#include <array>
#include <span>
#include <vector>

#include "cache/residency.h"
#include "pipeline/render/access_log.h"

namespace spillway::pipeline {

using KindCounts = std::array<double, kRayKinds>;  // of rays, by RayKind

struct ReplayRead {
  uint64_t first_bytes = 0, again_bytes = 0;
  [[nodiscard]] uint64_t bytes() const { return first_bytes + again_bytes; }
};

class ReplayPages {
 public:
  ReplayPages(const AccessLog& log, std::vector<WaveSamples> samples, const Plan& plan);

  // A wave of so many rays: from the camera like those of the log's waves `begun`, others like those of `going_on`.
  void begin(const std::vector<uint32_t>& begun, const std::vector<uint32_t>& going_on, const KindCounts& rays);
  [[nodiscard]] const KindCounts& waiting() const { return waiting_; }
  // Chooses the pages that few rays wait for; returns how many wait for them.
  KindCounts choose_late();
  // Those of them that no other page serves go to the lot, and the late pages are not read in this wave.
  KindCounts park();
  // All that the wave's rays wait for, or what park() left.
  ReplayRead sweep();
  // What the rays in the lot need; they leave it.
  ReplayRead sweep_lot();
  void rebalance();

 private:
  using Set = std::vector<bool>;
  // A row of samples that waits, for so many rays.
  struct Ray {
    RayKind kind;
    std::span<const uint32_t> pages, stops;
    std::span<const uint32_t> behind;  // its hit, as far as what is in memory
    double count;
  };
  double draw(RayKind kind, const std::vector<uint32_t>& waves, double wanted);
  void add_ray(Ray ray);
  void add_seldom(RayKind kind, const std::vector<uint32_t>& waves, double share);
  void add_boxes(const std::vector<uint32_t>& begun, const std::vector<uint32_t>& going_on);
  [[nodiscard]] bool is_early(uint32_t page) const { return visits_[page] > 0 && !late_[page]; }
  [[nodiscard]] bool still_waits(const Ray& ray) const;
  void add_to_lot(std::span<const uint32_t> pages);
  ReplayRead read(const Set& due);

  const AccessLog& log_;
  const std::vector<WaveSamples> samples_;
  const double park_pairs_, most_pairs_;
  cache::Residency residency_;
  Set known_, was_read_;
  Set lot_, kept_;  // needed by the lot; in memory since it was swept last, so that its rays have seen them
  // Of the wave.
  std::vector<Ray> rays_;
  std::vector<double> visits_;  // of pages that are not in memory
  double pairs_ = 0;
  Set late_, sampled_, seldom_;
  KindCounts waiting_ = {};
};

}  // namespace spillway::pipeline
