#pragma once

// Small text files, whole or not there at all.

#include <filesystem>
#include <string>

#include "cache/file.h"

namespace spillway::tools {

inline Status write_text(const std::filesystem::path& path, const std::string& text) {
  SPILLWAY_ASSIGN(cache::WriteFile file, cache::WriteFile::create(path, cache::IoPurpose::scene));
  SPILLWAY_TRY(file.append(std::as_bytes(std::span(text))));
  return file.commit();
}

}  // namespace spillway::tools
