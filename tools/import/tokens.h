#pragma once

// Tokens of pbrt's text format: bare words (directives, numbers, true/false), "strings", brackets; # comments.
//
// Owns: one open file, read forward in pieces. Memory: one piece, and one token of at most kMaxTokenBytes.
// Fails: unreadable files, unended strings, bytes that are not text; the message starts with file:line:column.

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cache/base/result.h"

namespace spillway::tools {

// Where a token begins. Lines and columns count from 1; a column is a byte. The name outlives every place.
struct Place {
  const std::string* file = nullptr;
  uint32_t line = 1;
  uint32_t column = 1;
};
[[nodiscard]] std::string to_string(const Place& place);

template <class... Args>
[[nodiscard]] Error error_at(const Place& place, fmt::format_string<Args...> format, Args&&... args) {
  return Error{to_string(place) + ": " + fmt::format(format, std::forward<Args>(args)...)};
}

enum class TokenKind : uint8_t { end, word, string, open, close };

struct Token {
  TokenKind kind = TokenKind::end;
  std::string text;  // of strings: without quotes, escapes replaced
  Place place;
};
// How a message names a token: `"text"`, `[`, the end of the file.
[[nodiscard]] std::string to_string(const Token& token);

inline constexpr size_t kMaxTokenBytes = 1 << 16;  // longer than any path or number; a bomb otherwise

class Tokenizer {
 public:
  // `name` is what messages call the file.
  static Result<std::unique_ptr<Tokenizer>> open(const std::filesystem::path& path, const std::string* name);
  static std::unique_ptr<Tokenizer> from_text(std::string text, const std::string* name);

  // The next token, left in place. Valid until next() or take().
  Result<const Token*> peek();
  Result<Token> take();

 private:
  struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  explicit Tokenizer(const std::string* name) { here_.file = name; }
  int byte();  // -1 at the end
  void advance();
  Status fill();
  Status skip_space();
  Status read_token();
  Status read_string();
  Status read_word();

  std::unique_ptr<std::FILE, CloseFile> file_;
  std::vector<char> piece_;
  size_t next_byte_ = 0;
  bool read_failed_ = false;
  Place here_;
  Token token_;
  bool has_token_ = false;
};

}  // namespace spillway::tools
