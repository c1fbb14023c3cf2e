#include "variator_sim/parameter_tree.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <system_error>

#include "variator_sim/units.h"

namespace variator_sim {

std::string entryPath(const std::string& dictionary, const std::string& key) {
  return dictionary.empty() ? key : dictionary + "/" + key;
}

std::string elementPath(const std::string& list, std::size_t index) {
  return list + "[" + std::to_string(index) + "]";
}

std::string formatNumber(double value) {
  std::array<char, 32> buffer{};
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return std::string(buffer.data(), result.ptr);
}

std::string formatNumbers(const double* values, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += (i > 0 ? ", " : "[") + formatNumber(values[i]);
  return text + "]";
}

std::string formatReal(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0.0 ? ".inf" : "-.inf";
  std::string text = formatNumber(value);
  if (text.find('.') == std::string::npos) {
    text.insert(std::min(text.find('e'), text.size()), ".0");
  }
  return text;
}

namespace {

/// Reads the number at the beginning of a text; returns its length, 0 if there is none. One too
/// large or too small for a double counts as NaN, which is no finite number.
std::size_t readNumberOf(const std::string& text, double* value) {
  const std::size_t begin = text.size() > 1 && text[0] == '+' && text[1] != '-' ? 1 : 0;
  const auto [rest, error] =
      std::from_chars(text.data() + begin, text.data() + text.size(), *value);
  if (error == std::errc::invalid_argument) return 0;
  if (error != std::errc()) *value = std::numeric_limits<double>::quiet_NaN();
  return static_cast<std::size_t>(rest - text.data());
}

/// Returns false unless the whole text is a number.
bool parseNumber(const std::string& text, double* value) {
  return !text.empty() && readNumberOf(text, value) == text.size();
}

/// Returns false unless `value` is a number or a text that is one.
bool parseNumber(const ParameterTree& value, double* number) {
  if (value.kind() == ParameterTree::Kind::kText) return parseNumber(value.asText(), number);
  const bool is_integer = value.kind() == ParameterTree::Kind::kInteger;
  *number = is_integer ? static_cast<double>(value.asInteger()) : value.asReal();
  return is_integer || value.kind() == ParameterTree::Kind::kReal;
}

/// A number with a unit behind it.
struct Quantity {
  double number = 0.0;
  std::string name;  ///< of the unit, as written
  UnitText unit;
};

/// Returns nothing for a value of another form.
std::optional<Quantity> findQuantity(const ParameterTree& value) {
  const std::string& text = value.asText();
  Quantity found;
  const std::size_t end = readNumberOf(text, &found.number);
  const std::size_t name = text.find_first_not_of(' ', end);
  if (end == 0 || std::isnan(found.number) || name == text.npos) return {};
  found.name = text.substr(name);
  const std::optional<UnitText> unit = readUnit(found.name);
  if (!unit) return {};
  found.unit = *unit;
  return found;
}

/// The same for a value that may be a formula: "2x" is one that lacks its '*'.
std::optional<Quantity> findQuantityOrFormula(const ParameterTree& value) {
  std::optional<Quantity> found = findQuantity(value);
  if (found && !found->unit.unknown.empty() && suggestUnit(found->unit.unknown).empty()) return {};
  return found;
}

/// Returns a number with a unit in SI units. Throws SceneError if the unit does not fit.
double toSi(const Quantity& given, const std::string& unit, const std::string& path,
            const ParameterTree& value, const std::string& allowed) {
  if (unit.empty()) {
    throw SceneError(path,
                     value.toText() + " has a unit, and none is declared for this key; allowed: " +
                         allowed + " without a unit" +
                         (given.unit.unknown.empty()
                              ? ", in SI units " + formatNumber(given.unit.unit.toSi(given.number))
                              : ""));
  }
  const bool is_plain = unit == "1";
  const std::string fitting = "; allowed: " + allowed + ", plain" +
                              (is_plain ? "" : " (" + unit + ")") + " or with a unit such as " +
                              listUnitsLike(unit);
  if (!given.unit.unknown.empty()) {
    throw SceneError(path, value.toText() + ": " + inQuotes(given.unit.unknown) +
                               " is not a known unit" + suggestUnit(given.unit.unknown) + fitting);
  }
  if (given.unit.unit.dimension != requireUnit(unit, path).dimension) {
    throw SceneError(path, value.toText() + " is in " + given.name + ", but this key is " +
                               (is_plain ? "a number without a unit" : "in " + unit) + fitting);
  }
  return given.unit.unit.toSi(given.number);
}

/// True when a YAML reader would take the bare text as this text.
bool isPlainText(const std::string& text) {
  double number = 0.0;
  if (text.empty() || std::isalpha(static_cast<unsigned char>(text.front())) == 0) return false;
  if (parseNumber(text, &number)) return false;
  std::string lower;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) == 0 && std::string("_/.+-*^()").find(c) == std::string::npos) {
      return false;
    }
    lower += static_cast<char>(std::tolower(byte));
  }
  return !contains(std::vector<std::string>{"true", "false", "yes", "no", "on", "off", "null"},
                   lower);
}

