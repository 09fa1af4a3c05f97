#pragma once

// What the laboratory leaves: index.html, results.csv, summary.csv and charts/*.svg; of a run that was stopped, numbers
// with names of their own.
//
// Fails: with the file's name. An older index.html is removed before anything is written and the new one comes last, by
// rename: a page that is there belongs to the numbers beside it.

#include <filesystem>

#include "tools/lab/page.h"

namespace spillway::tools::lab {

struct Peers {
  std::vector<PeerRow> rows;
  std::string remark;  // why there are none
};
// path empty: none were asked for. A file without a row, as bench/peers.py leaves where a renderer is missing, is no
// error.
Result<Peers> load_peers(const std::filesystem::path& path);

Status write_lab(const std::filesystem::path& folder, const PageInputs& inputs);

// What a run that was stopped has: the same numbers as unfinished_results.csv and unfinished_summary.csv. A page of an
// earlier run, and its numbers, stay.
Status write_unfinished(const std::filesystem::path& folder, std::span<const SceneResult> scenes);

// Whether pictures differ that must be equal.
[[nodiscard]] bool has_defect(std::span<const SceneResult> scenes);

}  // namespace spillway::tools::lab
