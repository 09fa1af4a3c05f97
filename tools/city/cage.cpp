#include "tools/city/cage.h"

#include <utility>

#include "pipeline/pack/dice_cage.h"

namespace spillway::tools::city {
namespace {

// Covers a ring with faces of four corners around a middle.
void close_ring(Cage& cage, const Frame& frame, const RingStack& stack, bool high) {
  const std::vector<Vec3>& ring = high ? stack.rings.back() : stack.rings.front();
  const std::vector<Vec3>& inner = high ? stack.rings[stack.rings.size() - 2] : stack.rings[1];
  const auto count = static_cast<uint32_t>(ring.size());
  Vec3 middle, inner_middle;
  for (const Vec3& p : ring) middle = middle + p * (1.0 / count);
  for (const Vec3& p : inner) inner_middle = inner_middle + p * (1.0 / count);
  const Vec3 out = normalize(middle - inner_middle) * (high ? stack.high_bulge : stack.low_bulge);
  const auto first = high ? static_cast<uint32_t>((stack.rings.size() - 1) * count) : 0u;
  const auto centre = static_cast<uint32_t>(cage.positions.size());
  cage.positions.push_back(frame.point(middle + out));
  for (uint32_t i = 0; i < count; i += 2) {
    const uint32_t a = first + i, b = first + (i + 1) % count, c = first + (i + 2) % count;
    if (high)
      cage.indices.insert(cage.indices.end(), {a, b, c, centre});
    else
      cage.indices.insert(cage.indices.end(), {c, b, a, centre});
  }
}

}  // namespace

Cage ring_cage(Surface surface, const Frame& frame, const RingStack& stack) {
  Cage cage;
  cage.surface = surface;
  const auto count = static_cast<uint32_t>(stack.rings[0].size());
  for (const std::vector<Vec3>& ring : stack.rings)
    for (const Vec3& p : ring) cage.positions.push_back(frame.point(p));
  for (uint32_t r = 0; r + 1 < stack.rings.size(); ++r)
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t a = r * count + i, b = r * count + (i + 1) % count;
      cage.indices.insert(cage.indices.end(), {a, b, b + count, a + count});
    }
  if (stack.closed_low) close_ring(cage, frame, stack, false);
  if (stack.closed_high) close_ring(cage, frame, stack, true);
  return cage;
}

void crease_ring(Cage& cage, const RingStack& stack, size_t ring, float sharpness) {
  const auto count = static_cast<uint32_t>(stack.rings[0].size());
  const auto first = static_cast<uint32_t>(ring * count);
  for (uint32_t i = 0; i < count; ++i) cage.sharp_edges.push_back({{first + i, first + (i + 1) % count}, sharpness});
}

void crease_column(Cage& cage, const RingStack& stack, size_t point, size_t first_ring, size_t last_ring,
                   float sharpness) {
  const size_t count = stack.rings[0].size();
  for (size_t r = first_ring; r < last_ring; ++r)
    cage.sharp_edges.push_back(
        {{static_cast<uint32_t>(r * count + point), static_cast<uint32_t>((r + 1) * count + point)}, sharpness});
}

std::vector<Vec3> circle_ring(size_t points, double radius, double z) {
  std::vector<Vec3> ring;
  for (size_t i = 0; i < points; ++i) {
    const Vec2 d = direction_of(6.283185307179586 * static_cast<double>(i) / static_cast<double>(points));
    ring.push_back({d.x * radius, d.y * radius, z});
  }
  return ring;
}

void dome_cage(Geometry& g, Surface surface, const Frame& frame, double radius, double z, double height, bool ribs) {
  constexpr size_t kPoints = 16;
  RingStack stack;
  // Out a little over the foot; the limit surface lies inside of the cage.
  stack.rings = {circle_ring(kPoints, radius, z), circle_ring(kPoints, radius * 1.03, z + height * 0.3),
                 circle_ring(kPoints, radius * 0.86, z + height * 0.68),
                 circle_ring(kPoints, radius * 0.5, z + height * 0.95)};
  stack.closed_high = true, stack.high_bulge = height * 0.07;
  Cage cage = ring_cage(surface, frame, stack);
  if (ribs)
    for (size_t i = 0; i < kPoints; i += 2) crease_column(cage, stack, i, 0, 3, 10);
  g.add_cage(std::move(cage));
}

Result<SurfaceMesh> tessellated(const Cage& cage, uint32_t pieces) {
  const std::vector<uint32_t> counts(cage.indices.size() / 4, 4);
  pipeline::SubdivisionInput input;
  input.cage.name = "cage";
  input.cage.positions = cage.positions, input.cage.indices = cage.indices;
  input.corner_counts = counts;
  input.sharp_edges = cage.sharp_edges, input.holes = cage.holes;
  SPILLWAY_ASSIGN(const pipeline::SubdivisionCage kept, pipeline::make_cage(input));
  SPILLWAY_ASSIGN(const auto dicer, pipeline::CageDicer::create(kept, [pieces](const Float3(&)[3]) { return pieces; }));
  dicer->evaluate_shared();
  SurfaceMesh mesh;
  for (size_t i = 0; i < dicer->piece_count(); ++i) {
    const pipeline::DicedPiece piece = dicer->piece(i);
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), piece.positions.begin(), piece.positions.end());
    mesh.normals.insert(mesh.normals.end(), piece.normals.begin(), piece.normals.end());
    for (const uint32_t index : piece.indices) mesh.indices.push_back(first + index);
  }
  return mesh;
}

}  // namespace spillway::tools::city