std::string quote(const std::string& text) {
  if (isPlainText(text)) return text;
  const bool has_control = std::any_of(text.begin(), text.end(), [](char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
  });
  std::string quoted;
  for (const char c : text) {
    if (has_control && (c == '"' || c == '\\')) quoted += '\\';
    if (!has_control && c == '\'') quoted += '\'';
    quoted += c;
  }
  return has_control ? "\"" + escaped(quoted, 4 * kLongestQuote) + "\"" : "'" + quoted + "'";
}

/// Appends `tree`, and stops once the text is longer than a message shows.
void append(const ParameterTree& tree, std::string* text) {
  if (text->size() > kLongestQuote) return;
  switch (tree.kind()) {
    case ParameterTree::Kind::kNothing:
      *text += "~";
      break;
    case ParameterTree::Kind::kBoolean:
      *text += tree.asBoolean() ? "true" : "false";
      break;
    case ParameterTree::Kind::kInteger:
      *text += std::to_string(tree.asInteger());
      break;
    case ParameterTree::Kind::kReal:
      *text += formatReal(tree.asReal());
      break;
    case ParameterTree::Kind::kText:
      // (Cut first: a text may have any length.)
      *text += quote(tree.asText().substr(0, kLongestQuote + 1));
      break;
    case ParameterTree::Kind::kList:
      *text += "[";
      for (const ParameterTree& value : tree.asList()) {
        if (text->size() > kLongestQuote) return;
        if (&value != &tree.asList().front()) *text += ", ";
        append(value, text);
      }
      *text += "]";
      break;
    case ParameterTree::Kind::kDictionary:
      *text += "{";
      for (const auto& [key, value] : tree.asDictionary()) {
        if (text->size() > kLongestQuote) return;
        if (&key != &tree.asDictionary().begin()->first) *text += ", ";
        *text += quote(key.substr(0, kLongestQuote + 1)) + ": ";
        append(value, text);
      }
      *text += "}";
      break;
  }
}

/// Returns "got a text: abc", or "got nothing".
std::string describe(const ParameterTree& value) {
  if (value.kind() == ParameterTree::Kind::kNothing) return "got nothing";
  return "got " + value.describeKind() + ": " + value.toText();
}

const std::string& requireText(const ParameterTree& value, const std::string& path) {
  requireKind(ParameterTree::Kind::kText, value, path, "a text");
  return value.asText();
}

thread_local std::set<std::string>* noted_keys = nullptr;
thread_local std::map<std::string, double>* noted_numbers = nullptr;
thread_local std::map<std::string, Range>* noted_ranges = nullptr;

double noteNumber(const std::string& path, double number, const Range& range) {
  if (noted_numbers != nullptr) (*noted_numbers)[path] = number;
  if (noted_ranges != nullptr) (*noted_ranges)[path] = range;
  return number;
}

}  // namespace

void requireKind(ParameterTree::Kind kind, const ParameterTree& value, const std::string& path,
                 const std::string& what) {
  if (value.kind() != kind) throw SceneError(path, "expected " + what + ", " + describe(value));
}

const ParameterTree* ParameterTree::find(const std::string& key) const {
  const auto found = asDictionary().find(key);
  return found == asDictionary().end() ? nullptr : &found->second;
}

std::string ParameterTree::toText() const {
  std::string text;
  append(*this, &text);
  return escaped(text);
}

std::string ParameterTree::describeKind() const {
  constexpr const char* kNames[] = {"nothing", "a boolean", "an integer",  "a number",
                                    "a text",  "a list",    "a dictionary"};
  return kNames[value_.index()];
}

bool Range::contains(double value) const {
  if (!(minimum_included ? value >= minimum : value > minimum)) return false;
  return maximum_included ? value <= maximum : value < maximum;
}

