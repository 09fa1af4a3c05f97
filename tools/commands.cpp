#include "tools/commands.h"

#include <fmt/format.h>

namespace spillway::tools {

int fail(const std::string& message, int code) {
  fmt::print(stderr, "spillway: {}\n", message);
  return code;
}

}  // namespace spillway::tools
