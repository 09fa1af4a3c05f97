#include "pipeline/pack/pack_pages.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "cache/base/hash.h"
#include "cache/base/parallel.h"
#include "cache/base/parallel_status.h"
#include "pipeline/pack/cluster_pages.h"

namespace spillway::pipeline {
namespace {

// While a page is built: 40 of the triangle, 32 of Embree's primitive and about 100 of its tree, 50 of the page with
// full leaves and four times that with leaves of one.
constexpr uint64_t kBuildBytesPerTriangle = 400;
// The largest micromap, 4^8 states of two bits; while baking also as bytes, but for few triangles at a time.
constexpr uint64_t kMicromapBytes = 4 + (1 << 14);
constexpr size_t kChunksPerRead = 16;  // a task: 16 large chunks are 5 MB, small ones share a read

struct PageInput {
  std::vector<PackTriangle> triangles;          // by ascending prim
  std::vector<std::vector<std::byte>> micromaps;  // empty, or one a triangle
};

// ---- plan ----

struct ObjectChunks {
  std::vector<const PlacedChunk*> chunks;
  std::vector<size_t> first_item;  // of each chunk
  size_t item_count = 0;
};

std::vector<ObjectChunks> chunks_by_object(const SpooledScene& scene) {
  std::vector<ObjectChunks> objects(scene.object_count);
  for (const PlacedChunk& placed : scene.chunks) {
    ObjectChunks& object = objects[scene.meshes[placed.mesh].row.object];
    object.chunks.push_back(&placed);
    object.first_item.push_back(object.item_count);
    object.item_count += placed.chunk.face_count;
  }
  return objects;
}

Status load_chunk(const PlacedChunk& placed, SpoolReader& reader, std::span<ClusterItem> items) {
  SPILLWAY_ASSIGN(const cache::AttributeSegmentData data, reader.read(placed.chunk, false));
  for (uint32_t face = 0; face < placed.chunk.face_count; ++face) {
    items[face] = {{}, placed.first_prim + face};
    for (int k = 0; k < 3; ++k) items[face].bounds.grow(data.positions[data.indices[3 * face + k]]);
  }
  return {};
}

Status load_items(const SpooledScene& scene, const ObjectChunks& object, std::span<ClusterItem> items) {
  return parallel_status(block_count(object.chunks.size(), kChunksPerRead), [&](size_t block) -> Status {
    SpoolReader reader(*scene.spool);
    const size_t end = std::min(object.chunks.size(), (block + 1) * kChunksPerRead);
    for (size_t c = block * kChunksPerRead; c < end; ++c)
      SPILLWAY_TRY(load_chunk(*object.chunks[c], reader, items.subspan(object.first_item[c])));
    return {};
  });
}

Status check_memory(const SpooledScene& scene, const std::vector<ObjectChunks>& objects, uint64_t limit_bytes) {
  size_t largest = 0;
  for (const ObjectChunks& object : objects) largest = std::max(largest, object.item_count);
  const uint64_t need = uint64_t{scene.prim_count} * sizeof(uint32_t) + largest * sizeof(ClusterItem);
  if (need <= limit_bytes) return {};
  return error("packing {} triangles ({} in the largest object) takes {} MiB, but {} MiB are allowed; allow more with "
               "--memory", scene.prim_count, largest, (need >> 20) + 1, limit_bytes >> 20);
}

void add_pages(PagePlan& plan, std::span<const ClusterItem> items, std::span<const uint32_t> begins, uint32_t object) {
  for (size_t p = 0; p < begins.size(); ++p) {
    const size_t end = p + 1 < begins.size() ? begins[p + 1] : items.size();
    cache::PageLocation page{};
    page.triangle_count = static_cast<uint32_t>(end - begins[p]);
    page.object = object;
    const auto index = static_cast<uint32_t>(plan.pages.size());
    for (size_t i = begins[p]; i < end; ++i) plan.page_of_prim[items[i].triangle] = index;
    plan.pages.push_back(page);
  }
}

// ---- write ----

// Pages [first, last) of a chunk: those it has triangles in.
struct PageRange {
  uint32_t first = UINT32_MAX, last = 0;
};

struct BatchPlan {
  std::vector<PageRange> chunk_pages;  // by chunk
  std::vector<uint64_t> page_bytes;    // what building a page takes
};

BatchPlan plan_batches(const SpooledScene& scene, const PagePlan& plan) {
  BatchPlan batches{std::vector<PageRange>(scene.chunks.size()), std::vector<uint64_t>(plan.pages.size(), 0)};
  for (size_t c = 0; c < scene.chunks.size(); ++c) {
    const PlacedChunk& placed = scene.chunks[c];
    const bool has_alpha = scene.meshes[placed.mesh].row.alpha_texture != TextureId::kNone;
    PageRange& range = batches.chunk_pages[c];
    for (uint32_t face = 0; face < placed.chunk.face_count; ++face) {
      const uint32_t page = plan.page_of_prim[placed.first_prim + face];
      range = {std::min(range.first, page), std::max(range.last, page + 1)};
      batches.page_bytes[page] += kBuildBytesPerTriangle + (has_alpha ? 2 * kMicromapBytes : 0);
    }
  }
  return batches;
}

// At least one page, and as many as fit.
uint32_t batch_end(const BatchPlan& batches, uint32_t first, uint64_t limit_bytes) {
  uint64_t bytes = batches.page_bytes[first];
  uint32_t last = first + 1;
  while (last < batches.page_bytes.size() && bytes + batches.page_bytes[last] <= limit_bytes)
    bytes += batches.page_bytes[last++];
  return last;
}

// uvs of a face; meshes without have pbrt's default corners.
void face_uvs(const cache::AttributeSegmentData& data, const uint16_t* corner, Float2 (&uv)[3]) {
  static constexpr Float2 kCorners[3] = {{0, 0}, {1, 0}, {1, 1}};
  for (int k = 0; k < 3; ++k) uv[k] = data.uvs.empty() ? kCorners[k] : data.uvs[corner[k]];
}

class BatchFiller {
 public:
  BatchFiller(const SpooledScene& scene, const PagePlan& plan, const BakeMicromap& bake, uint32_t first, uint32_t last)
      : scene_(scene), plan_(plan), bake_(bake), reader_(*scene.spool), first_(first), last_(last),
        inputs_(last - first) {
    for (uint32_t p = first; p < last; ++p) inputs_[p - first].triangles.reserve(plan.pages[p].triangle_count);
  }

