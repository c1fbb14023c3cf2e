#include "dynamics/system.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

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

System::System(const Scene& scene, const Shortcuts& shortcuts, const System* like)
    : scene_(scene),
      form_(formOf(scene)),
      S(scene.shaftCount()),
      size_(integratesTorque() ? 3 * S : 2 * S),
      drivetrain_(scene, shortcuts, fits(like, scene) ? &like->drivetrain_ : nullptr),
      initial_solver_(drivetrain_),
      accelerations_(drivetrain_, initial_solver_),
      reaction_(drivetrain_, {scene.solver.absolute_tolerance, scene.solver.relative_tolerance},
                form_ == Form::kJerk),
      series_(shortcuts.has_series ? SceneSeries::make(scene, drivetrain_.signals()) : nullptr),
      derive_(chooseDerive(shortcuts)) {
  const bool is_jerk = form_ == Form::kJerk;
  keeps_constraints_in_stages_ = drivetrain_.canKeepConstraintsInStages() &&
                                 (is_jerk || (!integratesTorque() && accelerations_.isLinear()));
}

// --- x' ------------------------------------------------------------------------------------------

System::Derive System::chooseDerive(const Shortcuts& shortcuts) const {
  switch (form_) {
    case Form::kFormalJerk:
      return deriveFormally;
    case Form::kAcceleration:
      return deriveAcceleration;
    case Form::kJerk:
      break;
  }
  const Inertia& inertia = drivetrain_.inertia();
  const bool has_one_row =
      S == 2 && drivetrain_.constraintCount() == 1 && inertia.isConstant() && inertia.isDiagonal();
  return has_one_row && shortcuts.specialize ? deriveOneRow : deriveJerk;
}

void System::deriveJerk(System& self, const State& x, State& dxdt, double t) {
  withShaftCount(self.S, [&](auto shafts) {
    // phi' = omega, omega' = epsilon
    for (int n = 0; n < 2 * shafts; ++n) dxdt[n] = x[n + shafts];
    double Lambda[kMaxRows];
    self.calcJerk(shafts, self.viewWithLast(t, x), dxdt.data() + 2 * shafts, Lambda);
  });
}

void System::deriveOneRow(System& self, const State& x, State& dxdt, double t) {
  for (int n = 0; n < 4; ++n) dxdt[n] = x[n + 2];
  if (!self.drivetrain_.calcJerkOfOneRow<2>(t, x.data(), dxdt.data() + 4)) {
    deriveJerk(self, x, dxdt, t);
  }
}

void System::deriveFormally(System& self, const State& x, State& dxdt, double t) {
  const int S = self.S;
  self.drivetrain_.countRightHandSide();
  for (int n = 0; n < 2 * S; ++n) dxdt[n] = x[n + S];
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double lambda[kMaxRows] = {};
  double reaction_rate[kMaxShafts];
  const StateView state = self.view(t, x);
  self.drivetrain_.calcTorque(state, torque);
  self.drivetrain_.calcReaction(state, torque, reaction);
  self.calcFormalJerk(state, reaction, lambda, dxdt.data() + 2 * S, reaction_rate);
}

void System::deriveAcceleration(System& self, const State& x, State& dxdt, double t) {
  self.drivetrain_.countRightHandSide();
  const StateView state = self.view(t, x);
  if (self.watch_ != nullptr) self.watch_->note(state);
  for (int i = 0; i < self.S; ++i) {
    dxdt[i] = x[self.S + i];
    dxdt[self.S + i] = state.acceleration[i];
  }
}

template <class Count>
void System::calcJerk(Count shafts, const StateView& state, double* eta, double* Lambda) {
  drivetrain_.countRightHandSide();
  double c0[kMaxRows];
  double rate[kMaxShafts];
  const bool regular = drivetrain_.calcRowsAndTorqueRate(shafts, state, c0, rate);
  drivetrain_.makeCovariant(state, rate);  // -g
  drivetrain_.inertia().solve(shafts, rate, eta);
  if (drivetrain_.constraintCount() == 0) return;
  if (regular) {
    drivetrain_.solver().constrain(shafts, c0, eta, Lambda);
  } else {
    std::fill_n(eta, S, kNaN);
  }
}

