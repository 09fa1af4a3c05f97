#pragma once

// Reads triangle meshes from PLY files (Turk 1994): ascii, binary little and big endian; also gzipped, as .ply.gz.
//
// Vertices: x y z; nx ny nz; u v, s t, texture_u texture_v or texture_s texture_t. Faces: the list vertex_indices or
// vertex_index, of three corners, or of four, split into 0 1 2 and 0 2 3; read as polygons, of any number up to
// kMostPolygonCorners. Numbered triangles say which face they are of: by the property face_indices, or counted. Other
// properties and elements are skipped.
// Memory: one mesh, and one piece of the file; counts in the header are held against the file's size first.
// Fails: `file: byte n: what`; any file cut short is refused. Values that are not finite are left to the reader.

#include <cstdint>
#include <filesystem>
#include <vector>

#include "cache/base/result.h"
#include "cache/base/vec.h"
#include "pipeline/pack/scene_sink.h"

namespace spillway::tools {

struct PlyMesh {
  std::vector<Float3> positions;
  std::vector<Float3> normals;    // empty, or one a position
  std::vector<Float2> uvs;        // empty, or one a position
  std::vector<uint32_t> indices;  // three a triangle, all below positions.size()
  std::vector<pipeline::TriangleFace> faces;  // read as numbered triangles: one a triangle; else empty
  std::vector<uint32_t> corner_counts;  // read as polygons: one a face; else empty
};

inline constexpr uint32_t kMostPolygonCorners = 256;

enum class PlyFaces : uint8_t { triangles, numbered_triangles, polygons };
Result<PlyMesh> read_ply(const std::filesystem::path& file, PlyFaces faces = PlyFaces::triangles);

}  // namespace spillway::tools