  Status add_chunk(const PlacedChunk& placed) {
    const uint32_t alpha = scene_.meshes[placed.mesh].row.alpha_texture;
    SPILLWAY_ASSIGN(const cache::AttributeSegmentData data,
                    reader_.read(placed.chunk, alpha != TextureId::kNone));
    std::vector<std::vector<std::byte>> micromaps;
    if (alpha != TextureId::kNone) SPILLWAY_TRY(bake_chunk(placed, data, alpha, micromaps));
    for (uint32_t face = 0; face < placed.chunk.face_count; ++face) {
      PageInput* page = page_of(placed.first_prim + face);
      if (page == nullptr) continue;
      PackTriangle triangle{};
      triangle.prim = placed.first_prim + face;
      for (int k = 0; k < 3; ++k) triangle.vertex[k] = data.positions[data.indices[3 * face + k]];
      page->triangles.push_back(triangle);
      if (!micromaps.empty() && !micromaps[face].empty()) put_micromap(*page, std::move(micromaps[face]));
    }
    return {};
  }

  std::vector<PageInput> take() {
    for (PageInput& page : inputs_)
      if (!page.micromaps.empty()) page.micromaps.resize(page.triangles.size());
    return std::move(inputs_);
  }

 private:
  PageInput* page_of(uint32_t prim) {
    const uint32_t page = plan_.page_of_prim[prim];
    return page >= first_ && page < last_ ? &inputs_[page - first_] : nullptr;
  }

