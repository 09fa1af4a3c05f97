#pragma once

// The integer film as a file: shard, resume file and preview. Holds both halves, or the one whose epoch has closed.
//
// Memory: tag film: the file once more while it is read, the sections once more while it is written.
// Fails: as cache/section_file.h; a file whose parts contradict each other is refused before a film is made.
// Format: film_file.cpp.

#include <filesystem>

#include "pipeline/render/film.h"

namespace spillway::pipeline {

enum FilmHalves : uint32_t { kHalfA = 1, kHalfB = 2, kBothHalves = 3 };
inline constexpr const char* kFilmKind = "SPWFILM ";
inline constexpr uint32_t kFilmVersion = 1;

// A half is whole from the end of its epoch to the first splat of the next epoch of the same half: write it then.
Status write_film(const Film& film, const std::filesystem::path& path, FilmHalves halves = kBothHalves);
Result<Film> read_film(const std::filesystem::path& path);
// Adds what the file holds; the same checks as merge, and the file's name in the message.
Status merge_film_file(Film& film, const std::filesystem::path& path);

}  // namespace spillway::pipeline
