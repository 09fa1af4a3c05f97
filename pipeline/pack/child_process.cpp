#include "pipeline/pack/child_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

namespace spillway::pipeline {
namespace {

void limit(__rlimit_resource_t resource, uint64_t value) {
  rlimit wanted{};
  getrlimit(resource, &wanted);
  wanted.rlim_cur = std::min<uint64_t>(value, wanted.rlim_max);
  setrlimit(resource, &wanted);
}

uint64_t processor_seconds_used() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  return static_cast<uint64_t>(used.ru_utime.tv_sec + used.ru_stime.tv_sec);
}

// Starts the program with its standard output in a pipe; returns the reading end.
Result<int> start(const std::string& program, std::span<const std::string> arguments, pid_t& process) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return error("no pipe for {}: {}", program, std::strerror(errno));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  std::vector<char*> pointers{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) pointers.push_back(const_cast<char*>(argument.c_str()));
  pointers.push_back(nullptr);
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

Result<ProgramEnd> run_program(const std::filesystem::path& program, std::span<const std::string> arguments) {
  pid_t process = -1;
  SPILLWAY_ASSIGN(const int pipe, start(program.string(), arguments, process));
  ProgramEnd end;
  end.said = listen(pipe);
  int status = 0;
  while (waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) end.signal = WTERMSIG(status);
  else end.code = WEXITSTATUS(status);
  return end;
}

Result<std::filesystem::path> program_beside(std::string_view name) {
  std::error_code code;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", code).parent_path() / name;
  if (code) return error("where this program is cannot be told: {}", code.message());
  if (!std::filesystem::exists(program, code))
    return error("{}: is missing; it belongs beside the program", program.string());
  return program;
}

void limit_this_process([[maybe_unused]] uint64_t memory_bytes, uint32_t processor_seconds) {
#ifndef __SANITIZE_ADDRESS__
  limit(RLIMIT_AS, memory_bytes);
#endif
  limit(RLIMIT_CPU, processor_seconds_used() + processor_seconds + 1);
}

void forbid_core_dumps() { limit(RLIMIT_CORE, 0); }

}  // namespace spillway::pipeline
