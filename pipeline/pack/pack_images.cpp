#include "pipeline/pack/pack_images.h"

#include <algorithm>
#include <set>
#include <string>

#include "pipeline/pack/pack_image.h"
#include "cache/base/parallel_status.h"

namespace spillway::pipeline {
namespace {

// A 4k x 4k image of three channels takes about 400 MB as floats with its coarser level.
constexpr uint64_t kBytesPerImage = 512 << 20;
constexpr uint64_t kMostAtOnce = 8;

}  // namespace

Result<std::vector<cache::ImageInfo>> pack_images(std::span<const ImageSource> sources,
                                                  const std::filesystem::path& textures_directory,
                                                  uint64_t memory_limit_bytes) {
  std::vector<cache::ImageInfo> images(sources.size());
  const size_t at_once = std::clamp<uint64_t>(memory_limit_bytes / kBytesPerImage, 1, kMostAtOnce);
  for (size_t first = 0; first < sources.size(); first += at_once) {
    SPILLWAY_TRY(parallel_status(std::min(at_once, sources.size() - first), [&](size_t i) -> Status {
      const ImageSource& source = sources[first + i];
      SPILLWAY_ASSIGN(images[first + i], pack_image(source.file, source.encoding, textures_directory,
                                                    static_cast<uint32_t>(first + i), PackImageOptions{}));
      return {};
    }));
  }
  return images;
}

bool is_packed_image_name(std::string_view name) {
  static constexpr std::string_view kUnfinished = "unfinished-", kSuffix = ".tif";
  if (name.starts_with(kUnfinished)) name.remove_prefix(kUnfinished.size());
  if (!name.ends_with(kSuffix)) return false;
  name.remove_suffix(kSuffix.size());
  return name.size() >= 5 && std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

void remove_packed_images(const std::filesystem::path& textures_directory, std::span<const cache::ImageInfo> keep) {
  std::set<std::string> kept;
  for (const cache::ImageInfo& image : keep) kept.insert(image.file_name);
  std::vector<std::filesystem::path> others;
  std::error_code code;
  for (const auto& entry : std::filesystem::directory_iterator(textures_directory, code)) {
    const std::string name = entry.path().filename().string();
    if (is_packed_image_name(name) && !kept.contains(name)) others.push_back(entry.path());
  }
  for (const std::filesystem::path& other : others) std::filesystem::remove(other, code);
  std::filesystem::remove(textures_directory, code);  // fails, as it should, unless empty
}

}  // namespace spillway::pipeline
