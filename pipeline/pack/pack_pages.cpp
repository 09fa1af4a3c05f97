#include "pipeline/pack/pack_pages.h"

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <numeric>

#include "cache/base/hash.h"
#include "cache/base/parallel.h"
#include "cache/base/parallel_status.h"
#include "pipeline/pack/cluster_pages.h"
#include "pipeline/pack/bake_micromap.h"
#include "pipeline/pack/triangle_sets.h"

namespace spillway::pipeline {
namespace {

// While a page is built: 32 a triangle of Embree's primitive and about 100 of its tree, 50 of the page with full leaves
// and four times that with leaves of one.
constexpr uint64_t kBuildBytesPerTriangle = 360;
// The largest micromap, 4^8 states of two bits, and its copy in the page.
constexpr uint64_t kMicromapBytes = 2 * (4 + (1 << 14));
// Pages worth of triangles in the smallest set: less would read the spool again and again.
constexpr uint64_t kSmallestSetPages = 4;

using Clock = std::chrono::steady_clock;

// A page's triangles in the set, by ascending prim.
struct PageSpan {
  uint32_t object;
  std::span<const PackTriangle> triangles;
};

// uvs of a face; meshes without have pbrt's default corners.
void face_uvs(const cache::AttributeSegmentData& data, const uint16_t* corner, Float2 (&uv)[3]) {
  static constexpr Float2 kCorners[3] = {{0, 0}, {1, 0}, {1, 1}};
  for (int k = 0; k < 3; ++k) uv[k] = data.uvs.empty() ? kCorners[k] : data.uvs[corner[k]];
}

// Which chunk a triangle came from, for the few that have alpha or are interfaces.
class AlphaBaker {
 public:
  AlphaBaker(const SpooledScene& scene, const BakeMicromap& bake) : scene_(scene), bake_(bake) {
    has_alpha_ = std::any_of(scene.meshes.begin(), scene.meshes.end(), [](const SpooledMesh& mesh) {
      return mesh.row.alpha_texture != TextureId::kNone || (mesh.row.flags & kMeshIsInterface) != 0;
    });
  }

  [[nodiscard]] uint64_t bytes_per_triangle() const { return has_alpha_ ? kMicromapBytes : 0; }
  // One micromap a triangle; empty when none has any.
  Result<std::vector<std::vector<std::byte>>> bake(std::span<const PackTriangle> triangles) const {
    std::vector<std::vector<std::byte>> micromaps;
    if (!has_alpha_) return micromaps;
    SpoolReader reader(*scene_.spool);
    for (size_t first = 0; first < triangles.size();) {
      const PlacedChunk& placed = chunk_of(triangles[first].prim);
      size_t last = first + 1;
      while (last < triangles.size() && triangles[last].prim - placed.first_prim < placed.chunk.face_count) ++last;
      const Mesh& mesh = scene_.meshes[placed.mesh].row;
      const uint32_t texture = mesh.alpha_texture;
      if (mesh.flags & kMeshIsInterface) {
        micromaps.resize(triangles.size());
        std::fill(&micromaps[first], &micromaps[first] + (last - first), unknown_micromap());
      } else if (texture != TextureId::kNone) {
        micromaps.resize(triangles.size());
        SPILLWAY_TRY(bake_chunk(placed, texture, triangles.subspan(first, last - first), reader, &micromaps[first]));
      }
      first = last;
    }
    if (std::ranges::all_of(micromaps, &std::vector<std::byte>::empty)) micromaps.clear();
    return micromaps;
  }

 private:
  [[nodiscard]] const PlacedChunk& chunk_of(uint32_t prim) const {
    const auto after = std::upper_bound(scene_.chunks.begin(), scene_.chunks.end(), prim,
                                        [](uint32_t p, const PlacedChunk& placed) { return p < placed.first_prim; });
    return after[-1];
  }
  Status bake_chunk(const PlacedChunk& placed, uint32_t texture, std::span<const PackTriangle> triangles,
                    SpoolReader& reader, std::vector<std::byte>* micromaps) const {
    SPILLWAY_ASSIGN(const cache::AttributeSegmentData data, reader.read(placed.chunk, true));
    return parallel_status(triangles.size(), [&](size_t i) -> Status {
      Float2 uv[3];
      face_uvs(data, &data.indices[size_t{3} * (triangles[i].prim - placed.first_prim)], uv);
      SPILLWAY_ASSIGN(micromaps[i], bake_(texture, uv));
      return {};
    });
  }

