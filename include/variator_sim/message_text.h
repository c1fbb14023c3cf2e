/// Texts of messages: quotes of user text, short, and without characters that control a terminal,
/// and the names that were meant.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

namespace variator_sim {

/// Limits of a quotation and of a message, in bytes.
constexpr std::size_t kLongestQuote = 80;
constexpr std::size_t kLongestMessage = 4000;

/// Returns `text` with control characters and bytes that are no UTF-8 as escapes ("\n", "\x1b"),
/// cut after about `most` bytes.
std::string escaped(const std::string& text, std::size_t most = kLongestQuote);

/// Returns the same in single quotes: a name, a value or a word as messages show it.
std::string inQuotes(const std::string& text);

/// Returns the path of a key, cut in the middle, because its end tells as much as its beginning.
std::string shownPath(const std::string& path);

/// Returns a whole message: as `escaped`, but with line ends, at most kLongestMessage bytes.
std::string presentable(const std::string& message);

/// Returns "a, b, c", for messages that list what is allowed; a long list is cut and counted.
std::string joinNames(const std::vector<std::string>& names);

/// Returns the words, whole, with `separator` between them.
std::string join(const std::vector<std::string>& words, const std::string& separator);
/// Returns the parts of `text` between separators; empty ones count.
std::vector<std::string> splitAt(const std::string& text, char separator);
/// Returns `text` with '_' in place of all but letters of ASCII and digits.
std::string toIdentifier(std::string text);

/// True when `values` has `value`.
template <class Value, class Wanted>
bool contains(const std::vector<Value>& values, const Wanted& value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

/// Returns the candidate most like `name` (fewest edits: insertion, deletion, substitution, swap of
/// neighbours; letter case counts half), or an empty string when none is near enough to be meant.
std::string findNearestName(const std::string& name, const std::vector<std::string>& candidates);

/// Returns " (did you mean 'x'?)" for the nearest candidate, or an empty string.
std::string suggestName(const std::string& name, const std::vector<std::string>& candidates);
/// Returns the same and "; allowed: x, y", or "; allowed: none".
std::string suggestAmong(const std::string& name, const std::vector<std::string>& allowed);

}  // namespace variator_sim
