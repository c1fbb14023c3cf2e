/// The plain tree that a scene is read from. YAML (offline) and XmlRpc (online) both become one;
/// the core reads nothing else, so one scene means the same in both worlds.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "variator_sim/errors.h"

namespace variator_sim {

/// Bounds trees from all sources: readers walk through them recursively.
constexpr int kDeepestNesting = 64;

/// A value: nothing, a boolean, an integer, a real number, a text, a list or a dictionary.
class ParameterTree {
 public:
  enum class Kind { kNothing, kBoolean, kInteger, kReal, kText, kList, kDictionary };
  using List = std::vector<ParameterTree>;
  /// Sorted by key: XmlRpc keeps no order either.
  using Dictionary = std::map<std::string, ParameterTree>;

  ParameterTree() = default;
  static ParameterTree boolean(bool value) { return make(value); }
  static ParameterTree integer(std::int64_t value) { return make(value); }
  static ParameterTree real(double value) { return make(value); }
  static ParameterTree text(std::string value) { return make(std::move(value)); }
  static ParameterTree list(List values = {}) { return make(std::move(values)); }
  static ParameterTree dictionary(Dictionary values = {}) { return make(std::move(values)); }

  Kind kind() const { return static_cast<Kind>(value_.index()); }
  // Return false, 0 or empty for values of another kind.
  bool asBoolean() const { return get<bool>(); }
  std::int64_t asInteger() const { return get<std::int64_t>(); }
  double asReal() const { return get<double>(); }
  const std::string& asText() const { return get<std::string>(); }
  const List& asList() const { return get<List>(); }
  const Dictionary& asDictionary() const { return get<Dictionary>(); }
  /// Returns the entry `key` of a dictionary, or nullptr; also for values of another kind.
  const ParameterTree* find(const std::string& key) const;
  ParameterTree* find(const std::string& key) {
    return const_cast<ParameterTree*>(std::as_const(*this).find(key));
  }
  // Only for values of their own kind.
  List& asList() { return std::get<List>(value_); }
  Dictionary& asDictionary() { return std::get<Dictionary>(value_); }

  /// Returns the value as a user would type it (YAML flow style), for messages; long ones are cut.
  std::string toText() const;
  /// Returns "a number", "a list", …, for error messages.
  std::string describeKind() const;

 private:
  /// The alternatives stand in the order of Kind.
  using Value =
      std::variant<std::monostate, bool, std::int64_t, double, std::string, List, Dictionary>;

  template <class T>
  static ParameterTree make(T value) {
    ParameterTree tree;
    tree.value_.template emplace<T>(std::move(value));
    return tree;
  }
  template <class T>
  const T& get() const {
    static const T none{};
    const T* const value = std::get_if<T>(&value_);
    return value != nullptr ? *value : none;
  }

  Value value_;
};

/// Throws SceneError at `path`, "expected WHAT, got a text: abc", unless `value` is of this kind.
void requireKind(ParameterTree::Kind kind, const ParameterTree& value, const std::string& path,
                 const std::string& what);

/// Returns the path of an entry of a dictionary, "dictionary/key"; of the root "key".
std::string entryPath(const std::string& dictionary, const std::string& key);
/// Returns the path of an element of a list, "list[index]".
std::string elementPath(const std::string& list, std::size_t index);

/// Returns the shortest text that reads back as the same number, for messages.
std::string formatNumber(double value);
/// Returns the same, but always a real of YAML ("1.0", "1.0e+20", ".inf").
std::string formatReal(double value);
/// Returns "[1, 2.5]".
std::string formatNumbers(const double* values, int count);

/// Puts `value` at `path` of a scene's tree: keys with slashes between, items of a list by their
/// index from 0 ("drive/inertia", "load/inertia/harmonics/0/cosine", "initial/velocity[1]").
/// Missing dictionaries on the way are made; the reader of the scene checks whether it knows the
/// key. Throws SceneError, with the nearest path of the tree, if the path leads into a number or a
/// text, or to an item that a list does not have.
void setValue(ParameterTree& tree, const std::string& path, ParameterTree value);

/// Returns the value at such a path. Throws SceneError, with the nearest path, where there is none.
ParameterTree getValue(const ParameterTree& tree, const std::string& path);

/// The words of scenes for values.
template <class Value>
using Choices = std::vector<std::pair<const char*, Value>>;

/// Allowed range of a number, and its unit.
struct Range {
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  bool minimum_included = true;
  bool maximum_included = true;
  /// SI unit in which plain numbers are taken ("rad/s", "1"; units.h): texts may carry another of
  /// its dimension. Empty: none is declared, and no text may carry a unit.
  std::string unit = {};

