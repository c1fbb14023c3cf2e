#include "dense.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace variator_sim {

DenseVector solveLu(const DenseMatrix& A, const DenseVector& b) {
  return A.partialPivLu().solve(b);
}

bool solveScaled(DenseMatrix& A, DenseVector& b, int refinements, DenseVector* x) {
  if (!A.allFinite() || !b.allFinite()) return false;
  for (int i = 0; i < A.rows(); ++i) {
    const double largest = A.row(i).cwiseAbs().maxCoeff();
    if (largest == 0.0) return false;
    A.row(i) /= largest;
    b(i) /= largest;
  }
  const Eigen::PartialPivLU<DenseMatrix> factors(A);
  *x = factors.solve(b);
  for (int round = 0; round < refinements; ++round) {
    const DenseVector rest = b - A * *x;
    *x += factors.solve(rest);
  }
  return x->allFinite();
}

bool solveSymmetric(const DenseMatrix& A, double least, DenseVector* b) {
  if (!A.allFinite()) return false;
  const Eigen::LDLT<DenseMatrix> factors(A);
  if (!(factors.vectorD().minCoeff() > least)) return false;
  *b = factors.solve(*b).eval();
  return true;
}

template <class Scalar>
struct DenseLu<Scalar>::Factors {
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxShafts, kMaxShafts>;
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1, 0, kMaxShafts, 1>;
  Eigen::PartialPivLU<Matrix> lu;
  Eigen::Index size = 0;
};

template <class Scalar>
DenseLu<Scalar>::DenseLu() : factors_(std::make_unique<Factors>()) {}
template <class Scalar>
DenseLu<Scalar>::~DenseLu() = default;

template <class Scalar>
void DenseLu<Scalar>::factor(const Scalar* A, int n) {
  factors_->size = n;
  factors_->lu.compute(Eigen::Map<const typename Factors::Matrix>(A, n, n));
}
template <class Scalar>
void DenseLu<Scalar>::solve(Scalar* x) const {
  Eigen::Map<typename Factors::Vector> vector(x, factors_->size);
  vector = factors_->lu.solve(vector).eval();
}

template class DenseLu<double>;
template class DenseLu<std::complex<double>>;

}  // namespace variator_sim
