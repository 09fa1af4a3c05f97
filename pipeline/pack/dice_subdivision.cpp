#include "pipeline/pack/dice_subdivision.h"

#include <tbb/task_arena.h>

#include <cmath>
#include <map>

#include "cache/base/memory.h"
#include "cache/base/parallel_status.h"
#include "pipeline/pack/dice_cage.h"
#include "pipeline/pack/spool_mesh.h"

namespace spillway::pipeline {
namespace {

constexpr uint64_t kBatchBytes = 64 << 20;  // of cages that are prepared together

// A cage for one object: `px_per_unit` on the picture, or by the place of each edge in the world.
struct DiceJob {
  const SubdivisionCage* cage;
  uint32_t object;
  double px_per_unit;  // 0: of the world
};

// ---- instances ----

class InstanceGroups {
 public:
  InstanceGroups(const DicedScene& diced, const DiceView& view) : diced_(diced), view_(view) {}

  // Jobs in the order of cages, then of details. Cages of objects that stand nowhere have none.
  std::vector<DiceJob> make() {
    note_objects();
    choose_details();
    move_instances();
    std::vector<DiceJob> jobs;
    for (const SubdivisionCage& cage : diced_.cages) {
      const uint32_t object = cage.surface.object;
      if (object == 0) jobs.push_back({&cage, 0, 0});
      else
        for (const auto& [detail, variant] : variants_[object]) jobs.push_back({&cage, variant, std::ldexp(1.0, detail)});
    }
    return jobs;
  }

 private:
  void note_objects() {
    boxes_.resize(diced_.scene.object_count);
    has_triangles_.resize(diced_.scene.object_count, false);
    variants_.resize(diced_.scene.object_count);
    for (const SubdivisionCage& cage : diced_.cages)
      for (const Float3 p : cage.positions) boxes_[cage.surface.object].grow(p);
    for (const SpooledMesh& mesh : diced_.scene.meshes) has_triangles_[mesh.row.object] = true;
  }

  void choose_details() {
    details_.resize(diced_.instances.size());
    for (size_t i = 1; i < details_.size(); ++i) {
      const cache::Instance& instance = diced_.instances[i];
      const Bounds3& box = boxes_[instance.object];
      if (box.empty()) continue;
      details_[i] = detail_of_instance(view_, box, instance.world_from_object);
      if (instance.motion != 0)
        details_[i] = std::max(details_[i], detail_of_instance(view_, box, diced_.motions[instance.motion - 1].key[1]));
      variants_[instance.object].try_emplace(details_[i], 0);
    }
    for (uint32_t object = 1; object < variants_.size(); ++object) number_variants(object);
  }

  // The first detail stays in the object itself, unless its triangles serve other details too.
  void number_variants(uint32_t object) {
    std::map<int, uint32_t>& variants = variants_[object];
    bool use_object = variants.size() == 1 || !has_triangles_[object];
    for (auto& [detail, variant] : variants) {
      variant = use_object ? object : diced_.scene.object_count++;
      if (!use_object) diced_.object_names.push_back(diced_.object_names[object - 1] + fmt::format(" (detail {})", detail));
      use_object = false;
    }
  }

  void move_instances() {
    const size_t count = diced_.instances.size();
    for (size_t i = 1; i < count; ++i) {
      const uint32_t object = diced_.instances[i].object;
      if (object >= variants_.size() || variants_[object].empty()) continue;
      const uint32_t variant = variants_[object].at(details_[i]);
      if (variant == object) continue;
      cache::Instance moved = diced_.instances[i];
      moved.object = variant;
      if (has_triangles_[object]) diced_.instances.push_back(moved);
      else diced_.instances[i] = moved;
    }
  }

  const DicedScene& diced_;
  const DiceView& view_;
  std::vector<Bounds3> boxes_;                      // of an object's cages
  std::vector<bool> has_triangles_;                 // of an object
  std::vector<std::map<int, uint32_t>> variants_;   // of an object: by detail, the object that has it
  std::vector<int> details_;                        // of an instance
};

// ---- dicing ----

EdgePieces edge_pieces(const DiceJob& job, const DiceView& view, const DiceOptions& options) {
  return [job, &view, &options](const Float3(&edge)[3]) {
    const double chords = double{length(edge[1] - edge[0])} + double{length(edge[2] - edge[1])};
    if (!(chords > 0)) return 1u;
    double px_per_unit = job.px_per_unit;
    if (px_per_unit == 0) {
      Bounds3 box;
      for (const Float3 p : edge) box.grow(p);
      px_per_unit = view.px_per_unit(box, 0);
    }
    return piece_count(chords * px_per_unit / options.edge_length_px, options.most_pieces);
  };
}

// A piece of a job of the batch.
struct PieceOf {
  size_t job, piece;
};

class Dicing {
 public:
  Dicing(const DicedScene& diced, const DiceView& view, const DiceOptions& options, uint32_t max_faces_per_chunk)
      : diced_(diced), view_(view), options_(options), max_faces_per_chunk_(max_faces_per_chunk) {}

