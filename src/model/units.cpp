#include "variator_sim/units.h"

#include <algorithm>
#include <boost/algorithm/string/replace.hpp>
#include <charconv>
#include <cmath>
#include <system_error>
#include <utility>
#include <vector>

#include "variator_sim/errors.h"
#include "variator_sim/message_text.h"

namespace variator_sim {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// The only list of units. Prefixes go with those that are usual with one.
struct NamedUnit {
  const char* name;
  Unit unit;
  bool takes_prefix;
};
constexpr NamedUnit kUnits[] = {
    //         value in SI units      kg  m   s   A   K  rad
    {"%", {1.0, 100.0, {{0, 0, 0, 0, 0, 0}}}, false},
    {"kg", {1.0, 1.0, {{1, 0, 0, 0, 0, 0}}}, false},
    {"g", {1.0, 1000.0, {{1, 0, 0, 0, 0, 0}}}, true},
    {"t", {1000.0, 1.0, {{1, 0, 0, 0, 0, 0}}}, false},
    {"lb", {0.45359237, 1.0, {{1, 0, 0, 0, 0, 0}}}, false},
    {"m", {1.0, 1.0, {{0, 1, 0, 0, 0, 0}}}, true},
    {"in", {0.0254, 1.0, {{0, 1, 0, 0, 0, 0}}}, false},
    {"ft", {0.3048, 1.0, {{0, 1, 0, 0, 0, 0}}}, false},
    {"mi", {1609.344, 1.0, {{0, 1, 0, 0, 0, 0}}}, false},
    {"l", {1.0, 1000.0, {{0, 3, 0, 0, 0, 0}}}, true},
    {"s", {1.0, 1.0, {{0, 0, 1, 0, 0, 0}}}, true},
    {"min", {60.0, 1.0, {{0, 0, 1, 0, 0, 0}}}, false},
    {"h", {3600.0, 1.0, {{0, 0, 1, 0, 0, 0}}}, false},
    {"Hz", {1.0, 1.0, {{0, 0, -1, 0, 0, 0}}}, true},
    {"rad", {1.0, 1.0, {{0, 0, 0, 0, 0, 1}}}, true},
    {"deg", {kPi, 180.0, {{0, 0, 0, 0, 0, 1}}}, false},
    {"rev", {2.0 * kPi, 1.0, {{0, 0, 0, 0, 0, 1}}}, false},
    {"rpm", {kPi, 30.0, {{0, 0, -1, 0, 0, 1}}}, false},
    {"mph", {0.44704, 1.0, {{0, 1, -1, 0, 0, 0}}}, false},
    {"kn", {1852.0, 3600.0, {{0, 1, -1, 0, 0, 0}}}, false},
    {"N", {1.0, 1.0, {{1, 1, -2, 0, 0, 0}}}, true},
    {"lbf", {4.4482216152605, 1.0, {{1, 1, -2, 0, 0, 0}}}, false},
    {"Nm", {1.0, 1.0, {{1, 2, -2, 0, 0, 0}}}, true},
    {"J", {1.0, 1.0, {{1, 2, -2, 0, 0, 0}}}, true},
    {"Wh", {3600.0, 1.0, {{1, 2, -2, 0, 0, 0}}}, true},
    {"W", {1.0, 1.0, {{1, 2, -3, 0, 0, 0}}}, true},
    {"hp", {745.69987158227022, 1.0, {{1, 2, -3, 0, 0, 0}}}, false},
    {"PS", {735.49875, 1.0, {{1, 2, -3, 0, 0, 0}}}, false},
    {"Pa", {1.0, 1.0, {{1, -1, -2, 0, 0, 0}}}, true},
    {"bar", {100000.0, 1.0, {{1, -1, -2, 0, 0, 0}}}, true},
    {"A", {1.0, 1.0, {{0, 0, 0, 1, 0, 0}}}, true},
    {"V", {1.0, 1.0, {{1, 2, -3, -1, 0, 0}}}, true},
    {"ohm", {1.0, 1.0, {{1, 2, -3, -2, 0, 0}}}, true},
    {"K", {1.0, 1.0, {{0, 0, 0, 0, 1, 0}}}, true},
    {"degC", {1.0, 1.0, {{0, 0, 0, 0, 1, 0}}, 273.15}, false}};

/// Other ways to write the same, in UTF-8.
constexpr std::pair<const char*, const char*> kSigns[] = {
    {"\u00b0C", "degC"}, {"\u2103", "degC"}, {"\u00b0", "deg"}, {"\u00b5", "u"},
    {"\u03bc", "u"},     {"\u00b2", "^2"},   {"\u00b3", "^3"},  {"\u00b7", "*"},
    {"\u2126", "ohm"},   {"\u03a9", "ohm"}};

std::string withoutSigns(std::string text) {
  for (const auto& [sign, plain] : kSigns) boost::algorithm::replace_all(text, sign, plain);
  return text;
}

struct Prefix {
  char letter;
  double numerator;
  double denominator;
};
constexpr Prefix kPrefixes[] = {{'u', 1.0, 1e6}, {'m', 1.0, 1e3}, {'c', 1.0, 1e2},
                                {'k', 1e3, 1.0}, {'M', 1e6, 1.0}, {'G', 1e9, 1.0}};

/// Units that messages show, where they fit.
constexpr const char* kUsual[] = {
    "rpm",  "deg/s", "deg", "rev", "km/h", "mph",    "kW",      "hp",    "kN m",    "ft lbf", "kN",
    "mm",   "cm",    "km",  "ms",  "min",  "h",      "g",       "t",     "N m/deg", "degC",   "mV",
    "mohm", "%",     "bar", "kHz", "cm^2", "g cm^2", "deg/s^2", "rpm/s", "kW/s"};

std::vector<std::string> listNames() {
  std::vector<std::string> names;
  for (const NamedUnit& it : kUnits) names.emplace_back(it.name);
  return names;
}

bool isUnitLetter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '%';
}

