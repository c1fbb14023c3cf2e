/// A drivetrain under its principle as the system x' = f(t, x) that is integrated, and what a step
/// needs beside it: how a state is started, projected, moved by jumps and kinks, and sampled.
#pragma once

#include <cstdint>
#include <memory>

#include "dynamics/drivetrain.h"
#include "dynamics/followed_accelerations.h"
#include "dynamics/initial_conditions.h"
#include "dynamics/linearization.h"
#include "dynamics/projection_result.h"
#include "dynamics/reaction_drift.h"
#include "dynamics/state_vector.h"
#include "dynamics/step_node.h"
#include "motion_program/scene_series.h"
#include "variator_sim/sample.h"

namespace variator_sim {

/// Sees the state of every stage of a step.
class StageWatch {
 public:
  virtual void note(const StateView& state) = 0;  // [loop]

 protected:
  ~StageWatch() = default;
};

/// All but the construction and `start` are [loop].
class System {
 public:
  /// `scene` has to outlive it. Where the scene of `like` has the very same elements, its programs
  /// are copied and not made again.
  explicit System(const Scene& scene, const Shortcuts& shortcuts = {},
                  const System* like = nullptr);
  System(const System&) = delete;
  System& operator=(const System&) = delete;

  const Scene& scene() const { return scene_; }
  Drivetrain& drivetrain() { return drivetrain_; }
  ReactionDrift& reaction() { return reaction_; }
  FollowedAccelerations& accelerations() { return accelerations_; }
  const LeastReactionSearch& search() const { return initial_solver_.search(); }

  /// The size of x, and of one of its levels (angles, velocities, ...).
  int size() const { return size_; }
  int shafts() const { return S; }
  /// True if the applied torque is known by its rate only: the accelerations are part of the state,
  /// and x' has Q' in it.
  bool integratesTorque() const { return form_ != Form::kAcceleration; }
  /// True when some derivative depends on an angle.
  bool readsAngles() const { return drivetrain_.readsAngles(); }
  /// True when the derivative is made by code for the scene's number of shafts and constraints.
  bool isSpecialized() const { return derive_ == deriveOneRow; }
  /// True when implicit steps hold psi = 0 in their stages instead of C eta + c0 = 0. Where the
  /// accelerations follow from the state, psi has to be linear in them, so that its form does not
  /// depend on them.
  bool keepsConstraintsInStages() const { return keeps_constraints_in_stages_; }
  /// True when R stays C^T lambda along a jump (the formal equations [18]) instead of changing by
  /// C^T Lambda. The same wherever C does not depend on epsilon.
  bool keepsReactionInRange() const { return form_ == Form::kFormalJerk; }
  /// True where the last accelerations lie in a corner of psi.
  bool isInCorner() const { return accelerations_.isInCorner(); }

  /// The motion as power series; nullptr where it has none. In a corner of psi the motion is
  /// another one than that of its formula.
  SceneSeries* series() const {
    const bool has_none = series_ == nullptr || form_ == Form::kFormalJerk || isInCorner();
    return has_none ? nullptr : series_.get();
  }
  /// Its formulas as series, for steps of other schemes; nullptr where some are none.
  SceneSeries* formulas() const { return series_.get(); }

  /// x' at (t, x). NaN where there is none.
  void operator()(const State& x, State& dxdt, double t) { derive_(*this, x, dxdt, t); }
  /// The view of (t, x) with its accelerations.
  StateView view(double t, const State& x);
  /// The same; where accelerations follow from the state, those computed last.
  StateView viewWithLast(double t, const State& x);

  /// Q' at the last derivative taken, N m/s, S values.
  const double* torqueRate() const { return drivetrain_.torqueRate(); }
  /// Q' at (t, x), where x need not satisfy the constraints.
  const double* calcTorqueRate(double t, const State& x);
  /// Squared length of row m of C, in the metric J^-1, at the last derivative taken.
  double rowLengthSquared(int m) const {
    return integratesTorque() ? drivetrain_.solver().rowLengthSquared(m)
                              : drivetrain_.accelerationRowLengthSquared(m);
  }
  /// Row m of C there, S values.
  const double* row(int m) const {
    return integratesTorque() ? drivetrain_.solver().row(m) : drivetrain_.accelerationRow(m);
  }

  /// Projects x, which stands at t, onto the constraints; `moved` gets by how much. Under the
  /// formal equations the reaction's drift from range(C^T) is corrected as well.
  ProjectionResult project(double t, State& x, State& moved, std::uint64_t* iterations);
  /// Projects x, which an implicit step of size h has reached at t; `slope` is x' of its polynomial
  /// there. Where the accelerations follow from the velocities, with 1/tau of a stiff constraint
  /// between them, the step knows both: the velocities move by the little that makes psi = 0 with
  /// its slope. See Drivetrain::calcStiffProjection.
  ProjectionResult projectStiffly(double t, double h, const State& slope, State& x, State& moved,
                                  std::uint64_t* iterations);
  /// Adds what rounding of the time makes of the accelerations that project() leads to, besides
  /// that of psi, S values.
  void addReactionRounding(double t, const State& x, double* acceleration);

