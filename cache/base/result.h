#pragma once

// What the world does wrong (files, scenes, disks, users) is a value, never an exception.
// The message says what failed, on what (file and byte offset, or `scene.pbrt:41:7`), and what to do.

#include <fmt/format.h>

#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace spillway {

struct Error {
  std::string message;
};

template <class... Args>
[[nodiscard]] Error error(fmt::format_string<Args...> format, Args&&... args) {
  return Error{fmt::format(format, std::forward<Args>(args)...)};
}

template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  explicit operator bool() const { return state_.index() == 0; }
  T& value() & { return std::get<0>(state_); }
  const T& value() const& { return std::get<0>(state_); }
  T&& value() && { return std::get<0>(std::move(state_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  const Error& error() const { return std::get<1>(state_); }

 private:
  std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}

  explicit operator bool() const { return !error_.has_value(); }
  const Error& error() const { return *error_; }

 private:
  std::optional<Error> error_;
};

using Status = Result<void>;

}  // namespace spillway

#define SPILLWAY_CONCAT_INNER(a, b) a##b
#define SPILLWAY_CONCAT(a, b) SPILLWAY_CONCAT_INNER(a, b)

// Returns the error of a Status to the caller.
#define SPILLWAY_TRY(expression)                             \
  do {                                                       \
    if (auto spillway_status = (expression); !spillway_status) \
      return spillway_status.error();                        \
  } while (false)

// SPILLWAY_ASSIGN(auto file, open(path)): the value, or the error to the caller.
#define SPILLWAY_ASSIGN(declaration, expression) \
  SPILLWAY_ASSIGN_INNER(SPILLWAY_CONCAT(spillway_result_, __LINE__), declaration, expression)
#define SPILLWAY_ASSIGN_INNER(result, declaration, expression) \
  auto result = (expression);                                  \
  if (!result) return result.error();                          \
  declaration = std::move(result).value()
