#include "pipeline/render/attribute_store.h"

#include <algorithm>

namespace spillway::pipeline {

uint32_t AttributeStore::block_of(uint32_t prim) const {
  const auto after = std::upper_bound(locations_.begin(), locations_.end(), prim,
                                      [](uint32_t p, const AttributeLocation& l) { return p < l.first_prim; });
  return static_cast<uint32_t>(after - locations_.begin()) - 1;
}

}  // namespace spillway::pipeline
