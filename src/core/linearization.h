/// The linear algebra of implicit steps for chains of derivatives.
///
/// The states are x = (x_0, ..., x_{L-1}), each of S values, with x_l' = x_{l+1} and
/// x_{L-1}' = f(t, x): (phi, omega, epsilon) or (phi, omega). With E_l = df/dx_l the matrix of an
/// implicit step, I/g - dx'/dx with g = h gamma, need not be factored as a whole: from the upper
/// rows k_l = g (r_l + k_{l+1}), so only
///     W = M/g - sum_l g^(L-1-l) E_l        (S x S)
/// is. M is the identity, or the mass matrix where the last row is implicit, M x_{L-1}' = f.
#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>

#include "central_difference.h"
#include "dense.h"

namespace variator_sim {

template <int S, int L>
class Linearization {
 public:
  using State = std::array<double, static_cast<std::size_t>(S* L)>;
  using Matrix = Eigen::Matrix<double, S, S>;
  using Complex = std::complex<double>;

  /// df_i/dx_{l,j}; to be written before `factor`.
  Matrix& block(int l) { return E_[static_cast<std::size_t>(l)]; }
  const Matrix& block(int l) const { return E_[static_cast<std::size_t>(l)]; }

  /// M; to be written before `factor`.
  Matrix& mass() { return mass_; }
  const Matrix& mass() const { return mass_; }

  /// P of Drivetrain::calcStageResidual where the linearization was made.
  Matrix& projector() { return projector_; }
  const Matrix& projector() const { return projector_; }
  /// D of Drivetrain::calcStageResidual where the linearization was made: column m is what psi_m
  /// pulls the accelerations back along.
  Matrix& pull() { return pull_; }
  const Matrix& pull() const { return pull_; }

  /// |lambda| of the fastest component, about (1/s): the spectral radius of dx'/dx, where M is the
  /// identity, by the growth of its powers.
  double calcFastestRate() const {
    constexpr int kIterations = 48;
    constexpr int kCounted = 24;  // the last ones, once the fastest one prevails
    State x;
    for (std::size_t n = 0; n < x.size(); ++n) x[n] = 1.0 / static_cast<double>(n + 1);
    double log_growth = 0.0;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const auto part = [&x](std::size_t l) {
        return Eigen::Map<Eigen::Matrix<double, S, 1>>(x.data() + l * static_cast<std::size_t>(S));
      };
      Eigen::Matrix<double, S, 1> last = Eigen::Matrix<double, S, 1>::Zero();
      for (std::size_t l = 0; l < L; ++l) last += E_[l] * part(l);
      for (std::size_t l = 0; l + 1 < L; ++l) part(l) = part(l + 1).eval();
      part(L - 1) = last;
      double size = 0.0;
      for (double value : x) size = std::max(size, std::abs(value));
      if (!(size > 0.0)) return 0.0;
      for (double& value : x) value /= size;
      if (iteration >= kIterations - kCounted) log_growth += std::log(size);
    }
    return std::exp(log_growth / kCounted);
  }

  /// Prepares solutions with g = h gamma. False when W is singular or not finite.
  bool factor(double g) { return real_.factor(mass_, E_, g); }
  bool factorComplex(Complex g) { return complex_.factor(mass_, E_, g); }

  /// Solves (M/g - dx'/dx) k = r in place.
  void solve(State& r) const { real_.solve(E_, r.data()); }
  void solveComplex(std::array<Complex, static_cast<std::size_t>(S* L)>& r) const {
    complex_.solve(E_, r.data());
  }

 private:
  using Blocks = std::array<Matrix, static_cast<std::size_t>(L)>;

  template <class Scalar>
  struct Solver {
    using SMatrix = Eigen::Matrix<Scalar, S, S>;
    using SVector = Eigen::Matrix<Scalar, S, 1>;
    Scalar g{};
    SMatrix inverse;
    DenseLu<Scalar> lu;  // of larger ones

    bool factor(const Matrix& M, const Blocks& E, Scalar new_g) {
      g = new_g;
      SMatrix W = M / g;
      Scalar power = 1.0;
      for (std::size_t l = L; l-- > 0; power *= g) W -= power * E[l];
      if (!W.allFinite()) return false;
      if constexpr (S <= 4) {
        inverse = W.inverse();
        return inverse.allFinite();
      } else {
        lu.factor(W.data(), S);
        return true;
      }
    }
    void solve(const Blocks& E, Scalar* r) const {
      const auto part = [r](std::size_t l) { return Eigen::Map<SVector>(r + l * S); };
      // p_l = g (r_l + p_{l+1}): what k_l is but for its part in k_{L-1}
      SVector p = SVector::Zero();
      SVector right = part(L - 1);
      for (std::size_t l = L - 1; l-- > 0;) {
        p = g * (part(l) + p);
        right += E[l] * p;
      }
      SVector k;
      if constexpr (S <= 4) {
        k = inverse * right;
      } else {
        k = right;
        lu.solve(k.data());
      }
      part(L - 1) = k;
      for (std::size_t l = L - 1; l-- > 0;) {
        k = g * (part(l) + k);
        part(l) = k;
      }
    }
  };

  Matrix mass_ = Matrix::Identity();
  Matrix projector_ = Matrix::Identity();
  Matrix pull_ = Matrix::Zero();
  Blocks E_;
  Solver<double> real_;
  Solver<Complex> complex_;
};

/// Writes the blocks of `linearization` by central differences of `system`, for systems that have
/// no derivatives of their own. Without `reads_angles` the first block is zero. `natural_size`, the
/// ratio of absolute and relative tolerance: see calcShift.
template <class System, int S, int L>
void linearizeByDifferences(System& system, double t, const typename System::State& x,
                            bool reads_angles, double natural_size,
                            Linearization<S, L>& linearization) {
  constexpr std::size_t kShafts = S;
  typename System::State shifted = x;
  typename System::State above;
  typename System::State below;
  for (int l = 0; l < L; ++l) {
    if (l == 0 && !reads_angles) {
      linearization.block(0).setZero();
      continue;
    }
    for (int j = 0; j < S; ++j) {
      const std::size_t n = kShafts * static_cast<std::size_t>(l) + static_cast<std::size_t>(j);
      const double step = calcShift(x.data() + l * S, S, j, l == 0, natural_size);
      shifted[n] = x[n] + step;
      const double upper = shifted[n];
      system(shifted, above, t);
      shifted[n] = x[n] - step;
      const double width = upper - shifted[n];
      system(shifted, below, t);
      shifted[n] = x[n];
      for (int i = 0; i < S; ++i) {
        const std::size_t row = kShafts * (L - 1) + static_cast<std::size_t>(i);
        linearization.block(l)(i, j) = (above[row] - below[row]) / width;
      }
    }
  }
}

}  // namespace variator_sim
