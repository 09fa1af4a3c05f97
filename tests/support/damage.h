#pragma once

// A disk that gives back something else than what was written.

#include <cstdint>
#include <filesystem>

namespace spillway::test {

// Flips a bit at `offset_bytes` of the scratch file, which has no name, that this process holds open below `directory`.
// False when there is none.
[[nodiscard]] bool damage_scratch_file(const std::filesystem::path& directory, uint64_t offset_bytes);

}  // namespace spillway::test
