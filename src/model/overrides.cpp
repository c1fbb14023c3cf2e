#include <algorithm>
#include <cctype>
#include <charconv>
#include <regex>
#include <utility>
#include <vector>

#include "variator_sim/parameter_tree.h"

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
  static const std::regex kIndex(R"(\[(\d{1,9})\](?=[/[]|$))");
  const std::string plain = std::regex_replace(path, kIndex, "/$1");
  std::vector<std::string> steps = splitAt(plain, '/');
  const bool is_valid = plain.find_first_of("[]") == plain.npos && !contains(steps, "");
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

[[noreturn]] void fail(const ParameterTree& tree, const std::string& path,
                       const std::string& message) {
  std::vector<std::string> paths;
  collectPaths(tree, "", &paths);
  throw SceneError(path, message + suggestName(join(splitPath(path), "/"), paths));
}

/// Returns the value at `path`; missing dictionaries on the way are made.
ParameterTree& follow(ParameterTree& tree, const std::string& path) {
  ParameterTree* here = &tree;
  std::string place;  // of it
  for (const std::string& step : splitPath(path)) {
    // A key with nothing behind it is a dictionary whose lines are all commented out.
    if (here->kind() == Kind::kNothing) *here = ParameterTree::dictionary();
    if (here->kind() == Kind::kList) {
      const std::size_t size = here->asList().size();
      std::size_t index = size;
      if (isIndex(step)) std::from_chars(step.data(), step.data() + step.size(), index);
      if (index >= size) {
        fail(tree, path,
             inQuotes(place) + " is a list and has no " + inQuotes(step) + "; allowed: " +
                 (size == 0 ? "none, it is empty" : "0 to " + std::to_string(size - 1)));
      }
      here = &here->asList()[index];
    } else if (here->kind() != Kind::kDictionary) {
      fail(tree, path,
           inQuotes(place) + " is " + here->describeKind() + ": " + here->toText() +
               ", and has no " + inQuotes(step) + " inside; it can be set as a whole");
    } else if (isIndex(step) && here->find(step) == nullptr) {
      fail(tree, path,
           (place.empty() ? "the scene" : inQuotes(place)) + " is not a list with an item " +
               inQuotes(step) + "; a list that the scene leaves out can be set as a whole");
    } else {
      here = &here->asDictionary()[step];
    }
    place = entryPath(place, step);
  }
  return *here;
}

}  // namespace

void setValue(ParameterTree& tree, const std::string& path, ParameterTree value) {
  // Works on a copy, so that a path that leads nowhere changes nothing.
  ParameterTree changed = tree;
  follow(changed, path) = std::move(value);
  tree = std::move(changed);
}

ParameterTree getValue(const ParameterTree& tree, const std::string& path) {
  ParameterTree copy = tree;
  ParameterTree found = follow(copy, path);
  if (found.kind() == Kind::kNothing) fail(tree, path, "the scene does not say it");
  return found;
}

}  // namespace variator_sim
