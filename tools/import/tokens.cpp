#include "tools/import/tokens.h"

#include <cerrno>
#include <cstring>
#include <string_view>
#include <system_error>

namespace spillway::tools {
namespace {

constexpr size_t kFirstPieceBytes = 8 << 10;  // most files that are included are small
constexpr size_t kPieceBytes = 256 << 10;

bool is_space(int c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\f' || c == '\v'; }
bool ends_word(int c) { return c < 0 || is_space(c) || c == '"' || c == '[' || c == ']' || c == '#'; }
bool is_text(int c) { return c >= 0x20 && c != 0x7f; }  // UTF-8 passes

// The byte that `\c` stands for, or -1.
int unescaped(int c) {
  constexpr std::string_view kFrom = "bfnrt\\\'\"";
  constexpr std::string_view kTo = "\b\f\n\r\t\\\'\"";
  const size_t at = c < 0 ? std::string_view::npos : kFrom.find(static_cast<char>(c));
  return at == std::string_view::npos ? -1 : kTo[at];
}

}  // namespace

std::string to_string(const Place& place) {
  return fmt::format("{}:{}:{}", place.file == nullptr ? std::string("scene") : *place.file, place.line, place.column);
}

std::string to_string(const Token& token) {
  switch (token.kind) {
    case TokenKind::end:
      return "the end of the file";
    case TokenKind::open:
      return "[";
    case TokenKind::close:
      return "]";
    case TokenKind::word:
    case TokenKind::string:
      break;
  }
  constexpr size_t kShown = 60;  // of a long token
  const std::string text = token.text.size() > kShown ? token.text.substr(0, kShown) + "..." : token.text;
  return token.kind == TokenKind::string ? '"' + text + '"' : text;
}

Result<std::unique_ptr<Tokenizer>> Tokenizer::open(const std::filesystem::path& path, const std::string* name) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) {
    return error("{}: is a directory: name the .pbrt file inside it", path.string());
  }
  std::unique_ptr<Tokenizer> tokenizer(new Tokenizer(name));
  tokenizer->file_.reset(std::fopen(path.c_str(), "rb"));
  if (!tokenizer->file_) return error("{}: {}: check the path", path.string(), std::strerror(errno));
  SPILLWAY_TRY(tokenizer->fill());
  const std::vector<char>& head = tokenizer->piece_;
  if (head.size() >= 2 && head[0] == '\x1f' && head[1] == '\x8b') {
    return error("{}: is gzip-compressed: decompress it first", path.string());
  }
  if (head.size() >= 3 && std::memcmp(head.data(), "\xef\xbb\xbf", 3) == 0) tokenizer->next_byte_ = 3;
  return tokenizer;
}

std::unique_ptr<Tokenizer> Tokenizer::from_text(std::string text, const std::string* name) {
  std::unique_ptr<Tokenizer> tokenizer(new Tokenizer(name));
  tokenizer->piece_.assign(text.begin(), text.end());
  return tokenizer;
}

Status Tokenizer::fill() {
  const size_t asked = piece_.empty() ? kFirstPieceBytes : kPieceBytes;
  piece_.resize(asked);
  piece_.resize(std::fread(piece_.data(), 1, asked, file_.get()));
  next_byte_ = 0;
  read_failed_ = std::ferror(file_.get()) != 0;
  if (read_failed_) return error_at(here_, "cannot read on: {}", std::strerror(errno));
  if (piece_.size() < asked) file_.reset();  // all of it was read: nothing is asked for again
  return {};
}

int Tokenizer::byte() {
  if (next_byte_ == piece_.size() && (!file_ || !fill() || piece_.empty())) return -1;
  return static_cast<unsigned char>(piece_[next_byte_]);
}

void Tokenizer::advance() {
  const bool newline = piece_[next_byte_++] == '\n';
  here_.line += newline;
  here_.column = newline ? 1 : here_.column + 1;
}

Status Tokenizer::skip_space() {
  for (int c = byte(); c >= 0; c = byte()) {
    if (c == '#') {
      while (byte() >= 0 && byte() != '\n') advance();
    } else if (is_space(c)) {
      advance();
    } else {
      break;
    }
  }
  if (read_failed_) return error_at(here_, "cannot read on: check the disk");
  return {};
}

Status Tokenizer::read_string() {
  token_.kind = TokenKind::string;
  advance();
  for (int c = byte(); c != '"'; c = byte()) {
    if (c < 0 || c == '\n') return error_at(token_.place, "string without closing quote: add a \"");
    if (token_.text.size() == kMaxTokenBytes)
      return error_at(token_.place, "string of more than {} bytes", kMaxTokenBytes);
    const Place place = here_;
    advance();
    if (c == '\\') {
      c = unescaped(byte());
      if (c < 0) return error_at(place, "unknown escape in string: use \\b \\f \\n \\r \\t \\\\ \\' or \\\"");
      advance();
    } else if (!is_text(c) && c != '\t') {
      return error_at(place, "byte {:#04x} in a string: not a text file?", c);
    }
    token_.text.push_back(static_cast<char>(c));
  }
  advance();
  return {};
}

Status Tokenizer::read_word() {
  token_.kind = TokenKind::word;
  for (int c = byte(); !ends_word(c); c = byte()) {
    if (!is_text(c)) return error_at(here_, "byte {:#04x}: not a text file?", c);
    if (token_.text.size() == kMaxTokenBytes)
      return error_at(token_.place, "word of more than {} bytes", kMaxTokenBytes);
    token_.text.push_back(static_cast<char>(c));
    advance();
  }
  return {};
}

Status Tokenizer::read_token() {
  SPILLWAY_TRY(skip_space());
  token_.text.clear();
  token_.place = here_;
  const int c = byte();
  if (c == '"') return read_string();
  if (c >= 0 && c != '[' && c != ']') return read_word();
  token_.kind = c < 0 ? TokenKind::end : c == '[' ? TokenKind::open : TokenKind::close;
  if (c >= 0) advance();
  return {};
}

Result<const Token*> Tokenizer::peek() {
  if (!has_token_) SPILLWAY_TRY(read_token());
  has_token_ = true;
  return &token_;
}

Result<Token> Tokenizer::take() {
  if (!has_token_) SPILLWAY_TRY(read_token());
  has_token_ = false;
  return token_;
}

}  // namespace spillway::tools
