/// The account of a motion's energy at the ends of its steps: its sources and its sinks.
///
///     T = 1/2 omega^T J omega        T' = sum Q_i omega_i + sum R_i omega_i
///
/// for J(phi) too: n, which R = J epsilon + n - Q has in it, is 1/2 J' omega^2. So
///
///     applied   = integral of sum Q_i omega_i
///     reactions = T - T(0) - applied
///
/// The account is a pure observer: it affects no step.
#pragma once

#include "dynamics/inertia.h"
#include "dynamics/tolerance.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/sample.h"
#include "variator_sim/scene.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// All are [loop].
class EnergyBalance {
 public:
  /// The share of the reactions is watched, which needs the rows of C, unless these are constant or
  /// of another principle.
  EnergyBalance(const Scene& scene, bool are_rows_constant);

  bool isWatched() const { return is_watched_; }
  /// The account at the end of the last step. Its reactions are known where they are watched.
  const EnergyAccount& account() const { return account_; }
  /// The applied energy up to the start of the last step, J.
  double appliedBefore() const { return applied_before_; }

  /// Begins an account at time 0, where T is `kinetic`, J.
  void begin(double kinetic);
  /// Goes on from another account at `time`, s.
  void resume(const EnergyAccount& account, double time);
  /// Notes the directions of the rows of C, K x S, at the start, where the angles are `angle`.
  void noteDirections(const double* rows, const double* angle);
  bool hasDirections() const { return account_.directions[0][0] != kUnknown; }

  /// Accounts for a step to `time`, s, and the state there: `work` and `through`, the integrals of
  /// sum Q_i omega_i and its magnitudes, J. `rows`: C at its end, K x S, if they are watched.
  void noteStep(double time, double work, double through, const double* state, const double* rows);
  /// Ends that step there, or sooner.
  void endStep(double time, double work, double through, const double* state);

  /// Returns all energies and powers of `sample`, where T and the applied energy are these, J.
  Energy report(const Sample& sample, double kinetic, double applied) const;

  /// Returns the doubt at the last step end that is not after `time`, s since the start.
  EnergyDoubt doubt(double time) const { return judged_at_ <= time ? doubtAtFront() : before_; }

 private:
  static constexpr double kUnknown = 2.0;  ///< no component of a unit vector

  EnergyDoubt doubtAtFront() const {
    return {account_.doubt_since, judged_at_, account_.reactions, account_.throughput};
  }
  /// Writes row c of C in coordinates in which J is 1 (but for inertia coupling), as a unit vector.
  void calcDirection(const double* c, double* direction) const;
  bool haveRowsTurned(const double* rows) const;
  /// Compares the energy of the reactions with the throughput of the applied torques.
  void judge(const double* velocity);

  const int S;  // shafts
  const int rows_;
  const Tolerance tolerance_;
  const bool is_watched_;
  Inertia inertia_;
  EnergyAccount account_;
  double judged_at_ = 0.0;       ///< s
  double applied_before_ = 0.0;  ///< J, at the start of the last step
  EnergyDoubt before_;           ///< at the start of the last step
};

}  // namespace variator_sim
