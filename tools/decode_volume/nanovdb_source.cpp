#include "tools/decode_volume/nanovdb_source.h"

#include <iostream>  // which the validator's header leaves to its user

#include <nanovdb/NanoVDB.h>
#include <nanovdb/util/GridValidator.h>
#include <nanovdb/util/IO.h>

namespace spillway::tools {
namespace {

using pipeline::LatticeBox;

class NanoVdbSource final : public pipeline::SampleSource {
 public:
  NanoVdbSource(nanovdb::GridHandle<> handle, const nanovdb::FloatGrid* grid)
      : handle_(std::move(handle)), grid_(grid) {}

  [[nodiscard]] LatticeBox bounds() const override {
    const nanovdb::CoordBBox box = grid_->indexBBox();
    return {{box.min()[0], box.min()[1], box.min()[2]}, {box.max()[0] + 1, box.max()[1] + 1, box.max()[2] + 1}};
  }
  [[nodiscard]] bool is_half() const override { return false; }
  Status load(const LatticeBox&) override { return {}; }

  void copy(const std::array<int32_t, 3>& corner, int32_t side, std::span<float> samples) const override {
    const auto values = grid_->getAccessor();
    size_t at = 0;
    for (int32_t z = 0; z < side; ++z)
      for (int32_t y = 0; y < side; ++y)
        for (int32_t x = 0; x < side; ++x)
          samples[at++] = values.getValue(nanovdb::Coord(corner[0] + x, corner[1] + y, corner[2] + z));
  }

 private:
  nanovdb::GridHandle<> handle_;
  const nanovdb::FloatGrid* grid_;
};

Affine3 medium_from_lattice(const nanovdb::FloatGrid& grid) {
  Affine3 result;
  const nanovdb::Vec3d origin = grid.indexToWorld(nanovdb::Vec3d(0, 0, 0));
  for (int axis = 0; axis < 3; ++axis) {
    nanovdb::Vec3d step(0, 0, 0);
    step[axis] = 1;
    const nanovdb::Vec3d column = grid.indexToWorld(step) - origin;
    for (int row = 0; row < 3; ++row) result.m[row][axis] = static_cast<float>(column[row]);
  }
  for (int row = 0; row < 3; ++row) result.m[row][3] = static_cast<float>(origin[row]);
  return result;
}

}  // namespace

Result<DecodedVolume> open_nanovdb(const std::string& file, const std::string& name) {
  try {
    auto handle = nanovdb::io::readGrid(file, name);
    if (!handle) return error("{}: has no grid '{}'", file, name);
    nanovdb::FloatGrid* grid = handle.grid<float>();
    if (grid == nullptr) return error("{}: grid '{}' holds no floats; float grids are possible", file, name);
    if (!nanovdb::isValid(*grid, /*detailed=*/true)) return error("{}: grid '{}' is damaged", file, name);
    if (grid->isEmpty()) return error("{}: grid '{}' is empty", file, name);
    const Affine3 transform = medium_from_lattice(*grid);
    return DecodedVolume{std::make_unique<NanoVdbSource>(std::move(handle), grid), transform};
  } catch (const std::exception& problem) {
    return error("{}: {}", file, problem.what());
  }
}

}  // namespace spillway::tools
