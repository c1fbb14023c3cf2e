/// What users wrote, within messages: short, and nothing that a terminal would obey.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace variator_sim {

/// Of what a message quotes, in bytes, and of a message.
constexpr std::size_t kLongestQuote = 80;
constexpr std::size_t kLongestMessage = 4000;

/// `text` with control characters and bytes that are no UTF-8 as escapes ("\n", "\x1b"); cut behind
/// about `most` bytes.
std::string escaped(const std::string& text, std::size_t most = kLongestQuote);

/// The same in single quotes: a name, a value or a word as messages show it.
std::string inQuotes(const std::string& text);

/// The same for the path of a key, whose end tells as much as its beginning: cut in between.
std::string shownPath(const std::string& path);

/// A whole message: as `escaped`, but with its ends of lines, and at most kLongestMessage bytes.
std::string presentable(const std::string& message);

/// "a, b, c", for messages that list what is allowed; a long list is cut and counted.
std::string joinNames(const std::vector<std::string>& names);

}  // namespace variator_sim
