#include "pipeline/pack/volume_decoder.h"

#include <array>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string_view>

#include "pipeline/pack/child_process.h"

namespace spillway::pipeline {
namespace {

constexpr std::string_view kAnswer = "medium_from_lattice";

std::optional<Affine3> read_answer(const std::string& text) {
  if (!text.starts_with(kAnswer)) return std::nullopt;
  Affine3 result;
  const char* at = text.c_str() + kAnswer.size();
  for (auto& row : result.m)
    for (float& value : row) {
      int length = 0;
      if (std::sscanf(at, " %a%n", &value, &length) != 1) return std::nullopt;
      at += length;
    }
  return result;
}

}  // namespace

std::string volume_answer(const Affine3& medium_from_lattice) {
  std::string text(kAnswer);
  for (const auto& row : medium_from_lattice.m)
    for (const float value : row) text += fmt::format(" {:a}", value);
  return text;
}

Result<Affine3> decode_volume(const std::filesystem::path& source, const std::string& grid,
                              const std::filesystem::path& bricks_file, const VolumeDecoderOptions& options) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(source, code))
    return error("{}: there is no such volume file", source.string());
  SPILLWAY_ASSIGN(const std::filesystem::path program, program_beside("spillway_decode_volume"));
  const std::array<std::string, 6> arguments = {source.string(),
                                                grid,
                                                bricks_file.string(),
                                                fmt::format("{}", options.brick_voxels),
                                                fmt::format("{}", options.memory_limit_bytes),
                                                fmt::format("{}", options.time_limit_seconds)};
  SPILLWAY_ASSIGN(const ProgramEnd end, run_program(program, arguments));
  if (end.signal != 0)
    return error(
        "{}: its decoder was ended by signal {} ({}); the file is damaged, or needs more memory or time than "
        "allowed",
        source.string(), end.signal, strsignal(end.signal));
  if (end.code != 0)
    return end.said.empty() ? error("{}: its decoder ended with code {}", source.string(), end.code)
                            : error("{}", end.said);
  if (const std::optional<Affine3> transform = read_answer(end.said)) return *transform;
  return error("{}: its decoder gave no answer", source.string());
}

}  // namespace spillway::pipeline
