#include "tools/decode_volume/nanovdb_source.h"

#include <algorithm>
#include <climits>
#include <fstream>
#include <map>
#include <optional>
#include <vector>

#include <nanovdb/NanoVDB.h>
#include <nanovdb/util/GridChecksum.h>
#include <nanovdb/util/IO.h>

#include "cache/file.h"
#include "tools/decode_volume/leaf_source.h"

namespace spillway::tools {
namespace {

using nanovdb::Coord;
using pipeline::LatticeBox;

// Nodes as they lie in the file: a grid is one piece of memory, its parts (header, tree, root with its tiles, upper
// nodes, lower nodes, leaves) one after the other, children named by their distance in bytes.
using GridData = nanovdb::GridData;
using TreeData = nanovdb::TreeData<3>;
using Root = nanovdb::NanoRoot<float>::DataType;
using Upper = nanovdb::NanoUpper<float>::DataType;
using Lower = nanovdb::NanoLower<float>::DataType;
using Leaf = nanovdb::NanoLeaf<float>::DataType;
constexpr uint64_t kRootAt = sizeof(GridData) + sizeof(TreeData);
constexpr int32_t kLowerSide = 16 * LeafSource::kLeafSide;

struct alignas(NANOVDB_DATA_ALIGNMENT) AlignedBytes {
  std::byte bytes[NANOVDB_DATA_ALIGNMENT];
};

// Where a grid lies in its file.
struct GridPlace {
  uint64_t at = 0, size_bytes = 0;
};

// The library reads what describes the grids; that their sizes lie within the file is checked here.
Result<GridPlace> find_grid(const std::string& file, const std::string& name, uint64_t file_bytes) {
  std::ifstream in(file, std::ios::binary);
  nanovdb::io::Segment segment;
  while (segment.read(in)) {
    auto at = static_cast<uint64_t>(in.tellg());
    for (const nanovdb::io::GridMetaData& grid : segment.meta) {
      if (at > file_bytes || grid.fileSize > file_bytes - at)
        return error("{}: grid '{}' is cut off", file, grid.gridName);
      if (grid.gridName != name) {
        at += grid.fileSize;
        continue;
      }
      if (segment.header.codec != nanovdb::io::Codec::NONE)
        return error("{}: grid '{}' is compressed ({}); grids without compression are possible", file, name,
                     segment.header.codec < nanovdb::io::Codec::END ? nanovdb::io::toStr(segment.header.codec) : "?");
      if (grid.gridType != nanovdb::GridType::Float)
        return error("{}: grid '{}' holds no floats; float grids are possible", file, name);
      return GridPlace{at, grid.fileSize};
    }
    in.seekg(static_cast<std::streamoff>(at));
  }
  return error("{}: has no grid '{}'", file, name);
}

// The parts of a grid, each checked to lie within it and behind the one before.
struct Layout {
  uint64_t begin[3] = {0, 0, 0};  // of leaves, lower and upper nodes
  uint32_t count[3] = {0, 0, 0};
  uint64_t upper_bytes = 0;  // of all that is not leaves

