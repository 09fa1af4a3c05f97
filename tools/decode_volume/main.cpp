// The process that packs one grid of a volume file: spillway_decode_volume FILE GRID BRICKS VOXELS MEMORY SECONDS.
// Prints the grid's transform, or what is wrong with it; exit code 0 or 3.

#include <fmt/format.h>

#include <charconv>
#include <cstdio>
#include <string_view>

#include "cache/file.h"
#include "pipeline/pack/child_process.h"
#include "pipeline/pack/volume_decoder.h"
#include "tools/decode_volume/nanovdb_source.h"
#include "tools/decode_volume/vdb_source.h"

namespace spillway::tools {
namespace {

uint64_t number(std::string_view text) {
  uint64_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

Result<Affine3> decode(const std::string& file, const std::string& grid, const std::string& bricks, int32_t voxels) {
  const bool is_nano = file.ends_with(".nvdb");
  SPILLWAY_ASSIGN(DecodedVolume volume, is_nano ? open_nanovdb(file, grid) : open_vdb(file, grid));
  SPILLWAY_ASSIGN(cache::WriteFile out, cache::WriteFile::create(bricks, cache::IoPurpose::pack));
  SPILLWAY_TRY(pipeline::cut_bricks(*volume.samples, voxels, fmt::format("{}: grid '{}'", file, grid),
                                    [&](std::span<const std::byte> brick) { return out.append(brick); }));
  SPILLWAY_TRY(out.commit());
  return volume.medium_from_lattice;
}

}  // namespace
}  // namespace spillway::tools

int main(int argc, char** argv) {
  using namespace spillway;
  if (argc != 7) return 2;
  pipeline::forbid_core_dumps();
  pipeline::limit_this_process(tools::number(argv[5]), static_cast<uint32_t>(tools::number(argv[6])));
  const auto decoded = tools::decode(argv[1], argv[2], argv[3], static_cast<int32_t>(tools::number(argv[4])));
  std::fputs(decoded ? pipeline::volume_answer(*decoded).c_str() : decoded.error().message.c_str(), stdout);
  return decoded ? 0 : 3;
}
