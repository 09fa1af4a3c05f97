#pragma once

// What every part of the importer shares: the sink, the options, and the two ways to complain.

#include <deque>
#include <string>
#include <string_view>
#include <utility>

#include "pipeline/pack/scene_sink.h"
#include "tools/import/import_pbrt.h"
#include "tools/import/tokens.h"

namespace spillway::tools {

struct Session {
  pipeline::SceneSink& sink;
  const ImportOptions& options;
  ImportReport& report;
  std::filesystem::path folder;        // of the scene: relative names start here, as in pbrt
  std::deque<std::string> file_names;  // what places point at
  bool has_face_textures = false;      // one was defined: shapes say which face a triangle is of

  // The picture will differ from what the scene asks for; the message says what is done instead.
  template <class... Args>
  void warn(const Place& place, fmt::format_string<Args...> format, Args&&... args) {
    add_warning(to_string(place) + ": " + fmt::format(format, std::forward<Args>(args)...));
  }

  // Something that can be left out: an error, with ImportOptions::lenient a warning.
  template <class... Args>
  Status ignorable(const Place& place, fmt::format_string<Args...> format, Args&&... args) {
    Error error = error_at(place, format, std::forward<Args>(args)...);
    if (!options.lenient) return error;
    add_warning(error.message + " (ignored: lenient)");
    return {};
  }

  // Something that has a stand-in: an error, with ImportOptions::lenient a warning that says what is used.
  Status replaced(const Place& place, std::string_view what, std::string_view stand_in) {
    if (!options.lenient) {
      return error_at(place, "{} is not supported: change the scene, or take {} in its place with --lenient", what,
                      stand_in);
    }
    warn(place, "{} is not supported: {} is used instead (lenient)", what, stand_in);
    return {};
  }

  [[nodiscard]] std::filesystem::path resolved(const std::string& file) const { return folder / file; }

 private:
  void add_warning(std::string message) {
    ++report.warning_count;
    if (report.warnings.size() < kMaxWarnings) report.warnings.push_back(std::move(message));
  }
};

}  // namespace spillway::tools
