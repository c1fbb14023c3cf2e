/// A drivetrain under its principle as the system x' = f(t, x), asked at single states: where a
/// motion may begin, and why it stops.
#pragma once

#include "dynamics/drivetrain.h"
#include "dynamics/followed_accelerations.h"
#include "dynamics/initial_conditions.h"
#include "dynamics/state_vector.h"

namespace variator_sim {

/// A state of a motion and its derivative.
struct StepNode {
  explicit StepNode(int size) : x(size), dxdt(size) {}
  double time = 0.0;
  State x;
  State dxdt;
};

/// All but the construction and `start` are [loop].
class System {
 public:
  /// `scene` has to outlive it. Where the scene of `like` has the very same elements, its programs
  /// are copied and not made again.
  explicit System(const Scene& scene, const System* like = nullptr);
  System(const System&) = delete;
  System& operator=(const System&) = delete;

  const Scene& scene() const { return scene_; }
  Drivetrain& drivetrain() { return drivetrain_; }
  FollowedAccelerations& accelerations() { return accelerations_; }
  const LeastReactionSearch& search() const { return initial_solver_.search(); }

  /// The size of x, and of one of its levels (angles, velocities, ...).
  int size() const { return size_; }
  int shafts() const { return S; }
  /// True if the applied torque is known by its rate only: the accelerations are part of the state,
  /// and x' has Q' in it.
  bool integratesTorque() const { return form_ != Form::kAcceleration; }
  /// x' at (t, x). NaN where there is none.
  void operator()(const State& x, State& dxdt, double t);
  /// The view of (t, x) with its accelerations.
  StateView view(double t, const State& x);
  /// The same; where accelerations follow from the state, those computed last.
  StateView viewWithLast(double t, const State& x);

  /// The state at time 0 with the inputs as they are. `nearest` gets the nearest consistent
  /// accelerations, or velocities where the result says so (S values).
  InitialResult start(State& x, double* nearest, bool* velocities_at_fault);
  /// The state at t with the values that x has, and the accelerations `epsilon` (S values; x's own
  /// where they are part of it), or those of least reaction unless these `are_given`. Inconsistent
  /// values are moved to the nearest consistent ones only when `may_move`. `nearest` as above.
  InitialResult accept(double t, bool may_move, bool are_given, State& x, double* epsilon,
                       double* nearest, bool* velocities_at_fault);

  /// A step begins at (t, x), where the derivative is dxdt: what iterations may start from.
  void noteBase(double t, const State& x, const State& dxdt) {
    if (!integratesTorque()) accelerations_.noteStepStart(t, x, dxdt.data() + S);
  }

  /// True if the accelerations at `to` that follow from the state come from another branch of
  /// psi = 0 than those at `from`, a little earlier: continued back to there they are others.
  bool haveAccelerationsLeapt(const StepNode& from, const StepNode& to);

 private:
  /// The equations that a principle and the constraints' orders lead to.
  enum class Form {
    kJerk,         ///< generalized Gauss: x = (phi, omega, epsilon), the reaction changes least
    kFormalJerk,   ///< Gauss, order 3: the same x, J epsilon + n - Q = C^T lambda differentiated
                   ///< beside C eta + c0 = 0 [18]; it minimises nothing, but users may compare it
    kAcceleration  ///< Gauss up to order 2: x = (phi, omega), the reaction is least
  };
  static Form formOf(const Scene& scene);

  /// Computes eta; it is NaN if C has lost rank.
  void calcJerk(const StateView& state, double* eta);
  /// The same of [18], where R is the reaction.
  void calcFormalJerk(const StateView& state, double* eta);
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
};

}  // namespace variator_sim
