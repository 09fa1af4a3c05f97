#pragma once

// A parallel loop whose steps may fail: the error of the lowest failing step, whatever the threads did.

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cstddef>
#include <mutex>
#include <optional>

#include "cache/base/result.h"

namespace spillway {

template <class Step>
Status parallel_status(size_t count, const Step& step) {
  if (count == 1) return step(size_t{0});
  std::mutex mutex;
  std::optional<Error> first;
  size_t first_index = count;
  tbb::parallel_for(tbb::blocked_range<size_t>(0, count, 1), [&](const tbb::blocked_range<size_t>& range) {
    for (size_t i = range.begin(); i != range.end(); ++i) {
      const Status status = step(i);
      if (status) continue;
      const std::lock_guard lock(mutex);
      if (i < first_index) first_index = i, first = status.error();
    }
  }, tbb::simple_partitioner());
  if (first) return *first;
  return {};
}

}  // namespace spillway
