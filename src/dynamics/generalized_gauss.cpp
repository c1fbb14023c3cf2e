#include "dynamics/generalized_gauss.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <type_traits>

namespace variator_sim {

namespace {

bool isSimple(const Inertia& inertia) {
  return inertia.isConstant() && inertia.isDiagonal();
}

}  // namespace

GeneralizedGauss::GeneralizedGauss(const Scene& scene, const Shortcuts& shortcuts,
                                   const PrincipleSystem* like)
    : AccelerationSystem(scene, shortcuts, like, false) {
  derive_ = chooseDerive(shortcuts);
}

System::Derive GeneralizedGauss::chooseDerive(const Shortcuts& shortcuts) const {
  const bool has_one_row = S == 2 && drivetrain_.constraintCount() == 1;
  if (has_one_row && isSimple(drivetrain_.inertia()) && shortcuts.specialize) return deriveOneRow;
  constexpr Derive kBySize[] = {derive<1>, derive<2>, derive<3>, derive<4>,
                                derive<5>, derive<6>, derive<7>, derive<8>};
  static_assert(std::size(kBySize) == kMaxShafts);
  return kBySize[S - 1];
}

template <int kShafts>
void GeneralizedGauss::derive(System& system, const State& x, State& dxdt, double t) {
  auto& self = static_cast<GeneralizedGauss&>(system);
  // phi' = omega, omega' = epsilon
  for (int n = 0; n < 2 * kShafts; ++n) dxdt[n] = x[n + kShafts];
  double* eta = dxdt.data() + 2 * kShafts;
  double Lambda[kMaxRows];
  const StateView state =
      self.drivetrain_.view(t, x.data(), x.data() + kShafts, x.data() + 2 * kShafts);
  self.calcJerk(std::integral_constant<int, kShafts>{}, state, eta, Lambda);
}

void GeneralizedGauss::deriveOneRow(System& system, const State& x, State& dxdt, double t) {
  auto& self = static_cast<GeneralizedGauss&>(system);
  for (int n = 0; n < 4; ++n) dxdt[n] = x[n + 2];
  if (!self.drivetrain_.calcJerkOfOneRow<2>(t, x.data(), dxdt.data() + 4)) {
    derive<2>(system, x, dxdt, t);
  }
}

template <class Count>
bool GeneralizedGauss::calcJerk(Count shafts, const StateView& state, double* eta, double* Lambda) {
  drivetrain_.countRightHandSide();
  double c0[kMaxRows];
  double rate[kMaxShafts];
  const bool regular = drivetrain_.calcRowsAndTorqueRate(shafts, state, c0, rate);
  drivetrain_.makeCovariant(state, rate);  // -g
  drivetrain_.inertia().solve(shafts, rate, eta);
  if (drivetrain_.constraintCount() == 0) return true;
  if (!regular) {
    for (int i = 0; i < shafts; ++i) eta[i] = std::numeric_limits<double>::quiet_NaN();
    return false;
  }
  drivetrain_.solver().constrain(shafts, c0, eta, Lambda);
  return true;
}

void GeneralizedGauss::calcLinearization(double t, const State& x, Linearization& linearization) {
  if (!drivetrain_.inertia().isConstant()) {
    linearizeByDifferences(*this, t, x, readsAngles(), drivetrain_.naturalSize(), linearization);
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

void GeneralizedGauss::calcStageResidual(double t, const State& x, const double* eta,
                                         const Linearization& linearization, double* residual) {
  if (!drivetrain_.canKeepConstraintsInStages()) {
    System::calcStageResidual(t, x, eta, linearization, residual);
    return;
  }
  drivetrain_.countRightHandSide();
  if (!drivetrain_.calcStageResidual(view(t, x), eta, linearization.projector(),
                                     linearization.pull(), residual)) {
    std::fill(residual, residual + S, std::numeric_limits<double>::quiet_NaN());
  }
}

void GeneralizedGauss::calcStageLinearization(double t, const State& x, const State& dxdt,
                                              Linearization& linearization) {
  if (!drivetrain_.canKeepConstraintsInStages()) {
    System::calcStageLinearization(t, x, dxdt, linearization);
    return;
  }
  const StateView state = view(t, x);
  double eta[kMaxShafts];
  double Lambda[kMaxRows];
  calcJerk(S, state, eta, Lambda);
  double derivatives[3 * kMaxShafts * kMaxShafts];
  drivetrain_.calcStageDerivatives(state, Lambda, linearization.projector(), linearization.pull(),
                                   derivatives);
  linearization.mass() = linearization.projector();
  for (int i = 0; i < S; ++i) {
    for (int q = 0; q < 3 * S; ++q) {
      linearization.block(q / S)(i, q % S) = -derivatives[q * S + i];
    }
  }
}

bool GeneralizedGauss::calcSample(double t, const State& x, Sample* sample) {
  const StateView state = view(t, x);
  copyState(t, x, sample);
  // R = J epsilon + n - Q
  drivetrain_.calcTorque(state, sample->applied_torque);
  drivetrain_.calcReaction(state, sample->applied_torque, sample->reaction_torque);
  double eta[kMaxShafts];
  const bool regular = calcJerk(S, state, eta, sample->multiplier);
  // R' = C^T Lambda + Gamma R omega [6]
  double* rate = sample->reaction_torque_rate;
  std::fill(rate, rate + S, 0.0);
  if (!drivetrain_.inertia().isConstant()) {
    drivetrain_.calcConnection(state, sample->reaction_torque, rate);
  }
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    const double* C = drivetrain_.solver().row(m);
    for (int i = 0; i < S; ++i) rate[i] += C[i] * sample->multiplier[m];
  }
  calcResiduals(state, eta, sample);
  return regular;
}

}  // namespace variator_sim
