/// Units that numbers carry in texts: "1500 rpm", "3 deg", "110 kW".
#pragma once

#include <array>
#include <optional>
#include <string>

namespace variator_sim {

/// A unit of measurement. Angles have a dimension of their own: 50 Hz is no 50 rad/s.
struct Unit {
  double numerator = 1.0;  ///< one of it is numerator/denominator of the SI unit of its dimension
  double denominator = 1.0;
  std::array<int, 6> dimension{};  ///< exponents of kg, m, s, A, K, rad
  double zero = 0.0;               ///< its 0 in SI units: 273.15 of degC that stands alone
  double toSi(double number) const { return number * numerator / denominator + zero; }
};

/// A text read as a unit.
struct UnitText {
  Unit unit;
  std::string unknown;  ///< the first name that is no unit; empty if all are
};

/// Reads a product of units with powers, then its divisors, each behind a slash: "N m s^2/rad^2",
/// "km/h", "m/s/s", "1/s", "1". SI prefixes stand where they are usual. Returns nothing for a text
/// that is not of this form.
std::optional<UnitText> readUnit(const std::string& text);

/// Returns the unit that the value at `path` of a scene names. Throws SceneError.
Unit requireUnit(const std::string& text, const std::string& path);

/// Returns "rad/s, rpm, deg/s": `unit`, unless it is 1, and usual ones of its
/// dimension.
std::string listUnitsLike(const std::string& unit);

/// Returns " (did you mean 'rpm'?)" or "" for a name that is no unit.
std::string suggestUnit(const std::string& unknown);

}  // namespace variator_sim
