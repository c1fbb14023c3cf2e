#include "variator_sim/torque.h"

#include "model/central_difference.h"
#include "model/switch_guard.h"

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

std::vector<GuardPtr> Torque::guards() const {
  std::vector<GuardPtr> guards = doGuards();
  addSwitchGuards(
      doSwitchCount(),
      [this](const StateView& state, double* values) { doCalcSwitches(state, values); },
      [this](int index) { return doSwitchJumps(index); }, guards);
  return guards;
}

}  // namespace variator_sim
