#include "analysis/principle_check.h"

#include <Eigen/Cholesky>
#include <memory>

#include "analysis/decompositions.h"
#include "variator_sim/message_text.h"

namespace variator_sim {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using expression::Node;

namespace {

/// Returns L of J = L L^T, which has to be positive definite.
MatrixXd factor(const MatrixXd& J) {
  return J.llt().matrixL();
}

/// Returns L^-1 M; also when L has no rows, by which Eigen's solution divides.
MatrixXd solveLower(const MatrixXd& L, const MatrixXd& M) {
  if (M.size() == 0) return M;
  return L.triangularView<Eigen::Lower>().solve(M);
}

VectorXd solve(const MatrixXd& M, const VectorXd& right) {
  MatrixXd x;
  solveSquare(M, right, 1e-15, x);
  return x;
}

constexpr double kRank = 1e-12;

}  // namespace

// --- the equations of an instant -----------------------------------------------------------------

VectorXd PrincipleSystem::unknownsOf(const VectorXd& F) const {
  return solve(J, F - g);
}

double PrincipleSystem::measure(const VectorXd& x) const {
  return 0.5 * solveLower(factor(J), J * x + g).squaredNorm();
}

VectorXd PrincipleSystem::solveByNullSpace() const {
  const MatrixXd h = findKernel(C, kRank);
  MatrixXd M(J.rows(), J.cols());
  VectorXd right(J.rows());
  M << C, h.transpose() * J;
  right << -c, -h.transpose() * g;
  return solve(M, right);
}

VectorXd PrincipleSystem::solveByStationarity() const {
  const auto s = J.rows();
  const auto k = C.rows();
  MatrixXd M = MatrixXd::Zero(s + k, s + k);
  M.topLeftCorner(s, s) = J;
  M.topRightCorner(s, k) = -C.transpose();
  M.bottomLeftCorner(k, s) = C;
  VectorXd right(s + k);
  right << -g, -c;
  return solve(M, right).head(s);
}

MatrixXd PrincipleSystem::admissibleDirections() const {
  const MatrixXd h = findKernel(C, kRank);
  // The columns of h W^-T are orthonormal in the metric J for h^T J h = W W^T.
  const MatrixXd W = factor(h.transpose() * J * h);
  return solveLower(W, h.transpose()).transpose();
}

// --- formulas ------------------------------------------------------------------------------------

PrincipleCheck::Formulas::Formulas(const Scene& scene, const std::vector<int>& mode,
                                   bool is_classical)
    : equations(scene, mode, false) {
  const VariableLayout& layout = equations.layout();
  const int rows = layout.S;
  std::vector<Node> z_rates;
  for (const SceneState& state : scene.states) z_rates.push_back(equations.inModes(state.rate));
  std::vector<Node> J;
  std::vector<Node> F;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < rows; ++j) J.push_back(equations.inertia(i, j));
  }
  for (int i = 0; i < rows; ++i) {
    J.push_back(equations.reaction(i));
    F.push_back(is_classical ? equations.reaction(i)
                             : equations.graph().subtract(equations.rate(equations.reaction(i)),
                                                          equations.connection(i)));
  }
  for (const ConstraintFormulas& it : equations.constraints()) {
    F.push_back(is_classical ? it.acceleration : it.jerk);
  }
  for (const ConstraintFormulas& it : equations.constraints()) {
    F.insert(F.end(), it.C.begin(), it.C.end());
  }
  rates = expression::Tape(equations.graph(), z_rates);
  inertia = expression::Tape(equations.graph(), J);
  balances = expression::Tape(equations.graph(), F);
}

PrincipleCheck::PrincipleCheck(const Scene& scene)
    : scene_(scene), is_classical_(scene.principle == Principle::kGauss) {
  const auto refuse = [](const Constraint& it, const char* why) {
    throw SceneError(it.name(), why);
  };
  for (const ConstraintPtr& it : scene.constraints) {
    if (!it->direction().empty() || !it->holdings().empty()) {
      refuse(*it,
             "its reaction is not along its gradient, and with it nothing is least; allowed: "
             "'reaction: gradient', no losses");
    }
    if (is_classical_ && it->order() == 3) {
      refuse(*it,
             "a constraint of order 3 under 'principle: gauss' leads to [18], which is the "
             "minimum of nothing; allowed: orders 1 and 2, or generalized_gauss");
    }
  }
}

std::vector<std::string> PrincipleCheck::limits() const {
  std::vector<std::string> sentences;
  for (const ConstraintPtr& it : scene_.constraints) {
    if (is_classical_ && it->nonlinearAccelerations() != 0) {
      sentences.push_back("the constraint " + inQuotes(it->name()) +
                          " is not linear in the accelerations: the least Z is that over its "
                          "tangent, so the motion is known to be stationary only");
    }
  }
  return sentences;
}

PrincipleSystem PrincipleCheck::calc(const OperatingPoint& point) {
  std::unique_ptr<Formulas>& known = formulas_[point.mode];
  if (!known) known = std::make_unique<Formulas>(scene_, point.mode, is_classical_);
  const Formulas& formulas = *known;
  const VariableLayout& layout = formulas.equations.layout();
  const int S = layout.S;
  const int k = layout.k;
  VectorXd v = layout.valuesAt(point);
  const double* value = formulas.rates.evaluate(layout.view(v));
  for (const SceneState& state : scene_.states) v(layout.inputRate(state.input)) = *value++;

  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  PrincipleSystem made;
  value = formulas.inertia.evaluate(layout.view(v));
  made.J = Eigen::Map<const Rows>(value, S, S);
  const VectorXd R = Eigen::Map<const VectorXd>(value + S * S, S);
  v.segment(layout.auxiliary(0), S) = solve(made.J, R);
  // All jerks in v are 0: F and C eta + c are g and c. The accelerations are those of the motion.
  value = formulas.balances.evaluate(layout.view(v));
  made.g = Eigen::Map<const VectorXd>(value, S);
  made.c = Eigen::Map<const VectorXd>(value + S, k);
  made.C = Eigen::Map<const Rows>(value + S + k, k, S);
  if (is_classical_) {
    const VectorXd own = v.segment(layout.acceleration(0), S);
    made.g -= made.J * own;
    made.c -= made.C * own;
  }
  return made;
}

VectorXd PrincipleCheck::ownOf(const Sample& sample) const {
  const double* const values =
      is_classical_ ? sample.reaction_torque : sample.reaction_torque_covariant_rate;
  return Eigen::Map<const VectorXd>(values, scene_.shaftCount());
}

LeastChange PrincipleCheck::compare(const PrincipleSystem& system, const VectorXd& own) {
  const MatrixXd L = factor(system.J);
  const VectorXd y = solveLower(L, own);
  const VectorXd y0 = solveLower(L, system.g);
  const MatrixXd B = solveLower(L, system.C.transpose()).transpose();
  LeastChange made;
  made.measure = 0.5 * y.squaredNorm();
  made.scale = 0.5 * y0.squaredNorm();
  if (B.rows() > 0) {
    const VectorXd d = B * y0 - system.c;
    made.least = 0.5 * solveLeastSquares(B, d, kRank).squaredNorm();
    made.off = solveLeastSquares(B, B * y - d, kRank).norm();
  }
  made.scale += made.least;
  return made;
}

}  // namespace variator_sim
