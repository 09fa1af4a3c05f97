#pragma once

// JSON as text, in the one way that everything here writes it. Names of files and parameters are bytes of strangers:
// what is not UTF-8 becomes U+FFFD, where nlohmann's own way ends the program.

#include <nlohmann/json.hpp>
#include <string>

namespace spillway::pipeline {

// indent below 0: all on one line.
template <class Json>
[[nodiscard]] std::string json_text(const Json& json, int indent = 1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace spillway::pipeline
