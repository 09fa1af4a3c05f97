#pragma once

// Diced cages between packings, by content: another frame, shot or scene with the same cage at the same rates finds its
// triangles instead of dicing them again.
//
// Owns: nothing; files `<128-bit key>.dice` in a directory. Any number of processes may use one; whoever is first writes.
// Memory: a piece at a time; no file stays open. Threads: find() and piece() by any number at once.
// Fails: a file that is damaged or too short, by name; delete it.
// Format: Header, then for each piece PieceHeader, positions, normals, uvs (when it has any), indices.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "cache/file.h"
#include "pipeline/pack/dice_cage.h"

namespace spillway::pipeline {

struct DiceKey {
  uint64_t words[2];
};
// Of everything that a cage's triangles depend on; `heights`: of its displacement.
[[nodiscard]] DiceKey dice_key(const SubdivisionCage& cage, std::span<const uint32_t> rates, uint64_t heights);

class CachedPieces {
 public:
  [[nodiscard]] Result<DicedPiece> piece(size_t index) const;

 private:
  friend class DiceCache;
  explicit CachedPieces(std::filesystem::path path) : path_(std::move(path)) {}
  Status scan(const DiceKey& key, size_t piece_count);
  std::filesystem::path path_;
  std::vector<uint64_t> offsets_;
};

class PieceWriter {
 public:
  Status append(const DicedPiece& piece);
  Status commit() { return file_.commit(); }

 private:
  friend class DiceCache;
  explicit PieceWriter(cache::WriteFile file) : file_(std::move(file)) {}
  cache::WriteFile file_;
};

class DiceCache {
 public:
  // Makes the directory when it is not there.
  static Result<DiceCache> open(const std::filesystem::path& directory);
  // Null: not there.
  Result<std::unique_ptr<CachedPieces>> find(const DiceKey& key, size_t piece_count) const;
  // Nothing is there until commit().
  Result<PieceWriter> create(const DiceKey& key, size_t piece_count) const;

 private:
  explicit DiceCache(std::filesystem::path directory) : directory_(std::move(directory)) {}
  [[nodiscard]] std::filesystem::path file_of(const DiceKey& key) const;
  std::filesystem::path directory_;
};

}  // namespace spillway::pipeline
