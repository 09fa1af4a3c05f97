#include "pipeline/pack/store_directory.h"

#include <string>
#include <vector>

#include "pipeline/pack/pack_face_textures.h"
#include "pipeline/pack/pack_image.h"
#include "pipeline/store.h"

namespace spillway::pipeline {
namespace {

namespace fs = std::filesystem;

// Whether this is a name that packing gives, possibly one left by a packing that was killed.
bool is_name_of_ours(const std::string& name) {
  for (const char* ours : {kManifestFile, kTracePagesFile, kAttributesFile, kVolumesFile})
    if (name == ours || (name.starts_with(std::string(ours) + ".") && name.ends_with(".tmp"))) return true;
  return name == kTexturesDirectory;
}

}  // namespace

Status check_store_directory(const fs::path& directory) {
  std::error_code code;
  fs::create_directories(directory, code);
  if (!fs::is_directory(directory, code))
    return error("{}: cannot be made a directory; name another store", directory.string());
  if (fs::exists(directory / kManifestFile, code)) return {};
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, code))
    if (!is_name_of_ours(entry.path().filename().string()))
      return error("{}: holds '{}', which is no part of a store; name a new or empty directory", directory.string(),
                   entry.path().filename().string());
  for (const fs::directory_entry& entry : fs::directory_iterator(directory / kTexturesDirectory, code))
    if (const std::string name = entry.path().filename().string();
        !is_packed_image_name(name) && !is_face_container_name(name))
      return error("{}: is no image of a store; name a new or empty directory for the store", entry.path().string());
  return {};
}

void remove_temporaries(const fs::path& directory) {
  std::error_code code;
  std::vector<fs::path> leftovers;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, code)) {
    const std::string name = entry.path().filename().string();
    if (is_name_of_ours(name) && name.ends_with(".tmp")) leftovers.push_back(entry.path());
  }
  for (const fs::path& leftover : leftovers) fs::remove(leftover, code);
}

}  // namespace spillway::pipeline
