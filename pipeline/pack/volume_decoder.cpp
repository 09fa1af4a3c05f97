#include "pipeline/pack/volume_decoder.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
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

// Starts the program with its standard output in a pipe; returns the reading end.
Result<int> start(const std::string& program, const std::array<std::string, 6>& arguments, pid_t& process) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return error("no pipe for {}: {}", program, std::strerror(errno));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  std::array<char*, 8> pointers{const_cast<char*>(program.c_str())};
  for (size_t i = 0; i < arguments.size(); ++i) pointers[i + 1] = const_cast<char*>(arguments[i].c_str());
  const int failed = posix_spawn(&process, program.c_str(), &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (failed == 0) return ends[0];
  close(ends[0]);
  return error("{}: cannot be started: {}", program, std::strerror(failed));
}

// What the child says, at most so much of it, until it ends.
std::string listen(int pipe) {
  constexpr size_t kMost = 4096;
  std::string text;
  char bytes[1024];
  while (true) {
    const ssize_t got = read(pipe, bytes, sizeof bytes);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    if (text.size() < kMost) text.append(bytes, static_cast<size_t>(got));
  }
  close(pipe);
  return text;
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
  pid_t process = -1;
  SPILLWAY_ASSIGN(const int pipe,
                  start(program.string(),
                        {source.string(), grid, bricks_file.string(), fmt::format("{}", options.brick_voxels),
                         fmt::format("{}", options.memory_limit_bytes), fmt::format("{}", options.time_limit_seconds)},
                        process));
  const std::string said = listen(pipe);
  int status = 0;
  while (waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status))
    return error(
        "{}: its decoder was ended by signal {} ({}); the file is damaged, or needs more memory or time than "
        "allowed",
        source.string(), WTERMSIG(status), strsignal(WTERMSIG(status)));
  if (WEXITSTATUS(status) != 0)
    return said.empty() ? error("{}: its decoder ended with code {}", source.string(), WEXITSTATUS(status))
                        : error("{}", said);
  if (const std::optional<Affine3> transform = read_answer(said)) return *transform;
  return error("{}: its decoder gave no answer", source.string());
}

}  // namespace spillway::pipeline
