#include "variator_sim/nearest_name.h"

#include <algorithm>
#include <cctype>
#include <cstddef>

namespace variator_sim {
namespace {

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
  return nearest;
}

std::string suggestName(const std::string& name, const std::vector<std::string>& candidates) {
  const std::string nearest = findNearestName(name, candidates);
  return nearest.empty() ? std::string() : " (did you mean " + inQuotes(nearest) + "?)";
}

std::string suggestAmong(const std::string& name, const std::vector<std::string>& allowed) {
  return suggestName(name, allowed) +
         "; allowed: " + (allowed.empty() ? "none" : joinNames(allowed));
}

}  // namespace variator_sim
