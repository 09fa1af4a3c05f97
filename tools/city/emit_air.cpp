// What hangs in the air of a planned city: chosen, written to a file, said to a sink.
//
// The grid of the whole is the medium that camera and city stand in; it has no hull, for outside of it its density is
// zero. A plume has a hull, a box, in which its own grid takes the place of the other.

#include "tools/city/city.h"
#include "tools/city/volume_file.h"

namespace spillway::tools::city {
namespace {

constexpr uint64_t kHullTriangles = 12;

Result<uint32_t> add_grid_medium(pipeline::SceneSink& sink, const std::filesystem::path& file, const AirGrid& grid,
                                 pipeline::Medium medium) {
  pipeline::VolumeInput volume;
  volume.name = fmt::format("{}: grid '{}'", file.string(), grid.name);
  volume.file = file, volume.grid = grid.name;
  SPILLWAY_ASSIGN(medium.density_volume, sink.add_volume(volume));
  return sink.add_medium({grid.name, medium, Affine3{}});
}

// Its normals point outwards.
Status add_hull(pipeline::SceneSink& sink, const AirGrid& grid, uint32_t inside, uint32_t outside) {
  const Box box = grid.box();
  std::array<Float3, 8> corners;
  for (size_t i = 0; i < 8; ++i)
    corners[i] = {static_cast<float>(i & 1 ? box.upper.x : box.lower.x),
                  static_cast<float>(i & 2 ? box.upper.y : box.lower.y),
                  static_cast<float>(i & 4 ? box.upper.z : box.lower.z)};
  static constexpr std::array<uint32_t, 3 * kHullTriangles> kSides = {
      0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  pipeline::MeshInput hull;
  hull.name = grid.name + "_hull";
  hull.positions = corners, hull.indices = kSides;
  hull.divides_media = true, hull.medium_inside = inside, hull.medium_outside = outside;
  return sink.add_mesh(hull);
}

}  // namespace

void City::raise_smoke(std::vector<Chimney> chimneys) {
  std::vector<Vec3> eyes;
  for (uint32_t frame = options_.first_frame; frame <= options_.last_frame; ++frame) eyes.push_back(view(frame).eye);
  plumes_ = air().plumes(std::move(chimneys), eyes);
  counts_.plumes = plumes_.size(), counts_.hull_triangles = kHullTriangles * plumes_.size();
  counts_.media = plumes_.size() + (options_.air.spreads() ? 1 : 0);
}

Status City::write_air(const std::filesystem::path& file) const {
  const Air air = City::air();
  std::vector<GridToWrite> grids;
  const auto add = [&](const AirGrid& grid, const Plume* plume) {
    grids.push_back({grid, [&air, grid, plume](int32_t x, int32_t y, std::span<float> samples) {
                       air.fill_column(grid, plume, x, y, samples);
                     }});
  };
  if (options_.air.spreads()) add(air.grid(), nullptr);
  for (const Plume& plume : plumes_) add(plume.grid, &plume);
  return write_volume_file(file, grids);
}

// The medium that everything stands in.
Result<uint32_t> City::emit_air(pipeline::SceneSink& sink, const std::filesystem::path& file) const {
  uint32_t around = pipeline::kNoMedium;
  if (options_.air.spreads()) {
    SPILLWAY_ASSIGN(around, add_grid_medium(sink, file, air().grid(), mist_medium()));
  }
  for (const Plume& plume : plumes_) {
    SPILLWAY_ASSIGN(const uint32_t inside, add_grid_medium(sink, file, plume.grid, smoke_medium()));
    SPILLWAY_TRY(add_hull(sink, plume.grid, inside, around));
  }
  return around;
}

}  // namespace spillway::tools::city
