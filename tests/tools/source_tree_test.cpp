// Folders are layers: what a file includes lies in its own layer or below.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

namespace spillway {
namespace {

namespace fs = std::filesystem;

// Of a path from the root of the sources.
std::string layer_of(const std::string& path) {
  for (const char* layer : {"cache/base", "cache", "shading", "pipeline", "tools", "tests", "bench"})
    if (path.starts_with(std::string(layer) + "/")) return layer;
  return {};
}

const std::map<std::string, std::vector<std::string>> kMayInclude = {
    {"cache/base", {"cache/base"}},
    {"cache", {"cache/base", "cache"}},
    {"shading", {"cache/base", "shading"}},
    {"pipeline", {"cache/base", "cache", "shading", "pipeline"}},
    {"tools", {"cache/base", "cache", "shading", "pipeline", "tools"}},
    {"tests", {"cache/base", "cache", "shading", "pipeline", "tools", "tests"}},
    {"bench", {"cache/base", "cache", "shading", "pipeline", "tools", "tests", "bench"}},
};

struct Include {
  std::string file, included;
};

std::vector<Include> includes(const char* opening) {
  std::vector<Include> found;
  for (const auto& [layer, below] : kMayInclude)
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(SPILLWAY_SOURCE_DIR) / layer)) {
      const std::string extension = entry.path().extension();
      const std::string file = fs::relative(entry.path(), SPILLWAY_SOURCE_DIR);
      if ((extension != ".h" && extension != ".cpp") || layer_of(file) != layer) continue;
      std::ifstream stream(entry.path());
      const std::string head = std::string("#include ") + opening;
      for (std::string line; std::getline(stream, line);)
        if (line.starts_with(head)) found.push_back({file, line.substr(head.size(), line.find_last_of("\">") - head.size())});
    }
  return found;
}

TEST(SourceTree, includes_lead_downwards) {
  const auto all = includes("\"");
  EXPECT_GT(all.size(), 400u);
  for (const Include& i : all) {
    const std::string from = layer_of(i.file), to = layer_of(i.included);
    ASSERT_FALSE(to.empty()) << i.file << " includes \"" << i.included << "\", which is not from the root of the sources";
    const auto& allowed = kMayInclude.at(from);
    EXPECT_NE(std::find(allowed.begin(), allowed.end(), to), allowed.end()) << i.file << " includes " << i.included;
    EXPECT_TRUE(fs::exists(fs::path(SPILLWAY_SOURCE_DIR) / i.included)) << i.file << " includes " << i.included;
  }
}

TEST(SourceTree, libraries_have_one_owner) {
  for (const Include& i : includes("<")) {
    const bool owns_embree = i.file == "pipeline/pack/build_trees.cpp" || i.file == "bench/support/embree_tracer.cpp";
    EXPECT_TRUE(!i.included.starts_with("embree") || owns_embree) << i.file;
    const bool owns_opensubdiv = i.file == "pipeline/pack/limit_surface.cpp" || layer_of(i.file) == "tests";
    EXPECT_TRUE(!i.included.starts_with("opensubdiv") || owns_opensubdiv) << i.file;
    EXPECT_TRUE(!i.included.starts_with("OpenImageIO") || i.file.ends_with(".cpp")) << i.file;
    const bool is_shading = layer_of(i.file) == "shading";
    for (const char* system : {"tbb/", "OpenImageIO", "fstream", "thread", "mutex", "atomic", "chrono"})
      EXPECT_FALSE(is_shading && i.included.starts_with(system)) << i.file << " includes " << i.included;
  }
}

std::string first_line(const fs::path& file, const char* head) {
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);)
    if (line.starts_with(head)) return line;
  return {};
}

// So that it includes what it needs; headers without a source of their own are compiled alone (tests/CMakeLists.txt).
TEST(SourceTree, headers_come_first_in_their_own_source_and_once_anywhere) {
  int count = 0;
  for (const auto& [layer, below] : kMayInclude)
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(SPILLWAY_SOURCE_DIR) / layer)) {
      if (entry.path().extension() != ".h") continue;
      EXPECT_EQ(first_line(entry.path(), ""), "#pragma once") << entry.path();
      fs::path source = entry.path();
      source.replace_extension(".cpp");
      if (!fs::exists(source)) continue;
      const std::string name = fs::relative(entry.path(), SPILLWAY_SOURCE_DIR);
      EXPECT_EQ(first_line(source, "#include"), "#include \"" + name + "\"") << source;
      ++count;
    }
  EXPECT_GT(count, 150);
}

// A name that is not UTF-8 ends the program anywhere else.
TEST(SourceTree, json_becomes_text_in_one_place) {
  for (const char* layer : {"cache", "shading", "pipeline", "tools"})
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(SPILLWAY_SOURCE_DIR) / layer)) {
      if (!entry.is_regular_file()) continue;
      std::ifstream stream(entry.path());
      for (std::string line; std::getline(stream, line);)
        EXPECT_TRUE(line.find(".dump(") == std::string::npos || entry.path().filename() == "json_text.h")
            << entry.path() << ": " << line;
    }
}

}  // namespace
}  // namespace spillway
