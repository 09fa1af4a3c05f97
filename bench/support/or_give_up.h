#pragma once

// Benchmarks end at the first error.

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "cache/base/result.h"

namespace spillway {

[[noreturn]] inline void give_up(const Error& error) {
  fmt::print(stderr, "{}\n", error.message);
  std::exit(1);
}

template <class T>
T value_of(Result<T> result) {
  if (!result) give_up(result.error());
  return std::move(*result);
}

inline void check(const Status& status) {
  if (!status) give_up(status.error());
}

}  // namespace spillway
