/// The inertia matrix J(phi) of S shafts, constant or depending on each shaft's own angle.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <vector>

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
///
/// `Simple`: known to be constant and diagonal when compiled; nothing asks again while running.
template <int S, bool Simple = false>
class Inertia {
 public:
  static constexpr bool kSimple = Simple;
  /// `mean`: S x S, symmetric positive definite at every angle, kg m^2; `harmonics`: one list per
  /// shaft, or none at all.
  explicit Inertia(const Eigen::MatrixXd& mean,
                   std::vector<std::vector<InertiaHarmonic>> harmonics = {})
      : matrix_(mean), harmonics_(std::move(harmonics)) {
    for (int i = 0; i < S; ++i) {
      mean_[i] = mean(i, i);
      for (int j = 0; j < S; ++j) {
        if (i != j && mean(i, j) != 0.0) diagonal_ = false;
      }
    }
    for (const auto& shaft : harmonics_) constant_ = constant_ && shaft.empty();
    invert();
  }

  /// True when J is the same at every angle: nothing below depends on `update` then.
  bool isConstant() const { return Simple || constant_; }
  bool isDiagonal() const { return Simple || diagonal_; }

  /// J, dJ/dphi and d2J/dphi2 at the angles `phi` (S values, rad).
  void update(const double* phi) {
    for (int i = 0; i < S; ++i) {
      const auto& shaft = harmonics_[i];
      if (shaft.empty()) continue;
      double value = mean_[i];
      double first = 0.0;
      double second = 0.0;
      for (const InertiaHarmonic& harmonic : shaft) {
        const double order = harmonic.order;
        const double c = std::cos(order * phi[i]);
        const double s = std::sin(order * phi[i]);
        const double part = harmonic.cosine * c + harmonic.sine * s;
        value += part;
        first += order * (harmonic.sine * c - harmonic.cosine * s);
        second -= order * order * part;
      }
      matrix_(i, i) = value;
      first_[i] = first;
      second_[i] = second;
    }
    invert();
  }

  /// y = J v.
  void multiply(const double* v, double* y) const {
    if constexpr (Simple) {
      for (int i = 0; i < S; ++i) y[i] = matrix_(i, i) * v[i];
      return;
    }
    for (int i = 0; i < S; ++i) {
      double sum = 0.0;
      for (int j = 0; j < S; ++j) sum += matrix_(i, j) * v[j];
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
      for (int j = 0; j < S; ++j) sum += inverse_(i, j) * v[j];
      y[i] = sum;
    }
  }
  /// 1 / J_i of a diagonal J.
  double inverse(int i) const { return inverse_diagonal_[i]; }
  double entry(int i, int j) const { return matrix_(i, j); }
  /// dJ_i/dphi_i, kg m^2/rad, and the second derivative, kg m^2/rad^2.
  double first(int i) const { return first_[i]; }
  double second(int i) const { return second_[i]; }

 private:
  using Matrix = Eigen::Matrix<double, S, S>;

  void invert() {
    if (diagonal_) {
      for (int i = 0; i < S; ++i) inverse_diagonal_[i] = 1.0 / matrix_(i, i);
      return;
    }
    const Matrix inverse = matrix_.llt().solve(Matrix::Identity());
    inverse_ = 0.5 * (inverse + inverse.transpose());
  }

  Matrix matrix_;
  Matrix inverse_ = Matrix::Zero();
  std::vector<std::vector<InertiaHarmonic>> harmonics_;
  double mean_[S] = {};
  double inverse_diagonal_[S] = {};
  double first_[S] = {};
  double second_[S] = {};
  bool diagonal_ = true;
  bool constant_ = true;
};

}  // namespace variator_sim
