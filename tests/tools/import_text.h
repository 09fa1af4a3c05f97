#pragma once

// Imports a scene given as text, with files beside it, in a folder of the running test's own.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "tests/tools/recording_sink.h"
#include "tools/import/import_pbrt.h"

namespace spillway::tools {

inline std::filesystem::path test_folder() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / "spillway_import" / test->test_suite_name() / test->name();
  std::filesystem::create_directories(folder);
  return folder;
}

inline std::filesystem::path write_file(const std::string& name, std::string_view bytes) {
  const std::filesystem::path path = test_folder() / name;
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return path;
}

struct Imported {
  RecordingSink sink;
  ImportReport report;
  std::string error;  // empty: imported. Without the folder
};

inline Imported import_text(std::string_view text, bool lenient = false) {
  Imported imported;
  const std::filesystem::path path = write_file("scene.pbrt", text);
  const Status status = import_pbrt(path, imported.sink, ImportOptions{.lenient = lenient}, imported.report);
  if (!status) imported.error = status.error().message;
  const std::string folder = path.parent_path().string() + "/";
  for (std::string* message : {&imported.error}) {
    for (size_t at = message->find(folder); at != std::string::npos; at = message->find(folder)) {
      message->erase(at, folder.size());
    }
  }
  EXPECT_EQ(imported.sink.contract, "");
  return imported;
}

// After WorldBegin, in line 2.
inline Imported import_world(std::string_view body, bool lenient = false) {
  return import_text("WorldBegin\n" + std::string(body), lenient);
}

inline constexpr std::string_view kTriangle = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n";

inline bool starts_with(const std::string& text, std::string_view head) { return text.starts_with(head); }

}  // namespace spillway::tools