  /// d(x')/dx at (t, x): exact under generalized Gauss with a constant inertia.
  void calcLinearization(double t, const State& x, Linearization& linearization);
  /// Computes the residual of an implicit stage: M x' - f in its last rows, `rate` the last rows of
  /// x'. NaN if C has lost rank. See Drivetrain::calcStageResidual.
  void calcStageResidual(double t, const State& x, const double* rate,
                         const Linearization& linearization, double* residual);
  /// Its derivatives at x, whose derivative is dxdt.
  void calcStageLinearization(double t, const State& x, const State& dxdt,
                              Linearization& linearization);

  /// The state at time 0 with the inputs as they are. `nearest` gets the nearest consistent
  /// accelerations, or velocities where the result says so (S values).
  InitialResult start(State& x, double* nearest, bool* velocities_at_fault);
  /// The state at t with the values that x has, and the accelerations `epsilon` (S values; x's own
  /// where they are part of it), or those of least reaction unless these `are_given`. Inconsistent
  /// values are moved to the nearest consistent ones only when `may_move`. `nearest` as above.
  InitialResult accept(double t, bool may_move, bool are_given, State& x, double* epsilon,
                       double* nearest, bool* velocities_at_fault);

  /// Constraints of order 1 have a kink between two nodes that are next to nothing apart: moves the
  /// accelerations at `to`, which are those at `from`, as f' = 0 asks. False where C loses rank.
  bool crossKink(const StepNode& from, StepNode& to);

  /// Tells `watch` of every state at which the derivative is taken, where a torque that jumps makes
  /// it another one: where the accelerations follow from the state.
  void watch(StageWatch* watch) { watch_ = watch; }

  /// A step begins at (t, x), where the derivative is dxdt: what iterations may start from.
  void noteBase(double t, const State& x, const State& dxdt) {
    if (!integratesTorque()) accelerations_.noteStepStart(t, x, dxdt.data() + S);
  }

  /// True if the accelerations at `to` that follow from the state come from another branch of
  /// psi = 0 than those at `from`, a little earlier: continued back to there they are others.
  bool haveAccelerationsLeapt(const StepNode& from, const StepNode& to);

  /// Everything that is published, at (t, x); not finite where C has lost rank.
  void calcSample(double t, const State& x, Sample* sample);

 private:
  /// The equations that a principle and the constraints' orders lead to.
  enum class Form {
    kJerk,         ///< generalized Gauss: x = (phi, omega, epsilon), the reaction changes least
    kFormalJerk,   ///< Gauss, order 3: the same x, J epsilon + n - Q = C^T lambda differentiated
                   ///< beside C eta + c0 = 0 [18]; it minimises nothing, but users may compare it
    kAcceleration  ///< Gauss up to order 2: x = (phi, omega), the reaction is least
  };
  static Form formOf(const Scene& scene);

  /// Computes x'. It is called more often than anything else: a function that is chosen once costs
  /// half of one that chooses.
  using Derive = void (*)(System& self, const State& x, State& dxdt, double t);
  Derive chooseDerive(const Shortcuts& shortcuts) const;
  static void deriveJerk(System& self, const State& x, State& dxdt, double t);
  /// The same for two shafts with a constant diagonal inertia and one constraint: most scenes.
  static void deriveOneRow(System& self, const State& x, State& dxdt, double t);
  static void deriveFormally(System& self, const State& x, State& dxdt, double t);
  static void deriveAcceleration(System& self, const State& x, State& dxdt, double t);

  /// Computes eta and Lambda; eta is NaN if C has lost rank. `shafts`: see ConstraintSolver.
  template <class Count>
  void calcJerk(Count shafts, const StateView& state, double* eta, double* Lambda);
  /// Computes lambda of the reaction, eta of [18] and R'; eta is NaN if C has lost rank.
  void calcFormalJerk(const StateView& state, const double* reaction, double* lambda, double* eta,
                      double* reaction_rate);
  /// epsilon = J^-1 (Q - n + C^T lambda) with the lambda of the part of R in range(C^T); adds the
  /// change to `moved`. False if C has lost rank.
  bool moveReactionIntoRange(const StateView& state, double* epsilon, double* moved);

  const Scene& scene_;
  const Form form_;
  const int S;  // shafts
  const int size_;
  Drivetrain drivetrain_;
  InitialConditionSolver initial_solver_;
  FollowedAccelerations accelerations_;
  ReactionDrift reaction_;
  std::unique_ptr<SceneSeries> series_;
  bool keeps_constraints_in_stages_ = false;
  StageWatch* watch_ = nullptr;
  Derive derive_ = nullptr;
};

inline StepNode::StepNode(const System& system)
    : x(system.size()),
      dxdt(system.size()),
      torque(system.shafts()),
      torque_rate(system.shafts()) {}

}  // namespace variator_sim
