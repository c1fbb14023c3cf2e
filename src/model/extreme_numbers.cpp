#include "model/extreme_numbers.h"

#include <cmath>
#include <vector>

namespace variator_sim {
namespace {

/// Largest number of values in one message.
constexpr std::size_t kMostTold = 4;

bool isExtreme(double value) {
  constexpr double kFar = 1e16;
  const double size = std::abs(value);
  return size > kFar || (size > 0.0 && size < 1.0 / kFar);
}

void collect(const ParameterTree& tree, const std::string& path, std::vector<std::string>& found) {
  if (found.size() == kMostTold) return;
  const bool is_integer = tree.kind() == ParameterTree::Kind::kInteger;
  if (isExtreme(is_integer ? static_cast<double>(tree.asInteger()) : tree.asReal())) {
    found.push_back(shownPath(path) + " = " + tree.toText());
  }
  for (std::size_t n = 0; n < tree.asList().size(); ++n) {
    collect(tree.asList()[n], elementPath(path, n), found);
  }
  for (const auto& [key, value] : tree.asDictionary()) {
    collect(value, std::string(path).append("/").append(key), found);
  }
}

}  // namespace

std::string describeExtremeNumbers(const ParameterTree& scene) {
  if (scene.kind() != ParameterTree::Kind::kDictionary) return "";
  std::vector<std::string> found;
  for (const auto& [key, value] : scene.asDictionary()) {
    // Numbers at the root belong to the node.
    const bool holds = value.kind() == ParameterTree::Kind::kDictionary ||
                       value.kind() == ParameterTree::Kind::kList;
    if (holds) collect(value, key, found);
  }
  std::string text;
  for (const std::string& number : found) {
    text += (text.empty() ? "; numbers that may be to blame: " : ", ") + number;
  }
  return text;
}

}  // namespace variator_sim
