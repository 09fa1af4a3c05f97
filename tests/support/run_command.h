#pragma once

// Runs a command as users do, through a shell.

#include <string>

namespace spillway::test {

struct Ended {
  int code = -1;     // 128 and the signal's number when it was killed
  std::string said;  // stdout and stderr
};

Ended run_command(const std::string& command);

}  // namespace spillway::test
