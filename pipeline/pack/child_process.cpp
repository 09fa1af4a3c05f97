#include "pipeline/pack/child_process.h"

#include <sys/resource.h>

#include <algorithm>

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

}  // namespace

Result<std::filesystem::path> program_beside(std::string_view name) {
  std::error_code code;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", code).parent_path() / name;
  if (code) return error("where this program is cannot be told: {}", code.message());
  if (!std::filesystem::exists(program, code))
    return error("{}: is missing; it decodes files for packing, and belongs beside the program", program.string());
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
