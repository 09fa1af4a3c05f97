#pragma once

// The first nodes of pages that come and go: enough to tell most rays that they would meet nothing there.
//
// Owns: so many nodes a page. Memory: tag page_tree, all of it claimed at birth, touched page by page.
// Threads: note() by one at a time, while nobody looks at that page's top.
//
// A page's box is mostly air: between a city's towers a page of 2 MiB was read for 400 rays, most of which meet none of
// its boxes. A top is the part of the page's own tree whose boxes are largest; where it ends, a child is a leaf. A ray
// that reaches no leaf of it reaches no triangle of the page, so that looking here changes no hit.

#include <vector>

#include "cache/base/memory.h"
#include "cache/trace_page.h"

namespace spillway::cache {

class PageTops {
 public:
  PageTops() = default;
  PageTops(size_t page_count, uint32_t nodes_a_page);

  // Keeps the top of a page that is in memory; of one that is known already: nothing happens.
  void note(uint32_t page, const TracePageView& view);
  // A page that is not in memory, as the kernel sees it: no header, and its top where that is known.
  [[nodiscard]] TracePageView view(uint32_t page) const;

 private:
  uint32_t nodes_a_page_ = 0;
  std::vector<bool> known_;
  Buffer<TraceNode> nodes_;
};

}  // namespace spillway::cache
