#include "dynamics/drivetrain.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

Drivetrain::Drivetrain(const Scene& scene, const Drivetrain* like)
    : S(scene.shaftCount()),
      scene_(scene),
      inertia_(scene.inertia, scene.inertia_harmonics),
      solver_(S, scene.constraintCount()),
      velocity_solver_(S, countOrders(scene, 1)),
      acceleration_solver_(S, countOrders(scene, 2)),
      program_(scene, like != nullptr ? &like->program_ : nullptr) {
  for (const TorquePtr& torque : scene.torques) torques_.push_back(torque.get());
  has_constant_jacobian_ = inertia_.isConstant();
  for (const ConstraintPtr& constraint : scene.constraints) {
    const int m = static_cast<int>(constraints_.size());
    constraints_.push_back(constraint.get());
    has_constant_jacobian_ = has_constant_jacobian_ && constraint->hasConstantJacobian();
    if (constraint->order() == 1) velocity_rows_.push_back(m);
    if (constraint->order() <= 2) acceleration_rows_.push_back(m);
    nonlinear_accelerations_ |= constraint->nonlinearAccelerations();
    for (const ConstraintPtr& kink : constraint->kinks()) {
      if (kinks_.size() < kMostKinks) kinks_.push_back(kink.get());
    }
  }
  for (std::size_t j = 0; j < torques_.size(); ++j) {
    noteBranches(*torques_[j], {static_cast<int>(j), -1});
  }
  for (std::size_t m = 0; m < constraints_.size(); ++m) {
    noteBranches(*constraints_[m], {-1, static_cast<int>(m)});
  }
  hessians_.resize(constraints_.size() * static_cast<std::size_t>(S * S));
  signals_.resize(scene.inputs.size());
  varying_.reserve(scene.inputs.size());
  resetInputs();
}

void Drivetrain::resetInputs() {
  for (std::size_t i = 0; i < signals_.size(); ++i) signals_[i].reset(scene_.inputs[i]);
  refreshInputs(0.0);
}

void Drivetrain::refreshInputs(double time) {
  varying_.clear();
  for (std::size_t i = 0; i < signals_.size(); ++i) {
    setInput(static_cast<int>(i), signals_[i].at(time));
    if (!signals_[i].isConstant()) varying_.push_back(static_cast<int>(i));
  }
}

void Drivetrain::moveInputs(double t) {
  for (int i : varying_) setInput(i, signals_[static_cast<std::size_t>(i)].at(t));
}

bool Drivetrain::calcRows(const StateView& state, double* c0) {
  const double* values = program_.calcRows(state);
  for (int m = 0; m < constraintCount(); ++m) {
    std::copy_n(values, S, solver_.row(m));
    c0[m] = values[S];
    values += S + 1;
  }
  return solver_.factor(inertia_);
}

void Drivetrain::addCovariantRate(const StateView& state, double* rate) const {
  addInertialRate(state, rate);
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double connection[kMaxShafts];
  calcTorque(state, torque);
  calcReaction(state, torque, reaction);
  calcConnection(state, reaction, connection);
  for (int i = 0; i < S; ++i) rate[i] += connection[i];
}

void Drivetrain::calcFreeTorque(const StateView& state, double* torque) const {
  calcTorque(state, torque);
  subtractInertialTorque(state, torque);
}

void Drivetrain::subtractInertialTorque(const StateView& state, double* torque) const {
  if (inertia_.isConstant()) return;
  for (int i = 0; i < S; ++i) {
    torque[i] -= 0.5 * inertia_.first(i) * state.velocity[i] * state.velocity[i];
  }
}

void Drivetrain::calcReaction(const StateView& state, const double* torque,
                              double* reaction) const {
  inertia_.multiply(state.acceleration, reaction);
  for (int i = 0; i < S; ++i) reaction[i] -= torque[i];
  if (inertia_.isConstant()) return;
  for (int i = 0; i < S; ++i) {
    reaction[i] += 0.5 * inertia_.first(i) * state.velocity[i] * state.velocity[i];
  }
}

void Drivetrain::calcConnection(const StateView& state, const double* reaction,
                                double* connection) const {
  inertia_.solve(reaction, connection);
  for (int i = 0; i < S; ++i) connection[i] *= 0.5 * inertia_.first(i) * state.velocity[i];
}

bool Drivetrain::calcFormalJerk(const StateView& state, const double* lambda, double* eta,
                                double* reaction_rate) {
  double rate[kMaxShafts];
  calcFreeTorqueRate(state, rate);
  double right[kMaxShafts];
  double c0[kMaxRows] = {};
  std::copy(rate, rate + S, right);
  for (int m = 0; m < constraintCount(); ++m) {
    double D[kMaxShafts];
    constraint(m).calcRow(state, solver_.row(m), &c0[m]);
    constraint(m).calcJacobianRate(state, D, hessian(m));
    for (int i = 0; i < S; ++i) right[i] += lambda[m] * D[i];
  }
  if (!solveFormal(lambda, right, c0, eta)) return false;
  inertia_.multiply(eta, reaction_rate);
  for (int i = 0; i < S; ++i) reaction_rate[i] -= rate[i];
  return true;
}

