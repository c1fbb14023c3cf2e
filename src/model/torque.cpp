#include "variator_sim/torque.h"

#include <algorithm>
#include <numeric>

#include "model/central_difference.h"
#include "model/switch_guard.h"
#include "variator_sim/errors.h"

namespace variator_sim {

void Torque::doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const {
  const int s = shaft_count_;
  forEachShift(state, s, [&](int q, const StateView& above, const StateView& below, double width) {
    double rate_above[kMaxShafts] = {};
    double rate_below[kMaxShafts] = {};
    doAddTorqueRate(above, rate_above);
    doAddTorqueRate(below, rate_below);
    for (int i = 0; i < s; ++i) derivatives[q * s + i] += (rate_above[i] - rate_below[i]) / width;
  });
}

std::vector<int> Torque::shafts() const {
  std::vector<int> shafts = doShafts();
  std::sort(shafts.begin(), shafts.end());
  shafts.erase(std::unique(shafts.begin(), shafts.end()), shafts.end());
  if (!shafts.empty() && (shafts.front() < 0 || shafts.back() >= shaft_count_)) {
    throw SceneError(name_,
                     "acts on shafts that the scene does not have (shafts); allowed: indices "
                     "from 0 to " +
                         std::to_string(shaft_count_ - 1));
  }
  return shafts;
}

std::vector<int> Torque::doShafts() const {
  std::vector<int> all(static_cast<std::size_t>(shaft_count_));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

std::vector<GuardPtr> Torque::guards() const {
  std::vector<GuardPtr> guards = doGuards();
  addSwitchGuards(
      doSwitchCount(),
      [this](const StateView& state, double* values) { doCalcSwitches(state, values); },
      [this](int index) { return doSwitchJumps(index); }, guards);
  return guards;
}

}  // namespace variator_sim
