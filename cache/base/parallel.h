#pragma once

// Ordered parallel loops on oneTBB. A loop is cut into blocks whose bounds depend on the counts alone, never on the
// number of threads; results are appended in block order.

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <cstddef>

namespace spillway {

inline size_t block_count(size_t count, size_t block) { return (count + block - 1) / block; }

// Calls body(block_index, first, last) for each block of [0, count), on all threads of the current arena.
template <class Body>
void parallel_blocks(size_t count, size_t block, const Body& body) {
  const size_t blocks = block_count(count, block);
  if (blocks == 1) return body(size_t{0}, size_t{0}, count);
  tbb::parallel_for(tbb::blocked_range<size_t>(0, blocks, 1), [&](const tbb::blocked_range<size_t>& range) {
    for (size_t b = range.begin(); b != range.end(); ++b) {
      const size_t first = b * block;
      body(b, first, first + block < count ? first + block : count);
    }
  }, tbb::simple_partitioner());
}

// What body() returns, run with that many threads: neither fewer, whatever the machine has, nor more in libraries that use
// oneTBB outside of the arena.
template <class Body>
auto on_threads(int count, const Body& body) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(count));
  return tbb::task_arena(count).execute(body);
}

}  // namespace spillway
