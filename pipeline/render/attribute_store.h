#pragma once

// The attribute blocks of a store, in memory as far as the budget allows, found by prim.
//
// Owns: a PartStore over the attribute file. Memory: tag attributes. Threads and failures: as PartStore.

#include <memory>
#include <span>
#include <vector>

#include "cache/attribute_block.h"
#include "cache/part_store.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

class AttributeStore {
 public:
  AttributeStore(std::unique_ptr<cache::PartStore> parts, std::span<const AttributeLocation> locations)
      : parts_(std::move(parts)), locations_(locations) {}

  // The block that holds the prim; prims are dense over blocks.
  [[nodiscard]] uint32_t block_of(uint32_t prim) const;
  [[nodiscard]] uint64_t first_prim(uint32_t block) const { return locations_[block].first_prim; }
  // One past the last prim of the block.
  [[nodiscard]] uint64_t end_prim(uint32_t block) const {
    return uint64_t{locations_[block].first_prim} + locations_[block].prim_count;
  }
  [[nodiscard]] std::span<const std::byte> resident(uint32_t block) const { return parts_->resident(block); }
  [[nodiscard]] cache::PartStore& parts() { return *parts_; }
  [[nodiscard]] const cache::PartStore& parts() const { return *parts_; }

 private:
  std::unique_ptr<cache::PartStore> parts_;
  std::span<const AttributeLocation> locations_;
};

}  // namespace spillway::pipeline
