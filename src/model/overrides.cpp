#include "variator_sim/overrides.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <utility>
#include <vector>

namespace variator_sim {
namespace {

using Kind = ParameterTree::Kind;

/// Largest number of paths of a tree that the search for a near one visits.
constexpr std::size_t kMostPaths = 1000;

bool isIndex(const std::string& step) {
  return std::all_of(step.begin(), step.end(),
                     [](unsigned char c) { return std::isdigit(c) != 0; });
}

/// Splits "a/b[1]" into a, b, 1.
std::vector<std::string> splitPath(const std::string& path) {
  std::vector<std::string> steps(1);
  bool is_valid = true;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const char c = path[i];
    if (c == '/' || c == '[') {
      steps.emplace_back();
    } else if (c == ']') {
      const bool ends = i + 1 == path.size() || path[i + 1] == '/' || path[i + 1] == '[';
      is_valid = is_valid && ends && steps.size() > 1 && isIndex(steps.back());
    } else {
      steps.back() += c;
    }
  }
  for (const std::string& step : steps) is_valid = is_valid && !step.empty();
  if (steps.size() > kDeepestNesting) {
    throw SceneError("", inQuotes(path) + " has more than " + std::to_string(kDeepestNesting) +
                             " keys, one within the other");
  }
  if (is_valid) return steps;
  throw SceneError("", inQuotes(path) +
                           " is not a path; expected keys with slashes between, items of a list "
                           "by their index, e.g. drive/inertia, initial/velocity/0");
}

void collectPaths(const ParameterTree& tree, const std::string& path,
                  std::vector<std::string>* paths) {
  if (paths->size() >= kMostPaths) return;
  if (!path.empty()) paths->push_back(path);
  if (tree.kind() == Kind::kDictionary) {
    for (const auto& [key, value] : tree.asDictionary())
      collectPaths(value, entryPath(path, key), paths);
  } else if (tree.kind() == Kind::kList) {
    for (std::size_t i = 0; i < tree.asList().size(); ++i) {
      collectPaths(tree.asList()[i], entryPath(path, std::to_string(i)), paths);
    }
  }
}

/// The path from a tree's root to one of its values.
class Walk {
 public:
  Walk(ParameterTree& tree, const std::string& path)
      : tree_(tree), path_(path), steps_(splitPath(path)) {}

  ParameterTree& toEnd() {
    ParameterTree* here = &tree_;
    for (at_ = 0; at_ < steps_.size(); ++at_) {
      here = here->kind() == Kind::kList ? &item(*here) : &entry(*here);
    }
    return *here;
  }
  [[noreturn]] void fail(const std::string& message) const {
    std::vector<std::string> paths;
    collectPaths(tree_, "", &paths);
    throw SceneError(path_, message + suggestName(join(steps_, "/"), paths));
  }

 private:
  /// Returns the path so far.
  std::string place() const { return inQuotes(join({steps_.data(), steps_.data() + at_}, "/")); }

  ParameterTree& item(ParameterTree& list) const {
    const std::string& step = steps_[at_];
    const std::size_t size = list.asList().size();
    std::size_t index = size;
    if (isIndex(step)) std::from_chars(step.data(), step.data() + step.size(), index);
    if (index < size) return list.asList()[index];
    fail(place() + " is a list and has no " + inQuotes(step) +
         "; allowed: " + (size == 0 ? "none, it is empty" : "0 to " + std::to_string(size - 1)));
  }

  ParameterTree& entry(ParameterTree& tree) const {
    const std::string& step = steps_[at_];
    // A key with nothing behind it is a dictionary whose lines are all commented out.
    if (tree.kind() == Kind::kNothing) tree = ParameterTree::dictionary();
    if (tree.kind() != Kind::kDictionary) {
      fail(place() + " is " + tree.describeKind() + ": " + tree.toText() + ", and has no " +
           inQuotes(step) + " inside; it can be set as a whole");
    }
    ParameterTree::Dictionary& entries = tree.asDictionary();
    if (isIndex(step) && entries.count(step) == 0) {
      fail((at_ == 0 ? std::string("the scene") : place()) + " is not a list with an item " +
           inQuotes(step) + "; a list that the scene leaves out can be set as a whole");
    }
    return entries[step];
  }

  ParameterTree& tree_;
  const std::string& path_;
  std::vector<std::string> steps_;
  std::size_t at_ = 0;  // the next step
};

}  // namespace

void setValue(ParameterTree& tree, const std::string& path, ParameterTree value) {
  // Works on a copy, so that a path that leads nowhere changes nothing.
  ParameterTree changed = tree;
  Walk(changed, path).toEnd() = std::move(value);
  tree = std::move(changed);
}

ParameterTree getValue(const ParameterTree& tree, const std::string& path) {
  ParameterTree copy = tree;
  ParameterTree found = Walk(copy, path).toEnd();
  if (found.kind() == Kind::kNothing) {
    ParameterTree its_own = tree;
    Walk(its_own, path).fail("the scene does not say it");
  }
  return found;
}

}  // namespace variator_sim
