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

#include "variator_sim/inertia.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/scene.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// All are [loop].
class EnergyBalance {
 public:
  /// `is_watched`: whether the share of the reactions is judged, which needs the rows of C.
  EnergyBalance(const Scene& scene, bool is_watched);

  bool isWatched() const { return is_watched_; }
  /// The account at the end of the last step. Its reactions are known where they are watched.
  const EnergyAccount& account() const { return account_; }
  /// J, brought by the applied torques up to the start of the last step.
  double appliedBefore() const { return applied_before_; }

  /// Begins at rest of the account, or goes on from another one, at `time`, s.
  void begin(double kinetic);
  void resume(const EnergyAccount& account, double time);
  /// Notes the directions of the rows of C at the start, K x S, and J at the angles there.
  void noteDirections(const double* rows, const double* angle);
  bool hasDirections() const { return account_.directions[0][0] != kUnknown; }

  /// Accounts for a step to `time`, s, and the state there: `work` and `through`, the integrals of
  /// sum Q_i omega_i and its magnitudes, J. `rows`: C at its end, K x S, if they are watched.
  void noteStep(double time, double work, double through, const double* angle,
                const double* velocity, const double* rows);
  /// Cuts that step at `time`: `applied` until then, and its throughput less by `less`, J.
  void cut(double time, double applied, double less);

  /// Returns the doubt at the last step end that is not after `time`, s since the start.
  EnergyDoubt doubt(double time) const { return judged_at_ <= time ? doubtAtFront() : before_; }

 private:
  static constexpr double kUnknown = 2.0;  ///< no component of a unit vector

  EnergyDoubt doubtAtFront() const {
    return {account_.doubt_since, judged_at_, account_.reactions, account_.throughput};
  }
  double calcKineticEnergy(const double* velocity) const;
  /// Writes row c of C in coordinates in which J is 1 (but for inertia coupling), as a unit vector.
  void calcDirection(const double* c, double* direction) const;
  bool haveRowsTurned(const double* rows) const;
  /// Compares the energy of the reactions with the throughput of the applied torques.
  void judge(const double* velocity);

  const int S;  // shafts
  const int rows_;
  const SolverSettings& solver_;
  const bool is_watched_;
  Inertia inertia_;
  EnergyAccount account_;
  double judged_at_ = 0.0;       ///< s
  double applied_before_ = 0.0;  ///< J, at the start of the last step
  EnergyDoubt before_;           ///< at the start of the last step
};

}  // namespace variator_sim
