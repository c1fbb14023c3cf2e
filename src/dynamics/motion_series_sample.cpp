// Samples of a motion inside a step by its series, around series_step_sample.inc.
#include <cstdint>

#include "dynamics/motion_series.h"

namespace variator_sim {

void MotionSeries::findSampled() {
  SeriesLayout& to = layout_;
  const auto add = [&to](int at) { to.sampled_at[to.sampled++] = at; };
  for (int n = 0; n < 3 * S; ++n) add(to.component_at[n]);
  for (int m = 0; m < k_; ++m) add(to.multiplier_at[m]);
  for (int i = 0; i < S; ++i) add(to.torque_at[i]);
  if (!isInertiaConstant()) {
    for (int i = 0; i < S; ++i) add(to.inertia_at[i]);
    for (int i = 0; i < S; ++i) add(to.inertial_torque_at[i]);
    for (int i = 0; i < S; ++i) add(static_cast<int>(program_.offset(row_of_connection_[i])));
  }
  constexpr int kTogether = 4;
  to.sampled_width = (to.sampled + kTogether - 1) / kTogether * kTogether;
}

void MotionSeries::tabulate() {
  const SeriesNode& node = step_.node[step_.made - 1];
  stepCodes().tabulate(&step_, program_.rows(), node.taken / own().unit, table_.rows);
  table_.stamp = stamp_;
  table_.last = step_.last;
  table_.end = node.end;
  table_.per_step = 1.0 / node.taken;
}

bool MotionSeries::calcSample(std::uint64_t stamp, double end, double t, std::uint64_t* projections,
                              Sample* sample) {
  if (table_.stamp != stamp) {
    if (!makes_samples_ || stamp != stamp_ || stamp != strode_) return false;
    fetch();
    tabulate();
  }
  if (end != table_.end) return false;
  prepare(&sample_);
  sample_.last = table_.last;
  sample_.end = t;
  const SeriesSample to = {sample->angle,           sample->velocity,
                           sample->acceleration,    sample->applied_torque,
                           sample->reaction_torque, sample->reaction_torque_rate,
                           sample->residual,        sample->multiplier};
  // Count from the end, which the caller knows exactly.
  const double part = 1.0 - (end - t) * table_.per_step;
  stepCodes().sample(&sample_, table_.rows, part, &to);
  *projections += static_cast<std::uint64_t>(sample_.projections);
  return sample_.doubt == 0.0;
}

}  // namespace variator_sim