  Status bake_chunk(const PlacedChunk& placed, const cache::AttributeSegmentData& data, uint32_t texture,
                    std::vector<std::vector<std::byte>>& micromaps) {
    micromaps.resize(placed.chunk.face_count);
    return parallel_status(micromaps.size(), [&](size_t face) -> Status {
      if (page_of(placed.first_prim + static_cast<uint32_t>(face)) == nullptr) return {};
      Float2 uv[3];
      face_uvs(data, &data.indices[3 * face], uv);
      SPILLWAY_ASSIGN(micromaps[face], bake_(texture, uv));
      return {};
    });
  }

  static void put_micromap(PageInput& page, std::vector<std::byte> micromap) {
    page.micromaps.resize(page.triangles.size());
    page.micromaps.back() = std::move(micromap);
  }

  const SpooledScene& scene_;
  const PagePlan& plan_;
  const BakeMicromap& bake_;
  SpoolReader reader_;
  uint32_t first_, last_;
  std::vector<PageInput> inputs_;
};

Status write_page(const Buffer<std::byte>& bytes, cache::PageLocation& page, Bounds3& bounds, cache::WriteFile& file) {
  const auto& header = *reinterpret_cast<const cache::TracePageHeader*>(bytes.data());
  page.offset_bytes = file.size_bytes();
  page.size_bytes = bytes.size();
  bounds = {header.lower, header.upper};
  return file.append(bytes);
}

Status write_batch(std::vector<PageInput> inputs, uint32_t first, PagePlan& plan, const BuildOptions& tree,
                   std::vector<Bounds3>& bounds, cache::WriteFile& file, uint64_t& content) {
  std::vector<Buffer<std::byte>> built(inputs.size());
  tbb::parallel_for(size_t{0}, inputs.size(), [&](size_t i) {
    built[i] = build_trace_page(inputs[i].triangles, inputs[i].micromaps, tree);
    inputs[i] = {};
  });
  for (size_t i = 0; i < built.size(); ++i) {
    content = hash_combine(content, reinterpret_cast<const cache::TracePageHeader*>(built[i].data())->checksum);
    SPILLWAY_TRY(write_page(built[i], plan.pages[first + i], bounds[first + i], file));
    built[i] = {};
  }
  return {};
}

}  // namespace

Result<PagePlan> plan_pages(const SpooledScene& scene, const PackPagesOptions& options) {
  const std::vector<ObjectChunks> objects = chunks_by_object(scene);
  SPILLWAY_TRY(check_memory(scene, objects, options.memory_limit_bytes));
  PagePlan plan;
  plan.page_of_prim = Buffer<uint32_t>(MemoryTag::pack, scene.prim_count);
  for (uint32_t o = 0; o < scene.object_count; ++o) {
    Buffer<ClusterItem> items(MemoryTag::pack, objects[o].item_count);
    SPILLWAY_TRY(load_items(scene, objects[o], items));
    const std::vector<uint32_t> begins =
        cluster_pages(items, {.max_triangles_per_page = options.max_triangles_per_page});
    add_pages(plan, items, begins, o);
  }
  return plan;
}

Result<std::vector<Bounds3>> pack_pages(const SpooledScene& scene, PagePlan& plan, const BakeMicromap& bake,
                                        const PackPagesOptions& options, cache::WriteFile& file,
                                        uint64_t& content) {
  std::vector<Bounds3> bounds(plan.pages.size());
  const BatchPlan batches = plan_batches(scene, plan);
  const uint64_t table_bytes = plan.page_of_prim.size_bytes();
  const uint64_t limit_bytes = options.memory_limit_bytes - std::min(options.memory_limit_bytes, table_bytes);
  for (uint32_t first = 0; first < plan.pages.size();) {
    const uint32_t last = batch_end(batches, first, limit_bytes);
    BatchFiller filler(scene, plan, bake, first, last);
    for (size_t c = 0; c < scene.chunks.size(); ++c)
      if (batches.chunk_pages[c].first < last && batches.chunk_pages[c].last > first)
        SPILLWAY_TRY(filler.add_chunk(scene.chunks[c]));
    SPILLWAY_TRY(write_batch(filler.take(), first, plan, options.tree, bounds, file, content));
    first = last;
  }
  return bounds;
}

}  // namespace spillway::pipeline
