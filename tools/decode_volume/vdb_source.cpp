#include "tools/decode_volume/vdb_source.h"

#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <openvdb/math/Maps.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <climits>
#include <fstream>
#include <vector>

#include "tools/decode_volume/leaf_source.h"

namespace spillway::tools {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using pipeline::LatticeBox;
using Leaf = FloatGrid::TreeType::LeafNodeType;
static_assert(Leaf::DIM == LeafSource::kLeafSide);

// No leaf of a grid that we take lies there: samples for which the library is asked here are passed over.
const CoordBBox kNowhere(Coord(INT_MAX - 1), Coord(INT_MAX - 1));

// A file from which parts of grids are read. The library's own File gives a grid whole, or what a box of the world
// holds of it: for a grid that stands askew that is up to all, and each time the file is walked through. What a reader
// of parts needs the library offers to those who derive from its Archive.
class VdbFile final : public openvdb::io::Archive {
 public:
  explicit VdbFile(const std::string& path) : path_(path), in_(path, std::ios::binary) {}

  // What the file says of its grids.
  Status open() {
    if (!in_) return error("{}: cannot be opened", path_);
    in_.seekg(0, std::ios::end);
    size_bytes_ = in_.tellg();
    in_.seekg(0);
    readHeader(in_);
    about_->setSeekable(true);
    openvdb::io::setStreamMetadataPtr(in_, about_, /*transfer=*/false);
    setFormatVersion(in_), setLibraryVersion(in_), setDataCompression(in_);
    openvdb::MetaMap().readMeta(in_);
    const int32_t count = readGridCount(in_);
    for (int32_t i = 0; i < count; ++i) SPILLWAY_TRY(read_place());
    return {};
  }

  // The grid, its tree without samples; those of the first leaf are what is read next.
  Result<FloatGrid::Ptr> read_topology(const std::string& name) {
    const auto by_name = [&](const GridPlace& place) { return place.said.gridName() == name; };
    const auto by_number = [&](const GridPlace& place) { return unique_name(place) == name; };
    const GridPlace* place = find(by_name);
    if (place == nullptr) place = find(by_number);
    if (place == nullptr) return error("{}: has no grid '{}'; it has {}", path_, name, grid_names());
    SPILLWAY_ASSIGN(FloatGrid::Ptr grid, read_grid(*place));
    if (!place->said.isInstance()) return grid;
    // It shares the tree of another grid.
    const auto parent =
        find([&](const GridPlace& p) { return p.said.uniqueName() == place->said.instanceParentName(); });
    if (parent == nullptr || parent->said.isInstance())
      return error("{}: grid '{}' lacks the grid whose samples it shares", path_, name);
    SPILLWAY_ASSIGN(const FloatGrid::Ptr whole, read_grid(*parent));
    grid->setTree(whole->treePtr());
    grid->setSaveFloatAsHalf(whole->saveFloatAsHalf());
    return grid;
  }

  // From where pass_leaf said that they are.
  Status read_leaf(const Leaf& about, bool is_half, int64_t at, std::span<float, Leaf::SIZE> samples) {
    if (in_.tellg() != at) in_.seekg(at);
    Leaf leaf = without_samples(about);
    leaf.readBuffers(in_, is_half);
    if (!in_) return cut_off();
    std::copy_n(leaf.buffer().data(), Leaf::SIZE, samples.data());
    return {};
  }
  // Passes over the samples of the next leaf, and says where they are.
  Result<int64_t> pass_leaf(const Leaf& about, bool is_half) {
    const int64_t at = in_.tellg();
    Leaf leaf = without_samples(about);
    leaf.readBuffers(in_, kNowhere, is_half);
    const int64_t end = in_.tellg();
    if (!in_ || end <= at || end > size_bytes_) return cut_off();
    return at;
  }

 private:
  struct GridPlace {
    openvdb::io::GridDescriptor said;
    int64_t at = 0;
  };

  // Grids lie one after the other; not all files say where each of them ends.
  Status read_place() {
    GridPlace place;
    const openvdb::GridBase::Ptr grid = place.said.read(in_);
    const int64_t here = in_.tellg();
    place.at = inputHasGridOffsets() ? place.said.getGridPos() : here;
    if (inputHasGridOffsets()) {
      if (place.said.getEndPos() <= here) return cut_off();
      place.said.seekToEnd(in_);
    } else {
      readGrid(grid, place.said, in_, kNowhere);
    }
    if (!in_) return cut_off();
    places_.push_back(std::move(place));
    return {};
  }

  Result<FloatGrid::Ptr> read_grid(const GridPlace& place) {
    if (place.said.gridType() != FloatGrid::gridType())
      return error("{}: grid '{}' is a {}; float grids are possible", path_, unique_name(place), place.said.gridType());
    in_.seekg(place.at);
    const FloatGrid::Ptr grid = FloatGrid::create();
    readGridCompression(in_);
    openvdb::io::setGridBackgroundValuePtr(in_, nullptr);
    grid->readMeta(in_);
    openvdb::io::setGridClass(in_, grid->getGridClass());
    grid->readTransform(in_);
    if (!place.said.isInstance()) grid->readTopology(in_);
    if (!in_) return cut_off();
    return grid;
  }