  [[nodiscard]] static std::optional<Layout> of(const TreeData& tree, uint64_t size_bytes) {
    constexpr uint64_t kSize[3] = {sizeof(Leaf), sizeof(Lower), sizeof(Upper)};
    Layout layout;
    uint64_t end = kRootAt + sizeof(Root);
    if (tree.mNodeOffset[3] != sizeof(TreeData) || size_bytes < end) return std::nullopt;
    layout.upper_bytes = size_bytes;
    for (int level = 2; level >= 0; --level) {
      layout.count[level] = tree.mNodeCount[level];
      if (layout.count[level] == 0) continue;
      const uint64_t begin = sizeof(GridData) + tree.mNodeOffset[level];
      if (begin < end || begin > size_bytes || begin % NANOVDB_DATA_ALIGNMENT != 0) return std::nullopt;
      if (layout.count[level] > (size_bytes - begin) / kSize[level]) return std::nullopt;
      layout.begin[level] = begin;
      end = begin + layout.count[level] * kSize[level];
      if (level == 0) layout.upper_bytes = begin;
    }
    return layout;
  }
  // Of a node that lies at `at`, or nothing: no node begins there.
  [[nodiscard]] std::optional<uint32_t> index(int level, uint64_t at, uint64_t node_bytes) const {
    if (at < begin[level] || (at - begin[level]) % node_bytes != 0) return std::nullopt;
    const uint64_t index = (at - begin[level]) / node_bytes;
    return index < count[level] ? std::optional(static_cast<uint32_t>(index)) : std::nullopt;
  }
};

// Corner of a child: its number counts z fastest.
Coord child_corner(const Coord& corner, uint32_t child, int32_t log2_children, int32_t child_side) {
  const uint32_t mask = (1u << log2_children) - 1;
  return corner + Coord(static_cast<int32_t>(child >> 2 * log2_children) * child_side,
                        static_cast<int32_t>(child >> log2_children & mask) * child_side,
                        static_cast<int32_t>(child & mask) * child_side);
}
uint32_t child_number(const Coord& place, int32_t log2_children, int32_t child_side) {
  const auto along = [&](int a) { return static_cast<uint32_t>(place[a] / child_side) & ((1u << log2_children) - 1); };
  return along(0) << 2 * log2_children | along(1) << log2_children | along(2);
}

class NanoVdbSource final : public LeafSource {
 public:
  NanoVdbSource(cache::ReadFile file, const GridPlace& place, std::string grid)
      : file_(std::move(file)), place_(place), name_(std::move(grid)) {}

  Status open() {
    if (place_.size_bytes < kRootAt + sizeof(Root)) return damaged();
    SPILLWAY_TRY(read_nodes(kRootAt));
    const auto& header = at<GridData>(0);
    const auto layout = Layout::of(at<TreeData>(sizeof(GridData)), place_.size_bytes);
    const bool is_known = header.mMagic == NANOVDB_MAGIC_NUMBER && header.mGridType == nanovdb::GridType::Float &&
                          (header.mFlags & static_cast<uint32_t>(nanovdb::GridFlags::IsBreadthFirst)) != 0;
    if (!is_known || !layout) return damaged();
    layout_ = *layout;
    SPILLWAY_TRY(read_nodes(layout_.upper_bytes));
    SPILLWAY_TRY(check_root());
    SPILLWAY_TRY(check_children());
    return check_sum();
  }

  [[nodiscard]] const nanovdb::FloatGrid& grid() const { return at<nanovdb::FloatGrid>(0); }
  [[nodiscard]] LatticeBox bounds() const override {
    const auto& box = root().mBBox;
    LatticeBox bounds;
    for (int a = 0; a < 3; ++a)
      bounds.lower[a] = box.min()[a], bounds.upper[a] = std::min(box.max()[a], INT_MAX - 1) + 1;
    return bounds;
  }
  [[nodiscard]] bool is_half() const override { return false; }

  // The leaves of the slab, in the order of the file.
  Status load(const LatticeBox& slab) override {
    loaded_.clear();
    for_each_lower([&](const Coord& corner, const Lower& lower, uint64_t at) {
      if (corner[2] >= slab.upper[2] || corner[2] + kLowerSide <= slab.lower[2]) return;
      for (uint32_t child = 0; child < kLowerChildren; ++child) {
        const int32_t z = child_corner(corner, child, 4, kLeafSide)[2];
        if (lower.mChildMask.isOn(child) && z < slab.upper[2] && z + kLeafSide > slab.lower[2])
          loaded_.push_back(*leaf_index(lower, at, child));
      }
    });
    std::sort(loaded_.begin(), loaded_.end());
    loaded_.erase(std::unique(loaded_.begin(), loaded_.end()), loaded_.end());
    leaves_.resize(loaded_.size() * (sizeof(Leaf) / sizeof(AlignedBytes)));
    for (size_t first = 0; first < loaded_.size();) {
      size_t last = first + 1;
      while (last < loaded_.size() && loaded_[last] == loaded_[last - 1] + 1) ++last;
      SPILLWAY_TRY(read(
          layout_.begin[0] + uint64_t{loaded_[first]} * sizeof(Leaf),
          std::as_writable_bytes(std::span(leaves_)).subspan(first * sizeof(Leaf), (last - first) * sizeof(Leaf))));
      first = last;
    }
    return {};
  }

 private:
  static constexpr uint32_t kLowerChildren = 1 << 12, kUpperChildren = 1 << 15;

