/// The coefficients of Radau IIA methods, worked out from what defines them: the stages are the
/// values of the polynomial p of degree s with p(0) = 0 whose slope is the derivative of the motion
/// at s points, the roots of Radau's polynomial (Hairer, Wanner: Solving ODE II, IV.5 and IV.8).
#pragma once

#include <array>
#include <complex>

namespace variator_sim {

/// The method with an odd number of stages s, of order 2s - 1: A of its Runge-Kutta scheme, c, and
/// the real transformation T^-1 A^-1 T that takes its stages apart, one real eigenvalue first and
/// then blocks ((a, -b), (b, a)) of each pair a +- ib.
class RadauMethod {
 public:
  static constexpr int kMaxStages = 7;
  static constexpr int kMaxPairs = kMaxStages / 2;
  using Vector = std::array<double, kMaxStages>;
  using Matrix = std::array<Vector, kMaxStages>;

  /// Returns the method of 3, 5 or 7 stages: worked out once, in extended precision.
  static const RadauMethod& withStages(int stages);

  int stages() const { return stages_; }
  int pairs() const { return stages_ / 2; }
  /// Points of the stages, of a step from 0 to 1; the last is 1.
  const Vector& points() const { return points_; }
  /// A, its last row the weights.
  const Matrix& coefficients() const { return A_; }
  /// A^-1: h times the slopes at the stages by what the stages have moved.
  const Matrix& inverse() const { return inverse_; }
  /// Eigenvalues of A^-1.
  double real() const { return real_; }
  std::complex<double> pair(int p) const { return pairs_[static_cast<std::size_t>(p)]; }
  /// T, eigenvectors whose last components are 1, and T^-1.
  const Matrix& transform() const { return T_; }
  const Matrix& inverseTransform() const { return inverse_transform_; }

  /// p(theta) and p'(theta) by what the stages have moved: a weight for each. [loop]
  void calcValueWeights(double theta, Vector& weights) const;
  void calcSlopeWeights(double theta, Vector& weights) const;

 private:
  explicit RadauMethod(int stages);

  int stages_;
  Vector points_{};
  Vector scale_{};  // of Lagrange's polynomials, which are zero at 0 and the other points
  Matrix A_{};
  Matrix inverse_{};
  double real_ = 0.0;
  std::array<std::complex<double>, kMaxPairs> pairs_{};
  Matrix T_{};
  Matrix inverse_transform_{};
};

}  // namespace variator_sim
