// The process that writes a .vdb file: spillway_write_volume FILE (GRID LEAVES TRANSFORM)...
// LEAVES: a file of city::LeafRecord; TRANSFORM: world_from_lattice, three rows of four numbers. Prints what is wrong;
// exit code 0 or 3.

#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <cstdio>
#include <filesystem>

#include "cache/base/hash.h"
#include "cache/file.h"
#include "pipeline/pack/child_process.h"
#include "tools/city/leaf_record.h"

namespace spillway::tools {
namespace {

using city::LeafRecord;
using Leaf = openvdb::FloatTree::LeafNodeType;

Result<openvdb::math::Transform::Ptr> transform_of(const char* text) {
  openvdb::Mat4d row_vectors = openvdb::Mat4d::identity();  // the library multiplies these
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) {
      float value = 0;
      int length = 0;
      if (std::sscanf(text, " %a%n", &value, &length) != 1) return error("a transform takes twelve numbers");
      row_vectors(column, row) = static_cast<double>(value);
      text += length;
    }
  return openvdb::math::Transform::createLinearTransform(row_vectors);
}

void add_leaf(openvdb::FloatTree& tree, const LeafRecord& record) {
  auto leaf = std::make_unique<Leaf>(openvdb::Coord(record.origin[0], record.origin[1], record.origin[2]), 0.0f, false);
  for (openvdb::Index i = 0; i < Leaf::SIZE; ++i)
    if (record.samples[i] != 0) leaf->setValueOn(i, record.samples[i]);
  tree.addLeaf(leaf.release());
}

Result<openvdb::FloatGrid::Ptr> read_grid(const std::string& name, const char* leaves, const char* transform) {
  openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0);
  SPILLWAY_ASSIGN(const openvdb::math::Transform::Ptr placed, transform_of(transform));
  grid->setTransform(placed), grid->setName(name);
  grid->setGridClass(openvdb::GRID_FOG_VOLUME), grid->setSaveFloatAsHalf(true);
  SPILLWAY_ASSIGN(const cache::ReadFile file, cache::ReadFile::open(leaves, {.purpose = cache::IoPurpose::scene}));
  std::vector<LeafRecord> some(256);
  for (uint64_t at = 0; at < file.size_bytes();) {
    some.resize(std::min<uint64_t>(some.size(), (file.size_bytes() - at) / sizeof(LeafRecord)));
    if (some.empty()) return error("{}: byte {}: a leaf is cut off", leaves, at);
    SPILLWAY_TRY(file.read(at, std::as_writable_bytes(std::span(some))));
    for (const LeafRecord& record : some) add_leaf(grid->tree(), record);
    at += some.size() * sizeof(LeafRecord);
  }
  return grid;
}

// A full disk is no error to the library's streams: what was written is read again.
Status check_written(const std::string& file, const openvdb::GridPtrVec& grids) {
  openvdb::io::File written(file);
  written.open(/*delayLoad=*/false);
  for (const openvdb::GridBase::Ptr& grid : grids) {
    const auto again = openvdb::gridPtrCast<openvdb::FloatGrid>(written.readGrid(grid->getName()));
    const auto meant = openvdb::gridPtrCast<openvdb::FloatGrid>(grid);
    if (!again->tree().hasSameTopology(meant->tree()))
      return error("{}: grid '{}' was not written whole; is the disk full?", file, grid->getName());
  }
  return {};
}

// In the header, after the magic number (8 bytes), three versions (12) and a flag (1): 36 characters of an identifier
// that is drawn at random. Made from what follows, the same grids have the same bytes.
Status set_identifier(const std::string& file) {
  constexpr long kAt = 21;
  constexpr size_t kLength = 36;
  std::FILE* f = std::fopen(file.c_str(), "r+b");
  if (f == nullptr) return error("{}: cannot be opened again", file);
  std::vector<char> bytes(1 << 20);
  uint64_t hash = 0;
  std::fseek(f, kAt + kLength, SEEK_SET);
  while (const size_t got = std::fread(bytes.data(), 1, bytes.size(), f)) hash = checksum(bytes.data(), got, hash);
  const uint64_t other = mix64(hash);
  const std::string id = fmt::format("{:08x}-{:04x}-4{:03x}-8{:03x}-{:012x}", hash >> 32, hash >> 16 & 0xffff,
                                     hash & 0xfff, other >> 48 & 0xfff, other & 0xffffffffffffull);
  std::fseek(f, kAt, SEEK_SET);
  const bool written = std::fwrite(id.data(), 1, kLength, f) == kLength;
  const bool closed = std::fclose(f) == 0;
  return written && closed ? Status{} : Status{error("{}: cannot be written", file)};
}

Status write(int count, char** arguments) {
  openvdb::initialize();
  const std::string file = arguments[0], temporary = file + ".tmp";
  openvdb::GridPtrVec grids;
  for (int i = 1; i + 2 < count; i += 3) {
    SPILLWAY_ASSIGN(const openvdb::FloatGrid::Ptr grid, read_grid(arguments[i], arguments[i + 1], arguments[i + 2]));
    grids.push_back(grid);
  }
  openvdb::io::File out(temporary);
  out.write(grids);
  SPILLWAY_TRY(check_written(temporary, grids));
  SPILLWAY_TRY(set_identifier(temporary));
  std::filesystem::rename(temporary, file);
  return {};
}

Status write_or_clean(int count, char** arguments) {
  Status written;
  try {
    written = write(count, arguments);
  } catch (const std::exception& problem) {
    written = error("{}: cannot be written: {}", arguments[0], problem.what());
  }
  std::error_code code;
  if (!written) std::filesystem::remove(std::string(arguments[0]) + ".tmp", code);
  return written;
}

}  // namespace
}  // namespace spillway::tools

int main(int argc, char** argv) {
  using namespace spillway;
  if (argc < 5 || (argc - 2) % 3 != 0) return 2;
  pipeline::forbid_core_dumps();
  const Status written = tools::write_or_clean(argc - 1, argv + 1);
  if (!written) std::fputs(written.error().message.c_str(), stdout);
  return written ? 0 : 3;
}
