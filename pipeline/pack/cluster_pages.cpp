#include "pipeline/pack/cluster_pages.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>

#include "cache/base/check.h"

namespace spillway::pipeline {
namespace {

constexpr int kBinCount = 32;                // more bins changed page surface by less than a percent
constexpr size_t kParallelItems = 1 << 15;   // smaller sets are not worth a task
constexpr int kMaxCutDepth = 64;             // beyond, cuts go through the middle: depth stays logarithmic

using Items = std::span<ClusterItem>;

// Twice the centre, in double: exact, so that comparing and binning cannot depend on rounding.
double center2(const ClusterItem& item, int axis) {
  return static_cast<double>(item.bounds.lower[axis]) + static_cast<double>(item.bounds.upper[axis]);
}

struct CenterRange {
  double lower[3] = {INFINITY, INFINITY, INFINITY};
  double upper[3] = {-INFINITY, -INFINITY, -INFINITY};
  void grow(const CenterRange& other) {
    for (int a = 0; a < 3; ++a) {
      lower[a] = std::min(lower[a], other.lower[a]);
      upper[a] = std::max(upper[a], other.upper[a]);
    }
  }
  void grow(const ClusterItem& item) {
    for (int a = 0; a < 3; ++a) {
      lower[a] = std::min(lower[a], center2(item, a));
      upper[a] = std::max(upper[a], center2(item, a));
    }
  }
  [[nodiscard]] int largest_axis() const {
    int best = 0;
    for (int a = 1; a < 3; ++a)
      if (upper[a] - lower[a] > upper[best] - lower[best]) best = a;
    return best;
  }
};

struct Bin {
  Bounds3 bounds;
  uint64_t count = 0;
  void grow(const Bin& other) { bounds.grow(other.bounds), count += other.count; }
};

struct Bins {
  Bin bin[3][kBinCount];
  void grow(const Bins& other) {
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < kBinCount; ++b) bin[a][b].grow(other.bin[a][b]);
  }
};

int bin_of(const ClusterItem& item, const CenterRange& range, int axis) {
  const double extent = range.upper[axis] - range.lower[axis];
  if (!(extent > 0)) return 0;
  const double place = (center2(item, axis) - range.lower[axis]) / extent * kBinCount;
  return std::clamp(static_cast<int>(place), 0, kBinCount - 1);
}

// All three kinds of sums here are exact and commutative: minimum, maximum, integer addition.
template <class Sum, class Add>
Sum reduce(Items items, const Add& add) {
  const auto serial = [&](size_t first, size_t last, Sum sum) {
    for (size_t i = first; i < last; ++i) add(sum, items[i]);
    return sum;
  };
  if (items.size() < kParallelItems) return serial(0, items.size(), Sum{});
  return tbb::parallel_reduce(
      tbb::blocked_range<size_t>(0, items.size(), kParallelItems / 2), Sum{},
      [&](const tbb::blocked_range<size_t>& r, Sum sum) { return serial(r.begin(), r.end(), std::move(sum)); },
      [](Sum a, const Sum& b) { return a.grow(b), a; });
}

struct Cut {
  double price = INFINITY;
  int axis = -1;
  int first_right_bin = 0;
};

double side_price(const Bin& side, uint32_t page) {
  const uint64_t room = (side.count + page - 1) / page * page;
  return static_cast<double>(side.bounds.half_area()) * static_cast<double>(side.count + room);
}

void best_cut_of_axis(const Bin (&bin)[kBinCount], int axis, uint32_t page, Cut& best) {
  Bin right[kBinCount];
  for (int b = kBinCount - 1; b >= 0; --b) {
    right[b] = bin[b];
    if (b + 1 < kBinCount) right[b].grow(right[b + 1]);
  }
  Bin left;
  for (int b = 1; b < kBinCount; ++b) {
    left.grow(bin[b - 1]);
    if (left.count == 0 || right[b].count == 0) continue;
    const double price = side_price(left, page) + side_price(right[b], page);
    if (price < best.price) best = {price, axis, b};
  }
}

// Half of the pages to each side, by (centre on the longest axis, triangle): a total order.
size_t cut_in_the_middle(Items items, const CenterRange& range, uint32_t page) {
  const int axis = range.largest_axis();
  const size_t pages = (items.size() + page - 1) / page;
  const size_t left = pages / 2 * page;
  std::nth_element(items.begin(), items.begin() + static_cast<ptrdiff_t>(left), items.end(),
                   [&](const ClusterItem& a, const ClusterItem& b) {
                     const double ca = center2(a, axis), cb = center2(b, axis);
                     return ca != cb ? ca < cb : a.triangle < b.triangle;
                   });
  return left;
}

// Puts the left side first and returns its size, neither 0 nor all.
size_t cut(Items items, uint32_t page, int depth) {
  const auto range =
      reduce<CenterRange>(items, [](CenterRange& sum, const ClusterItem& item) { sum.grow(item); });
  Cut best;
  if (depth < kMaxCutDepth) {
    const auto bins = reduce<Bins>(items, [&](Bins& sum, const ClusterItem& item) {
      for (int a = 0; a < 3; ++a) {
        Bin& bin = sum.bin[a][bin_of(item, range, a)];
        bin.bounds.grow(item.bounds), ++bin.count;
      }
    });
    for (int a = 0; a < 3; ++a) best_cut_of_axis(bins.bin[a], a, page, best);
  }
  if (best.axis < 0) return cut_in_the_middle(items, range, page);
  const auto middle = std::partition(items.begin(), items.end(), [&](const ClusterItem& item) {
    return bin_of(item, range, best.axis) < best.first_right_bin;
  });
  return static_cast<size_t>(middle - items.begin());
}

std::vector<uint32_t> cluster(Items items, uint32_t first, uint32_t page, int depth) {
  if (items.size() <= page) {
    std::sort(items.begin(), items.end(),
              [](const ClusterItem& a, const ClusterItem& b) { return a.triangle < b.triangle; });
    return {first};
  }
  const size_t middle = cut(items, page, depth);
  const Items left = items.first(middle), right = items.subspan(middle);
  std::vector<uint32_t> begins, right_begins;
  const auto do_left = [&] { begins = cluster(left, first, page, depth + 1); };
  const auto do_right = [&] { right_begins = cluster(right, first + static_cast<uint32_t>(middle), page, depth + 1); };
  if (items.size() >= kParallelItems)
    tbb::parallel_invoke(do_left, do_right);
  else
    do_left(), do_right();
  begins.insert(begins.end(), right_begins.begin(), right_begins.end());
  return begins;
}

}  // namespace

std::vector<uint32_t> cluster_pages(std::span<ClusterItem> items, const ClusterPagesOptions& options) {
  SPILLWAY_CHECK(options.max_triangles_per_page, >, 0u);
  SPILLWAY_CHECK(items.size(), <=, size_t{UINT32_MAX});
  if (items.empty()) return {};
  return cluster(items, 0, options.max_triangles_per_page, 0);
}

}  // namespace spillway::pipeline
