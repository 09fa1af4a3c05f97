#include "pipeline/pack/pack_media.h"

#include <algorithm>
#include <climits>

#include "cache/base/motion.h"
#include "pipeline/pack/cut_bricks.h"
#include "pipeline/pack/volume_decoder.h"
#include "pipeline/scene_validation.h"

namespace spillway::pipeline {
namespace {

namespace fs = std::filesystem;

// Samples that were given, x fastest, from lattice point (0, 0, 0) on; read layer by layer.
class GivenSamples final : public SampleSource {
 public:
  explicit GivenSamples(const VolumeInput& volume) : volume_(volume) {}
  [[nodiscard]] LatticeBox bounds() const override { return {{0, 0, 0}, volume_.counts}; }
  [[nodiscard]] bool is_half() const override { return false; }
  Status load(const LatticeBox& slab) override {
    const auto& n = volume_.counts;
    first_layer_ = std::clamp(slab.lower[2], 0, n[2]);
    const auto layers = static_cast<size_t>(std::clamp(slab.upper[2], first_layer_, n[2]) - first_layer_);
    const size_t layer = static_cast<size_t>(n[0]) * n[1] * volume_.channels;
    slab_.grow(MemoryTag::pack, layers * layer);
    slab_.set_size(layers * layer);
    return volume_.samples->read(first_layer_ * layer, slab_);
  }
  [[nodiscard]] uint32_t channels() const override { return volume_.channels; }
  void copy(const std::array<int32_t, 3>& corner, int32_t side, std::span<float> samples) const override {
    const auto& n = volume_.counts;
    size_t at = 0;
    for (uint32_t c = 0; c < volume_.channels; ++c)
      for (int32_t z = corner[2]; z < corner[2] + side; ++z)
        for (int32_t y = corner[1]; y < corner[1] + side; ++y)
          for (int32_t x = corner[0]; x < corner[0] + side; ++x) {
            const bool inside = x >= 0 && y >= 0 && z >= 0 && x < n[0] && y < n[1] && z < n[2];
            const size_t sample = inside ? (static_cast<size_t>(z - first_layer_) * n[1] + y) * n[0] + x : 0;
            samples[at++] = inside ? slab_[sample * volume_.channels + c] : 0;
          }
  }

 private:
  const VolumeInput& volume_;
  int32_t first_layer_ = 0;
  Buffer<float> slab_;
};

Affine3 product(const Affine3& a, const Affine3& b) {
  Affine3 result;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) {
      double sum = column == 3 ? a.m[row][3] : 0;
      for (int k = 0; k < 3; ++k) sum += static_cast<double>(a.m[row][k]) * b.m[k][column];
      result.m[row][column] = static_cast<float>(sum);
    }
  return result;
}

// One volume's bricks, from a file that holds nothing else to the end of `out`.
class BrickFile {
 public:
  static Result<BrickFile> open(const fs::path& path) {
    SPILLWAY_ASSIGN(cache::ReadFile file, cache::ReadFile::open(path, {.purpose = cache::IoPurpose::pack}));
    return BrickFile(std::move(file));
  }

  // visit(brick) for each, in file order.
  template <class Visit>
  Status for_each(const Visit& visit) const {
    const std::string where = file_.path().string();
    for (uint64_t at = 0; at < file_.size_bytes();) {
      cache::VolumeBrickHeader header{};
      if (file_.size_bytes() - at < sizeof header) return error("{}: byte {}: a brick is cut off", where, at);
      SPILLWAY_TRY(file_.read(at, std::as_writable_bytes(std::span(&header, 1))));
      if (header.size_bytes > file_.size_bytes() - at || header.size_bytes < sizeof header)
        return error("{}: byte {}: a brick is cut off", where, at);
      Buffer<std::byte> brick(MemoryTag::pack, header.size_bytes);
      SPILLWAY_TRY(file_.read(at, brick));
      SPILLWAY_TRY(cache::validate_volume_brick(brick, fmt::format("{}: byte {}", where, at)));
      SPILLWAY_TRY(visit(std::span<const std::byte>(brick)));
      at += header.size_bytes;
    }
    return {};
  }

