#include "pipeline/pack/dice_subdivision.h"

#include <tbb/task_arena.h>

#include <cmath>
#include <map>
#include <optional>

#include "cache/base/memory.h"
#include "cache/base/parallel_status.h"
#include "pipeline/pack/dice_cache.h"
#include "pipeline/pack/dice_cage.h"
#include "pipeline/pack/spool_mesh.h"

namespace spillway::pipeline {
namespace {

// Of cages that are prepared together; with their topologies and edges some ten times as much, and for each the patches of
// its irregular faces.
constexpr uint64_t kBatchBytes = 8 << 20;
constexpr uint64_t kPatchBytes = 64 << 10;

// A cage for one object: `px_per_unit` on the picture, or by the place of each edge in the world.
struct DiceJob {
  const SpooledCage* cage;
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
    for (const SpooledCage& cage : diced_.cages.cages()) {
      const uint32_t object = cage.row.surface.object;
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
    for (const SpooledCage& cage : diced_.cages.cages()) boxes_[cage.row.surface.object].grow(cage.bounds);
    for (const SpooledMesh& mesh : diced_.scene.meshes) has_triangles_[mesh.row.object] = true;
  }

  void choose_details() {
    details_.resize(diced_.instances.size());
    for (size_t i = 1; i < details_.size(); ++i) {
      const cache::Instance& instance = diced_.instances[i];
      const Bounds3& box = boxes_[instance.object];
      if (box.empty()) continue;
      details_[i] = detail_of(instance, box);
      variants_[instance.object].try_emplace(details_[i], 0);
    }
    for (uint32_t object = 1; object < variants_.size(); ++object) number_variants(object);
  }