  static Leaf without_samples(const Leaf& about) {
    Leaf leaf(openvdb::PartialCreate(), about.origin(), 0, false);
    leaf.setValueMask(about.valueMask());
    return leaf;
  }

  template <class Is>
  [[nodiscard]] const GridPlace* find(const Is& is) const {
    const auto at = std::find_if(places_.begin(), places_.end(), is);
    return at != places_.end() ? &*at : nullptr;
  }
  [[nodiscard]] static std::string unique_name(const GridPlace& place) {
    return openvdb::io::GridDescriptor::nameAsString(place.said.uniqueName());
  }
  [[nodiscard]] std::string grid_names() const {
    std::vector<std::string> names;
    for (const GridPlace& place : places_) names.push_back(unique_name(place));
    std::sort(names.begin(), names.end());
    return names.empty() ? "none" : fmt::format("'{}'", fmt::join(names, "', '"));
  }
  [[nodiscard]] Error cut_off() const { return error("{}: is cut off or damaged", path_); }

  std::string path_;
  std::ifstream in_;
  int64_t size_bytes_ = 0;
  openvdb::io::StreamMetadata::Ptr about_ = std::make_shared<openvdb::io::StreamMetadata>();  // the stream points to it
  std::vector<GridPlace> places_;
};

class VdbSource final : public LeafSource {
 public:
  VdbSource(const std::string& file, std::string grid) : file_(file), path_(file), name_(std::move(grid)) {}

  Result<Affine3> open() {
    SPILLWAY_TRY(file_.open());
    SPILLWAY_ASSIGN(grid_, file_.read_topology(name_));
    SPILLWAY_TRY(find_bounds());
    if (!grid_->transform().isLinear()) return error("{}: grid '{}' has a transform that is not affine", path_, name_);
    for (auto leaf = grid_->tree().beginLeaf(); leaf; ++leaf) {  // in the order of the file
      SPILLWAY_ASSIGN(const int64_t at, file_.pass_leaf(*leaf, is_half()));
      leaves_.push_back({&*leaf, at});
    }
    const openvdb::Mat4d m = grid_->transform().baseMap()->getAffineMap()->getMat4();  // multiplies row vectors
    Affine3 medium_from_lattice;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 4; ++column)
        medium_from_lattice.m[row][column] = static_cast<float>(m(column, row));
    return medium_from_lattice;
  }

  [[nodiscard]] LatticeBox bounds() const override { return bounds_; }
  [[nodiscard]] bool is_half() const override { return grid_->saveFloatAsHalf(); }

  // The leaves of the slab, which then know their place among them.
  Status load(const LatticeBox& slab) override {
    const auto is_inside = [&](const LeafPlace& place) {
      const int32_t z = place.leaf->origin()[2];
      return z < slab.upper[2] && z + kLeafSide > slab.lower[2];
    };
    const auto count = static_cast<size_t>(std::count_if(leaves_.begin(), leaves_.end(), is_inside));
    samples_.resize(count * Leaf::SIZE);
    openvdb::Index32 next = 0;
    try {
      for (const LeafPlace& place : leaves_) {
        if (!is_inside(place)) continue;
        const auto samples = std::span(samples_).subspan(size_t{next} * Leaf::SIZE).first<Leaf::SIZE>();
        SPILLWAY_TRY(file_.read_leaf(*place.leaf, is_half(), place.at, samples));
        place.leaf->setTransientData(next++);
      }
    } catch (const std::exception& problem) {
      return error("{}: grid '{}': {}", path_, name_, problem.what());
    }
    return {};
  }

 private:
  struct LeafPlace {
    Leaf* leaf;
    int64_t at;  // of its samples, with their mask, in the file
  };

  [[nodiscard]] Values find(const std::array<int32_t, 3>& cell) const override {
    const Coord at(cell[0], cell[1], cell[2]);
    const Leaf* leaf = grid_->tree().probeConstLeaf(at);
    if (leaf == nullptr) return {nullptr, grid_->tree().getValue(at)};
    return {samples_.data() + size_t{leaf->transientData()} * Leaf::SIZE, 0};
  }

  // Of what is active: the masks tell, whatever the file says of it.
  Status find_bounds() {
    const CoordBBox box = grid_->evalActiveVoxelBoundingBox();
    if (box.empty()) return error("{}: grid '{}' is empty", path_, name_);
    for (int a = 0; a < 3; ++a) {
      if (box.min()[a] < -cache::kMaxLattice || box.max()[a] >= cache::kMaxLattice)
        return error("{}: grid '{}' has samples from {} to {} along axis {}; between -{} and {} are possible", path_,
                     name_, box.min()[a], box.max()[a], a, cache::kMaxLattice, cache::kMaxLattice);
      bounds_.lower[a] = box.min()[a], bounds_.upper[a] = box.max()[a] + 1;
    }
    return {};
  }

  VdbFile file_;
  std::string path_, name_;
  FloatGrid::Ptr grid_;  // its leaves have masks, and no samples
  LatticeBox bounds_;
  std::vector<LeafPlace> leaves_;
  std::vector<float> samples_;  // of the slab's leaves
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
