#pragma once

// What we do wrong: both values are printed, and the process aborts. Stays on in release builds.

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>

namespace spillway {

template <class A, class B>
[[noreturn]] void check_failed(const char* file, int line, const char* text, const A& a, const B& b) {
  fmt::print(stderr, "{}:{}: check failed: {} (left {}, right {})\n", file, line, text, a, b);
  std::abort();
}

}  // namespace spillway

#define SPILLWAY_CHECK(a, op, b)                                                              \
  do {                                                                                        \
    const auto& spillway_a = (a);                                                             \
    const auto& spillway_b = (b);                                                             \
    if (!(spillway_a op spillway_b)) [[unlikely]]                                             \
      ::spillway::check_failed(__FILE__, __LINE__, #a " " #op " " #b, spillway_a, spillway_b); \
  } while (false)
