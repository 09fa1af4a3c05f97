#include "pipeline/pack/cluster_pages.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>

#include "cache/base/check.h"

namespace spillway::pipeline {
namespace {

constexpr int kBinCount = 32;               // more bins changed page surface by less than a percent
constexpr size_t kParallelItems = 1 << 15;  // smaller sets are not worth a task
constexpr int kMaxCutDepth = 64;            // beyond, cuts go through the middle: depth stays logarithmic

using Items = std::span<PackTriangle>;

Bounds3 bounds_of(const PackTriangle& t) {
  Bounds3 b;
  for (const Float3& v : t.vertex) b.grow(v);
  return b;
}

// Twice the centre, in double: exact, so that comparing and binning cannot depend on rounding.
double center2(const Bounds3& bounds, int axis) {
  return static_cast<double>(bounds.lower[axis]) + static_cast<double>(bounds.upper[axis]);
}

double center2(const PackTriangle& t, int axis) {
  const float a = t.vertex[0][axis], b = t.vertex[1][axis], c = t.vertex[2][axis];
  return static_cast<double>(std::min({a, b, c})) + static_cast<double>(std::max({a, b, c}));
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
  void grow(const PackTriangle& t) {
    for (int a = 0; a < 3; ++a) {
      const double center = center2(t, a);
      lower[a] = std::min(lower[a], center);
      upper[a] = std::max(upper[a], center);
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

// Which bin of an axis a centre falls into.
struct Binning {
  double lower = 0, extent = 0;
  Binning(const CenterRange& range, int axis)
      : lower(range.lower[axis]), extent(range.upper[axis] - range.lower[axis]) {}
  [[nodiscard]] int operator()(double center) const {
    if (!(extent > 0)) return 0;
    return std::clamp(static_cast<int>((center - lower) / extent * kBinCount), 0, kBinCount - 1);
  }
};

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
                   [&](const PackTriangle& a, const PackTriangle& b) {
                     const double ca = center2(a, axis), cb = center2(b, axis);
                     return ca != cb ? ca < cb : a.prim < b.prim;
                   });
  return left;
}

Cut best_cut(const Bins& bins, uint32_t page) {
  Cut best;
  for (int a = 0; a < 3; ++a) best_cut_of_axis(bins.bin[a], a, page, best);
  return best;
}

void add_to_bins(Bins& sum, const Binning (&binning)[3], const PackTriangle& item) {
  const Bounds3 bounds = bounds_of(item);
  for (int a = 0; a < 3; ++a) {
    Bin& bin = sum.bin[a][binning[a](center2(bounds, a))];
    bin.bounds.grow(bounds), ++bin.count;
  }
}

// Puts the left side first and returns its size, neither 0 nor all.
size_t cut(Items items, uint32_t page, int depth) {
  const auto range = reduce<CenterRange>(items, [](CenterRange& sum, const PackTriangle& item) { sum.grow(item); });
  const Binning binning[3] = {{range, 0}, {range, 1}, {range, 2}};
  Cut best;
  if (depth < kMaxCutDepth)
    best = best_cut(reduce<Bins>(items, [&](Bins& sum, const PackTriangle& item) { add_to_bins(sum, binning, item); }),
                    page);
  if (best.axis < 0) return cut_in_the_middle(items, range, page);
  const Binning& on_axis = binning[best.axis];
  const auto middle = std::partition(items.begin(), items.end(), [&](const PackTriangle& item) {
    return on_axis(center2(item, best.axis)) < best.first_right_bin;
  });
  return static_cast<size_t>(middle - items.begin());
}

std::vector<uint32_t> cluster(Items items, uint32_t first, uint32_t page, int depth) {
  if (items.size() <= page) {
    std::sort(items.begin(), items.end(), [](const PackTriangle& a, const PackTriangle& b) { return a.prim < b.prim; });
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

// ---- cuts of a set that is not held ----

// What the bins of a streamed set hold besides: the range of centres, from which the sides are binned next.
struct StreamedBins {
  Bins bins;
  CenterRange centers[3][kBinCount];

  void grow(const StreamedBins& other) {
    bins.grow(other.bins);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < kBinCount; ++b) centers[a][b].grow(other.centers[a][b]);
  }
};

struct CutNode {
  CenterRange range;
  uint64_t count = 0;
  int depth = 0;
  int axis = -1;  // -1: not cut
  int first_right_bin = 0;
  uint32_t left = 0;  // the right side follows it
  uint32_t set = 0;   // of one that is not cut
};

}  // namespace

struct StreamedCuts::State {
  std::vector<CutNode> nodes;
  std::vector<uint32_t> sets;  // their nodes, in depth-first order

  [[nodiscard]] uint32_t node_of(const PackTriangle& t) const {
    uint32_t at = 0;
    while (nodes[at].axis >= 0) {
      const CutNode& node = nodes[at];
      at = node.left + (Binning(node.range, node.axis)(center2(t, node.axis)) < node.first_right_bin ? 0 : 1);
    }
    return at;
  }

  Status find_range(const Pass& pass);
  Status cut_level(const Pass& pass, std::span<const uint32_t> open, const ClusterPagesOptions& options);
  Status cut_node(uint32_t at, const StreamedBins& sums, const ClusterPagesOptions& options);
  void number_sets(uint32_t at);
};

Status StreamedCuts::State::find_range(const Pass& pass) {
  tbb::enumerable_thread_specific<CenterRange> ranges;
  SPILLWAY_TRY(pass([&](std::span<const PackTriangle> block) {
    CenterRange& range = ranges.local();
    for (const PackTriangle& t : block) range.grow(t);
  }));
  for (const CenterRange& range : ranges) nodes[0].range.grow(range);
  return {};
}

// Cuts every open node, in one pass over the set.
Status StreamedCuts::State::cut_level(const Pass& pass, std::span<const uint32_t> open,
                                      const ClusterPagesOptions& options) {
  std::vector<uint32_t> place(nodes.size(), UINT32_MAX);
  for (uint32_t i = 0; i < open.size(); ++i) place[open[i]] = i;
  tbb::enumerable_thread_specific<std::vector<StreamedBins>> sums(
      [&] { return std::vector<StreamedBins>(open.size()); });
  SPILLWAY_TRY(pass([&](std::span<const PackTriangle> block) {
    std::vector<StreamedBins>& mine = sums.local();
    for (const PackTriangle& t : block) {
      const uint32_t node = node_of(t);
      if (place[node] == UINT32_MAX) continue;
      StreamedBins& sum = mine[place[node]];
      const CenterRange& range = nodes[node].range;
      const Binning binning[3] = {{range, 0}, {range, 1}, {range, 2}};
      add_to_bins(sum.bins, binning, t);
      for (int a = 0; a < 3; ++a) sum.centers[a][binning[a](center2(t, a))].grow(t);
    }
  }));
  for (uint32_t i = 0; i < open.size(); ++i) {
    StreamedBins sum;
    for (const std::vector<StreamedBins>& mine : sums) sum.grow(mine[i]);
    SPILLWAY_TRY(cut_node(open[i], sum, options));
  }
  return {};
}

Status StreamedCuts::State::cut_node(uint32_t at, const StreamedBins& sums, const ClusterPagesOptions& options) {
  const Cut best = nodes[at].depth < kMaxCutDepth ? best_cut(sums.bins, options.max_triangles_per_page) : Cut{};
  if (best.axis < 0)
    return error("{} triangles lie in one place, more than can be held at a time; allow more with --memory",
                 nodes[at].count);
  CutNode side[2];
  for (int b = 0; b < kBinCount; ++b) {
    CutNode& s = side[b < best.first_right_bin ? 0 : 1];
    s.count += sums.bins.bin[best.axis][b].count;
    s.range.grow(sums.centers[best.axis][b]);
  }
  side[0].depth = side[1].depth = nodes[at].depth + 1;
  nodes[at].axis = best.axis, nodes[at].first_right_bin = best.first_right_bin;
  nodes[at].left = static_cast<uint32_t>(nodes.size());
  nodes.insert(nodes.end(), {side[0], side[1]});
  return {};
}

void StreamedCuts::State::number_sets(uint32_t at) {
  if (nodes[at].axis >= 0) {
    number_sets(nodes[at].left);
    number_sets(nodes[at].left + 1);
    return;
  }
  nodes[at].set = static_cast<uint32_t>(sets.size());
  sets.push_back(at);
}

StreamedCuts::StreamedCuts(std::unique_ptr<State> state) : state_(std::move(state)) {}
StreamedCuts::StreamedCuts(StreamedCuts&&) noexcept = default;
StreamedCuts& StreamedCuts::operator=(StreamedCuts&&) noexcept = default;
StreamedCuts::~StreamedCuts() = default;

Result<StreamedCuts> StreamedCuts::make(const Pass& pass, uint64_t count, uint64_t max_set,
                                        const ClusterPagesOptions& options) {
  SPILLWAY_CHECK(max_set, >=, uint64_t{options.max_triangles_per_page});
  auto state = std::make_unique<State>();
  state->nodes.resize(1);
  state->nodes[0].count = count;
  if (count > max_set) SPILLWAY_TRY(state->find_range(pass));
  for (size_t first = 0; first < state->nodes.size();) {
    std::vector<uint32_t> open;
    for (; first < state->nodes.size(); ++first)
      if (state->nodes[first].count > max_set) open.push_back(static_cast<uint32_t>(first));
    if (!open.empty()) SPILLWAY_TRY(state->cut_level(pass, open, options));
  }
  state->number_sets(0);
  return StreamedCuts(std::move(state));
}

size_t StreamedCuts::size() const { return state_->sets.size(); }
uint64_t StreamedCuts::count(size_t set) const { return state_->nodes[state_->sets[set]].count; }
int StreamedCuts::depth(size_t set) const { return state_->nodes[state_->sets[set]].depth; }
uint32_t StreamedCuts::set_of(const PackTriangle& triangle) const {
  return state_->nodes[state_->node_of(triangle)].set;
}

std::vector<uint32_t> cluster_pages(std::span<PackTriangle> triangles, const ClusterPagesOptions& options, int depth) {
  SPILLWAY_CHECK(options.max_triangles_per_page, >, 0u);
  SPILLWAY_CHECK(triangles.size(), <=, size_t{UINT32_MAX});
  if (triangles.empty()) return {};
  return cluster(triangles, 0, options.max_triangles_per_page, depth);
}

}  // namespace spillway::pipeline
