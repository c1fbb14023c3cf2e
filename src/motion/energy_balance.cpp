#include "motion/energy_balance.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {
namespace {

/// Angle, rad, from which on C counts as turned.
constexpr double kTurnedAngle = 0.01;
/// Factor above the tolerance's effect from which on an energy is certain.
constexpr double kCertainFactor = 100.0;

}  // namespace

EnergyBalance::EnergyBalance(const Scene& scene, bool is_watched)
    : S(scene.shaftCount()),
      rows_(scene.constraintCount()),
      solver_(scene.solver),
      is_watched_(is_watched),
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
  if (!inertia_.isConstant()) inertia_.updateValue(angle);
  for (int m = 0; m < rows_; ++m) calcDirection(rows + S * m, account_.directions[m]);
}

void EnergyBalance::noteStep(double time, double work, double through, const double* angle,
                             const double* velocity, const double* rows) {
  applied_before_ = account_.applied;
  before_ = doubtAtFront();
  account_.throughput += through;
  account_.applied += work;
  if (!is_watched_) return;
  judged_at_ = time;
  if (!inertia_.isConstant()) inertia_.updateValue(angle);
  account_.has_turned = account_.has_turned || haveRowsTurned(rows);
  judge(velocity);
}

void EnergyBalance::cut(double time, double applied, double less) {
  account_.applied = applied_before_ = applied;
  account_.throughput -= less;
  judged_at_ = time;
  before_ = doubtAtFront();
}

double EnergyBalance::calcKineticEnergy(const double* velocity) const {
  double momentum[kMaxShafts];
  inertia_.multiply(velocity, momentum);
  double twice = 0.0;
  for (int i = 0; i < S; ++i) twice += velocity[i] * momentum[i];
  return 0.5 * twice;
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
    if (1.0 - cosine * cosine > kTurnedAngle * kTurnedAngle) return true;
  }
  return false;
}

void EnergyBalance::judge(const double* velocity) {
  account_.reactions = calcKineticEnergy(velocity) - account_.start_kinetic - account_.applied;
  if (account_.doubt_since >= 0.0 || !account_.has_turned || !doubtAtFront().isShareLarge()) return;
  // The uncertainty of T at this tolerance.
  double uncertain = 0.0;
  for (int i = 0; i < S; ++i) {
    const double omega = std::abs(velocity[i]);
    uncertain += inertia_.entry(i, i) * omega *
                 (solver_.absolute_tolerance + solver_.relative_tolerance * omega);
  }
  if (std::abs(account_.reactions) > kCertainFactor * uncertain) account_.doubt_since = judged_at_;
}

}  // namespace variator_sim