  // Jobs whose cages are about kBatchBytes.
  Status dice(std::span<const DiceJob> jobs) {
    std::vector<std::unique_ptr<CageDicer>> dicers(jobs.size());
    SPILLWAY_TRY(parallel_status(jobs.size(), [&](size_t i) -> Status {
      SPILLWAY_ASSIGN(dicers[i], CageDicer::create(*jobs[i].cage, edge_pieces(jobs[i], view_, options_)));
      return {};
    }));
    for (size_t i = 0; i < jobs.size(); ++i) SPILLWAY_TRY(count(*jobs[i].cage, dicers[i]->triangle_count()));
    tbb::parallel_for(size_t{0}, jobs.size(), [&](size_t i) { dicers[i]->evaluate_shared(); });
    std::vector<PieceOf> pieces;
    for (size_t i = 0; i < jobs.size(); ++i)
      for (size_t p = 0; p < dicers[i]->piece_count(); ++p) pieces.push_back({i, p});
    return dice_pieces(jobs, dicers, pieces);
  }

 private:
  Status count(const SubdivisionCage& cage, uint64_t triangles) {
    triangle_count_ += triangles;
    if (triangle_count_ <= options_.most_triangles) return {};
    return error("{}: asks for {} triangles, with the cages before it {}; {} are allowed: use longer edges",
                 cage.surface.name, triangles, triangle_count_, options_.most_triangles);
  }

  Status dice_pieces(std::span<const DiceJob> jobs, const std::vector<std::unique_ptr<CageDicer>>& dicers,
                     std::span<const PieceOf> pieces) {
    const size_t window = 2 * static_cast<size_t>(tbb::this_task_arena::max_concurrency());
    std::vector<DicedPiece> made(window);
    SpooledMesh mesh;
    for (size_t first = 0; first < pieces.size(); first += window) {
      const size_t count = std::min(window, pieces.size() - first);
      tbb::parallel_for(size_t{0}, count, [&](size_t i) {
        made[i] = dicers[pieces[first + i].job]->piece(pieces[first + i].piece);
      });
      for (size_t i = 0; i < count; ++i) {
        const auto [job, piece] = pieces[first + i];
        SPILLWAY_TRY(spool(jobs[job], made[i], mesh));
        if (piece + 1 == dicers[job]->piece_count()) end_mesh(mesh);
      }
    }
    return {};
  }

  Status spool(const DiceJob& job, const DicedPiece& piece, SpooledMesh& mesh) {
    MeshInput input = job.cage->surface;
    input.object = job.object;
    input.positions = piece.positions, input.normals = piece.normals, input.uvs = piece.uvs;
    input.indices = piece.indices;
    SPILLWAY_ASSIGN(SpooledMesh part, spool_mesh(input, diced_.spool, max_faces_per_chunk_, diced_.degenerate_count));
    if (mesh.chunks.empty()) {
      mesh = std::move(part);
      return {};
    }
    mesh.row.face_count += part.row.face_count;
    mesh.chunks.insert(mesh.chunks.end(), part.chunks.begin(), part.chunks.end());
    return {};
  }

  void end_mesh(SpooledMesh& mesh) {
    if (!mesh.chunks.empty()) diced_.scene.meshes.push_back(std::move(mesh));
    mesh = {};
  }

  const DicedScene& diced_;
  const DiceView& view_;
  const DiceOptions& options_;
  uint32_t max_faces_per_chunk_;
  uint64_t triangle_count_ = 0;
};

}  // namespace

Status dice_subdivision(const DicedScene& diced, const DiceOptions& options, uint32_t max_faces_per_chunk) {
  if (diced.cages.empty()) return {};
  const DiceView view(options.cameras);
  const std::vector<DiceJob> jobs = InstanceGroups(diced, view).make();
  Dicing dicing(diced, view, options, max_faces_per_chunk);
  for (size_t first = 0; first < jobs.size();) {
    uint64_t bytes = 0;
    size_t last = first;
    while (last < jobs.size() && (last == first || bytes + jobs[last].cage->size_bytes() <= kBatchBytes))
      bytes += jobs[last++].cage->size_bytes();
    SPILLWAY_TRY(dicing.dice(std::span(jobs).subspan(first, last - first)));
    first = last;
  }
  return {};
}

}  // namespace spillway::pipeline
