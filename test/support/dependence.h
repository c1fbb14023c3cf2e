/// Which of the time and the angles formulas read.
#pragma once

#include <utility>
#include <vector>

#include "variator_sim/torque.h"

namespace variator_sim {

struct Dependence {
  bool time;
  bool angle;
};
inline bool operator==(Dependence a, Dependence b) {
  return a.time == b.time && a.angle == b.angle;
}

inline Dependence dependenceOf(const Law& law) {
  return {reads(law.graph(), law.formulas(), expression::Source::kTime),
          reads(law.graph(), law.formulas(), expression::Source::kAngle)};
}
inline Dependence dependenceOfRate(const Torque& torque) {
  std::vector<expression::Node> rates;
  for (const auto& rate : torque.rates()) rates.push_back(rate.second);
  return {reads(torque.graph(), rates, expression::Source::kTime),
          reads(torque.graph(), rates, expression::Source::kAngle)};
}

}  // namespace variator_sim