  // What moves is looked at where its way begins, in the middle, and where it ends.
  [[nodiscard]] int detail_of(const cache::Instance& instance, const Bounds3& box) const {
    int detail = detail_of_instance(view_, box, instance.world_from_object);
    if (instance.motion == 0) return detail;
    for (const float time : {0.5f, 1.0f})
      detail = std::max(detail, detail_of_instance(view_, box, transform_at(diced_.motions[instance.motion - 1], time)));
    return detail;
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

// Smaller ones are diced sooner than a file is opened.
constexpr uint64_t kLeastCachedTriangles = 4096;

// A job at work: its triangles come from the dicer or from the cache.
struct ActiveJob {
  SubdivisionCage cage;
  std::unique_ptr<CageDicer> dicer;
  std::unique_ptr<CachedPieces> cached;
  std::optional<DiceKey> key;         // under which the cache will want it
  std::optional<PieceWriter> writer;  // from the first piece to the last: one at a time is open

  [[nodiscard]] Result<DicedPiece> piece(size_t index) const { return cached ? cached->piece(index) : dicer->piece(index); }
};

// A piece of a job of the batch.
struct PieceOf {
  size_t job, piece;
};

class Dicing {
 public:
  Dicing(const DicedScene& diced, const DiceView& view, const DiceOptions& options, uint32_t max_faces_per_chunk)
      : diced_(diced), view_(view), options_(options), max_faces_per_chunk_(max_faces_per_chunk) {}

  Status open_cache() {
    if (options_.cache_directory.empty()) return {};
    SPILLWAY_ASSIGN(cache_, DiceCache::open(options_.cache_directory));
    return {};
  }

  // Jobs whose cages are about kBatchBytes.
  Status dice(std::span<const DiceJob> jobs) {
    std::vector<ActiveJob> active(jobs.size());
    for (size_t i = 0; i < jobs.size(); ++i) {
      SPILLWAY_ASSIGN(active[i].cage, diced_.cages.read(*jobs[i].cage));
    }
    SPILLWAY_TRY(parallel_status(jobs.size(), [&](size_t i) -> Status {
      const HeightsAt heights = diced_.displacement.heights(active[i].cage);
      SPILLWAY_ASSIGN(active[i].dicer, CageDicer::create(active[i].cage, edge_pieces(jobs[i], view_, options_), heights));
      return {};
    }));
    for (size_t i = 0; i < jobs.size(); ++i) SPILLWAY_TRY(count(active[i].cage, active[i].dicer->triangle_count()));
    SPILLWAY_TRY(parallel_status(jobs.size(), [&](size_t i) {
      const Status looked_up = look_up(active[i]);
      if (looked_up && !active[i].cached) active[i].dicer->evaluate_shared();
      return looked_up;
    }));
    std::vector<PieceOf> pieces;
    for (size_t i = 0; i < jobs.size(); ++i)
      for (size_t p = 0; p < active[i].dicer->piece_count(); ++p) pieces.push_back({i, p});
    for (const ActiveJob& job : active)
      if (job.cached) ++report_.cached_cage_count, report_.cached_triangle_count += job.dicer->triangle_count();
    return dice_pieces(jobs, active, pieces);
  }

  [[nodiscard]] const DiceReport& report() const { return report_; }

 private:
  Status count(const SubdivisionCage& cage, uint64_t triangles) {
    ++report_.cage_count, report_.triangle_count += triangles;
    if (report_.triangle_count <= options_.most_triangles) return {};
    return error("{}: asks for {} triangles, with the cages before it {}; {} are allowed: use longer edges",
                 cage.surface.name, triangles, report_.triangle_count, options_.most_triangles);
  }

  Status look_up(ActiveJob& job) const {
    if (!cache_ || job.dicer->triangle_count() < kLeastCachedTriangles) return {};
    const DiceKey key = dice_key(job.cage, job.dicer->rates(), diced_.displacement.key(job.cage));
    SPILLWAY_ASSIGN(job.cached, cache_->find(key, job.dicer->piece_count()));
    if (job.cached) return {};
    job.key = key;
    return {};
  }

  Status dice_pieces(std::span<const DiceJob> jobs, std::vector<ActiveJob>& active, std::span<const PieceOf> pieces) {
    const size_t window = 2 * static_cast<size_t>(tbb::this_task_arena::max_concurrency());
    std::vector<DicedPiece> made(window);
    SpooledMesh mesh;
    for (size_t first = 0; first < pieces.size(); first += window) {
      const size_t count = std::min(window, pieces.size() - first);
      SPILLWAY_TRY(parallel_status(count, [&](size_t i) -> Status {
        const auto [job, piece] = pieces[first + i];
        SPILLWAY_ASSIGN(made[i], active[job].piece(piece));
        return {};
      }));
      SPILLWAY_TRY(diced_.displacement.status());
      for (size_t i = 0; i < count; ++i) {
        const auto [job, piece] = pieces[first + i];
        SPILLWAY_TRY(spool(jobs[job], made[i], mesh));
        if (active[job].key) SPILLWAY_TRY(keep(active[job], piece, made[i]));
        if (piece + 1 == active[job].dicer->piece_count()) SPILLWAY_TRY(end_job(active[job], mesh));
      }
    }
    return {};
  }

  Status keep(ActiveJob& job, size_t index, const DicedPiece& piece) const {
    if (index == 0) {
      SPILLWAY_ASSIGN(job.writer, cache_->create(*job.key, job.dicer->piece_count()));
    }
    return job.writer->append(piece);
  }

  Status end_job(ActiveJob& job, SpooledMesh& mesh) {
    end_mesh(mesh);
    if (job.writer) SPILLWAY_TRY(job.writer->commit());
    job = {};
    return {};
  }

  Status spool(const DiceJob& job, const DicedPiece& piece, SpooledMesh& mesh) {
    MeshInput input = job.cage->row.surface;
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
  std::optional<DiceCache> cache_;
  DiceReport report_;
};

}  // namespace

Result<DiceReport> dice_subdivision(const DicedScene& diced, const DiceOptions& options, uint32_t max_faces_per_chunk) {
  if (diced.cages.cages().empty()) return DiceReport{};
  const DiceView view(options.cameras);
  const std::vector<DiceJob> jobs = InstanceGroups(diced, view).make();
  Dicing dicing(diced, view, options, max_faces_per_chunk);
  SPILLWAY_TRY(dicing.open_cache());
  for (size_t first = 0; first < jobs.size();) {
    uint64_t bytes = 0;
    size_t last = first;
    while (last < jobs.size() && (last == first || bytes + jobs[last].cage->size_bytes <= kBatchBytes))
      bytes += jobs[last++].cage->size_bytes + kPatchBytes;
    SPILLWAY_TRY(dicing.dice(std::span(jobs).subspan(first, last - first)));
    first = last;
  }
  return dicing.report();
}

}  // namespace spillway::pipeline