  static Range any(std::string unit = "") {
    Range range;
    range.unit = std::move(unit);
    return range;
  }
  static Range positive(std::string unit = "") {
    return {0.0, std::numeric_limits<double>::infinity(), false, true, std::move(unit)};
  }
  static Range notNegative(std::string unit = "") { return atLeast(0.0, std::move(unit)); }
  static Range atLeast(double minimum, std::string unit = "") {
    return between(minimum, std::numeric_limits<double>::infinity(), std::move(unit));
  }
  static Range between(double minimum, double maximum, std::string unit = "") {
    return {minimum, maximum, true, true, std::move(unit)};
  }
  bool contains(double value) const;
  /// Returns "> 0", "from 0 to 1", "any finite number".
  std::string toText() const;
};

/// Reads one dictionary of a tree with checks and remembers which keys it has read, so that
/// `finish` can reject the rest. Every failure is a SceneError with the key's full path. Numbers
/// may be integers, reals, or texts that are numbers ("1e-9"), with a unit where the range has one
/// ("1500 rpm"), and are returned in SI units; they must be finite.
class ParameterReader {
 public:
  /// `tree` must outlive the reader and be a dictionary (SceneError otherwise); `path` is the
  /// dictionary's own path, "" for the root.
  ParameterReader(const ParameterTree& tree, std::string path);

  const std::string& path() const { return path_; }
  /// Returns the full path of a key below this dictionary.
  std::string keyPath(const std::string& key) const { return entryPath(path_, key); }
  /// Returns the error that tells of the value at `key`.
  SceneError error(const std::string& key, const std::string& message) const {
    return {keyPath(key), message};
  }
  bool has(const std::string& key) const;
  /// True for a number, be it as a text or with a unit.
  static bool isNumber(const ParameterTree& value);

  // A key without a `default_value` is required.
  double number(const std::string& key, const Range& range = Range::any(),
                std::optional<double> default_value = {});
  int integer(const std::string& key, int minimum, int maximum,
              std::optional<int> default_value = {});
  bool boolean(const std::string& key, bool default_value);
  std::string text(const std::string& key, const std::optional<std::string>& default_value = {});
  /// Reads a formula: a text, or a number taken as its text with full precision; of a number with a
  /// unit, which has to fit to `unit`, its value in SI units.
  std::string formula(const std::string& key, const std::string& unit = "");
  /// Reads a text out of `allowed`.
  std::string choice(const std::string& key, const std::vector<std::string>& allowed,
                     const std::optional<std::string>& default_value = {});
  /// Reads a word, of which each stands for a value.
  template <class Value>
  Value choice(const std::string& key, const Choices<Value>& words,
               const std::optional<std::string>& default_value = {}) {
    std::vector<std::string> allowed;
    for (const auto& it : words) allowed.emplace_back(it.first);
    const std::string word = choice(key, allowed, default_value);
    return words[static_cast<std::size_t>(placeOf(word, allowed, keyPath(key), ""))].second;
  }
  /// Reads a list of exactly `size` numbers.
  std::vector<double> numbers(const std::string& key, std::size_t size,
                              const Range& range = Range::any());
  /// Reads a list of anything, which messages call `what`; an absent key or nothing gives an empty
  /// list.
  const ParameterTree::List& list(const std::string& key, const std::string& what);
  /// Reads a list of texts; an absent key or nothing gives an empty list.
  std::vector<std::string> names(const std::string& key);
  /// Reads a dictionary of numbers; an absent key gives an empty one.
  std::map<std::string, double> numberDictionary(const std::string& key);
  /// Returns a reader of the dictionary at `key`, which has the keys `known`; `finish` it before
  /// this one.
  ParameterReader section(const std::string& key, std::initializer_list<const char*> known = {});
  /// Returns the value at `key` as it is, or nullptr; counts as read.
  const ParameterTree* raw(const std::string& key);
  /// Does the same; throws SceneError that `what` is expected when it is missing.
  const ParameterTree& require(const std::string& key, const std::string& what);

  /// Converts a value that stands at `path` to a number, with the checks of `number`.
  static double toNumber(const ParameterTree& value, const std::string& path,
                         const Range& range = Range::any());
  /// Returns a number, or a text that is one, in SI units whatever its unit; nothing for others.
  static std::optional<double> findNumber(const ParameterTree& value);

  /// Counts `key` as read (or as known, for the suggestion when another is misspelt).
  void allow(const std::string& key);
  void allow(std::initializer_list<const char*> keys) {
    for (const char* key : keys) allow(std::string(key));
  }
  /// Throws SceneError for the first unread key of the dictionary, with the nearest known.
  void finish() const;

  /// Records from now on the paths of all keys that readers of this thread know; nullptr ends the
  /// record. A test makes its table of keys with it.
  static void noteKeys(std::set<std::string>* paths);
  /// Records likewise the numbers that are read, or taken as defaults, and the ranges that they are
  /// allowed, by their paths.
  static void noteNumbers(std::map<std::string, double>* numbers,
                          std::map<std::string, Range>* ranges = nullptr);

 private:
  const ParameterTree* tree_;
  std::string path_;
  std::set<std::string> known_;
};

}  // namespace variator_sim
