#include "variator_sim/torque.h"

#include "central_difference.h"

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

}  // namespace variator_sim
