#include "pipeline/render/replay_pages.h"

#include <algorithm>

namespace spillway::pipeline {
namespace {

// Of a sweep's pairs, and the part of their memory that links their lists (sweep_pages.cpp).
constexpr double kPairBytes = 8.0 * 32 / 31;

}  // namespace

ReplayPages::ReplayPages(const AccessLog& log, const ReplayPaths& paths, const Plan& plan)
    : log_(log),
      paths_(paths),
      rays_a_sample_(paths.rays_a_sample()),
      rays_a_box_(paths.rays_a_sample() * static_cast<double>(log.facts.boxed_of) /
                  static_cast<double>(log.facts.sampled_of)),
      park_pairs_(static_cast<double>(plan.park_pairs)),
      most_pairs_(static_cast<double>(plan.pair_bytes) / kPairBytes),
      parks_(plan.parked_rays > 0),
      residency_(log.page_bytes, plan.page_bytes, plan.read_ahead_bytes),
      resident_(log.page_bytes.size()),
      known_(log.page_bytes.size()),
      was_read_(log.page_bytes.size()),
      lot_seldom_(log.page_bytes.size()),
      kept_(log.page_bytes.size()) {}

// ---- which rays wait for which pages ----

template <class Visit>
void ReplayPages::for_each_top(const Ray& ray, const Set& seen, const Visit& visit) const {
  const RaySamples& samples = paths_.samples();
  const NeedsRow& needs = needs_of(ray);
  for (const uint32_t page : samples.pages(needs))
    if (!seen[page]) visit(page);
  if (!ray.hit_is_open || ray.stops < 2) return;
  // The first stop is the hit's own page, one of those before it.
  for (const uint32_t page : samples.stops(needs).subspan(1, ray.stops - 1))
    if (!seen[page]) visit(page);
}

template <class Visit>
void ReplayPages::for_each_box(const Ray& ray, const Set& seen, const Visit& visit) const {
  const RaySamples& samples = paths_.samples();
  const NeedsRow& needs = needs_of(ray);
  for (const uint32_t page : samples.boxes(needs))
    if (!known_[page] && !seen[page]) visit(page);
  if (!ray.hit_is_open) return;
  const auto behind = samples.boxes_behind(needs);
  for (size_t i = 0; i + 1 < behind.size(); i += 2)
    if (behind[i] <= ray.stops && !known_[behind[i + 1]] && !seen[behind[i + 1]]) visit(behind[i + 1]);
}

void ReplayPages::begin(std::span<const uint32_t> paths, std::span<const uint32_t> shadows) {
  const size_t page_count = log_.page_bytes.size();
  rays_.clear(), early_.clear();
  pairs_ = waiting_ = 0;
  visits_.assign(page_count, 0);
  late_.assign(page_count, false), seldom_.assign(page_count, false);
  ray_count_ = paths.size() + shadows.size(), path_count_ = paths.size();
  uint32_t place = 0;
  for (const auto& rays : {paths, shadows})
    for (const uint32_t ray : rays) {
      for (const ReplayPaths::Single& one : paths_.beside(ray)) {
        if (!one.is_box) add_ray(place, one.what, true);
        if (!one.is_box || resident_[one.what] || known_[one.what]) continue;
        add_visit(one.what, 1), seldom_[one.what] = true;
      }
      add_ray(place++, paths_.needs_number(ray), false);
    }
}

void ReplayPages::add_visit(uint32_t page, double count) {
  const double enough = parks_ ? park_pairs_ : 1, before = visits_[page];
  visits_[page] += count, pairs_ += count;
  if (before < enough && visits_[page] >= enough) early_.push_back(page);
}

void ReplayPages::add_ray(uint32_t place, uint32_t number, bool is_single) {
  const NeedsRow& needs = paths_.samples().needs[number];
  const auto pages = paths_.samples().pages(needs), stops = paths_.samples().stops(needs);
  const auto stop = std::ranges::find_if(stops, [&](uint32_t page) { return resident_[page]; });
  Ray ray{place, number, static_cast<uint32_t>(stop - stops.begin()), is_single};
  if (!is_path(ray) && stop != stops.end()) {
    residency_.ask(*stop);
    return;
  }
  size_t residents = 0;
  for (const uint32_t page : pages)
    if (resident_[page]) residency_.ask(page), ++residents;
  // Where a page before the hit is in memory the hit may be in that one: what is said of it is a guess.
  ray.hit_is_open = is_path(ray) && residents == 0 && ray.stops > 0;
  for_each_top(ray, resident_, [&](uint32_t page) { ray.waits = true, add_visit(page, count_of(ray)); });
  for_each_box(ray, resident_,
               [&](uint32_t page) { ray.waits_by_box = true, add_visit(page, is_single ? 1 : rays_a_box_); });
  if (ray.waits || ray.waits_by_box) waiting_ += ray.waits || is_single ? count_of(ray) : rays_a_box_;
  rays_.push_back(ray);
}

// ---- parking ----

ReplayRays ReplayPages::choose_late() {
  ReplayRays late;
  if (pairs_ > most_pairs_) return late;  // they are not listed: the wave is swept in windows
  for (uint32_t page = 0; page < visits_.size(); ++page) late_[page] = visits_[page] > 0 && visits_[page] < park_pairs_;
  for (const Ray& ray : rays_) {
    bool by_top = false, by_box = false;
    for_each_top(ray, resident_, [&](uint32_t page) { by_top |= late_[page]; });
    for_each_box(ray, resident_, [&](uint32_t page) { by_box |= late_[page]; });
    if (!by_top && !by_box) continue;
    (is_path(ray) ? late.paths : late.shadows) += by_top || ray.is_single ? count_of(ray) : rays_a_box_;
  }
  return late;
}

bool ReplayPages::stops_in(const Ray& ray, const Set& pages) const {
  const auto stops = paths_.samples().stops(needs_of(ray));
  if (is_path(ray)) return !stops.empty() && pages[stops.front()];
  return std::ranges::any_of(stops, [&](uint32_t page) { return pages[page]; });
}

std::vector<bool> ReplayPages::park() {
  std::vector<bool> is_parked(ray_count_);
  Set read_now(visits_.size());
  for (uint32_t page = 0; page < visits_.size(); ++page) read_now[page] = visits_[page] > 0 && !late_[page];
  std::array<double, kRayKinds> owed = {};  // rays that wait as those do that know boxes
  for (Ray ray : rays_) {
    // What is behind a hit whose page is read in the wave is not needed any more.
    const bool stops_now = stops_in(ray, read_now);
    if (!is_path(ray) && stops_now) continue;
    if (stops_now) ray.hit_is_open = false;
    const auto kind = static_cast<size_t>(needs_of(ray).kind);
    bool by_top = false, by_box = false;
    for (const uint32_t page : paths_.samples().pages(needs_of(ray))) by_top |= late_[page];
    for_each_box(ray, resident_, [&](uint32_t page) { by_box |= late_[page]; });
    if (by_box && !by_top && !ray.is_single) owed[kind] += rays_a_box_ / rays_a_sample_ - 1;
    const bool pays = !by_top && !by_box && !needs_of(ray).knows_boxes && !ray.is_single && owed[kind] >= 1;
    if (pays) owed[kind] -= 1;
    if (!by_top && !by_box && !pays) continue;
    if (!ray.is_single) is_parked[ray.place] = true;
    lot_.push_back(ray);
  }
  for (uint32_t page = 0; page < visits_.size(); ++page) {
    if (!late_[page]) continue;
    visits_[page] = 0;
    if (seldom_[page]) lot_seldom_[page] = true;
  }
  return is_parked;
}

// ---- reading ----

void ReplayPages::read(uint32_t page, ReplayRead& sum) {
  residency_.ask(page);
  if (resident_[page]) return;
  (was_read_[page] ? sum.again_bytes : sum.first_bytes) += log_.page_bytes[page];
  was_read_[page] = true;
  known_[page] = !residency_.fits();
  if (!residency_.take_room(page)) return;
  residency_.set_resident(page);
  resident_[page] = true;
}

ReplayRead ReplayPages::sweep() {
  if (pairs_ > most_pairs_) return sweep_windows();
  ReplayRead sum;
  Set is_early(visits_.size());
  // Pages are read early while it looks as if half of the room did for all pairs (sweep_pages.cpp).
  if (2 * pairs_ <= most_pairs_) {
    for (const uint32_t page : early_) {
      is_early[page] = true;
      if (visits_[page] > 0) read(page, sum);
    }
  }
  for (uint32_t page = 0; page < visits_.size(); ++page)
    if (visits_[page] > 0 && !is_early[page]) read(page, sum);
  return sum;
}

// Windows of pages whose pairs fit: what the pages of those before stopped needs no other ones.
ReplayRead ReplayPages::sweep_windows() {
  ReplayRead sum;
  const auto page_count = static_cast<uint32_t>(visits_.size());
  for (uint32_t first = 0, last = 0; first < page_count; first = last) {
    double pairs = 0;
    while (last < page_count && (last == first || pairs + visits_[last] <= most_pairs_)) pairs += visits_[last++];
    Set due(page_count);
    const auto visit = [&](uint32_t page) { due[page] = due[page] || (page >= first && page < last); };
    for (const Ray& ray : rays_) for_each_top(ray, resident_, visit), for_each_box(ray, resident_, visit);
    for (uint32_t page = first; page < last; ++page) {
      due[page] = due[page] || (seldom_[page] && !resident_[page]);
      if (due[page]) read(page, sum);
    }
    std::erase_if(rays_, [&](const Ray& ray) { return !is_path(ray) && stops_in(ray, due); });
    for (Ray& ray : rays_) ray.hit_is_open = ray.hit_is_open && !stops_in(ray, due);
  }
  return sum;
}

// Pages that were read for these rays in their wave and were not in memory when the lot was swept last are visited once
// more: which of them a ray has seen is not kept.
ReplayRead ReplayPages::sweep_lot() {
  Set due = std::exchange(lot_seldom_, Set(lot_seldom_.size()));
  for (const Ray& ray : lot_) {
    const auto visit = [&](uint32_t page) { due[page] = true; };
    for_each_top(ray, kept_, visit), for_each_box(ray, kept_, visit);
  }
  lot_.clear();
  ReplayRead sum;
  for (uint32_t page = 0; page < due.size(); ++page)
    if (due[page]) read(page, sum);
  rebalance();
  kept_ = resident_;
  return sum;
}

void ReplayPages::rebalance() {
  residency_.rebalance([&](uint32_t page) { resident_[page] = false; });
}

}  // namespace spillway::pipeline
