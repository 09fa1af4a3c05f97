// Words, strings and brackets of a scene's text, and where they are.

#include "tools/import/tokens.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

// A file is read in pieces of kilobytes: wherever they end, inside of what, nothing is lost or said twice.
TEST(Tokenizer, texts_of_many_pieces_lose_nothing) {
  constexpr int kCount = 50000;
  std::string text;
  for (int i = 0; i < kCount; ++i)
    text += fmt::format("w{} \"a string\\n{}\" [ # {}\n ]{}", i, i, i, i % 3 == 0 ? "\n" : "\t");
  ASSERT_GT(text.size(), size_t{5} << 18);
  const std::string name = "text";
  for (const int shift : {0, 1, 2, 5, 11}) {
    const auto path = write_file("text.pbrt", std::string(static_cast<size_t>(shift), '\n') + text);
    auto tokens = Tokenizer::open(path, &name);
    ASSERT_TRUE(tokens) << tokens.error().message;
    uint32_t line = 1 + static_cast<uint32_t>(shift);
    for (int i = 0; i < kCount; ++i) {
      const std::string wanted[] = {fmt::format("w{}", i), fmt::format("a string\n{}", i), "[", "]"};
      const TokenKind kinds[] = {TokenKind::word, TokenKind::string, TokenKind::open, TokenKind::close};
      for (int k = 0; k < 4; ++k) {
        const auto token = (*tokens)->take();
        ASSERT_TRUE(token) << token.error().message;
        ASSERT_EQ(token->kind, kinds[k]) << i;
        if (k < 2) {
          ASSERT_EQ(token->text, wanted[k]) << "shift " << shift;
        }
        ASSERT_EQ(token->place.line, line + (k == 3 ? 1 : 0)) << i;
      }
      line += i % 3 == 0 ? 2 : 1;
    }
    const auto last = (*tokens)->take();
    ASSERT_TRUE(last);
    EXPECT_EQ(last->kind, TokenKind::end);
  }
}

}  // namespace
}  // namespace spillway::tools