std::string Range::toText() const {
  const bool has_minimum = std::isfinite(minimum);
  const bool has_maximum = std::isfinite(maximum);
  if (!has_minimum && !has_maximum) return "any finite number";
  if (has_minimum && has_maximum && minimum_included && maximum_included) {
    return "from " + formatNumber(minimum) + " to " + formatNumber(maximum);
  }
  std::string text;
  if (has_minimum) text = (minimum_included ? ">= " : "> ") + formatNumber(minimum);
  if (has_minimum && has_maximum) text += " and ";
  if (has_maximum) text += (maximum_included ? "<= " : "< ") + formatNumber(maximum);
  return text;
}

ParameterReader::ParameterReader(const ParameterTree& tree, std::string path)
    : tree_(&tree), path_(std::move(path)) {
  requireKind(ParameterTree::Kind::kDictionary, tree, path_, "a dictionary");
}

bool ParameterReader::has(const std::string& key) const {
  return tree_->find(key) != nullptr;
}

bool ParameterReader::isNumber(const ParameterTree& value) {
  double unused = 0.0;
  return parseNumber(value, &unused) || findQuantityOrFormula(value);
}

void ParameterReader::noteKeys(std::set<std::string>* paths) {
  noted_keys = paths;
}

void ParameterReader::noteNumbers(std::map<std::string, double>* numbers,
                                  std::map<std::string, Range>* ranges) {
  noted_numbers = numbers;
  noted_ranges = ranges;
}

void ParameterReader::allow(const std::string& key) {
  known_.insert(key);
  if (noted_keys != nullptr) noted_keys->insert(keyPath(key));
}

const ParameterTree* ParameterReader::raw(const std::string& key) {
  allow(key);
  return tree_->find(key);
}

const ParameterTree& ParameterReader::require(const std::string& key, const std::string& what) {
  const ParameterTree* value = raw(key);
  if (value != nullptr) return *value;
  std::vector<std::string> unread;
  for (const auto& entry : tree_->asDictionary()) {
    if (known_.count(entry.first) == 0) unread.push_back(entry.first);
  }
  const std::string misspelt = findNearestName(key, unread);
  throw error(key, "missing; expected " + what +
                       (misspelt.empty()
                            ? ""
                            : " (is " + inQuotes(misspelt) + " meant for " + inQuotes(key) + "?)"));
}

double ParameterReader::toNumber(const ParameterTree& value, const std::string& path,
                                 const Range& range) {
  double number = 0.0;
  const bool any = range.toText() == Range::any().toText();
  std::string allowed = any ? "a finite number" : "a number " + range.toText();
  if (!parseNumber(value, &number)) {
    const std::optional<Quantity> quantity = findQuantity(value);
    if (!quantity) throw SceneError(path, "expected " + allowed + ", " + describe(value));
    number = toSi(*quantity, range.unit, path, value, allowed);
    if (range.unit != "1") allowed += " in " + range.unit;
  }
  if (!std::isfinite(number)) {
    throw SceneError(path, value.toText() + " is not a finite number; allowed: " + allowed);
  }
  if (!range.contains(number)) {
    throw SceneError(path, value.toText() + " is out of range; allowed: " + allowed);
  }
  return noteNumber(path, number, range);
}

std::optional<double> ParameterReader::findNumber(const ParameterTree& value) {
  double number = 0.0;
  if (parseNumber(value, &number)) return number;
  const std::optional<Quantity> quantity = findQuantity(value);
  if (!quantity || !quantity->unit.unknown.empty()) return {};
  return quantity->unit.unit.toSi(quantity->number);
}

double ParameterReader::number(const std::string& key, const Range& range,
                               std::optional<double> default_value) {
  if (raw(key) == nullptr && default_value) {
    return noteNumber(keyPath(key), *default_value, range);
  }
  const bool any = range.toText() == Range::any().toText();
  const std::string what = any ? "a number" : "a number " + range.toText();
  return toNumber(require(key, what), keyPath(key), range);
}

int ParameterReader::integer(const std::string& key, int minimum, int maximum,
                             std::optional<int> default_value) {
  if (raw(key) == nullptr && default_value) return *default_value;
  const std::string what = minimum == maximum ? "the integer " + std::to_string(minimum)
                                              : "an integer from " + std::to_string(minimum) +
                                                    " to " + std::to_string(maximum);
  const ParameterTree& value = require(key, what);
  const bool is_scalar = value.kind() == ParameterTree::Kind::kInteger ||
                         value.kind() == ParameterTree::Kind::kReal ||
                         value.kind() == ParameterTree::Kind::kText;
  if (!is_scalar) throw error(key, "expected " + what + ", " + describe(value));
  const double number = toNumber(value, keyPath(key));
  if (number != std::floor(number)) {
    throw error(key, value.toText() + " is not an integer; allowed: " + what);
  }
  if (!(number >= minimum && number <= maximum)) {
    throw error(key, value.toText() + " is out of range; allowed: " + what);
  }
  return static_cast<int>(number);
}

