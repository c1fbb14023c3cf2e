#include "dynamics/system.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/projection.h"
#include "model/formula_laws.h"

namespace variator_sim {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool fits(const System* like, const Scene& scene) {
  return like != nullptr && haveSameElements(scene, like->scene());
}

}  // namespace

System::Form System::formOf(const Scene& scene) {
  if (scene.principle == Principle::kGeneralizedGauss) return Form::kJerk;
  return scene.hasOrder3() ? Form::kFormalJerk : Form::kAcceleration;
}

System::System(const Scene& scene, const System* like)
    : scene_(scene),
      form_(formOf(scene)),
      S(scene.shaftCount()),
      size_(integratesTorque() ? 3 * S : 2 * S),
      drivetrain_(scene, fits(like, scene) ? &like->drivetrain_ : nullptr),
      initial_solver_(drivetrain_),
      accelerations_(drivetrain_, initial_solver_) {}

// --- x' ------------------------------------------------------------------------------------------

void System::operator()(const State& x, State& dxdt, double t) {
  const StateView state = view(t, x);
  std::copy_n(state.velocity, S, dxdt.data());
  std::copy_n(state.acceleration, S, dxdt.data() + S);
  if (form_ == Form::kJerk) calcJerk(state, dxdt.data() + 2 * S);
  if (form_ == Form::kFormalJerk) calcFormalJerk(state, dxdt.data() + 2 * S);
}

void System::calcJerk(const StateView& state, double* eta) {
  double c0[kMaxRows];
  double rate[kMaxShafts];
  double Lambda[kMaxRows];
  const bool is_regular = drivetrain_.calcRows(state, c0);
  drivetrain_.calcTorqueRate(state, rate);
  drivetrain_.makeCovariant(state, rate);  // -g
  drivetrain_.inertia().solve(rate, eta);
  if (drivetrain_.constraintCount() == 0) return;
  if (is_regular) {
    drivetrain_.solver().constrain(c0, eta, Lambda);
  } else {
    std::fill_n(eta, S, kNaN);
  }
}

void System::calcFormalJerk(const StateView& state, double* eta) {
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double reaction_rate[kMaxShafts];
  double lambda[kMaxRows] = {};
  double c0[kMaxRows] = {};
  drivetrain_.calcTorque(state, torque);
  drivetrain_.calcReaction(state, torque, reaction);
  if (drivetrain_.calcRows(state, c0)) {
    drivetrain_.calcMultipliers(reaction, lambda);
    if (drivetrain_.calcFormalJerk(state, lambda, eta, reaction_rate)) return;
  }
  std::fill_n(eta, S, kNaN);
}

StateView System::view(double t, const State& x) {
  const StateView state = viewWithLast(t, x);
  if (!integratesTorque()) accelerations_.calc(state);
  return state;
}

StateView System::viewWithLast(double t, const State& x) {
  return drivetrain_.view(t, x.data(), x.data() + S,
                          integratesTorque() ? x.data() + 2 * S : accelerations_.last());
}

bool System::haveAccelerationsLeapt(const StepNode& from, const StepNode& to) {
  if (integratesTorque() || accelerations_.isLinear()) return false;
  noteBase(to.time, to.x, to.dxdt);
  view(from.time, from.x);
  const bool are_found = std::isfinite(accelerations_.last()[0]);
  const bool has_leapt = are_found && !accelerations_.areNear(from.dxdt.data() + S);
  noteBase(from.time, from.x, from.dxdt);
  return has_leapt;
}

bool System::moveReactionIntoRange(const StateView& state, double* epsilon, double* moved) {
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double lambda[kMaxRows] = {};
  double c0[kMaxRows] = {};
  drivetrain_.calcTorque(state, torque);
  drivetrain_.calcReaction(state, torque, reaction);
  if (!drivetrain_.calcRows(state, c0)) return false;
  double rest[kMaxShafts];
  drivetrain_.calcOutOfRange(reaction, lambda, rest);
  for (int i = 0; i < S; ++i) {
    moved[i] += std::abs(rest[i]);
    epsilon[i] += rest[i];
  }
  return true;
}

// --- starts --------------------------------------------------------------------------------------

InitialResult System::start(State& x, double* nearest, bool* velocities_at_fault) {
  const InitialConditions& initial = scene_.initial;
  x.fill(0.0);
  std::copy(initial.angle.begin(), initial.angle.end(), x.begin());
  std::copy(initial.velocity.begin(), initial.velocity.end(), x.begin() + S);
  if (integratesTorque()) {
    std::copy(initial.acceleration.begin(), initial.acceleration.end(), x.begin() + 2 * S);
    double epsilon[kMaxShafts];
    return accept(0.0, initial.project, !initial.acceleration.empty(), x, epsilon, nearest,
                  velocities_at_fault);
  }
  const StateView state = viewWithLast(0.0, x);
  const InitialResult velocities =
      initial_solver_.acceptVelocities(state, initial.project, x.data() + S, nearest);
  *velocities_at_fault = velocities != InitialResult::kConsistent;
  return *velocities_at_fault ? velocities : accelerations_.start(state, initial, nearest);
}

InitialResult System::accept(double t, bool may_move, bool are_given, State& x, double* epsilon,
                             double* nearest, bool* velocities_at_fault) {
  const StateView state = viewWithLast(t, x);
  InitialResult result = initial_solver_.acceptVelocities(state, may_move, x.data() + S, nearest);
  *velocities_at_fault = result != InitialResult::kConsistent;
  if (*velocities_at_fault) return result;
  if (!integratesTorque()) {
    return accelerations_.accept(state, may_move, are_given, epsilon, nearest);
  }
  double* const own = x.data() + 2 * S;
  result = are_given ? initial_solver_.acceptAccelerations(state, may_move, own, nearest)
                     : initial_solver_.findLeastReaction(state, own);
  if (form_ == Form::kFormalJerk && are_given && result == InitialResult::kConsistent) {
    // Its reaction has to lie in range(C^T).
    double moved[kMaxShafts] = {};
    if (!moveReactionIntoRange(state, own, moved)) return InitialResult::kSingular;
    std::copy_n(own, S, nearest);
    for (int i = 0; i < S; ++i) {
      const bool is_near = moved[i] <= 1e-9 * std::max(1.0, std::abs(own[i]));
      if (!is_near && !may_move) result = InitialResult::kInconsistent;
    }
  }
  std::copy_n(own, S, epsilon);
  return result;
}

}  // namespace variator_sim
