#pragma once

// The cages of a scene between import and dicing: their arrays on disk, a row of some hundred bytes each in memory.
//
// Owns: one scratch file, made with the first cage.
// Memory: tag pack, one buffer of a MiB. Threads: one. Fails: the scratch file's errors.
// Format: the arrays of a cage one after the other, in the order of SubdivisionCage, cages end to end.

#include <memory>
#include <span>
#include <vector>

#include "cache/base/memory.h"
#include "cache/file.h"
#include "pipeline/pack/subdivision_cage.h"

namespace spillway::pipeline {

struct SpooledCage {
  SubdivisionCage row;       // without its arrays
  uint32_t item_counts[8];   // of these
  uint64_t offset_bytes, size_bytes;
  Bounds3 bounds;            // of its vertices
};

class CageSpool {
 public:
  Status append(SubdivisionCage cage, cache::Scratch& scratch);
  Status seal();  // before the first read()
  [[nodiscard]] std::span<const SpooledCage> cages() const { return cages_; }
  [[nodiscard]] Result<SubdivisionCage> read(const SpooledCage& cage) const;

 private:
  Status append_bytes(std::span<const std::byte> bytes);
  Status flush();

  std::unique_ptr<cache::Scratch::File> file_;
  Buffer<std::byte> buffer_;
  size_t buffered_ = 0;
  uint64_t flushed_bytes_ = 0;
  std::vector<SpooledCage> cages_;
};

}  // namespace spillway::pipeline
