#include "pipeline/pack/pack_images.h"

#include <algorithm>
#include <atomic>
#include <set>
#include <string>

#include "cache/base/parallel.h"
#include "pipeline/pack/image_decoder.h"
#include "pipeline/pack/pack_face_textures.h"
#include "pipeline/pack/pack_image.h"

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
  std::vector<Status> statuses(sources.size());
  std::atomic<size_t> next = 0;
  std::atomic<bool> failed = false;
  const size_t decoders = std::min<uint64_t>(std::clamp<uint64_t>(memory_limit_bytes / kBytesPerImage, 1, kMostAtOnce), sources.size());
  parallel_blocks(decoders, 1, [&](size_t, size_t, size_t) {
    ImageDecoder decoder;
    while (!failed) {
      const size_t i = next++;
      if (i >= sources.size()) return;
      auto info = decoder.pack(sources[i].file, sources[i].encoding, textures_directory, static_cast<uint32_t>(i));
      if (info) images[i] = *info;
      if (!info) statuses[i] = info.error(), failed = true;
    }
  });
  // Images are begun in order, and what is begun is ended: the first failure is the same in every run.
  for (const Status& status : statuses) SPILLWAY_TRY(status);
  return images;
}

void remove_packed_images(const std::filesystem::path& textures_directory, std::span<const cache::ImageInfo> keep,
                          std::span<const cache::FaceContainerInfo> keep_faces) {
  std::set<std::string> kept;
  for (const cache::ImageInfo& image : keep) kept.insert(image.file_name);
  for (const cache::FaceContainerInfo& container : keep_faces) kept.insert(container.file_name);
  std::vector<std::filesystem::path> others;
  std::error_code code;
  for (const auto& entry : std::filesystem::directory_iterator(textures_directory, code)) {
    const std::string name = entry.path().filename().string();
    if ((is_packed_image_name(name) || is_face_container_name(name)) && !kept.contains(name)) others.push_back(entry.path());
  }
  for (const std::filesystem::path& other : others) std::filesystem::remove(other, code);
  std::filesystem::remove(textures_directory, code);  // fails, as it should, unless empty
}

}  // namespace spillway::pipeline
