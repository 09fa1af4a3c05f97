#pragma once

// What programs of ours that read and write other people's formats have in common: where they are, how they are run, and
// what limits them.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "cache/base/result.h"

namespace spillway::pipeline {

// A program beside the running one. Fails when it is missing.
Result<std::filesystem::path> program_beside(std::string_view name);

// How a program ended.
struct ProgramEnd {
  int signal = 0;    // that ended it; 0: it ended by itself
  int code = 0;      // its exit code
  std::string said;  // on its standard output; the first 4 KiB
};
// Waits for its end. Fails where it cannot be started.
Result<ProgramEnd> run_program(const std::filesystem::path& program, std::span<const std::string> arguments);

// Of this process, from now on: its address space, and the processor time it may still use. A sanitizer's shadow takes
// terabytes of addresses: under one only the time is limited.
void limit_this_process(uint64_t memory_bytes, uint32_t processor_seconds);
void forbid_core_dumps();

}  // namespace spillway::pipeline
