#pragma once

// The laws between a store's tables: what rendering may rely on without looking again.

#include <filesystem>
#include <string_view>

#include "cache/base/result.h"
#include "pipeline/store.h"

namespace spillway::pipeline {

// What is wrong with which item of which section.
template <class... Args>
Error damaged(std::string_view where, const char* section, size_t index, fmt::format_string<Args...> what,
              Args&&... args) {
  return error("{}: section '{}', item {}: {}; pack the scene again", where, section, index,
               fmt::format(what, std::forward<Args>(args)...));
}

// `where` names the manifest; messages add section and index.
Status validate_tables(const StoreTables& tables, std::string_view where);
// That the files named are there and long enough for the tables.
Status validate_files(const StoreTables& tables, const std::filesystem::path& directory);

}  // namespace spillway::pipeline
