#pragma once

// What programs of ours that decode other people's formats have in common: where they are, and what limits them.

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "cache/base/result.h"

namespace spillway::pipeline {

// A program beside the running one. Fails when it is missing.
Result<std::filesystem::path> program_beside(std::string_view name);

// Of this process, from now on: its address space, and the processor time it may still use. A sanitizer's shadow takes
// terabytes of addresses: under one only the time is limited.
void limit_this_process(uint64_t memory_bytes, uint32_t processor_seconds);
void forbid_core_dumps();

}  // namespace spillway::pipeline
