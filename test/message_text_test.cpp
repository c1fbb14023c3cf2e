#include "variator_sim/message_text.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "variator_sim/errors.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

bool hasControl(const std::string& text) {
  for (const char c : text) {
    if ((c >= 0 && c < ' ' && c != '\n') || c == 0x7f) return true;
  }
  return false;
}

TEST(MessageText, EscapesWhatATerminalObeys) {
  EXPECT_EQ(inQuotes("\x1b[31m"), "'\\x1b[31m'");
  EXPECT_EQ(inQuotes(std::string("a\0b", 3)), "'a\\x00b'");
  EXPECT_EQ(inQuotes("a\nb\tc\rd\x7f"), "'a\\nb\\tc\\rd\\x7f'");
  EXPECT_EQ(inQuotes("\xc2\x9b"
                     "31m"),
            "'\\xc2\\x9b31m'");
}

TEST(MessageText, LeavesWhatCanBeShown) {
  const std::string text = "a' \xcf\x89 \xe2\x82\xac \xf0\x9f\x9a\x97";
  EXPECT_EQ(inQuotes(text), "'" + text + "'");
}

TEST(MessageText, EscapesWhatIsNoUtf8) {
  EXPECT_EQ(inQuotes("\xff"), "'\\xff'");
  EXPECT_EQ(inQuotes("\xcf"), "'\\xcf'");
  EXPECT_EQ(inQuotes("\xc0\xaf"), "'\\xc0\\xaf'");                    // overlong
  EXPECT_EQ(inQuotes("\xed\xa0\x80"), "'\\xed\\xa0\\x80'");           // half of a surrogate pair
  EXPECT_EQ(inQuotes("\xf4\x90\x80\x80"), "'\\xf4\\x90\\x80\\x80'");  // beyond the last character
  EXPECT_EQ(inQuotes("\x80"), "'\\x80'");
}

TEST(MessageText, CutsBetweenCharactersAndEscapes) {
  EXPECT_EQ(escaped("abcdefgh", 8), "abcdefgh");
  EXPECT_EQ(escaped("abcdefghi", 8), "abcde...");
  EXPECT_EQ(escaped("abcd\xcf\x89"
                    "fghi",
                    8),
            "abcd...");
  EXPECT_EQ(escaped("abc\x1b"
                    "fghi",
                    8),
            "abc...");
  EXPECT_LE(inQuotes(std::string(2000000, 'x')).size(), kLongestQuote + 2);
  EXPECT_LE(inQuotes(std::string(2000000, '\0')).size(), kLongestQuote + 2);
}

TEST(MessageText, KeepsTheEndOfALongPath) {
  const std::string path = shownPath("solver/" + std::string(2000000, 'x') + "/order");
  EXPECT_LE(path.size(), 250U);
  EXPECT_EQ(path.rfind("solver/", 0), 0U);
  EXPECT_EQ(path.substr(path.size() - 6), "/order");
}

TEST(MessageText, BoundsWholeMessages) {
  const std::string evil = "\x1b[2J" + std::string(2000000, '\0');
  const std::string messages[] = {SceneError(evil, evil).what(),
                                  expression::ExpressionError(evil, evil, 3).what(),
                                  CommandFileError(evil).what(), presentable("a\nb")};
  for (const std::string& message : messages) {
    EXPECT_LE(message.size(), kLongestMessage);
    EXPECT_FALSE(hasControl(message));
  }
  EXPECT_EQ(messages[3], "a\nb");
  // A message that is quoted again stays the same.
  EXPECT_EQ(presentable(messages[0]), messages[0]);
}

TEST(MessageText, CutsLongLists) {
  EXPECT_EQ(joinNames({"a", "b"}), "a, b");
  const std::string list = joinNames(std::vector<std::string>(100000, "name"));
  EXPECT_LE(list.size(), 1600U);
  EXPECT_EQ(list.substr(list.size() - 12), "... (100000)") << list.substr(1400);
}

TEST(MessageText, ShowsTheCaretBelowControlCharacters) {
  const std::string what = expression::ExpressionError("no", "a\x1b\nb ? c", 6).what();
  EXPECT_EQ(what.substr(what.find('\n')), "\n  a  b ? c\n       ^");
}

TEST(MessageText, SuggestsNothingForTextsThatAreNotTyped) {
  EXPECT_EQ(findNearestName("formula", {"unit", "expression"}), "expression");
  EXPECT_EQ(findNearestName("max", {"maximum", "minimum"}), "maximum");
  EXPECT_EQ(findNearestName("formula", {"formulae", "expression"}), "formulae");
  EXPECT_EQ(findNearestName(std::string(20000000, 'x'), {"throttle", std::string(20000000, 'y')}),
            "");
}

}  // namespace
}  // namespace variator_sim
