/// The inertia matrix J(phi) of S shafts, constant or depending on each shaft's own angle.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "variator_sim/types.h"

namespace variator_sim {

/// One harmonic of a shaft's inertia: cosine cos(order phi) + sine sin(order phi), kg m^2.
struct InertiaHarmonic {
  int order = 1;
  double cosine = 0.0;
  double sine = 0.0;
};

/// J: diagonal entries mean_i + harmonics of phi_i, constant off-diagonal entries. With
/// T = 1/2 omega^T J omega the inertial torque beside J epsilon is
///     n_i = d/dt dT/domega_i - dT/dphi_i - (J epsilon)_i = 1/2 J_i'(phi_i) omega_i^2.
class Inertia {
 public:
  /// `mean`: s x s, symmetric positive definite at every angle, kg m^2; `harmonics`: one list per
  /// shaft, or none at all.
  explicit Inertia(const Eigen::MatrixXd& mean,
                   std::vector<std::vector<InertiaHarmonic>> harmonics = {});

  int shafts() const { return S; }
  /// True when J is the same at every angle: `update` does nothing then.
  bool isConstant() const { return constant_; }
  bool isDiagonal() const { return diagonal_; }

  /// Computes J and dJ/dphi at the angles `phi` (S values, rad).
  void update(const double* phi) {
    if (!constant_ && !isAt(phi)) updateAll(phi);
  }

  /// y = J v.
  void multiply(const double* v, double* y) const {
    if (isDiagonal()) {
      for (int i = 0; i < S; ++i) y[i] = matrix_[i][i] * v[i];
      return;
    }
    for (int i = 0; i < S; ++i) {
      double sum = 0.0;
      for (int j = 0; j < S; ++j) sum += matrix_[i][j] * v[j];
      y[i] = sum;
    }
  }
  /// y = J^-1 v.
  void solve(const double* v, double* y) const {
    if (isDiagonal()) {
      for (int i = 0; i < S; ++i) y[i] = inverse_diagonal_[i] * v[i];
      return;
    }
    for (int i = 0; i < S; ++i) {
      double sum = 0.0;
      for (int j = 0; j < S; ++j) sum += inverse_[i][j] * v[j];
      y[i] = sum;
    }
  }
  double entry(int i, int j) const { return matrix_[i][j]; }
  /// Returns dJ_i/dphi_i, kg m^2/rad.
  double first(int i) const { return first_[i]; }

 private:
  bool isAt(const double* phi) const;
  void updateAll(const double* phi);
  void invert();

  const int S;  // shafts
  double matrix_[kMaxShafts][kMaxShafts] = {};
  double inverse_[kMaxShafts][kMaxShafts] = {};
  std::vector<std::vector<InertiaHarmonic>> harmonics_;
  double mean_[kMaxShafts] = {};
  double inverse_diagonal_[kMaxShafts] = {};
  double angle_[kMaxShafts];  ///< angles of the values below, rad
  double first_[kMaxShafts] = {};
  bool diagonal_ = true;
  bool constant_ = true;
};

}  // namespace variator_sim