void System::calcFormalJerk(const StateView& state, const double* reaction, double* lambda,
                            double* eta, double* reaction_rate) {
  double c0[kMaxRows] = {};
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

const double* System::calcTorqueRate(double t, const State& x) {
  double rate[kMaxShafts];
  drivetrain_.calcTorqueRate(viewWithLast(t, x), rate);
  return drivetrain_.torqueRate();
}

// --- projection ----------------------------------------------------------------------------------

ProjectionResult System::project(double t, State& x, State& moved, std::uint64_t* iterations) {
  moved.fill(0.0);
  if (!integratesTorque() && !drivetrain_.hasVelocityRows()) return ProjectionResult::kConverged;
  const StateView state = viewWithLast(t, x);
  ProjectionResult result =
      projectVelocities(drivetrain_, state, x.data() + S, moved.data() + S, iterations);
  if (result != ProjectionResult::kConverged || !integratesTorque()) return result;
  double* const epsilon = x.data() + 2 * S;
  result = projectAccelerations(drivetrain_, state, epsilon, moved.data() + 2 * S, iterations);
  if (result != ProjectionResult::kConverged || form_ == Form::kJerk) return result;
  return moveReactionIntoRange(state, epsilon, moved.data() + 2 * S) ? ProjectionResult::kConverged
                                                                     : ProjectionResult::kSingular;
}

ProjectionResult System::projectStiffly(double t, double h, const State& slope, State& x,
                                        State& moved, std::uint64_t* iterations) {
  const bool is_stiff = form_ == Form::kJerk
                            ? !drivetrain_.hasVelocityRows() && drivetrain_.hasAccelerationRows()
                            : keeps_constraints_in_stages_;
  if (!is_stiff) return project(t, x, moved, iterations);
  double both[2 * kMaxShafts];  // velocities, accelerations
  double change[2 * kMaxShafts] = {};
  std::copy_n(x.data() + S, S, both);
  std::copy_n(integratesTorque() ? x.data() + 2 * S : slope.data() + S, S, both + S);
  const StateView state = drivetrain_.view(t, x.data(), both, both + S);
  const ProjectionResult result = iterateProjection(
      2 * S, [&](double* delta) { return drivetrain_.calcStiffProjection(state, h, delta); }, both,
      change, iterations);
  moved.fill(0.0);
  for (int n = S; n < size_; ++n) {
    x[n] = both[n - S];
    moved[n] = change[n - S];
  }
  return result;
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

// epsilon of the formal equations follows Q: with a torque that rises by 1e8 N m/s, one ulp of the
// time is 1e-8 N m.
void System::addReactionRounding(double t, const State& x, double* acceleration) {
  if (form_ != Form::kFormalJerk) return;
  constexpr double kUlps = 4.0 * std::numeric_limits<double>::epsilon();
  const StateView state = view(t, x);
  double torque[kMaxShafts];
  double lambda[kMaxRows] = {};
  double rest[kMaxShafts];
  double c0[kMaxRows] = {};
  if (!drivetrain_.calcRows(state, c0)) return;
  drivetrain_.calcTorqueRate(state, torque);
  for (int i = 0; i < S; ++i) torque[i] *= kUlps * state.time;
  drivetrain_.calcOutOfRange(torque, lambda, rest);
  for (int i = 0; i < S; ++i) acceleration[i] += std::abs(rest[i]);
}

// --- implicit steps ------------------------------------------------------------------------------

void System::calcLinearization(double t, const State& x, Linearization& linearization) {
  if (form_ != Form::kJerk || !drivetrain_.inertia().isConstant()) {
    // Differences may look behind a jump; no stage has been there.
    StageWatch* const watch = std::exchange(watch_, nullptr);
    if (!integratesTorque()) accelerations_.beginTangent(viewWithLast(t, x));
    linearizeByDifferences(*this, t, x, readsAngles(), drivetrain_.naturalSize(), linearization);
    accelerations_.endTangent();
    watch_ = watch;
    return;
  }
  const StateView state = view(t, x);
  double eta[kMaxShafts];
  double Lambda[kMaxRows];
  calcJerk(S, state, eta, Lambda);
  double derivatives[3 * kMaxShafts * kMaxShafts];
  drivetrain_.calcJerkDerivatives(state, eta, Lambda, derivatives);
  for (int q = 0; q < 3 * S; ++q) {
    for (int i = 0; i < S; ++i) linearization.block(q / S)(i, q % S) = derivatives[q * S + i];
  }
}

void System::calcStageResidual(double t, const State& x, const double* rate,
                               const Linearization& linearization, double* residual) {
  if (!keeps_constraints_in_stages_) {
    State dxdt(size_);
    (*this)(x, dxdt, t);
    for (int i = 0; i < S; ++i) residual[i] = rate[i] - dxdt[size_ - S + i];
    return;
  }
  drivetrain_.countRightHandSide();
  const SquareMatrix& P = linearization.projector();
  const SquareMatrix& D = linearization.pull();
  const bool regular = integratesTorque()
                           ? drivetrain_.calcStageResidual(view(t, x), rate, P, D, residual)
                           : drivetrain_.calcAccelerationResidual(
                                 drivetrain_.view(t, x.data(), x.data() + S, rate), P, D, residual);
  if (!regular) std::fill_n(residual, S, kNaN);
}

void System::calcStageLinearization(double t, const State& x, const State& dxdt,
                                    Linearization& linearization) {
  linearization.mass().setIdentity();
  if (!keeps_constraints_in_stages_) {
    calcLinearization(t, x, linearization);
    return;
  }
  double multipliers[kMaxRows] = {};
  double derivatives[3 * kMaxShafts * kMaxShafts];
  if (integratesTorque()) {
    const StateView state = view(t, x);
    double eta[kMaxShafts];
    calcJerk(S, state, eta, multipliers);
    drivetrain_.calcStageDerivatives(state, multipliers, linearization.projector(),
                                     linearization.pull(), derivatives);
    linearization.mass() = linearization.projector();
  } else {
    const StateView state = drivetrain_.view(t, x.data(), x.data() + S, dxdt.data() + S);
    accelerations_.calcMultipliers(state, multipliers);
    drivetrain_.calcAccelerationDerivatives(state, multipliers, linearization.projector(),
                                            linearization.pull(), derivatives);
  }
  for (int i = 0; i < S; ++i) {
    for (int q = 0; q < size_; ++q) {
      linearization.block(q / S)(i, q % S) = -derivatives[q * S + i];
    }
  }
}

// --- starts, kinks, samples ----------------------------------------------------------------------

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

bool System::crossKink(const StepNode& from, StepNode& to) {
  if (!integratesTorque()) return true;
  double change[kMaxShafts];
  State there = to.x;
  std::copy_n(from.x.begin() + 2 * S, S, there.begin() + 2 * S);
  if (!drivetrain_.calcKinkJump(view(from.time, from.x), view(to.time, there), change)) {
    return false;
  }
  for (int i = 0; i < S; ++i) to.x[2 * S + i] += change[i];
  return true;
}

void System::calcSample(double t, const State& x, Sample* sample) {
  const StateView state = view(t, x);
  const int k = drivetrain_.constraintCount();
  double* const rate = sample->reaction_torque_rate;
  sample->time = t;
  std::copy_n(state.angle, S, sample->angle);
  std::copy_n(state.velocity, S, sample->velocity);
  std::copy_n(state.acceleration, S, sample->acceleration);
  std::fill_n(rate, S, 0.0);
  // R = J epsilon + n - Q
  drivetrain_.calcTorque(state, sample->applied_torque);
  drivetrain_.calcReaction(state, sample->applied_torque, sample->reaction_torque);
  double eta[kMaxShafts] = {};
  if (form_ == Form::kJerk) {
    calcJerk(S, state, eta, sample->multiplier);
    // R' = C^T Lambda + Gamma R omega [6]
    if (!drivetrain_.inertia().isConstant()) {
      drivetrain_.calcConnection(state, sample->reaction_torque, rate);
    }
    for (int m = 0; m < k; ++m) {
      const double* C = drivetrain_.solver().row(m);
      for (int i = 0; i < S; ++i) rate[i] += C[i] * sample->multiplier[m];
    }
  } else if (isInCorner()) {
    accelerations_.calcRateInCorner(state, sample->multiplier, rate);
  } else if (k > 0) {
    calcFormalJerk(state, sample->reaction_torque, sample->multiplier, eta, rate);
  }
  // G = R' - Gamma R omega
  double connection[kMaxShafts] = {};
  if (!drivetrain_.inertia().isConstant()) {
    drivetrain_.calcConnection(state, sample->reaction_torque, connection);
  }
  for (int i = 0; i < S; ++i) {
    sample->reaction_torque_covariant_rate[i] = rate[i] - connection[i];
  }
  for (int m = 0; m < k; ++m) sample->residual[m] = drivetrain_.calcResidual(m, state, eta);
}

}  // namespace variator_sim
