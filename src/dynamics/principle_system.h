/// A drivetrain under a principle, as the integrator (integrator.h) asks for it: beside what
/// steppers need, how its state is started, moved by jumps and edges, and sampled.
#pragma once

#include <cstdint>
#include <memory>

#include "dynamics/drivetrain.h"
#include "dynamics/initial_conditions.h"
#include "dynamics/motion_series.h"
#include "dynamics/step_node.h"
#include "dynamics/system.h"
#include "dynamics/tolerance.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/sample.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// Sees the state of every stage of a step.
class StageWatch {
 public:
  virtual void note(const StateView& state) = 0;  // [loop]

 protected:
  ~StageWatch() = default;
};

/// All but `start` are [loop].
class PrincipleSystem : public System {
 public:
  const Scene& scene() const { return scene_; }
  Drivetrain& drivetrain() { return drivetrain_; }
  const LeastReactionSearch& search() const { return initial_solver_.search(); }
  bool readsAngles() const override { return drivetrain_.readsAngles(); }
  MotionSeries* series() const override {
    const bool is_formal = scene_.principle == Principle::kGauss && hasOrder3();
    return is_formal ? nullptr : series_.get();
  }
  /// Its formulas as series, for steps of other schemes; nullptr where some are none.
  MotionSeries* formulas() const { return series_.get(); }
  bool hasOrder3() const override { return scene_.hasOrder3(); }

  /// True when the derivative is made by code for the scene's number of shafts and constraints.
  virtual bool isSpecialized() const { return false; }

  /// Squared length of row m of C, in the metric J^-1, at the last derivative taken.
  virtual double rowLengthSquared(int m) const = 0;
  /// Row m of C there, s values.
  virtual const double* row(int m) const = 0;

  /// The view of (t, x) with its accelerations.
  virtual StateView view(double t, const State& x) = 0;

  /// Projects x, which an implicit step of size h has reached at t; `slope` is x' of its polynomial
  /// there.
  virtual ProjectionResult projectStiffly(double t, double h, const State& slope, State& x,
                                          State& moved, std::uint64_t* iterations) = 0;

  /// The state at time 0 with the inputs as they are. `nearest` gets the nearest consistent
  /// accelerations, or velocities where the result says so (s values).
  virtual InitialResult start(State& x, double* nearest, bool* velocities_at_fault) = 0;

  /// The state at t with the values that x has, and the accelerations `epsilon` (S values; x's own
  /// where they are part of it), or those of least reaction unless these `are_given`. Inconsistent
  /// values are moved to the nearest consistent ones only when `may_move`. `nearest` as above.
  virtual InitialResult accept(double t, bool may_move, bool are_given, State& x, double* epsilon,
                               double* nearest, bool* velocities_at_fault) = 0;

  /// Moves x as a jump of the inputs from u0 to u1 at t asks for, where the accelerations follow
  /// from the state. (Where they are part of it, JumpMap does.) On failure x is unchanged.
  virtual MotionStatus jump(double /*t*/, State& /*x*/, const double* /*u0*/, const double* /*u1*/,
                            std::uint64_t* /*projections*/) {
    return {};
  }
  /// Likewise, what a jump of the applied torque by `torque_jump` (N m, s values) to that at (t, x)
  /// does to the accelerations that follow from x.
  virtual MotionStatus jumpTorque(double /*t*/, State& /*x*/, const double* /*torque_jump*/,
                                  std::uint64_t* /*projections*/) {
    return {};
  }
  /// True when R stays C^T lambda along a jump (the formal equations [18]) instead of changing by
  /// C^T Lambda. The same wherever C does not depend on epsilon.
  virtual bool keepsReactionInRange() const { return false; }

  /// Constraints of order 1 have a kink between two nodes that are next to nothing apart: moves the
  /// accelerations at `to`, which are those at `from`, as f' = 0 asks. False where C loses rank.
  virtual bool crossKink(const StepNode& /*from*/, StepNode& /*to*/) { return true; }

  /// True where the last accelerations lie in a corner of psi.
  virtual bool isInCorner() const { return false; }

  /// Tells `watch` of every state at which the derivative is taken, where a torque that jumps makes
  /// it another one.
  virtual void watch(StageWatch* /*watch*/) {}

  /// R' = C^T Lambda: what no C has ever had a part of is a constant of the reaction R, and not the
  /// integrator's business. It is kept as it is at the start: `noteReaction` there (and wherever a
  /// motion begins), `noteColumns` gets the rows of C at the end of every step.
  virtual void noteReaction(const StepNode& /*node*/) {}
  virtual void noteColumns(const double (* /*C*/)[kMaxShafts]) {}
  /// Moves the accelerations of a node, whose torque is known, to where that part of the reaction
  /// is what it was, along psi = 0; by at most `most` tolerances where a torque answers steeply to
  /// the state.
  virtual void restoreReaction(StepNode& /*node*/, double /*most*/) {}

  /// The same constant, for a motion that is saved and goes on elsewhere.
  virtual KeptReaction keptReaction() const { return {}; }
  virtual void keepReaction(const KeptReaction& /*kept*/) {}

  /// A step begins at (t, x), where the derivative is dxdt: what iterations may start from.
  virtual void noteBase(double /*t*/, const State& /*x*/, const State& /*dxdt*/) {}

  /// Everything that is published, at (t, x). False where C has lost rank.
  virtual bool calcSample(double t, const State& x, Sample* sample) = 0;

 protected:
  /// `like`: of a scene with the same elements, or nullptr.
  PrincipleSystem(const Scene& scene, const Shortcuts& shortcuts, const PrincipleSystem* like,
                  int levels, bool integrates_torque)
      : System(scene.shaftCount(), levels, integrates_torque),
        scene_(scene),
        drivetrain_(scene, shortcuts, like != nullptr ? &like->drivetrain_ : nullptr),
        initial_solver_(drivetrain_),
        series_(MotionSeries::make(scene, drivetrain_,
                                   like != nullptr ? like->series_.get() : nullptr)) {}

  const Scene& scene_;
  Drivetrain drivetrain_;
  InitialConditionSolver initial_solver_;
  std::unique_ptr<MotionSeries> series_;
};

/// The system of a scene's principle and orders. `scene` has to outlive it. Where the scene of
/// `like` has the very same elements, its programs are copied and not made again.
std::unique_ptr<PrincipleSystem> makeSystem(const Scene& scene, const Shortcuts& shortcuts,
                                            const PrincipleSystem* like = nullptr);

}  // namespace variator_sim
