#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "motion.h"

namespace variator_sim {

void Motion::stop(StopReason reason) {
  status_.reason = reason;
  status_.time = absolute(front_.time);
}

bool Motion::stopWhereToleranceIsLost() {
  const double measure = checks_.unattainable();
  if (measure > 1.0) {
    statistics_.largest_rounding = std::max(statistics_.largest_rounding, measure);
  }
  if (!checks_.isToleranceLost()) return false;
  front_ = base_;
  explainStop(StopReason::kToleranceTooSmall);
  if (status_.reason == StopReason::kToleranceTooSmall) status_.measure = measure;
  return true;
}

void Motion::explainStop(StopReason otherwise) {
  stop(otherwise);
  if (nameBadValue(front_.time, front_.x)) return;
  const StateView state = system_.view(front_.time, front_.x);
  double c0[kMaxRows] = {};
  if (!drivetrain_.calcRows(state, c0)) {
    status_.reason = StopReason::kSingularConstraint;
    status_.constraint = drivetrain_.solver().singularRow();
    status_.measure = drivetrain_.solver().singularMeasure();
    return;
  }
  // The step underflows before the rank is lost outright: eta grows without bound near there.
  const double pivot = drivetrain_.solver().calcSmallestPivot(&status_.constraint);
  if (pivot < 1e-9) {
    status_.reason = StopReason::kSingularConstraint;
    status_.measure = pivot;
    return;
  }
  status_.constraint = -1;
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    // Where C goes to zero like sqrt(t* - t) the step underflows first, at C ~ 1e-8.
    const double left =
        std::sqrt(drivetrain_.solver().rowLengthSquared(m) / std::max(row_reference_[m], 1e-300));
    if (left < 1e-5) {
      status_.reason = StopReason::kSingularConstraint;
      status_.constraint = m;
      status_.measure = left;
      return;
    }
  }
  // Just ahead of the front: does a component leave its domain there?
  double h = 1e-14 * std::max(1.0, std::abs(front_.time));
  for (int decade = 0; decade < 12; ++decade, h *= 10.0) {
    State ahead(system_.size());
    for (int i = 0; i < ahead.size(); ++i) {
      ahead[i] = front_.x[i] + h * front_.dxdt[i];
      if (!std::isfinite(ahead[i])) return;
    }
    if (nameBadValue(front_.time + h, ahead)) return;
  }
}

bool Motion::nameBadValue(double t, const State& x) {
  static constexpr double kZeros[kMaxShafts] = {};
  StateView state = system_.view(t, x);
  bool solved = true;
  for (int i = 0; i < S; ++i) solved = solved && std::isfinite(state.acceleration[i]);
  if (!solved) state.acceleration = kZeros;
  if (drivetrain_.findNonFinite(state, &status_.torque, &status_.constraint)) {
    status_.reason = StopReason::kNonFiniteValue;
    return true;
  }
  if (!solved) status_.reason = StopReason::kProjectionFailed;
  return !solved;
}

}  // namespace variator_sim
