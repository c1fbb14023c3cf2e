#include "variator_sim/message_text.h"

#include <boost/algorithm/string/join.hpp>
#include <boost/algorithm/string/split.hpp>
#include <boost/locale/utf.hpp>
#include <cctype>

#include "expression/characters.h"
#include "model/number_text.h"

namespace variator_sim {
namespace {

/// Returns the number of bytes of the character at `i`; 0 unless one begins there that can be
/// shown: no control character (also above 0x7f: some terminals obey 0x9b), and valid UTF-8.
std::size_t lengthOfCharacter(const std::string& text, std::size_t i) {
  namespace utf = boost::locale::utf;
  const auto begin = text.begin() + static_cast<std::ptrdiff_t>(i);
  auto next = begin;
  const utf::code_point it = utf::utf_traits<char>::decode(next, text.end());
  const bool is_control = it < 0x20U || (it > 0x7eU && it < 0xa0U);
  return utf::is_valid_codepoint(it) && !is_control ? static_cast<std::size_t>(next - begin) : 0;
}

std::string escapeOf(char byte) {
  if (byte == '\n') return "\\n";
  if (byte == '\t') return "\\t";
  if (byte == '\r') return "\\r";
  return printed("\\x%02x", static_cast<unsigned>(static_cast<unsigned char>(byte)));
}

constexpr const char* kCut = "...";

std::string shown(const std::string& text, std::size_t most, bool keeps_lines) {
  std::string result;
  std::size_t whole = 0;  // the length that leaves room for the dots
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = lengthOfCharacter(text, i);
    if (length > 0) {
      result.append(text, i, length);
    } else if (keeps_lines && text[i] == '\n') {
      result += '\n';
    } else {
      result += escapeOf(text[i]);
    }
    i += std::max<std::size_t>(length, 1);
    if (result.size() > most) return result.substr(0, whole) + kCut;
    if (result.size() + 3 <= most) whole = result.size();
  }
  return result;
}

/// Costs are counted in half edits: a wrong letter case is half an edit.
constexpr int kEdit = 2;
constexpr int kCaseEdit = 1;

int substitutionCost(char a, char b) {
  if (a == b) return 0;
  const int lower_a = std::tolower(static_cast<unsigned char>(a));
  const int lower_b = std::tolower(static_cast<unsigned char>(b));
  return lower_a == lower_b ? kCaseEdit : kEdit;
}

bool differInCaseOnly(const std::string& a, const std::string& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](char x, char y) { return substitutionCost(x, y) <= kCaseEdit; });
}

/// Returns the optimal string alignment distance, in half edits.
int calcDistance(const std::string& a, const std::string& b) {
  std::vector<int> before_last(b.size() + 1);
  std::vector<int> last(b.size() + 1);
  std::vector<int> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = kEdit * static_cast<int>(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before_last.swap(last);
    last.swap(row);
    row[0] = kEdit * static_cast<int>(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + kEdit, row[j - 1] + kEdit,
                         last[j - 1] + substitutionCost(a[i - 1], b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before_last[j - 2] + kEdit);
      }
    }
  }
  // The number of letters does not matter: a name in capitals is the same name.
  return differInCaseOnly(a, b) ? std::min(row[b.size()], kCaseEdit) : row[b.size()];
}

/// One edit per three letters may be a slip; more is another word.
bool isNear(int distance, std::size_t length) {
  const int letters = static_cast<int>(length);
  return distance <= kEdit * std::max(1, letters / 3) && distance < kEdit * letters;
}

}  // namespace

std::string escaped(const std::string& text, std::size_t most) {
  return shown(text, most, false);
}

std::string inQuotes(const std::string& text) {
  return "'" + escaped(text) + "'";
}

std::string shownPath(const std::string& path) {
  constexpr std::size_t kLongestPath = 240;
  constexpr std::size_t kEnd = 100;
  if (path.size() <= kLongestPath) return escaped(path, 4 * kLongestPath);
  using utf8 = boost::locale::utf::utf_traits<char>;
  std::size_t end = path.size() - kEnd;
  while (end < path.size() && utf8::is_trail(path[end])) ++end;
  return escaped(path, kLongestPath - kEnd) + escaped(path.substr(end), 4 * kEnd);
}

std::string presentable(const std::string& message) {
  return shown(message, kLongestMessage, true);
}

std::string joinNames(const std::vector<std::string>& names) {
  constexpr std::size_t kLongestList = 1500;
  std::string text;
  for (const std::string& name : names) {
    if (text.size() > kLongestList) return text + ", ... (" + std::to_string(names.size()) + ")";
    if (!text.empty()) text += ", ";
    text += escaped(name);
  }
  return text;
}

std::string join(const std::vector<std::string>& words, const std::string& separator) {
  return boost::algorithm::join(words, separator);
}

std::vector<std::string> splitAt(const std::string& text, char separator) {
  std::vector<std::string> parts;
  boost::algorithm::split(parts, text, [separator](char c) { return c == separator; });
  return parts;
}

std::string toIdentifier(std::string text) {
  for (char& c : text) {
    if (!expression::isNameStart(c) && !expression::isDigit(c)) c = '_';
  }
  return text;
}

std::string findNearestName(const std::string& name, const std::vector<std::string>& candidates) {
  // A text of this length is no misspelt name, and distances take time.
  constexpr std::size_t kLongestName = 200;
  if (name.size() > kLongestName) return "";
  std::string nearest;
  int nearest_distance = -1;
  const auto consider = [&](const std::string& candidate, int distance, std::size_t length) {
    if (!isNear(distance, length)) return;
    if (nearest_distance >= 0 && distance >= nearest_distance) return;
    nearest = candidate;
    nearest_distance = distance;
  };
  for (const std::string& candidate : candidates) {
    if (candidate.size() > kLongestName) continue;
    consider(candidate, calcDistance(name, candidate), std::max(name.size(), candidate.size()));
    // A missing package or folder before the name ("ExpressionTorque") counts as one edit.
    const std::size_t slash = candidate.rfind('/');
    if (slash == std::string::npos || name.find('/') != std::string::npos) continue;
    const std::string base = candidate.substr(slash + 1);
    const int distance = calcDistance(name, base);
    if (isNear(distance, std::max(name.size(), base.size()))) {
      consider(candidate, distance + kEdit, candidate.size());
    }
  }
  if (!nearest.empty()) return nearest;
  // Other words for the same.
  constexpr const char* kSynonyms[][2] = {{"formula", "expression"}, {"formula", "torque"},
                                          {"expression", "torque"},  {"maximum", "max"},
                                          {"minimum", "min"},        {"start", "initial"}};
  for (const auto& [one, other] : kSynonyms) {
    if (name == one && contains(candidates, other)) return other;
    if (name == other && contains(candidates, one)) return one;
  }
  return "";
}

std::string suggestName(const std::string& name, const std::vector<std::string>& candidates) {
  const std::string nearest = findNearestName(name, candidates);
  return nearest.empty() ? std::string() : " (did you mean " + inQuotes(nearest) + "?)";
}

std::string suggestAmong(const std::string& name, const std::vector<std::string>& allowed) {
  return suggestName(name, allowed) +
         "; allowed: " + (allowed.empty() ? "none" : joinNames(allowed));
}

int placeOf(const std::string& name, const std::vector<std::string>& allowed,
            const std::string& path, const std::string& is_not) {
  const auto found = std::find(allowed.begin(), allowed.end(), name);
  if (found != allowed.end()) return static_cast<int>(found - allowed.begin());
  throw SceneError(path, inQuotes(name) + " " + is_not + suggestAmong(name, allowed));
}

}  // namespace variator_sim