 private:
  explicit BrickFile(cache::ReadFile file) : file_(std::move(file)) {}
  cache::ReadFile file_;
};

// A file that goes away.
struct Temporary {
  explicit Temporary(fs::path p) : path(std::move(p)) {}
  ~Temporary() {
    std::error_code code;
    fs::remove(path, code);
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;
  fs::path path;
};

Status write_given(const VolumeInput& volume, int32_t brick_voxels, const fs::path& path) {
  SPILLWAY_ASSIGN(cache::WriteFile file, cache::WriteFile::create(path, cache::IoPurpose::pack));
  GivenSamples samples(volume);
  SPILLWAY_TRY(cut_bricks(samples, brick_voxels, volume.name,
                          [&](std::span<const std::byte> brick) { return file.append(brick); }));
  return file.commit();
}

// The box of the bricks that are there; of none, one brick at the origin.
struct BrickBox {
  int32_t lower[3] = {INT_MAX, INT_MAX, INT_MAX}, upper[3] = {INT_MIN, INT_MIN, INT_MIN};
  void grow(const cache::VolumeBrickHeader& brick) {
    for (int a = 0; a < 3; ++a) {
      lower[a] = std::min(lower[a], brick.corner[a]);
      upper[a] = std::max(upper[a], brick.corner[a] + brick.voxels);
    }
  }
};

// Appends one volume's bricks; returns medium_from_lattice.
Result<Affine3> pack_volume(const VolumeInput& volume, const fs::path& bricks_path, const PackMediaOptions& options,
                            cache::WriteFile& bricks, cache::VolumeTablesBuilder& tables) {
  const Temporary part(bricks_path.string() + ".part.tmp");
  Affine3 medium_from_lattice = volume.medium_from_lattice;
  if (volume.file.empty()) {
    SPILLWAY_TRY(write_given(volume, options.brick_voxels, part.path));
  } else {
    VolumeDecoderOptions decoder;
    decoder.brick_voxels = options.brick_voxels;
    SPILLWAY_ASSIGN(medium_from_lattice, decode_volume(volume.file, volume.grid, part.path, decoder));
  }
  SPILLWAY_ASSIGN(const BrickFile file, BrickFile::open(part.path));
  BrickBox box;
  SPILLWAY_TRY(file.for_each([&](std::span<const std::byte> brick) -> Status {
    box.grow(cache::VolumeBrickView(brick).header());
    return {};
  }));
  if (box.lower[0] > box.upper[0]) box = {{0, 0, 0}, {1, 1, 1}};
  tables.begin_grid(box.lower, box.upper, options.brick_voxels);
  const auto append = [&](std::span<const std::byte> brick) -> Status {
    SPILLWAY_TRY(tables.add_brick(cache::VolumeBrickView(brick), {bricks.size_bytes(), brick.size()}, volume.name));
    return bricks.append(brick);
  };
  SPILLWAY_TRY(file.for_each(append));
  return medium_from_lattice;
}

Status lattice_from_world(const Affine3& world_from_medium, const Affine3& medium_from_lattice, std::string_view where,
                          Affine3& result) {
  if (invert(product(world_from_medium, medium_from_lattice), result)) return {};
  return error("{}: its transform, or its grid's, has no finite inverse", where);
}

}  // namespace

Result<uint32_t> SaidMedia::add_volume(const VolumeInput& volume) {
  const auto& n = volume.counts;
  if (volume.file.empty()) {
    const bool possible = n[0] > 0 && n[1] > 0 && n[2] > 0;
    const double count = static_cast<double>(n[0]) * n[1] * n[2] * volume.channels;
    const uint64_t given = volume.samples ? volume.samples->size() : 0;
    if (!possible || count != static_cast<double>(given))
      return error("{}: {} x {} x {} samples of {}, but {} numbers are given", volume.name, n[0], n[1], n[2],
                   volume.channels == 1 ? "one" : "three", given);
  }
  volumes_.push_back(volume);
  return static_cast<uint32_t>(volumes_.size() - 1);
}

Result<uint32_t> SaidMedia::add_medium(const MediumInput& medium) {
  SPILLWAY_TRY(check_medium(medium.medium, volumes_.size(), medium.name));
  if (media_.size() >= kMaxMedia) return error("{}: at most {} media are possible", medium.name, kMaxMedia);
  media_.push_back(medium);
  return static_cast<uint32_t>(media_.size() - 1);
}

Result<PackedMedia> SaidMedia::pack(cache::WriteFile& bricks, const fs::path& bricks_path,
                                    const PackMediaOptions& options) const {
  PackedMedia packed;
  std::vector<Affine3> medium_from_lattice;
  for (const VolumeInput& volume : volumes_) {
    SPILLWAY_ASSIGN(const Affine3 transform, pack_volume(volume, bricks_path, options, bricks, packed.volumes));
    medium_from_lattice.push_back(transform);
  }
  for (const MediumInput& said : media_) {
    Medium medium = said.medium;
    if (medium.density_volume != Medium::kNoVolume)
      SPILLWAY_TRY(lattice_from_world(said.world_from_medium, medium_from_lattice[medium.density_volume], said.name,
                                      medium.density_from_world));
    if (medium.glow_volume != Medium::kNoVolume)
      SPILLWAY_TRY(lattice_from_world(said.world_from_medium, medium_from_lattice[medium.glow_volume], said.name,
                                      medium.glow_from_world));
    packed.media.push_back(medium);
  }
  packed.black_bodies = black_bodies_;
  return packed;
}

}  // namespace spillway::pipeline
