#pragma once

// The triangles of a scene between import and packing: in chunks as the attribute file will hold them, on disk.
//
// Owns: one scratch file (its name is unlinked at birth, so that nothing is left behind however the process ends).
// Memory: tag pack, a MiB a lane, 64 lanes at most; of a chunk nothing but its table row stays.
// Threads: append() by one thread; after seal(), any number of SpoolReaders at once, each of one thread.
// Fails: the scratch file's errors.
// Format: regions of kRegionBytes, each of one lane (a chunk that is larger: of several regions to itself); in a region
//         chunks one after the other, 16-aligned: positions, indices, normals, uvs, faces of an attribute segment. Meshes are
//         packed by material: a lane a material makes each of them a sequential read, however the import mixed them.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cache/attribute_block.h"
#include "cache/file.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

enum MeshChunkColumn : uint32_t { kChunkNormals = 1, kChunkUvs = 2, kChunkFaces = 4 };

// Faces of one mesh that follow each other, at most a block of attributes, with their own deduplicated vertices.
struct MeshChunk {
  uint64_t offset_bytes = 0;
  uint16_t face_count = 0;  // at most cache::kMaxFacesPerAttributeBlock
  uint16_t vertex_count = 0;
  uint32_t columns = 0;  // MeshChunkColumn
};
static_assert(sizeof(MeshChunk) == 16);

// Of its columns: positions and indices, and the others when `everything`.
[[nodiscard]] uint64_t chunk_bytes(const MeshChunk& chunk, bool everything);

// A mesh as imported. Of its triangles only the number is known here; they are in the spool.
struct SpooledMesh {
  std::string name;
  Mesh row{};  // prim_base and light_base are set when all meshes are known
  bool emits = false;
  bool emits_two_sided = false;
  Rgb emission{0, 0, 0};
  uint32_t emission_texture = TextureId::kNone;
  bool emission_is_mean = false;
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
  static constexpr uint64_t kRegionBytes = 1 << 20;
  static constexpr uint32_t kMaxLanes = 64;

  static Result<MeshSpool> create(cache::Scratch& scratch);

  // Chunks of the same lane lie together.
  Result<MeshChunk> append(const cache::AttributeSegmentData& data, uint32_t lane);
  Status seal();  // nothing may be appended afterwards

 private:
  // The region that a lane is filling.
  struct Lane {
    Buffer<std::byte> buffer;
    uint64_t offset_bytes = 0;
    uint64_t used_bytes = 0;
  };

  MeshSpool() = default;
  Status flush(Lane& lane);
  void open_region(Lane& lane, uint64_t bytes);

  friend class SpoolReader;
  std::unique_ptr<cache::Scratch::File> file_;
  std::vector<Lane> lanes_;
  uint64_t end_bytes_ = 0;      // of all regions
  uint64_t written_bytes_ = 0;  // where the file ends
};

// Reads chunks of a sealed spool region by region, since small chunks usually follow each other.
class SpoolReader {
 public:
  explicit SpoolReader(const MeshSpool& spool) : spool_(spool) {}

  // Indices and positions, and the other columns when `everything`. mesh and first_prim are left to the caller.
  Result<cache::AttributeSegmentData> read(const MeshChunk& chunk, bool everything);
  // What trace pages need, where it lies; valid until the next call.
  struct View {
    std::span<const uint16_t> indices;
    std::span<const Float3> positions;
  };
  Result<View> view(const MeshChunk& chunk);

 private:
  Result<const std::byte*> bytes(uint64_t offset, uint64_t size);

  const MeshSpool& spool_;
  Buffer<std::byte> window_;
  uint64_t window_begin_ = 0, window_end_ = 0;  // of the spool
};

}  // namespace spillway::pipeline
