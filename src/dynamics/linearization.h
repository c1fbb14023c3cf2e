/// The linear algebra of implicit steps for chains of derivatives.
///
/// The states are x = (x_0, ..., x_{L-1}), each of S values, with x_l' = x_{l+1} and
/// x_{L-1}' = f(t, x): (phi, omega, epsilon) or (phi, omega). With E_l = df/dx_l the matrix of an
/// implicit step, I/g - dx'/dx with g = h gamma, need not be factored as a whole: from the upper
/// rows k_l = g (r_l + k_{l+1}), so only
///     W = M/g - sum_l g^(L-1-l) E_l        (S x S)
/// is. M is the identity, or the mass matrix if the last row is implicit, M x_{L-1}' = f.
#pragma once

#include <algorithm>
#include <array>
#include <complex>

#include "dynamics/dense.h"
#include "dynamics/state_vector.h"

namespace variator_sim {

/// The matrix of an implicit step; `levels` is L.
class Linearization {
 public:
  static constexpr int kMaxLevels = 3;
  static constexpr int kMaxComplex = 3;
  using Complex = std::complex<double>;
  using ComplexState = std::array<Complex, kMaxLevels * kMaxShafts>;

  Linearization(int shafts, int levels);

  int shafts() const { return S; }
  int levels() const { return L; }

  /// df_i/dx_{l,j}; to be written before `factor`.
  SquareMatrix& block(int l) { return E_[static_cast<std::size_t>(l)]; }
  const SquareMatrix& block(int l) const { return E_[static_cast<std::size_t>(l)]; }

  /// M; to be written before `factor`.
  SquareMatrix& mass() { return mass_; }
  /// r = M r, the last S rows of a residual.
  void weigh(double* r) const {
    double weighed[kMaxShafts];
    for (int i = 0; i < S; ++i) {
      weighed[i] = mass_(i, 0) * r[0];
      for (int j = 1; j < S; ++j) weighed[i] += mass_(i, j) * r[j];
    }
    std::copy_n(weighed, S, r);
  }

  /// P of Drivetrain::calcStageResidual at the point of linearization.
  SquareMatrix& projector() { return projector_; }
  const SquareMatrix& projector() const { return projector_; }
  /// D of Drivetrain::calcStageResidual at the point of linearization: column m is the direction in
  /// which psi_m corrects the accelerations.
  SquareMatrix& pull() { return pull_; }
  const SquareMatrix& pull() const { return pull_; }

  /// Estimates |lambda| of the fastest component (1/s): the spectral radius of dx'/dx for M = I, by
  /// the growth of its powers.
  double calcFastestRate() const;

  /// Prepares solutions with g = h gamma. Returns false if W is singular or not finite. [loop]
  bool factor(double g);
  /// The same for up to kMaxComplex additional complex g, by their index.
  bool factorComplex(int index, Complex g);

  /// Solves (M/g - dx'/dx) k = r in place. [loop]
  void solve(State& r) const;
  void solveComplex(int index, ComplexState& r) const;

 private:
  using Blocks = std::array<SquareMatrix, static_cast<std::size_t>(kMaxLevels)>;

  /// The factors of W, or the inverse of a small W, which is fastest.
  template <class Scalar>
  struct Factors {
    Scalar g{};
    std::array<Scalar, kMaxShafts * kMaxShafts> inverse{};  // column by column
    DenseLu<Scalar> lu;
  };
  template <class Scalar>
  bool factor(Factors<Scalar>& factors, Scalar g);
  template <class Scalar>
  void solve(const Factors<Scalar>& factors, Scalar* r) const;
  template <int kShafts, class Scalar>
  bool factorSized(Factors<Scalar>& factors, Scalar g);
  template <int kShafts, class Scalar>
  void solveSized(const Factors<Scalar>& factors, Scalar* r) const;
  template <int kShafts, int kLevels, class Scalar>
  void solveLevels(const Factors<Scalar>& factors, Scalar* r) const;

  const int S;  // shafts
  const int L;  // levels
  SquareMatrix mass_;
  SquareMatrix projector_;
  SquareMatrix pull_;
  Blocks E_;
  Factors<double> real_;
  std::array<Factors<Complex>, static_cast<std::size_t>(kMaxComplex)> complex_;
};

class System;

/// Writes the blocks of `linearization` by central differences of `system`, for systems without
/// their own derivatives. Without `reads_angles` the first block is zero. `natural_size`, the ratio
/// of absolute and relative tolerance: see calcShift. [loop]
void linearizeByDifferences(System& system, double t, const State& x, bool reads_angles,
                            double natural_size, Linearization& linearization);

}  // namespace variator_sim
