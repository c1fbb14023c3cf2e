#include "model/extreme_numbers.h"

#include <cmath>
#include <vector>

namespace variator_sim {
namespace {

/// What a message has room for.
constexpr std::size_t kMostTold = 4;

bool isExtreme(double value) {
  constexpr double kFar = 1e16;
  const double size = std::abs(value);
  return size > kFar || (size > 0.0 && size < 1.0 / kFar);
}

class Search {
 public:
  void enter(const std::string& step, const ParameterTree& tree) {
    const std::size_t length = path_.size();
    path_ += step;
    visit(tree);
    path_.resize(length);
  }
  const std::vector<std::string>& found() const { return found_; }

 private:
  void visit(const ParameterTree& tree) {
    switch (tree.kind()) {
      case ParameterTree::Kind::kInteger:
        note(static_cast<double>(tree.asInteger()), tree);
        break;
      case ParameterTree::Kind::kReal:
        note(tree.asReal(), tree);
        break;
      case ParameterTree::Kind::kList:
        for (std::size_t n = 0; n < tree.asList().size() && found_.size() < kMostTold; ++n) {
          enter("[" + std::to_string(n) + "]", tree.asList()[n]);
        }
        break;
      case ParameterTree::Kind::kDictionary:
        for (const auto& [key, value] : tree.asDictionary()) {
          if (found_.size() < kMostTold) enter("/" + key, value);
        }
        break;
      default:
        break;
    }
  }
  void note(double value, const ParameterTree& tree) {
    if (isExtreme(value)) found_.push_back(shownPath(path_) + " = " + tree.toText());
  }

  std::string path_;
  std::vector<std::string> found_;
};

}  // namespace

std::string describeExtremeNumbers(const ParameterTree& scene) {
  if (scene.kind() != ParameterTree::Kind::kDictionary) return "";
  Search search;
  for (const auto& [key, value] : scene.asDictionary()) {
    // Numbers at the root are the node's.
    const bool holds = value.kind() == ParameterTree::Kind::kDictionary ||
                       value.kind() == ParameterTree::Kind::kList;
    if (holds) search.enter(key, value);
  }
  std::string text;
  for (const std::string& number : search.found()) {
    text += (text.empty() ? "; numbers that may be to blame: " : ", ") + number;
  }
  return text;
}

}  // namespace variator_sim
