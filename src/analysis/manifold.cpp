#include "analysis/manifold.h"

#include <algorithm>

#include "analysis/decompositions.h"
#include "variator_sim/errors.h"

namespace variator_sim {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr const char* kLostRank =
    "the constraints' derivatives by the highest rates have lost rank here (or a value is not "
    "finite): there is no linear model at this state";

/// Some columns from `first` on that `rows` can be solved for, and as many rows as are independent.
/// `rank` < 0: as many as there are.
std::vector<int> findDependent(const MatrixXd& rows, int first, int rank, const VectorXd& inertia,
                               MatrixXd& independent) {
  const MatrixXd scaled =
      rows.middleCols(first, inertia.size()) * inertia.cwiseSqrt().cwiseInverse().asDiagonal();
  IndependentRows found = findIndependentRows(scaled, 1e-9);
  const auto independent_rows = static_cast<int>(found.pivots.size());
  if (rank < 0) rank = independent_rows;
  if (independent_rows < rank) throw SceneError("", kLostRank);
  independent = found.transform.topRows(rank) * rows;
  std::vector<int> dependent;
  dependent.reserve(static_cast<std::size_t>(rank));
  for (int r = 0; r < rank; ++r)
    dependent.push_back(first + found.pivots[static_cast<std::size_t>(r)]);
  return dependent;
}

}  // namespace

MatrixXd solveScaled(const MatrixXd& M, const MatrixXd& right) {
  VectorXd row(M.rows());
  for (int i = 0; i < M.rows(); ++i) {
    const double size = M.row(i).cwiseAbs().maxCoeff();
    row(i) = size > 0.0 ? 1.0 / size : 1.0;
  }
  MatrixXd scaled = row.asDiagonal() * M;
  VectorXd column(M.cols());
  for (int i = 0; i < M.cols(); ++i) {
    const double size = scaled.col(i).cwiseAbs().maxCoeff();
    column(i) = size > 0.0 ? 1.0 / size : 1.0;
  }
  scaled = scaled * column.asDiagonal();
  MatrixXd solution;
  if (!scaled.allFinite() || !solveSquare(scaled, row.asDiagonal() * right, 1e-13, solution)) {
    throw SceneError("", kLostRank);
  }
  return column.asDiagonal() * solution;
}

ManifoldCoordinates findCoordinates(const MatrixXd& G, int velocity_rows, const VectorXd& inertia) {
  const int n = static_cast<int>(G.cols());
  const int S = static_cast<int>(inertia.size());
  const int others = static_cast<int>(G.rows()) - velocity_rows;
  std::vector<int> dependent;
  MatrixXd rows(0, n);
  const auto leave_out = [&](const MatrixXd& of, int first, int rank) {
    if (of.rows() == 0) return;
    MatrixXd independent;
    const std::vector<int> more = findDependent(of, first, rank, inertia, independent);
    dependent.insert(dependent.end(), more.begin(), more.end());
    MatrixXd both(rows.rows() + independent.rows(), n);
    both << rows, independent;
    rows = both;
  };
  leave_out(G.topRows(velocity_rows), S, velocity_rows);
  leave_out(G.bottomRows(others), 2 * S, -1);

  ManifoldCoordinates coordinates;
  for (int j = 0; j < n; ++j) {
    const bool is_kept = std::find(dependent.begin(), dependent.end(), j) == dependent.end();
    if (is_kept) coordinates.kept.push_back(j);
  }
  const MatrixXd by_kept = chooseColumns(rows, coordinates.kept);
  coordinates.N = MatrixXd::Zero(n, by_kept.cols());
  for (int j = 0; j < by_kept.cols(); ++j) {
    coordinates.N(coordinates.kept[static_cast<std::size_t>(j)], j) = 1.0;
  }
  if (dependent.empty()) return coordinates;
  const MatrixXd by_dependent = chooseColumns(rows, dependent);
  const MatrixXd follows = solveScaled(by_dependent, -by_kept);
  for (int j = 0; j < follows.rows(); ++j) {
    coordinates.N.row(dependent[static_cast<std::size_t>(j)]) = follows.row(j);
  }
  return coordinates;
}

}  // namespace variator_sim
