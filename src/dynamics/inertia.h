/// The inertia matrix J(phi) of S shafts, constant or depending on each shaft's own angle.
#pragma once

#include <utility>
#include <vector>

#include "dynamics/dense.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// J: diagonal entries mean_i + harmonics of phi_i, constant off-diagonal entries. With
/// T = 1/2 omega^T J omega the inertial torque beside J epsilon is
///     n_i = d/dt dT/domega_i - dT/dphi_i - (J epsilon)_i = 1/2 J_i'(phi_i) omega_i^2.
class Inertia {
 public:
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxShafts, 1>;

  /// `mean`: s x s, symmetric positive definite at every angle, kg m^2; `harmonics`: one list per
  /// shaft, or none at all.
  explicit Inertia(const Eigen::MatrixXd& mean,
                   std::vector<std::vector<InertiaHarmonic>> harmonics = {})
      : harmonics_(std::move(harmonics)),
        mean_(mean.diagonal()),
        J_(mean),
        first_(Vector::Zero(mean.rows())) {}

  /// True when J is the same at every angle: `update` does nothing then.
  bool isConstant() const { return harmonics_.empty(); }
  /// Computes J and dJ/dphi at the angles `phi` (S values, rad). [loop]
  void update(const double* phi);
  const SquareMatrix& matrix() const { return J_; }
  SquareMatrix inverse() const { return invertSymmetric(J_); }
  double entry(int i, int j) const { return J_(i, j); }
  /// Returns dJ_i/dphi_i, kg m^2/rad.
  double first(int i) const { return first_(i); }
  /// y = J v.
  void multiply(const double* v, double* y) const {
    Vector::Map(y, J_.rows()).noalias() = J_ * Vector::Map(v, J_.rows());
  }
  /// y = J^-1 v.
  void solve(const double* v, double* y) const {
    Vector::Map(y, J_.rows()).noalias() = inverse() * Vector::Map(v, J_.rows());
  }

 private:
  std::vector<std::vector<InertiaHarmonic>> harmonics_;
  Vector mean_;  ///< of the diagonal
  SquareMatrix J_;
  Vector first_;
};

}  // namespace variator_sim
