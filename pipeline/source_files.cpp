#include "pipeline/source_files.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <set>

namespace spillway::pipeline {
namespace {

std::string absolute_name(const std::filesystem::path& path) {
  std::error_code code;
  const std::filesystem::path absolute = std::filesystem::weakly_canonical(path, code);
  return code ? path.string() : absolute.string();
}

// The line of a file as it is now; a file that is not there has size and time -1, and so never matches again.
std::string line_of(const std::string& name) {
  struct stat facts {};
  if (::stat(name.c_str(), &facts) != 0) return fmt::format("-1 -1 {}\n", name);
  const int64_t changed = int64_t{facts.st_mtim.tv_sec} * 1'000'000'000 + facts.st_mtim.tv_nsec;
  return fmt::format("{} {} {}\n", facts.st_size, changed, name);
}

// The path after the second space; empty when the line is not of the format.
std::string_view name_in(std::string_view line) {
  const size_t first = line.find(' ');
  const size_t second = first == line.npos ? line.npos : line.find(' ', first + 1);
  return second == line.npos ? std::string_view{} : line.substr(second + 1);
}

}  // namespace

std::string source_record(std::span<const std::filesystem::path> sources) {
  std::set<std::string> names;
  for (const std::filesystem::path& source : sources) names.insert(absolute_name(source));
  std::string record;
  for (const std::string& name : names) record += line_of(name);
  return record;
}

bool sources_unchanged(std::string_view record, std::span<const std::filesystem::path> sources) {
  std::set<std::string, std::less<>> recorded;
  if (record.empty()) return false;
  while (!record.empty()) {
    const size_t end = record.find('\n');
    if (end == record.npos) return false;
    const std::string name(name_in(record.substr(0, end)));
    const std::string_view line = record.substr(0, end + 1);
    if (name.empty() || line.starts_with('-') || line_of(name) != line) return false;
    recorded.insert(name);
    record.remove_prefix(end + 1);
  }
  for (const std::filesystem::path& source : sources)
    if (!recorded.contains(absolute_name(source))) return false;
  return true;
}

}  // namespace spillway::pipeline
