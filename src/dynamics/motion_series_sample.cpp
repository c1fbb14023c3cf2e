// Samples of a motion inside a step by its series: what is around series_step_sample.inc.
#include <algorithm>
#include <cstdint>

#include "dynamics/motion_series.h"

namespace variator_sim {

void MotionSeries::findSampled() {
  SeriesLayout& to = layout_;
  const auto add = [&to](int at) { to.sampled_at[to.sampled++] = at; };
  for (int n = 0; n < 3 * S; ++n) add(to.component_at[n]);
  for (int m = 0; m < k_; ++m) {
    to.constraint_order[m] = drivetrain_.constraint(m).order();
    add(static_cast<int>(program_.offset(row_of_multiplier_[m])));
  }
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
  const int last = step_.last;
  const int width = layout_.sampled_width;
  const int multipliers = 3 * S;
  const int torques = multipliers + k_;
  const double theta = node.taken / own().unit;
  double end[sizeof layout_.sampled_at / sizeof(int)] = {};
  std::copy_n(node.x, multipliers, end);
  std::copy_n(node.multiplier, k_, end + multipliers);
  std::copy_n(node.torque, S, end + torques);
  const double* const rows = program_.rows();
  double gap[kMaxRows] = {};  // of Lambda, whose last coefficient is not known
  double power = 1.0;
  double* to = table_.rows;
  for (int k = 0; k <= last; ++k, power *= theta, to += width) {
    if (k == last) std::copy_n(end + multipliers, k_, gap);
    for (int n = 0; n < layout_.sampled; ++n) {
      to[n] = rows[layout_.sampled_at[n] + k] * power;
      end[n] -= to[n];
    }
  }
  std::copy_n(gap, k_, to - width + multipliers);
  std::fill_n(to, 4 * width, 0.0);  // rows go by fours
  std::copy_n(end, multipliers, to);
  std::copy_n(end + torques, S, to + torques);
  table_.stamp = stamp_;
  table_.last = last;
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
  // From the end, which others are told exactly.
  const double part = 1.0 - (end - t) * table_.per_step;
  sample_code_(&sample_, table_.rows, part, &to);
  *projections += static_cast<std::uint64_t>(sample_.projections);
  return sample_.doubt == 0.0;
}

}  // namespace variator_sim
