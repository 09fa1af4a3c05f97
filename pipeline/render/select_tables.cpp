#include "pipeline/render/select_tables.h"

#include <algorithm>

namespace spillway::pipeline {

bool looks_up_images(const Store& store) {
  return !store.face_textures().empty() ||
         std::ranges::any_of(store.textures(), [](const TextureNode& node) { return node.kind == TextureKind::image; });
}

SelectedTextures::SelectedTextures(const Store& store, TextureFilter filter) : nodes_(store.textures()) {
  if (filter == TextureFilter::of_texture || nodes_.empty()) return;
  changed_ = Buffer<TextureNode>(MemoryTag::scene, nodes_.size());
  std::copy(nodes_.begin(), nodes_.end(), changed_.begin());
  for (TextureNode& node : changed_)
    node.filter = filter == TextureFilter::point      ? cache::TexelFilter::point
                  : filter == TextureFilter::bilinear ? cache::TexelFilter::bilinear
                                                      : cache::TexelFilter::trilinear;
  nodes_ = changed_;
}

SelectedMedia::SelectedMedia(const Store& store, MajorantExtent extent) : tables_(store.medium_tables()) {
  cache::VolumeTables& volumes = tables_.volumes;
  if (extent == MajorantExtent::cell || volumes.cell_max.empty()) return;
  changed_ = Buffer<float>(MemoryTag::volumes, volumes.cell_max.size());
  std::copy(volumes.cell_max.begin(), volumes.cell_max.end(), changed_.begin());
  for (const cache::VolumeGrid& grid : volumes.grids) loosen(grid, extent);
  volumes.cell_max = changed_;
}

// Cells of bricks that are not there stay empty: they have no bound to loosen.
void SelectedMedia::loosen(const cache::VolumeGrid& grid, MajorantExtent extent) {
  const size_t cells = cache::brick_cell_count(grid.brick_voxels);
  for (uint32_t brick = 0; brick < grid.brick_total; ++brick) {
    float* const first = changed_.data() + grid.first_cell + brick * cells;
    const float largest = extent == MajorantExtent::grid ? grid.value_max : *std::max_element(first, first + cells);
    std::fill(first, first + cells, largest);
  }
}

}  // namespace spillway::pipeline