  const SpooledScene& scene_;
  const BakeMicromap& bake_;
  bool has_alpha_ = false;
};

class PagePacker {
 public:
  PagePacker(const SpooledScene& scene, const BakeMicromap& bake, const PackPagesOptions& options,
             cache::WriteFile& file, PackReport& report)
      : scene_(scene), options_(options), file_(file), report_(report), baker_(scene, bake), sets_(scene) {}

  Result<PackedPages> run();

 private:
  Status share_memory();
  [[nodiscard]] std::vector<PageSpan> cluster(const TriangleSet& set);
  Status build_and_write(std::span<const PageSpan> pages);
  Result<Buffer<std::byte>> build(const PageSpan& page);
  Status write(const PageSpan& page, const Buffer<std::byte>& bytes);

  const SpooledScene& scene_;
  const PackPagesOptions& options_;
  cache::WriteFile& file_;
  PackReport& report_;
  AlphaBaker baker_;
  TriangleSets sets_;
  uint64_t max_set_ = 0;
  size_t tokens_ = 1;  // pages being built, or waiting to be written
  Buffer<PackTriangle> triangles_;
  std::atomic<uint64_t> build_nanoseconds_ = 0;
  PackedPages packed_;
};

// Pages under way take at most a quarter of the limit, down to one; the rest holds triangles.
Status PagePacker::share_memory() {
  const uint64_t page = options_.max_triangles_per_page, limit = options_.memory_limit_bytes;
  const uint64_t largest_page = std::min(page, sets_.largest_object());
  const uint64_t page_bytes =
      std::max<uint64_t>(1, largest_page * (kBuildBytesPerTriangle + baker_.bytes_per_triangle()));
  const auto threads = static_cast<uint64_t>(tbb::this_task_arena::max_concurrency());
  tokens_ = std::clamp<uint64_t>(limit / 4 / page_bytes, 1, threads + 2);
  const uint64_t smallest_set = std::min(kSmallestSetPages * page, sets_.largest_object());
  // The largest micromaps are rare: one page of nothing else is not what a scene is refused for.
  const uint64_t build_bytes =
      baker_.bytes_per_triangle() == 0 ? tokens_ * page_bytes : std::min(tokens_ * page_bytes, limit / 4);
  const uint64_t needed = build_bytes + smallest_set * sizeof(PackTriangle);
  if (needed > limit)
    return error(
        "packing {} triangles takes at least {} MiB beside the scene's tables, but {} MiB are left; allow more with "
        "--memory",
        scene_.prim_count, (needed >> 20) + 1, limit >> 20);
  max_set_ = std::max((limit - build_bytes) / sizeof(PackTriangle), page);
  return {};
}

// The pages of a set; the spans are of triangles_.
std::vector<PageSpan> PagePacker::cluster(const TriangleSet& set) {
  const PackStepTimer timer(report_, "cluster_pages");
  const ClusterPagesOptions options{.max_triangles_per_page = options_.max_triangles_per_page};
  const std::span<PackTriangle> all(triangles_.data(), set.count);
  const size_t object_count = set.last_object - set.first_object;
  std::vector<std::vector<PageSpan>> pages(object_count);
  std::vector<uint64_t> first(object_count + 1, 0);
  for (size_t i = 0; i < object_count; ++i)
    first[i + 1] = first[i] + (set.cuts ? set.count : sets_.object_count(set.first_object + static_cast<uint32_t>(i)));
  parallel_blocks(object_count, 1, [&](size_t i, size_t, size_t) {
    const std::span<PackTriangle> mine = all.subspan(first[i], first[i + 1] - first[i]);
    const std::vector<uint32_t> begins = cluster_pages(mine, options, set.depth);
    for (size_t p = 0; p < begins.size(); ++p) {
      const size_t end = p + 1 < begins.size() ? begins[p + 1] : mine.size();
      pages[i].push_back({set.first_object + static_cast<uint32_t>(i), mine.subspan(begins[p], end - begins[p])});
    }
  });
  std::vector<PageSpan> joined;
  for (const std::vector<PageSpan>& object : pages) joined.insert(joined.end(), object.begin(), object.end());
  return joined;
}

Result<Buffer<std::byte>> PagePacker::build(const PageSpan& page) {
  const Clock::time_point start = Clock::now();
  SPILLWAY_ASSIGN(const auto micromaps, baker_.bake(page.triangles));
  Buffer<std::byte> bytes = build_trace_page(page.triangles, micromaps, options_.tree);
  build_nanoseconds_ += static_cast<uint64_t>(std::chrono::nanoseconds(Clock::now() - start).count());
  return bytes;
}

Status PagePacker::write(const PageSpan& page, const Buffer<std::byte>& bytes) {
  const auto& header = *reinterpret_cast<const cache::TracePageHeader*>(bytes.data());
  cache::PageLocation location{};
  location.offset_bytes = file_.size_bytes(), location.size_bytes = bytes.size();
  location.triangle_count = static_cast<uint32_t>(page.triangles.size());
  location.object = page.object;
  packed_.pages.push_back(location);
  packed_.bounds.push_back({header.lower, header.upper});
  packed_.content = hash_combine(packed_.content, header.checksum);
  return file_.append(bytes);
}

// Pages are built side by side and written in order; the first failure stops what follows.
Status PagePacker::build_and_write(std::span<const PageSpan> pages) {
  const PackStepTimer timer(report_, "build_trees");
  using Built = std::shared_ptr<Result<Buffer<std::byte>>>;
  size_t next = 0, written = 0;
  Status status;
  std::atomic<bool> stopped = false;
  const auto source = [&](tbb::flow_control& control) -> size_t {
    if (next < pages.size() && !stopped) return next++;
    control.stop();
    return 0;
  };
  const auto make = [&](size_t p) { return std::make_shared<Result<Buffer<std::byte>>>(build(pages[p])); };
  const auto sink = [&](const Built& built) {
    if (!status) return;
    const Clock::time_point start = Clock::now();
    status = *built ? write(pages[written], **built) : Status(built->error());
    report_.step("write_pages").thread_seconds += std::chrono::duration<double>(Clock::now() - start).count();
    ++written;
    if (!status) stopped = true;
  };
  tbb::parallel_pipeline(tokens_, tbb::make_filter<void, size_t>(tbb::filter_mode::serial_in_order, source) &
                                      tbb::make_filter<size_t, Built>(tbb::filter_mode::parallel, make) &
                                      tbb::make_filter<Built, void>(tbb::filter_mode::serial_in_order, sink));
  return status;
}

Result<PackedPages> PagePacker::run() {
  SPILLWAY_TRY(share_memory());
  std::vector<TriangleSet> sets;
  {
    const PackStepTimer timer(report_, "cut_sets");
    SPILLWAY_ASSIGN(
        sets, sets_.cut(max_set_, {.max_triangles_per_page = options_.max_triangles_per_page}, report_.pass_count));
  }
  for (const TriangleSet& set : sets)
    report_.largest_set_triangles = std::max(report_.largest_set_triangles, set.count);
  report_.set_count = sets.size();
  triangles_ = Buffer<PackTriangle>(MemoryTag::pack, report_.largest_set_triangles);
  for (const TriangleSet& set : sets) {
    {
      const PackStepTimer timer(report_, "load_triangles");
      SPILLWAY_TRY(sets_.load(set, {triangles_.data(), set.count}));
    }
    SPILLWAY_TRY(build_and_write(cluster(set)));
  }
  report_.step("build_trees").thread_seconds = static_cast<double>(build_nanoseconds_.load()) * 1e-9;
  report_.page_count = packed_.pages.size();
  return std::move(packed_);
}

}  // namespace

Result<PackedPages> pack_pages(const SpooledScene& scene, const BakeMicromap& bake, const PackPagesOptions& options,
                               cache::WriteFile& file, PackReport& report) {
  return PagePacker(scene, bake, options, file, report).run();
}

}  // namespace spillway::pipeline