std::optional<Unit> findUnit(const std::string& name) {
  for (const NamedUnit& it : kUnits) {
    if (name == it.name) return it.unit;
  }
  for (const NamedUnit& it : kUnits) {
    if (!it.takes_prefix || name.size() < 2 || name.compare(1, name.npos, it.name) != 0) continue;
    for (const Prefix& prefix : kPrefixes) {
      if (prefix.letter != name.front()) continue;
      Unit unit = it.unit;
      unit.numerator *= prefix.numerator;
      unit.denominator *= prefix.denominator;
      return unit;
    }
  }
  return {};
}

/// Multiplies `product` by unit^power.
void multiply(const Unit& unit, int power, Unit* product) {
  for (int n = 0; n < std::abs(power); ++n) {
    product->numerator *= power > 0 ? unit.numerator : unit.denominator;
    product->denominator *= power > 0 ? unit.denominator : unit.numerator;
  }
  for (std::size_t i = 0; i < unit.dimension.size(); ++i) {
    product->dimension[i] += power * unit.dimension[i];
  }
}

/// Reads "^2" or "^-1" at `position`; 1 if there is no power. Returns false for a wrong one.
bool readPower(const std::string& text, std::size_t* position, int* power) {
  *power = 1;
  if (*position == text.size() || text[*position] != '^') return true;
  const char* const begin = text.data() + *position + 1;
  const auto [rest, error] = std::from_chars(begin, text.data() + text.size(), *power);
  *position = static_cast<std::size_t>(rest - text.data());
  return error == std::errc() && std::abs(*power) <= 9;
}

}  // namespace

std::optional<UnitText> readUnit(const std::string& given) {
  const std::string text = withoutSigns(given);
  constexpr std::size_t kLongest = 60;
  if (text.empty() || text.size() > kLongest) return {};
  UnitText read;
  std::size_t position = 0;
  bool divides = false;
  while (true) {
    std::size_t end = position;
    while (end < text.size() && isUnitLetter(text[end])) ++end;
    const bool is_one = end == position && position < text.size() && text[position] == '1';
    if (end == position && !is_one) return {};
    const std::string name = text.substr(position, end - position);
    position = end + (is_one ? 1 : 0);
    int power = 1;
    if (!readPower(text, &position, &power)) return {};
    const std::optional<Unit> unit = is_one ? Unit() : findUnit(name);
    if (unit) multiply(*unit, divides ? -power : power, &read.unit);
    if (unit && end == text.size() && end == name.size()) read.unit.zero = unit->zero;
    if (!unit && read.unknown.empty()) read.unknown = name;
    // A sign between two units, with blanks around it: a slash, an asterisk, or blanks alone.
    const std::size_t sign = std::min(text.find_first_not_of(' ', position), text.size());
    if (sign == text.size()) break;
    const bool is_slash = text[sign] == '/';
    const bool is_sign = is_slash || text[sign] == '*';
    // "J/kg K" would mean two things.
    if ((divides && !is_slash) || (!is_sign && sign == position)) return {};
    divides = is_slash;
    position = std::min(text.find_first_not_of(' ', sign + (is_sign ? 1 : 0)), text.size());
  }
  return read;
}

Unit requireUnit(const std::string& text, const std::string& path) {
  const std::optional<UnitText> read = readUnit(text);
  if (read && read->unknown.empty()) return read->unit;
  throw SceneError(
      path, (read ? inQuotes(read->unknown) + " is not a known unit" + suggestUnit(read->unknown)
                  : inQuotes(text) + " is not a unit") +
                "; allowed: products and quotients, such as N m/rad, of " + joinNames(listNames()) +
                ", many with u, m, c, k, M, G before them");
}

std::string listUnitsLike(const std::string& unit) {
  std::vector<std::string> fitting;
  if (unit != "1") fitting.push_back(unit);
  const std::optional<UnitText> own = readUnit(unit);
  for (const char* usual : kUsual) {
    if (own && usual != unit && readUnit(usual)->unit.dimension == own->unit.dimension) {
      fitting.emplace_back(usual);
    }
  }
  return joinNames(fitting);
}

std::string suggestUnit(const std::string& unknown) {
  std::vector<std::string> names = listNames();
  for (const char* usual : kUsual) names.emplace_back(usual);
  return suggestName(unknown, names);
}

}  // namespace variator_sim
