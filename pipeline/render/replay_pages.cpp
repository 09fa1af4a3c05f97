#include "pipeline/render/replay_pages.h"

#include <algorithm>
#include <cmath>

namespace spillway::pipeline {
namespace {

// Of a sweep's pairs, and the part of their memory that links their lists (sweep_pages.cpp).
constexpr double kPairBytes = 8.0 * 32 / 31;

size_t index(RayKind kind) { return static_cast<size_t>(kind); }

const std::vector<uint32_t>& list_of(const WaveAccess& wave, RayKind kind) {
  if (kind == RayKind::camera) return wave.camera_pages;
  return kind == RayKind::continued ? wave.continued_pages : wave.shadow_pages;
}

}  // namespace

ReplayPages::ReplayPages(const AccessLog& log, std::vector<WaveSamples> samples, const Plan& plan)
    : log_(log),
      samples_(std::move(samples)),
      park_pairs_(static_cast<double>(plan.park_pairs)),
      most_pairs_(static_cast<double>(plan.pair_bytes) / kPairBytes),
      residency_(log.page_bytes, plan.page_bytes, plan.read_ahead_bytes),
      known_(log.page_bytes.size()),
      was_read_(log.page_bytes.size()),
      lot_(log.page_bytes.size()),
      kept_(log.page_bytes.size()) {}

// ---- which rays wait for which pages ----

void ReplayPages::begin(const std::vector<uint32_t>& begun, const std::vector<uint32_t>& going_on,
                        const KindCounts& rays) {
  const size_t page_count = log_.page_bytes.size();
  rays_.clear(), waiting_ = {}, pairs_ = 0;
  visits_.assign(page_count, 0);
  late_.assign(page_count, false), seldom_.assign(page_count, false);
  for (const RayKind kind : {RayKind::camera, RayKind::continued, RayKind::shadow}) {
    const std::vector<uint32_t>& waves = kind == RayKind::camera ? begun : going_on;
    sampled_.assign(page_count, false);
    add_seldom(kind, waves, draw(kind, waves, rays[index(kind)]));
  }
  add_boxes(begun, going_on);
}

// So many rays out of the samples. Returns how many each sample stands for.
double ReplayPages::draw(RayKind kind, const std::vector<uint32_t>& waves, double wanted) {
  double sampled = 0;
  for (const uint32_t w : waves)
    for (const SampleRow& row : samples_[w].rows) sampled += row.kind == kind ? row.count : 0;
  if (sampled == 0 || wanted <= 0) return 0;
  const double share = wanted / sampled;
  double carry = 0.5;
  for (const uint32_t w : waves) {
    for (const SampleRow& row : samples_[w].rows) {
      if (row.kind != kind) continue;
      const auto pages = samples_[w].pages(row);
      for (const uint32_t page : pages) sampled_[page] = true;
      carry += row.count * share;
      const double count = std::floor(carry);
      carry -= count;
      if (count > 0) add_ray({kind, pages, samples_[w].stops(row), {}, count});
    }
  }
  return share;
}

void ReplayPages::add_ray(Ray ray) {
  const auto is_resident = [&](uint32_t page) { return residency_.is_resident(page); };
  const auto stop = std::ranges::find_if(ray.stops, is_resident);
  if (ray.kind == RayKind::shadow && stop != ray.stops.end()) {
    residency_.ask(*stop);
    return;
  }
  size_t residents = 0;
  for (const uint32_t page : ray.pages)
    if (is_resident(page)) residency_.ask(page), ++residents;
  if (residents == ray.pages.size()) return;
  // Where a page before the hit is in memory the hit may be in that one: what is said of it is a guess. The first stop
  // is the hit's own page, one of those before it.
  if (ray.kind != RayKind::shadow && residents == 0 && stop - ray.stops.begin() > 1)
    ray.behind = {ray.stops.begin() + 1, stop};
  const auto add = [&](uint32_t page) {
    if (!is_resident(page)) visits_[page] += ray.count, pairs_ += ray.count;
  };
  for (const uint32_t page : ray.pages) add(page);
  for (const uint32_t page : ray.behind) add(page);
  waiting_[index(ray.kind)] += ray.count;
  rays_.push_back(ray);
}

// Pages that rays of the log needed of which none is a sample.
void ReplayPages::add_seldom(RayKind kind, const std::vector<uint32_t>& waves, double share) {
  if (log_.facts.sampled_of == 1 || share == 0) return;
  const double drawn = std::min(1.0, share / static_cast<double>(log_.facts.sampled_of));
  double carry = 0.5;
  for (const uint32_t w : waves) {
    for (const uint32_t page : list_of(log_.waves[w], kind)) {
      if (sampled_[page] || residency_.is_resident(page)) continue;
      sampled_[page] = true;
      carry += drawn;
      if (carry < 1) continue;
      carry -= 1, visits_[page] += 1, pairs_ += 1;
      seldom_[page] = true;
    }
  }
}

// Of a page whose top is not known all rays that meet its box must visit it. How many these are is not known; they are
// taken for too many to wait. In a street most of them did wait; but paths that came back from the lot then needed more
// than others do, of which the log does not tell. Of the two errors the one makes up for most of the other.
void ReplayPages::add_boxes(const std::vector<uint32_t>& begun, const std::vector<uint32_t>& going_on) {
  const auto add = [&](const std::vector<uint32_t>& boxes) {
    for (const uint32_t page : boxes)
      if (!known_[page] && !residency_.is_resident(page)) visits_[page] += park_pairs_ + 1;
  };
  for (const uint32_t w : begun) add(log_.waves[w].camera_boxes);
  for (const uint32_t w : going_on) add(log_.waves[w].later_boxes);
}

// ---- parking ----

KindCounts ReplayPages::choose_late() {
  KindCounts late = {};
  if (pairs_ > most_pairs_) return late;  // they are not listed: the wave is swept in windows
  for (uint32_t page = 0; page < visits_.size(); ++page) late_[page] = visits_[page] > 0 && visits_[page] < park_pairs_;
  const auto is_late = [&](uint32_t page) { return late_[page]; };
  for (const Ray& ray : rays_)
    if (std::ranges::any_of(ray.pages, is_late) || std::ranges::any_of(ray.behind, is_late))
      late[index(ray.kind)] += ray.count;
  return late;
}

// What is behind a hit whose page is read in the wave is not needed any more.
bool ReplayPages::still_waits(const Ray& ray) const {
  const auto early = [&](uint32_t page) { return is_early(page); };
  if (ray.kind == RayKind::shadow && std::ranges::any_of(ray.stops, early)) return false;
  return std::ranges::any_of(ray.pages, [&](uint32_t page) { return late_[page]; });
}

// Pages that were read for these rays in their wave and were not in memory when the lot was swept last are visited once
// more: which of them a ray has seen is not kept.
void ReplayPages::add_to_lot(std::span<const uint32_t> pages) {
  for (const uint32_t page : pages)
    if (!kept_[page]) lot_[page] = true;
}

KindCounts ReplayPages::park() {
  KindCounts parked = {};
  for (const Ray& ray : rays_) {
    if (!still_waits(ray)) continue;
    parked[index(ray.kind)] += ray.count;
    add_to_lot(ray.pages);
    if (!ray.behind.empty() && !is_early(ray.stops.front())) add_to_lot(ray.behind);
  }
  for (uint32_t page = 0; page < visits_.size(); ++page) {
    if (!late_[page]) continue;
    visits_[page] = 0;
    if (seldom_[page]) lot_[page] = true;
  }
  return parked;
}

// ---- reading ----

ReplayRead ReplayPages::read(const Set& due) {
  ReplayRead read;
  for (uint32_t page = 0; page < due.size(); ++page) {
    if (!due[page]) continue;
    residency_.ask(page);
    if (residency_.is_resident(page)) continue;
    (was_read_[page] ? read.again_bytes : read.first_bytes) += log_.page_bytes[page];
    was_read_[page] = true;
    known_[page] = !residency_.fits();
    if (residency_.take_room(page)) residency_.set_resident(page);
  }
  return read;
}

ReplayRead ReplayPages::sweep() {
  Set due(visits_.size());
  for (uint32_t page = 0; page < visits_.size(); ++page) due[page] = visits_[page] > 0;
  return read(due);
}

ReplayRead ReplayPages::sweep_lot() {
  const ReplayRead all = read(lot_);
  lot_.assign(lot_.size(), false);
  rebalance();
  for (uint32_t page = 0; page < kept_.size(); ++page) kept_[page] = residency_.is_resident(page);
  return all;
}

void ReplayPages::rebalance() {
  residency_.rebalance([](uint32_t) {});
}

}  // namespace spillway::pipeline
