#pragma once

// The triangles of a scene between import and packing: in chunks as the attribute file will hold them, on disk.
//
// Owns: one scratch file (its name is unlinked at birth, so that nothing is left behind however the process ends).
// Memory: tag pack, one write buffer; of a chunk nothing but its table row stays.
// Threads: append() by one thread; after seal(), any number of SpoolReaders at once, each of one thread.
// Fails: the scratch file's errors.
// Format: chunks one after the other, 16-aligned: a chunk's columns are those of an attribute segment.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cache/attribute_block.h"
#include "cache/file.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

enum MeshChunkColumn : uint32_t { kChunkNormals = 1, kChunkUvs = 2 };

// Faces of one mesh that follow each other, at most a block of attributes, with their own deduplicated vertices.
struct MeshChunk {
  uint64_t offset_bytes = 0;
  uint32_t face_count = 0;
  uint32_t vertex_count = 0;
  uint32_t columns = 0;  // MeshChunkColumn
};

// A mesh as imported. Of its triangles only the number is known here; they are in the spool.
struct SpooledMesh {
  std::string name;
  Mesh row{};  // prim_base and light_base are set when all meshes are known
  bool emits = false;
  bool emits_two_sided = false;
  Rgb emission{0, 0, 0};
  std::vector<MeshChunk> chunks;
};

// A chunk once meshes are numbered.
struct PlacedChunk {
  MeshChunk chunk;
  uint32_t mesh;
  uint32_t first_prim;
};

class MeshSpool;

// What the stages of packing read: meshes by MeshId, their chunks by ascending prim.
struct SpooledScene {
  std::vector<SpooledMesh> meshes;
  std::vector<PlacedChunk> chunks;
  uint32_t prim_count = 0;
  uint32_t object_count = 1;
  const MeshSpool* spool = nullptr;
};

class MeshSpool {
 public:
  static Result<MeshSpool> create(cache::Scratch& scratch);

  Result<MeshChunk> append(const cache::AttributeSegmentData& data);
  Status seal();  // nothing may be appended afterwards

 private:
  MeshSpool() = default;
  Status append_bytes(std::span<const std::byte> bytes);
  Status flush();

  friend class SpoolReader;
  std::unique_ptr<cache::Scratch::File> file_;
  Buffer<std::byte> buffer_;
  size_t buffered_ = 0;
  uint64_t flushed_bytes_ = 0;
};

// Reads chunks of a sealed spool through a window of a MiB, since small chunks usually follow each other.
class SpoolReader {
 public:
  explicit SpoolReader(const MeshSpool& spool) : spool_(spool) {}

  // Indices and positions, and the other columns when `everything`. mesh and first_prim are left to the caller.
  Result<cache::AttributeSegmentData> read(const MeshChunk& chunk, bool everything);

 private:
  Result<const std::byte*> bytes(uint64_t offset, uint64_t size);

  const MeshSpool& spool_;
  Buffer<std::byte> window_;
  uint64_t window_begin_ = 0, window_end_ = 0;  // of the spool
};

}  // namespace spillway::pipeline
