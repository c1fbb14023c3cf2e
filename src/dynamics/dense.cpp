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

void invertSymmetric(int n, const double (&A)[kMaxShafts][kMaxShafts],
                     double (&inverse)[kMaxShafts][kMaxShafts]) {
  DenseMatrix matrix(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) matrix(i, j) = A[i][j];
  }
  const Eigen::LDLT<DenseMatrix> factors(matrix);
  DenseMatrix whole(n, n);
  for (int j = 0; j < n; ++j) {
    const DenseVector unit = DenseVector::Unit(n, j);
    whole.col(j) = factors.solve(unit);
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) inverse[i][j] = 0.5 * (whole(i, j) + whole(j, i));
  }
}

}  // namespace variator_sim