void Drivetrain::calcMultipliers(const double* reaction, double* lambda) const {
  double rest[kMaxShafts];
  calcOutOfRange(reaction, lambda, rest);
}

void Drivetrain::calcOutOfRange(const double* reaction, double* lambda, double* rest) const {
  constexpr double kZeros[kMaxRows] = {};
  inertia_.solve(reaction, rest);
  for (int i = 0; i < S; ++i) rest[i] = -rest[i];
  solver_.constrain(kZeros, rest, lambda);
}

bool findNonFinite(const Scene& scene, StateView state, int* torque, int* constraint) {
  static constexpr double kZeros[kMaxShafts] = {};
  const int S = scene.shaftCount();
  const auto isFinite = [S](const double* values) {
    return std::all_of(values, values + S, [](double value) { return std::isfinite(value); });
  };
  const auto findTorque = [&](void (Torque::*add)(const StateView&, double*) const) {
    for (std::size_t j = 0; j < scene.torques.size() && *torque < 0; ++j) {
      double value[kMaxShafts] = {};
      ((*scene.torques[j]).*add)(state, value);
      if (!isFinite(value)) *torque = static_cast<int>(j);
    }
    return *torque >= 0;
  };
  *torque = -1;
  *constraint = -1;
  // The order of dependence is Q, the accelerations, psi, Q'. A law that reads accelerations which
  // are not finite is a consequence of an earlier one.
  if (findTorque(&Torque::addTorque)) return true;
  if (!isFinite(state.acceleration)) state.acceleration = kZeros;
  for (std::size_t m = 0; m < scene.constraints.size(); ++m) {
    const Constraint& law = *scene.constraints[m];
    double C[kMaxShafts];
    double c0;
    law.calcRow(state, C, &c0);
    const bool is_finite = std::isfinite(c0) && isFinite(C) &&
                           (law.order() == 3 || std::isfinite(law.calcResidual(state)));
    if (is_finite) continue;
    *constraint = static_cast<int>(m);
    return true;
  }
  return findTorque(&Torque::addTorqueRate);
}

bool Drivetrain::calcCorrection(const double* level, const double* shift, ConstraintSolver* solver,
                                double* delta) {
  double residual[kMaxRows];
  for (int r = 0; r < solver->rowCount(); ++r) {
    residual[r] = *level++;
    for (int i = 0; i < S; ++i) solver->row(r)[i] = level[i];
    for (int i = 0; shift != nullptr && i < S; ++i) residual[r] += level[i] * shift[i];
    level += S;
  }
  if (!solver->factor(inertia_)) return false;
  for (int r = 0; r < solver->rowCount(); ++r) residual[r] = -residual[r];
  solver->solve(residual, residual);
  std::fill_n(delta, S, 0.0);
  solver->addReaction(residual, delta);
  return true;
}

bool Drivetrain::calcVelocityProjection(const StateView& state, double* delta) {
  const double* const level = program_.calcVelocityLevel(state);
  return calcCorrection(level, nullptr, &velocity_solver_, delta);
}

bool Drivetrain::calcAccelerationProjection(const StateView& state, double* delta) {
  const double* const level = program_.calcAccelerationLevel(state);
  return calcCorrection(level, nullptr, &acceleration_solver_, delta);
}

bool Drivetrain::calcLinearizedReaction(const StateView& state, const double* free, double* delta) {
  double shift[kMaxShafts];
  for (int i = 0; i < S; ++i) shift[i] = free[i] - state.acceleration[i];
  const double* const level = program_.calcAccelerationLevel(state);
  return calcCorrection(level, shift, &acceleration_solver_, delta);
}

int Drivetrain::countOrders(const Scene& scene, int highest) {
  int count = 0;
  for (const ConstraintPtr& constraint : scene.constraints) {
    if (constraint->order() <= highest) ++count;
  }
  return count;
}

bool Drivetrain::solveFormal(const double* lambda, const double* right, const double* c0,
                             double* x) const {
  const int k = constraintCount();
  DenseMatrix K = DenseMatrix::Zero(S + k, S + k);
  DenseVector b = DenseVector::Zero(S + k);
  for (int i = 0; i < S; ++i) {
    b(i) = right[i];
    for (int j = 0; j < S; ++j) K(i, j) = inertia_.entry(i, j);
  }
  for (int m = 0; m < k; ++m) {
    const double* const H = hessians_.data() + m * S * S;
    b(S + m) = -c0[m];
    for (int i = 0; i < S; ++i) {
      K(S + m, i) = solver_.row(m)[i];
      K(i, S + m) = -solver_.row(m)[i];
      for (int j = 0; j < S; ++j) K(i, j) -= lambda[m] * H[i * S + j];
    }
  }
  // y is large where rows of C are nearly dependent, and multiplies the rounding errors of the
  // zeros in K: iterative refinement removes them.
  constexpr int kRefinements = 2;
  DenseVector solution;
  if (!solveScaled(K, b, kRefinements, &solution)) return false;
  for (int i = 0; i < S; ++i) x[i] = solution(i);
  return true;
}

}  // namespace variator_sim
