#pragma once

// Which files a store was made from, and whether they are still the same: by path, size and time of last change.
//
// Format: one line a file, by path: "<size in bytes> <time of change in nanoseconds> <absolute path>".
// Fails: a file that is gone, or whose name has a line break, counts as changed.

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace spillway::pipeline {

[[nodiscard]] std::string source_record(std::span<const std::filesystem::path> sources);
// Whether each of `sources` is in the record, and each file of the record is as it was. An empty record never holds.
[[nodiscard]] bool sources_unchanged(std::string_view record, std::span<const std::filesystem::path> sources);

}  // namespace spillway::pipeline