bool ParameterReader::boolean(const std::string& key, bool default_value) {
  const ParameterTree* value = raw(key);
  if (value == nullptr) return default_value;
  requireKind(ParameterTree::Kind::kBoolean, *value, keyPath(key), "true or false");
  return value->asBoolean();
}

std::string ParameterReader::text(const std::string& key,
                                  const std::optional<std::string>& default_value) {
  if (raw(key) == nullptr && default_value) return *default_value;
  return requireText(require(key, "a text"), keyPath(key));
}

std::string ParameterReader::formula(const std::string& key, const std::string& unit) {
  const ParameterTree& value = require(key, "a formula (a text or a number)");
  switch (value.kind()) {
    case ParameterTree::Kind::kText:
      if (findQuantityOrFormula(value)) {
        return formatNumber(toNumber(value, keyPath(key), Range::any(unit)));
      }
      return value.asText();
    case ParameterTree::Kind::kInteger:
      return std::to_string(value.asInteger());
    case ParameterTree::Kind::kReal:
      return formatNumber(toNumber(value, keyPath(key)));
    default:
      throw error(key, "expected a formula (a text or a number), " + describe(value));
  }
}

std::string ParameterReader::choice(const std::string& key, const std::vector<std::string>& allowed,
                                    const std::optional<std::string>& default_value) {
  if (raw(key) == nullptr && default_value) return *default_value;
  const std::string what = "one of " + joinNames(allowed);
  const ParameterTree& value = require(key, what);
  requireKind(ParameterTree::Kind::kText, value, keyPath(key), what);
  const std::string& name = value.asText();
  placeOf(name, allowed, keyPath(key), "is not allowed");
  return name;
}

std::vector<double> ParameterReader::numbers(const std::string& key, std::size_t size,
                                             const Range& range) {
  const std::string what =
      "a list of " + std::to_string(size) + (size == 1 ? " number" : " numbers");
  const ParameterTree& value = require(key, what);
  requireKind(ParameterTree::Kind::kList, value, keyPath(key), what);
  const ParameterTree::List& list = value.asList();
  if (list.size() != size) {
    throw error(
        key, "expected " + what + ", got " + std::to_string(list.size()) + ": " + value.toText());
  }
  std::vector<double> numbers;
  for (std::size_t i = 0; i < list.size(); ++i) {
    numbers.push_back(toNumber(list[i], elementPath(keyPath(key), i), range));
  }
  return numbers;
}

const ParameterTree::List& ParameterReader::list(const std::string& key, const std::string& what) {
  static const ParameterTree empty = ParameterTree::list();
  const ParameterTree* const value = raw(key);
  if (value == nullptr || value->kind() == ParameterTree::Kind::kNothing) return empty.asList();
  requireKind(ParameterTree::Kind::kList, *value, keyPath(key), what);
  return value->asList();
}

std::vector<std::string> ParameterReader::names(const std::string& key) {
  std::vector<std::string> names;
  for (const ParameterTree& name : list(key, "a list of names")) {
    names.push_back(requireText(name, elementPath(keyPath(key), names.size())));
  }
  return names;
}

std::map<std::string, double> ParameterReader::numberDictionary(const std::string& key) {
  const ParameterTree* value = raw(key);
  if (value == nullptr || value->kind() == ParameterTree::Kind::kNothing) return {};
  requireKind(ParameterTree::Kind::kDictionary, *value, keyPath(key), "a dictionary of numbers");
  std::map<std::string, double> numbers;
  for (const auto& [name, number] : value->asDictionary()) {
    numbers[name] = toNumber(number, keyPath(key) + "/" + name);
  }
  return numbers;
}

ParameterReader ParameterReader::section(const std::string& key,
                                         std::initializer_list<const char*> known) {
  static const ParameterTree empty = ParameterTree::dictionary();
  const ParameterTree& value = require(key, "a dictionary");
  // A key with nothing behind it is a dictionary whose lines are all commented out.
  const bool is_empty = value.kind() == ParameterTree::Kind::kNothing;
  ParameterReader reader(is_empty ? empty : value, keyPath(key));
  reader.allow(known);
  return reader;
}

void ParameterReader::finish() const {
  const std::vector<std::string> known(known_.begin(), known_.end());
  for (const auto& entry : tree_->asDictionary()) {
    if (known_.count(entry.first) != 0) continue;
    throw error(entry.first, "unknown key" + suggestAmong(entry.first, known));
  }
}

}  // namespace variator_sim
