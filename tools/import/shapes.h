#pragma once

// Shape: whatever a scene calls one, as triangles, moved into the space of their object.

#include <memory>
#include <optional>
#include <string>

#include "tools/import/lights.h"
#include "tools/import/params.h"
#include "tools/import/ply.h"
#include "tools/import/session.h"
#include "tools/import/subdivision.h"
#include "tools/import/textures.h"
#include "tools/import/transform.h"

namespace spillway::tools {

// The part of the graphics state that a shape takes with it.
struct ShapeState {
  Transform object_from_shape;  // the current transform: shapes of an object keep theirs, instances add their own
  bool reverse_orientation = false;
  MaterialId material;
  std::optional<AreaEmission> emission;
  uint32_t object = 0;
  bool divides_media = false;
  uint32_t medium_inside = pipeline::kNoMedium, medium_outside = pipeline::kNoMedium;
};

// A shape in its own space, with what it needs to be sent.
struct ReadShape {
  std::string type, name;
  Place place;
  PlyMesh mesh;
  std::optional<ReadCage> cage;  // of a subdivmesh, whose faces are mesh.indices
  TextureId alpha;
  ShapeState state;
  [[nodiscard]] bool emits() const { return state.emission && !is_black(state.emission->radiance); }
};

[[nodiscard]] bool is_supported_shape(const std::string& type);
Result<ReadShape> read_shape(Session& session, TextureTable& textures, const std::string& type, const ParamList& params,
                             Place place, const ShapeState& state);
// Moves it, and sends it to the sink.
Status send_shape(Session& session, ReadShape shape);

// What send_shape does to a mesh, by itself: moves it, and makes its geometric side and its normals agree.
// Returns whether the geometric normal is opposite to cross(p1 - p0, p2 - p0).
bool place_mesh(PlyMesh& mesh, const Transform& object_from_shape, bool reverse_orientation);

}  // namespace spillway::tools
