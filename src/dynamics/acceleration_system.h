/// The common base of systems with accelerations in their state: x = (phi, omega, epsilon).
#pragma once

#include "dynamics/principle_system.h"
#include "dynamics/projection.h"
#include "variator_sim/sample.h"

namespace variator_sim {

/// Derived classes implement the derivative and the sample.
class AccelerationSystem : public PrincipleSystem {
 public:
  double rowLengthSquared(int m) const override { return drivetrain_.solver().rowLengthSquared(m); }
  const double* row(int m) const override { return drivetrain_.solver().row(m); }

  /// The accelerations are part of the state.
  StateView view(double t, const State& x) override {
    return drivetrain_.view(t, x.data(), x.data() + S, x.data() + 2 * S);
  }

  ProjectionResult project(double t, State& x, State& moved, std::uint64_t* iterations) override;

  /// See calcStiffProjection.
  ProjectionResult projectStiffly(double t, double h, const State& /*slope*/, State& x,
                                  State& moved, std::uint64_t* iterations) override;

  InitialResult start(State& x, double* nearest, bool* velocities_at_fault) override;

  InitialResult accept(double t, bool may_move, bool are_given, State& x, double* epsilon,
                       double* nearest, bool* velocities_at_fault) override;

  bool keepsReactionInRange() const override { return keeps_reaction_in_range_; }

  bool crossKink(const StepNode& from, StepNode& to) override;

  void noteReaction(const StepNode& node) override;
  void noteColumns(const double (*C)[kMaxShafts]) override;
  void restoreReaction(StepNode& node, double most) override;
  KeptReaction keptReaction() const override;
  void keepReaction(const KeptReaction& kept) override;

  const double* torqueRate() const override { return drivetrain_.torqueRate(); }
  const double* calcTorqueRate(double t, const State& x) override;

 protected:
  AccelerationSystem(const Scene& scene, const Shortcuts& shortcuts, const PrincipleSystem* like,
                     bool keeps_reaction_in_range)
      : PrincipleSystem(scene, shortcuts, like, 3, true),
        tolerance_{scene.solver.absolute_tolerance, scene.solver.relative_tolerance},
        keeps_reaction_in_range_(keeps_reaction_in_range) {}

  /// phi' = omega, omega' = epsilon.
  void copyRates(const State& x, State& dxdt) const;
  void copyState(double t, const State& x, Sample* sample) const;
  void calcResiduals(const StateView& state, const double* eta, Sample* sample) const;

  /// Returns true if errors of one tolerance in angles and velocities, or rounding of the time,
  /// change the accelerations through Q by more than their tolerance.
  bool answersSteeply(const StepNode& node);

  Tolerance tolerance_;
  bool keeps_reaction_in_range_;
  bool has_neutral_ = false;
  bool is_neutral_[kMaxShafts] = {};
  /// N m; divided by sqrt(J_i) where the inertia depends on the angle: R' = C^T Lambda + Gamma R
  /// omega [6] becomes R_i' = 1/2 J_i'/J_i omega_i R_i there, so R_i / sqrt(J_i) is invariant.
  /// (Coupled inertias that depend on angles have no such simple invariant.)
  double reaction_at_start_[kMaxShafts] = {};
};

}  // namespace variator_sim
