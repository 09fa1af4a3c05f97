#include "tools/decode_volume/vdb_source.h"

#include <openvdb/io/File.h>
#include <openvdb/math/Maps.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>

namespace spillway::tools {
namespace {

using pipeline::LatticeBox;

openvdb::CoordBBox box_of(const LatticeBox& box) {
  return {openvdb::Coord(box.lower[0], box.lower[1], box.lower[2]),
          openvdb::Coord(box.upper[0] - 1, box.upper[1] - 1, box.upper[2] - 1)};
}

class VdbSource final : public pipeline::SampleSource {
 public:
  VdbSource(const std::string& file, std::string grid) : file_(file), name_(std::move(grid)) {
    file_.open(/*delayLoad=*/false);
  }

  // The grid's description without its samples.
  Result<Affine3> open() {
    if (!file_.hasGrid(name_)) return error("{}: has no grid '{}'; it has {}", path(), name_, grid_names());
    const openvdb::GridBase::Ptr grid = file_.readGridMetadata(name_);
    if (grid->type() != openvdb::FloatGrid::gridType())
      return error("{}: grid '{}' is a {}; float grids are possible", path(), name_, grid->type());
    is_half_ = grid->saveFloatAsHalf();
    SPILLWAY_TRY(find_bounds(*grid));
    if (!grid->transform().isLinear()) return error("{}: grid '{}' has a transform that is not affine", path(), name_);
    const openvdb::Mat4d m = grid->transform().baseMap()->getAffineMap()->getMat4();  // multiplies row vectors
    Affine3 medium_from_lattice;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 4; ++column)
        medium_from_lattice.m[row][column] = static_cast<float>(m(column, row));
    return medium_from_lattice;
  }

  [[nodiscard]] LatticeBox bounds() const override { return bounds_; }
  [[nodiscard]] bool is_half() const override { return is_half_; }

  Status load(const LatticeBox& slab) override {
    try {
      if (whole_) return {};
      const openvdb::GridBase::Ptr about = file_.readGridMetadata(name_);
      openvdb::CoordBBox box = box_of(slab);
      box.expand(1);  // the library rounds the box that it is given in world units
      slab_ = openvdb::gridPtrCast<openvdb::FloatGrid>(file_.readGrid(name_, about->transform().indexToWorld(box)));
      return {};
    } catch (const std::exception& problem) {
      return error("{}: grid '{}': {}", path(), name_, problem.what());
    }
  }

  void copy(const std::array<int32_t, 3>& corner, int32_t side, std::span<float> samples) const override {
    const LatticeBox box{corner, {corner[0] + side, corner[1] + side, corner[2] + side}};
    openvdb::tools::Dense<float, openvdb::tools::LayoutXYZ> dense(box_of(box), samples.data());
    openvdb::tools::copyToDense(*slab_, dense, /*serial=*/true);
  }

 private:
  [[nodiscard]] std::string path() const { return file_.filename(); }

  [[nodiscard]] std::string grid_names() {
    std::string names;
    for (auto name = file_.beginName(); name != file_.endName(); ++name)
      names += (names.empty() ? "'" : ", '") + *name + "'";
    return names.empty() ? "none" : names;
  }

  // From the metadata that the library writes; where somebody left it out the grid is read whole.
  Status find_bounds(const openvdb::GridBase& about) {
    openvdb::CoordBBox box;
    const auto lower = about.getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MIN);
    const auto upper = about.getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MAX);
    if (lower && upper) box = {openvdb::Coord(lower->value()), openvdb::Coord(upper->value())};
    if (!lower || !upper) {
      slab_ = openvdb::gridPtrCast<openvdb::FloatGrid>(file_.readGrid(name_));
      whole_ = true;
      box = slab_->evalActiveVoxelBoundingBox();
    }
    if (box.empty()) return error("{}: grid '{}' is empty", path(), name_);
    for (int a = 0; a < 3; ++a) {
      if (box.min()[a] < -cache::kMaxLattice || box.max()[a] >= cache::kMaxLattice)
        return error("{}: grid '{}' has samples from {} to {} along axis {}; between -{} and {} are possible", path(),
                     name_, box.min()[a], box.max()[a], a, cache::kMaxLattice, cache::kMaxLattice);
      bounds_.lower[a] = box.min()[a], bounds_.upper[a] = box.max()[a] + 1;
    }
    return {};
  }

  openvdb::io::File file_;
  std::string name_;
  LatticeBox bounds_;
  bool is_half_ = false, whole_ = false;
  openvdb::FloatGrid::Ptr slab_;
};

}  // namespace

Result<DecodedVolume> open_vdb(const std::string& file, const std::string& grid) {
  try {
    openvdb::initialize();
    auto source = std::make_unique<VdbSource>(file, grid);
    SPILLWAY_ASSIGN(const Affine3 medium_from_lattice, source->open());
    return DecodedVolume{std::move(source), medium_from_lattice};
  } catch (const std::exception& problem) {
    return error("{}: {}", file, problem.what());
  }
}

}  // namespace spillway::tools