  template <class T>
  [[nodiscard]] const T& at(uint64_t byte) const {
    return *reinterpret_cast<const T*>(reinterpret_cast<const std::byte*>(nodes_.data()) + byte);
  }
  [[nodiscard]] const Root& root() const { return at<Root>(kRootAt); }
  [[nodiscard]] Error damaged() const { return error("{}: grid '{}' is damaged", file_.path().string(), name_); }

  Status read(uint64_t at, std::span<std::byte> bytes) const { return file_.read(place_.at + at, bytes); }
  // All that lies before `end`.
  Status read_nodes(uint64_t end) {
    nodes_.resize((end + sizeof(AlignedBytes) - 1) / sizeof(AlignedBytes));
    return read(0, std::as_writable_bytes(std::span(nodes_)).first(end));
  }

  Status check_root() {
    const uint64_t tiles_at = kRootAt + sizeof(Root);
    const uint64_t end = layout_.count[2] > 0 ? layout_.begin[2] : layout_.upper_bytes;
    if (root().mTableSize > (end - tiles_at) / sizeof(Root::Tile)) return damaged();
    if (root().mTableSize == 0) return error("{}: grid '{}' is empty", file_.path().string(), name_);
    uint64_t children = 0;
    for (uint32_t i = 0; i < root().mTableSize; ++i) {
      const auto& tile = at<Root::Tile>(tiles_at + i * sizeof(Root::Tile));
      if (tile.child != 0 && !layout_.index(2, kRootAt + static_cast<uint64_t>(tile.child), sizeof(Upper)))
        return damaged();
      children += tile.child != 0 ? 1 : 0;
      const Coord corner = tile.origin();
      tiles_[{corner[0], corner[1], corner[2]}] = &tile;
    }
    return children == layout_.count[2] ? Status{} : Status{damaged()};
  }

  // Every child is a node of the level below, and there are as many of both: a walk through the tree ends.
  Status check_children() const {
    SPILLWAY_TRY(check_level<Upper>(2, kUpperChildren, [&](const auto&... of) { return lower_at(of...).has_value(); }));
    return check_level<Lower>(1, kLowerChildren, [&](const auto&... of) { return leaf_index(of...).has_value(); });
  }
  // exists(node, its byte, child)
  template <class Node, class Exists>
  Status check_level(int level, uint32_t children_of_a_node, const Exists& exists) const {
    uint64_t children = 0;
    for (uint32_t i = 0; i < layout_.count[level]; ++i) {
      const uint64_t here = layout_.begin[level] + i * sizeof(Node);
      const auto& node = at<Node>(here);
      for (uint32_t child = 0; child < children_of_a_node; ++child)
        if (node.mChildMask.isOn(child) && !exists(node, here, child)) return damaged();
      children += node.mChildMask.countOn();
    }
    return children == layout_.count[level - 1] ? Status{} : Status{damaged()};
  }

  // As the library has it: of header and root, and of the sums of all nodes, one by one.
  Status check_sum() const {
    const uint64_t wanted = at<GridData>(0).mChecksum;
    const nanovdb::GridChecksum said(wanted);
    if (said.isEmpty()) return {};
    const auto* bytes = reinterpret_cast<const uint8_t*>(nodes_.data());
    constexpr size_t kSummed = 16;  // magic number and sum are not
    const auto head = nanovdb::crc32(bytes + kSummed, kRootAt + root_bytes() - kSummed);
    if (static_cast<uint32_t>(head) != said.crc32(0)) return damaged();
    if (said.mode() == nanovdb::ChecksumMode::Partial) return {};
    nanovdb::CRC32 all;
    const auto add = [&](const void* node, size_t size) { all(nanovdb::crc32(node, size)); };
    for (uint32_t i = 0; i < layout_.count[2]; ++i) add(bytes + layout_.begin[2] + i * sizeof(Upper), sizeof(Upper));
    for (uint32_t i = 0; i < layout_.count[1]; ++i) add(bytes + layout_.begin[1] + i * sizeof(Lower), sizeof(Lower));
    std::vector<std::byte> some(std::min<uint64_t>(layout_.count[0], 256) * sizeof(Leaf));
    for (uint64_t first = 0; first < layout_.count[0]; first += 256) {
      const auto count = std::min<uint64_t>(256, layout_.count[0] - first);
      SPILLWAY_TRY(read(layout_.begin[0] + first * sizeof(Leaf), std::span(some).first(count * sizeof(Leaf))));
      for (uint64_t i = 0; i < count; ++i) add(some.data() + i * sizeof(Leaf), sizeof(Leaf));
    }
    return static_cast<uint32_t>(all.checksum()) == said.crc32(1) ? Status{} : Status{damaged()};
  }
  [[nodiscard]] uint64_t root_bytes() const { return sizeof(Root) + root().mTableSize * sizeof(Root::Tile); }

