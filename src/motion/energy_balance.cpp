#include "motion/energy_balance.h"

#include <cmath>

namespace variator_sim {
namespace {

/// Angle, rad, from which on C counts as turned.
constexpr double kTurned = 0.01;
/// Factor above the tolerance's effect from which on an energy is certain.
constexpr double kCertain = 100.0;

}  // namespace

EnergyBalance::EnergyBalance(const Scene& scene, bool are_rows_constant)
    : S(scene.shaftCount()),
      rows_(scene.constraintCount()),
      tolerance_{scene.solver.absolute_tolerance, scene.solver.relative_tolerance},
      is_watched_(scene.principle == Principle::kGeneralizedGauss && rows_ > 0 &&
                  !are_rows_constant),
      inertia_(scene.inertia, scene.inertia_harmonics) {}

void EnergyBalance::begin(double kinetic) {
  resume({}, 0.0);
  account_.start_kinetic = kinetic;
  if (is_watched_) account_.directions[0][0] = kUnknown;
}

void EnergyBalance::resume(const EnergyAccount& account, double time) {
  account_ = account;
  judged_at_ = time;
  applied_before_ = account.applied;
  before_ = doubtAtFront();
}

void EnergyBalance::noteDirections(const double* rows, const double* angle) {
  inertia_.update(angle);
  for (int m = 0; m < rows_; ++m) calcDirection(rows + S * m, account_.directions[m]);
}

void EnergyBalance::noteStep(double time, double work, double through, const double* state,
                             const double* rows) {
  applied_before_ = account_.applied;
  before_ = doubtAtFront();
  if (is_watched_) {
    inertia_.update(state);
    account_.has_turned = account_.has_turned || haveRowsTurned(rows);
  }
  endStep(time, work, through, state);
}

void EnergyBalance::endStep(double time, double work, double through, const double* state) {
  account_.applied = applied_before_ + work;
  account_.throughput = before_.throughput + through;
  if (!is_watched_) return;
  judged_at_ = time;
  inertia_.update(state);
  judge(state + S);
}

Energy EnergyBalance::report(const Sample& sample, double kinetic, double applied) const {
  Energy energy;
  energy.applied = applied;
  energy.kinetic = kinetic;
  energy.reactions = energy.kinetic - account_.start_kinetic - energy.applied;
  for (int i = 0; i < S; ++i) {
    energy.applied_power += sample.applied_torque[i] * sample.velocity[i];
    energy.reaction_power += sample.reaction_torque[i] * sample.velocity[i];
  }
  return energy;
}

void EnergyBalance::calcDirection(const double* c, double* direction) const {
  double square = 0.0;
  for (int i = 0; i < S; ++i) {
    direction[i] = c[i] / std::sqrt(inertia_.entry(i, i));
    square += direction[i] * direction[i];
  }
  const double scale = 1.0 / std::sqrt(square);
  for (int i = 0; i < S; ++i) direction[i] *= scale;
}

bool EnergyBalance::haveRowsTurned(const double* rows) const {
  for (int m = 0; m < rows_; ++m) {
    double direction[kMaxShafts];
    calcDirection(rows + S * m, direction);
    double cosine = 0.0;
    for (int i = 0; i < S; ++i) cosine += direction[i] * account_.directions[m][i];
    if (1.0 - cosine * cosine > kTurned * kTurned) return true;
  }
  return false;
}

void EnergyBalance::judge(const double* velocity) {
  double momentum[kMaxShafts];
  inertia_.multiply(velocity, momentum);
  double twice = 0.0;  // the kinetic energy
  for (int i = 0; i < S; ++i) twice += velocity[i] * momentum[i];
  account_.reactions = 0.5 * twice - account_.start_kinetic - account_.applied;
  if (account_.doubt_since >= 0.0 || !account_.has_turned || !doubtAtFront().isShareLarge()) return;
  // The uncertainty of T at this tolerance.
  double uncertain = 0.0;
  for (int i = 0; i < S; ++i) {
    const double omega = velocity[i];
    uncertain += inertia_.entry(i, i) * std::abs(omega) * tolerance_.of(omega);
  }
  if (std::abs(account_.reactions) > kCertain * uncertain) account_.doubt_since = judged_at_;
}

}  // namespace variator_sim
