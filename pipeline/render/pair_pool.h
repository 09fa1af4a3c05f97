#pragma once

// Pairs of rays and pages, listed by page while they are found: each list is a ring of pieces of one pool.
//
// Owns: nothing; memory (PairMemory) and the lists' heads (Cell) are the caller's.
// Memory: tag rays, 8 bytes a pair and 4 a piece, all of it asked for at birth; touched as pieces are begun, front to back.
// Threads: add() to different cells at once; the rest by one thread at a time, or reading only.
// Fails: add() returns false when the pool is used up; what is listed is then of no use, counts go on with the caller.

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstdint>
#include <span>

#include "cache/base/memory.h"

namespace spillway::pipeline {

// A visit that is due: `ray` counts paths first, then shadow rays.
struct Pair {
  uint32_t ray, instance;
};

// The pairs of one page and one chunk of the order, rays in order: pairs[start .. start + count), or a list in a pool
// whose last piece is `start`.
struct Cell {
  uint32_t start, count;
};

// What pools of one wave after another are in: memory that was touched is not made zero again.
struct PairMemory {
  Buffer<Pair> pairs;
  Buffer<uint32_t> links;  // of pieces
};

class PairPool {
 public:
  // Pieces are small against what a cell may expect, so that little of them stays empty.
  PairPool(PairMemory& memory, size_t pair_capacity, size_t cell_count)
      : piece_pairs_(static_cast<uint32_t>(
            std::bit_floor(std::clamp<size_t>(pair_capacity / (4 * cell_count + 1), kSmallestPiece, kLargestPiece)))) {
    const size_t pieces = pair_capacity / piece_pairs_;
    memory.pairs.grow(MemoryTag::rays, pieces * piece_pairs_), memory.links.grow(MemoryTag::rays, pieces);
    pairs_ = std::span(memory.pairs).first(pieces * piece_pairs_), next_ = std::span(memory.links).first(pieces);
  }

  bool add(Cell& cell, Pair pair) {
    const uint32_t at = cell.count % piece_pairs_;
    if (at == 0 && !begin_piece(cell)) return false;
    pairs_[size_t{cell.start} * piece_pairs_ + at] = pair;
    ++cell.count;
    return true;
  }

  // Calls body(span of pairs) for each piece of the list, in order.
  template <class Body>
  void for_each_piece(const Cell& cell, const Body& body) const {
    if (cell.count == 0) return;
    uint32_t piece = next_[cell.start];
    for (uint32_t left = cell.count; left > 0; piece = next_[piece]) {
      const uint32_t here = std::min(left, piece_pairs_);
      body(std::span<const Pair>(pairs_.data() + size_t{piece} * piece_pairs_, here));
      left -= here;
    }
  }

 private:
  // Links are a ring: the last piece knows the first.
  bool begin_piece(Cell& cell) {
    const uint32_t piece = begun_.fetch_add(1, std::memory_order_relaxed);
    if (piece >= next_.size()) return false;
    next_[piece] = cell.count == 0 ? piece : next_[cell.start];
    if (cell.count != 0) next_[cell.start] = piece;
    cell.start = piece;
    return true;
  }

  static constexpr size_t kSmallestPiece = 16, kLargestPiece = 512;
  uint32_t piece_pairs_ = kSmallestPiece;
  std::span<Pair> pairs_;
  std::span<uint32_t> next_;
  std::atomic<uint32_t> begun_ = 0;
};

}  // namespace spillway::pipeline
