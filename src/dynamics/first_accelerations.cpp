#include "dynamics/first_accelerations.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

FirstAccelerations::Verdict FirstAccelerations::findLeastReaction(const StateView& state,
                                                                  double* epsilon) {
  constraints_.enter(state);
  const double* const free = constraints_.free().data();
  std::copy_n(free, S, epsilon);
  if (!constraints_.free().allFinite()) return Verdict::kNone;
  double multipliers[kMaxShafts] = {};
  bool is_found = solver_.solve(state, 0, epsilon, multipliers);
  if (!is_found) {
    // Far from psi = 0 Newton's iteration may lead away; damped steps to the solution of the
    // linearised constraints come near first.
    std::copy_n(free, S, epsilon);
    approach(state, epsilon);
    std::fill_n(multipliers, S, 0.0);
    is_found = solver_.solve(state, 0, epsilon, multipliers);
  }
  const Verdict verdict = search_.find(state, is_found ? epsilon : nullptr);
  const bool has_any = search_.candidateCount() > 0;
  std::copy_n(has_any ? search_.candidate(0).epsilon : free, S, epsilon);
  return verdict;
}

bool FirstAccelerations::retract(const StateView& state, double* epsilon) {
  constraints_.enter(state);
  StateView moving = state;
  moving.acceleration = epsilon;
  return solver_.retract(moving, epsilon);
}

void FirstAccelerations::approach(const StateView& given, double* epsilon) {
  StateView state = given;
  state.acceleration = epsilon;
  for (int iteration = 0; iteration < 100; ++iteration) {
    double delta[kMaxShafts];
    if (!constraints_.calcLinearizedReaction(state, delta)) return;
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(delta[i])) return;
      epsilon[i] += 0.5 * (constraints_.free()(i) + delta[i] - epsilon[i]);
    }
  }
}

}  // namespace variator_sim
