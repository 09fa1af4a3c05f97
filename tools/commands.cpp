#include "tools/commands.h"

#include <fmt/format.h>

#include <cmath>

namespace spillway::tools {

CLI::Validator positive() {
  const auto check = [](const std::string& text) {
    double number = 0;
    const bool read = CLI::detail::lexical_cast(text, number);
    return read && std::isfinite(number) && number > 0 ? std::string() : text + " is not a number above 0";
  };
  return {check, "POSITIVE"};
}

void refuse_option(const std::string& name, const std::string& message) { throw CLI::ValidationError(name, message); }

int fail(const std::string& message, int code) {
  fmt::print(stderr, "spillway: {}\n", message);
  return code;
}

}  // namespace spillway::tools
