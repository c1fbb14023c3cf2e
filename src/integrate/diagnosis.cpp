#include "integrate/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

namespace variator_sim {

void diagnoseStop(PrincipleSystem& system, const StepNode& front, const RowWatch& rows,
                  MotionStatus* status) {
  Drivetrain& drivetrain = system.drivetrain();
  if (nameBadValue(system, front.time, front.x, status)) return;
  const StateView state = system.view(front.time, front.x);
  double c0[kMaxRows] = {};
  if (!drivetrain.calcRows(state, c0)) {
    status->reason = StopReason::kSingularConstraint;
    status->constraint = drivetrain.solver().singularRow();
    status->measure = drivetrain.solver().singularMeasure();
    return;
  }
  // The step underflows before the rank is lost outright: eta grows without bound near there.
  const double pivot = drivetrain.solver().calcSmallestPivot(&status->constraint);
  if (pivot < 1e-9) {
    status->reason = StopReason::kSingularConstraint;
    status->measure = pivot;
    return;
  }
  status->constraint = -1;
  for (int m = 0; m < drivetrain.constraintCount(); ++m) {
    // Where C goes to zero like sqrt(t* - t) the step underflows first, at C ~ 1e-8.
    const double left =
        std::sqrt(drivetrain.solver().rowLengthSquared(m) / std::max(rows.reference(m), 1e-300));
    if (left < 1e-5) {
      status->reason = StopReason::kSingularConstraint;
      status->constraint = m;
      status->measure = left;
      return;
    }
  }
  // Just ahead of the front: does a component leave its domain there?
  double h = 1e-14 * std::max(1.0, std::abs(front.time));
  for (int decade = 0; decade < 12; ++decade, h *= 10.0) {
    State ahead(system.size());
    for (int i = 0; i < ahead.size(); ++i) {
      ahead[i] = front.x[i] + h * front.dxdt[i];
      if (!std::isfinite(ahead[i])) return;
    }
    if (nameBadValue(system, front.time + h, ahead, status)) return;
  }
}

bool nameBadValue(PrincipleSystem& system, double t, const State& x, MotionStatus* status) {
  static constexpr double kZeros[kMaxShafts] = {};
  StateView state = system.view(t, x);
  bool solved = true;
  for (int i = 0; i < system.shafts(); ++i) solved = solved && std::isfinite(state.acceleration[i]);
  if (!solved) state.acceleration = kZeros;
  if (system.drivetrain().findNonFinite(state, &status->torque, &status->constraint)) {
    status->reason = StopReason::kNonFiniteValue;
    return true;
  }
  if (!solved) status->reason = StopReason::kProjectionFailed;
  return !solved;
}

MotionStatus diagnoseStart(PrincipleSystem& system, const Start& start) {
  Drivetrain& drivetrain = system.drivetrain();
  MotionStatus status;
  switch (start.result) {
    case InitialResult::kConsistent:
      break;
    case InitialResult::kSingular:
      status.reason = StopReason::kSingularConstraint;
      status.constraint = start.velocities_at_fault ? drivetrain.singularVelocityConstraint()
                                                    : drivetrain.singularAccelerationConstraint();
      // (Of constraints of order 3 only the solver of all of them knows.)
      if (status.constraint < 0) status.constraint = drivetrain.solver().singularRow();
      break;
    case InitialResult::kNonFinite:
      status.reason = StopReason::kNonFiniteValue;
      drivetrain.findNonFinite(system.view(0.0, start.x), &status.torque, &status.constraint);
      break;
    case InitialResult::kInconsistent:
    case InitialResult::kNotFound:
    case InitialResult::kNotUnique:
    case InitialResult::kDoubtful:
      status.reason = StopReason::kProjectionFailed;
      break;
  }
  return status;
}

namespace {

void writeResiduals(std::ostream& text, const Drivetrain& drivetrain, bool of_velocities,
                    const StateView& state) {
  const std::vector<int>& rows =
      of_velocities ? drivetrain.velocityRows() : drivetrain.accelerationRows();
  const char* separator = "";
  for (int m : rows) {
    double C[kMaxShafts];
    const Constraint& constraint = drivetrain.constraint(m);
    text << separator << " residual of '" << constraint.name() << "' = "
         << formatNumber(of_velocities ? constraint.calcResidual(state)
                                       : constraint.calcResidualAndJacobian(state, C));
    separator = ",";
  }
}

}  // namespace

std::string describeInconsistency(PrincipleSystem& system, const Start& start,
                                  const double* given) {
  const bool of_velocities = start.velocities_at_fault;
  const std::string what = of_velocities ? "velocities" : "accelerations";
  StateView state = system.view(0.0, start.x);
  if (!of_velocities) state.acceleration = given;
  std::ostringstream text;
  const auto write = [&](const double* values) {
    text << "[";
    for (int i = 0; i < system.shafts(); ++i) text << (i ? ", " : "") << formatNumber(values[i]);
    text << "]";
  };
  if (start.result == InitialResult::kNotUnique || start.result == InitialResult::kDoubtful) {
    return "which accelerations have the least reaction is not certain; give them";
  }
  if (start.result != InitialResult::kInconsistent) {
    text << "no " << what << " that satisfy the constraints were found near ";
    write(of_velocities ? state.velocity : given);
    text << " (there:";
    writeResiduals(text, system.drivetrain(), of_velocities, state);
    text << ")";
    return text.str();
  }
  text << "the " << what << " ";
  write(of_velocities ? state.velocity : given);
  text << " do not satisfy the constraints or the principle:";
  writeResiduals(text, system.drivetrain(), of_velocities, state);
  text << "; the nearest consistent " << what << " are ";
  write(start.nearest);
  text << " (set these, or have them projected)";
  return text.str();
}

void throwInitialError(PrincipleSystem& system, const Scene& scene, const Start& start) {
  const int S = system.shafts();
  const InitialConditions& initial = scene.initial;
  const std::string what = start.velocities_at_fault ? "velocities" : "accelerations";
  const std::string key = start.velocities_at_fault ? "initial/velocity" : "initial/acceleration";
  const std::vector<double>& given =
      start.velocities_at_fault ? initial.velocity : initial.acceleration;
  std::ostringstream text;
  const auto write = [&](const double* values) {
    text << "[";
    for (int i = 0; i < S; ++i) text << (i ? ", " : "") << formatNumber(values[i]);
    text << "]";
  };
  const StateView state = system.view(0.0, start.x);
  if (start.result == InitialResult::kNotUnique || start.result == InitialResult::kDoubtful) {
    const auto& search = system.search();
    text << (start.result == InitialResult::kNotUnique
                 ? "more than one has the least reaction, and they lead to different motions: "
                 : "which one has the least reaction is not certain, the constraints have too "
                   "many like these: ");
    for (int n = 0; n < search.candidateCount(); ++n) {
      text << (n > 0 ? ", " : "");
      write(search.candidate(n).epsilon);
      text << " with 1/2 R^T J^-1 R = " << formatNumber(search.candidate(n).reaction);
    }
    throw SceneError(key, text.str() + "; give 'initial/acceleration'" + scene.extreme_numbers);
  }
  if (start.result != InitialResult::kInconsistent) {
    text << "no " << what << " that satisfy the constraints were found ";
    text << (given.empty() ? "from the free accelerations; give 'initial/acceleration' (there:"
                           : "near those given (there:");
    writeResiduals(text, system.drivetrain(), start.velocities_at_fault, state);
    text << ")";
    throw SceneError(key, text.str() + scene.extreme_numbers);
  }
  write(given.data());
  StateView there = state;
  (start.velocities_at_fault ? there.velocity : there.acceleration) = given.data();
  if (scene.principle == Principle::kGauss && !start.velocities_at_fault) {
    text << " is not what the principle 'gauss' gives:";
  } else {
    text << " does not satisfy the constraints:";
  }
  writeResiduals(text, system.drivetrain(), start.velocities_at_fault, there);
  text << "; the nearest consistent " << what << " are ";
  write(start.nearest);
  text << " (write these, or set 'initial/project: true' to start there)";
  throw SceneError(key, text.str() + scene.extreme_numbers);
}

}  // namespace variator_sim
