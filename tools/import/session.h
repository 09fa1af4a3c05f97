#pragma once

// What every part of the importer shares: the sink, the options, and the two ways to complain.

#include <deque>
#include <string>
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

  [[nodiscard]] std::filesystem::path resolved(const std::string& file) const { return folder / file; }

 private:
  void add_warning(std::string message) {
    ++report.warning_count;
    if (report.warnings.size() < kMaxWarnings) report.warnings.push_back(std::move(message));
  }
};

}  // namespace spillway::tools
