#include "tools/city/volume_file.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "cache/base/parallel.h"
#include "cache/file.h"
#include "pipeline/pack/child_process.h"
#include "tools/city/leaf_record.h"

namespace spillway::tools::city {
namespace {

namespace fs = std::filesystem;

// The leaves above the eight by eight columns at (x, y).
std::vector<LeafRecord> leaves_above(const GridToWrite& grid, int32_t x, int32_t y) {
  const auto height = static_cast<size_t>(grid.grid.count[2]);
  std::vector<float> columns(kLeafSide * kLeafSide * height);
  for (int32_t c = 0; c < kLeafSide * kLeafSide; ++c)
    grid.fill_column(x + c / kLeafSide, y + c % kLeafSide, std::span(columns).subspan(c * height, height));
  std::vector<LeafRecord> leaves;
  for (size_t z = 0; z < height; z += kLeafSide) {
    LeafRecord leaf{{x, y, static_cast<int32_t>(z)}, {}};
    for (size_t c = 0; c < kLeafSide * kLeafSide; ++c)
      std::memcpy(leaf.samples + c * kLeafSide, columns.data() + c * height + z, kLeafSide * sizeof(float));
    if (std::any_of(std::begin(leaf.samples), std::end(leaf.samples), [](float v) { return v != 0; }))
      leaves.push_back(leaf);
  }
  return leaves;
}

Status write_leaves(const GridToWrite& grid, const fs::path& path) {
  SPILLWAY_ASSIGN(cache::WriteFile file, cache::WriteFile::create(path, cache::IoPurpose::scene));
  const auto row = static_cast<size_t>(grid.grid.count[0] / kLeafSide);
  for (int32_t y = 0; y < grid.grid.count[1]; y += kLeafSide) {
    std::vector<std::vector<LeafRecord>> leaves(row);
    parallel_blocks(row, 1, [&](size_t i, size_t, size_t) {
      leaves[i] = leaves_above(grid, static_cast<int32_t>(i) * kLeafSide, y);
    });
    for (const std::vector<LeafRecord>& some : leaves) SPILLWAY_TRY(file.append(std::as_bytes(std::span(some))));
  }
  return file.commit();
}

// Files that go away.
struct Temporaries {
  std::vector<fs::path> paths;
  Temporaries() = default;
  Temporaries(const Temporaries&) = delete;
  Temporaries& operator=(const Temporaries&) = delete;
  ~Temporaries() {
    std::error_code code;
    for (const fs::path& path : paths) fs::remove(path, code);
  }
};

std::string transform_text(const Affine3& world_from_lattice) {
  std::string text;
  for (const auto& row : world_from_lattice.m)
    for (const float value : row) text += fmt::format("{:a} ", value);
  return text;
}

}  // namespace

Status write_volume_file(const fs::path& file, std::span<const GridToWrite> grids) {
  SPILLWAY_ASSIGN(const fs::path program, pipeline::program_beside("spillway_write_volume"));
  Temporaries temporaries;
  std::vector<std::string> arguments = {file.string()};
  for (const GridToWrite& grid : grids) {
    const fs::path leaves = file.string() + "." + grid.grid.name + ".leaves";
    temporaries.paths.push_back(leaves);
    SPILLWAY_TRY(write_leaves(grid, leaves));
    arguments.insert(arguments.end(),
                     {grid.grid.name, leaves.string(), transform_text(grid.grid.world_from_lattice())});
  }
  SPILLWAY_ASSIGN(const pipeline::ProgramEnd end, pipeline::run_program(program, arguments));
  if (end.signal == 0 && end.code == 0) return {};
  std::error_code code;
  fs::remove(file, code);
  if (end.signal != 0)
    return error("{}: its writer was ended by signal {} ({})", file.string(), end.signal, strsignal(end.signal));
  return end.said.empty() ? error("{}: its writer ended with code {}", file.string(), end.code) : error("{}", end.said);
}

}  // namespace spillway::tools::city
