#include "dynamics/dense.h"

#include <Eigen/Cholesky>

namespace variator_sim {

bool solveScaled(DenseMatrix& A, DenseVector& b, DenseVector* x) {
  if (!A.allFinite() || !b.allFinite()) return false;
  for (int i = 0; i < A.rows(); ++i) {
    const double largest = A.row(i).cwiseAbs().maxCoeff();
    if (largest == 0.0) return false;
    A.row(i) /= largest;
    b(i) /= largest;
  }
  *x = A.partialPivLu().solve(b);
  return x->allFinite();
}

bool solveSymmetric(const DenseMatrix& A, double least, DenseVector* b) {
  if (!A.allFinite()) return false;
  const Eigen::LDLT<DenseMatrix> factors(A);
  if (!(factors.vectorD().minCoeff() > least)) return false;
  *b = factors.solve(*b).eval();
  return true;
}

SquareMatrix invertSymmetric(const SquareMatrix& A) {
  const Eigen::LDLT<DenseMatrix> factors(A);
  DenseMatrix whole(A.rows(), A.cols());
  for (int j = 0; j < A.cols(); ++j) {
    const DenseVector unit = DenseVector::Unit(A.rows(), j);
    whole.col(j) = factors.solve(unit);
  }
  return 0.5 * (whole + whole.transpose());
}

}  // namespace variator_sim