  // Byte of a child within the grid.
  [[nodiscard]] std::optional<uint64_t> lower_at(const Upper& node, uint64_t here, uint32_t child) const {
    const uint64_t there = here + static_cast<uint64_t>(node.mTable[child].child);
    return layout_.index(1, there, sizeof(Lower)) ? std::optional(there) : std::nullopt;
  }
  [[nodiscard]] std::optional<uint32_t> leaf_index(const Lower& node, uint64_t here, uint32_t child) const {
    return layout_.index(0, here + static_cast<uint64_t>(node.mTable[child].child), sizeof(Leaf));
  }

  // visit(corner, lower, byte) for every lower node, by its place in the tree.
  template <class Visit>
  void for_each_lower(const Visit& visit) const {
    for (const auto& [key, tile] : tiles_) {
      if (tile->child == 0) continue;
      const uint64_t upper = kRootAt + static_cast<uint64_t>(tile->child);
      const auto& node = at<Upper>(upper);
      for (uint32_t child = 0; child < kUpperChildren; ++child)
        if (node.mChildMask.isOn(child)) {
          const uint64_t lower = *lower_at(node, upper, child);
          visit(child_corner(Coord(key[0], key[1], key[2]), child, 5, kLowerSide), at<Lower>(lower), lower);
        }
    }
  }

  [[nodiscard]] Values find(const std::array<int32_t, 3>& cell) const override {
    constexpr int32_t kUpperMask = ~(32 * kLowerSide - 1);
    const auto tile = tiles_.find({cell[0] & kUpperMask, cell[1] & kUpperMask, cell[2] & kUpperMask});
    if (tile == tiles_.end()) return {nullptr, root().mBackground};
    if (tile->second->child == 0) return {nullptr, tile->second->value};
    const Coord inside(cell[0] & ~kUpperMask, cell[1] & ~kUpperMask, cell[2] & ~kUpperMask);
    const uint64_t upper = kRootAt + static_cast<uint64_t>(tile->second->child);
    const auto& node = at<Upper>(upper);
    const uint32_t child = child_number(inside, 5, kLowerSide);
    if (!node.mChildMask.isOn(child)) return {nullptr, node.mTable[child].value};
    const uint64_t here = *lower_at(node, upper, child);
    const auto& lower = at<Lower>(here);
    const uint32_t leaf = child_number(inside, 4, kLeafSide);
    if (!lower.mChildMask.isOn(leaf)) return {nullptr, lower.mTable[leaf].value};
    const uint32_t index = *leaf_index(lower, here, leaf);
    const auto slot = static_cast<size_t>(std::lower_bound(loaded_.begin(), loaded_.end(), index) - loaded_.begin());
    return {reinterpret_cast<const Leaf*>(leaves_.data())[slot].mValues, 0};
  }

  cache::ReadFile file_;
  GridPlace place_;
  std::string name_;
  std::vector<AlignedBytes> nodes_;  // all that lies before the leaves
  Layout layout_;
  std::map<std::array<int32_t, 3>, const Root::Tile*> tiles_;
  std::vector<uint32_t> loaded_;  // ascending
  std::vector<AlignedBytes> leaves_;
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
    SPILLWAY_ASSIGN(cache::ReadFile bytes, cache::ReadFile::open(file, {.purpose = cache::IoPurpose::pack}));
    SPILLWAY_ASSIGN(const GridPlace place, find_grid(file, name, bytes.size_bytes()));
    auto source = std::make_unique<NanoVdbSource>(std::move(bytes), place, name);
    SPILLWAY_TRY(source->open());
    const Affine3 transform = medium_from_lattice(source->grid());
    return DecodedVolume{std::move(source), transform};
  } catch (const std::exception& problem) {
    return error("{}: {}", file, problem.what());
  }
}

}  // namespace spillway::tools
