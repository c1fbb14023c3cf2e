// y_q = -(dE/dy)^-1 dE/dq for every q of (x, u, u', u''), with E of model_formulas.h.
//
// An input that jumps with its command has x' = A x + B0 u + B1 u'; the state of the model is
// x - B1 u, which does not jump:
//     (x - B1 u)' = A (x - B1 u) + (A B1 + B0 - B1') u.
#include "variator_sim/linear_model.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "analysis/decompositions.h"
#include "analysis/manifold.h"
#include "analysis/model_formulas.h"

namespace variator_sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class Linearizer {
 public:
  Linearizer(const Scene& scene, const OperatingPoint& point);
  LinearModel make(LinearForm form);

 private:
  /// How u and u' of an input follow from the model's states and commands.
  struct Path {
    int state = -1;       ///< of u; -1 for an input that is its command
    int rate_state = -1;  ///< of u'
  };
  void namePaths();
  void solveUnknowns();
  void checkPoint();
  /// d(y)/d(all variables) at v
  MatrixXd calcSensitivity(const VectorXd& v);
  /// What a formula's derivatives by all variables are by the model's states (columns 0..n-1),
  /// commands and the rates of commands.
  MatrixXd reduce(const MatrixXd& by_variables) const;
  /// Of x' in the model's order.
  MatrixXd calcRates(const MatrixXd& sensitivity) const;
  MatrixXd calcFeedthrough(const VectorXd& v);
  MatrixXd calcFeedthroughRate();
  VectorXd calcVariableRates() const;
  /// What keeps the motion on its manifold, by the model's states.
  MatrixXd calcManifoldRows(const MatrixXd& rows, const MatrixXd& sensitivity) const;
  void keepToManifold(const MatrixXd& G, LinearModel& model) const;
  void nameModel(LinearModel& model) const;
  std::string shaftName(int i) const { return scene_.shafts[at(i)]; }

  const Scene& scene_;
  const OperatingPoint& point_;
  const MotionKind kind_;
  MotionEquations equations_;
  const VariableLayout& layout_;
  ModelFormulas formulas_;
  std::unique_ptr<DifferentiatedFormulas> program_;
  std::vector<Path> paths_;
  std::vector<int> state_variables_;  ///< of the model's states
  int motion_states_;                 ///< the first of them: (phi, omega[, epsilon])
  VectorXd v_;
  VectorXd values_;
  MatrixXd derivatives_;
  MatrixXd feedthrough_;  ///< B1
};

Linearizer::Linearizer(const Scene& scene, const OperatingPoint& point)
    : scene_(scene),
      point_(point),
      kind_(kindOf(scene)),
      equations_(scene, kind_ == MotionKind::kFormal),
      layout_(equations_.layout()),
      formulas_(makeModelFormulas(equations_, scene)),
      motion_states_((kind_ == MotionKind::kClassical ? 2 : 3) * layout_.S) {
  v_ = VectorXd::Zero(layout_.size());
  v_(layout_.time()) = point.time;
  for (int i = 0; i < layout_.S; ++i) {
    v_(layout_.angle(i)) = point.angle[at(i)];
    v_(layout_.velocity(i)) = point.velocity[at(i)];
    v_(layout_.acceleration(i)) = point.acceleration[at(i)];
  }
  namePaths();
  program_ = std::make_unique<DifferentiatedFormulas>(equations_, formulas_.all);
}

void Linearizer::namePaths() {
  for (int n = 0; n < motion_states_; ++n) state_variables_.push_back(layout_.angle(n));
  for (int i = 0; i < layout_.U; ++i) {
    const CommandInputSettings& input = scene_.inputs[at(i)];
    v_(layout_.input(i)) = point_.input[at(i)];
    v_(layout_.inputRate(i)) = point_.input_rate[at(i)];
    Path path;
    if (input.hold == Hold::kFirstOrderLag || input.hold == Hold::kSecondOrderLag) {
      path.state = static_cast<int>(state_variables_.size());
      state_variables_.push_back(layout_.input(i));
    }
    if (input.hold == Hold::kSecondOrderLag) {
      path.rate_state = static_cast<int>(state_variables_.size());
      state_variables_.push_back(layout_.inputRate(i));
      // (tau d/dt + 1)^2 u = command
      const double tau = input.time_constant;
      v_(layout_.inputSecondRate(i)) =
          (point_.command[at(i)] - point_.input[at(i)] - 2.0 * tau * point_.input_rate[at(i)]) /
          (tau * tau);
    }
    paths_.push_back(path);
  }
}

void Linearizer::solveUnknowns() {
  const int count = formulas_.equations();
  const VectorXd given = v_;
  for (int round = 0; round < 10; ++round) {
    program_->evaluate(v_, values_, derivatives_);
    MatrixXd M(count, count);
    for (int n = 0; n < count; ++n)
      M.col(n) = derivatives_.col(formulas_.unknowns[at(n)]).head(count);
    const VectorXd change = solveScaled(M, -values_.head(count));
    double moved = 0.0;
    for (int n = 0; n < count; ++n) {
      double& value = v_(formulas_.unknowns[at(n)]);
      value += change(n);
      moved = std::max(moved, std::abs(change(n)) / std::max(1.0, std::abs(value)));
    }
    if (moved < 1e-13) break;
  }
  program_->evaluate(v_, values_, derivatives_);
  for (int i = 0; i < layout_.S; ++i) {
    const int n = layout_.acceleration(i);
    const double moved = std::abs(v_(n) - given(n));
    if (!(moved <= 1e-6 * std::max(1.0, std::abs(given(n))))) {
      throw SceneError("", "the acceleration of shaft " + inQuotes(shaftName(i)) + ", " +
                               formatNumber(given(n)) +
                               " rad/s^2, does not follow from the equations of the motion by " +
                               formatNumber(moved) +
                               ": no state of this scene, or one in a corner of psi, where there "
                               "is no linear model");
    }
  }
}

void Linearizer::checkPoint() {
  const int first = formulas_.equations();
  for (int r = 0; r < formulas_.velocity_rows + formulas_.acceleration_rows; ++r) {
    const double value = values_(first + r);
    // What a relative change of 1e-7 of the state makes
    double scale = 0.0;
    for (int n = 0; n < layout_.size(); ++n) {
      scale += std::abs(derivatives_(first + r, n)) * std::max(1.0, std::abs(v_(n)));
    }
    if (std::abs(value) <= 1e-7 * scale) continue;
    throw SceneError(
        "", "the state does not satisfy the constraints: a residual is " + formatNumber(value));
  }
}

MatrixXd Linearizer::calcSensitivity(const VectorXd& v) {
  program_->evaluate(v, values_, derivatives_);
  const int count = formulas_.equations();
  MatrixXd M(count, count);
  MatrixXd right = -derivatives_.topRows(count);
  for (int n = 0; n < count; ++n) {
    M.col(n) = derivatives_.col(formulas_.unknowns[at(n)]).head(count);
    right.col(formulas_.unknowns[at(n)]).setZero();
  }
  return solveScaled(M, right);
}

MatrixXd Linearizer::reduce(const MatrixXd& by_variables) const {
  const int n = static_cast<int>(state_variables_.size());
  const int U = layout_.U;
  MatrixXd reduced = MatrixXd::Zero(by_variables.rows(), n + 2 * U);
  for (int j = 0; j < n; ++j) reduced.col(j) = by_variables.col(state_variables_[at(j)]);
  for (int i = 0; i < U; ++i) {
    const Path& path = paths_[at(i)];
    const double tau = scene_.inputs[at(i)].time_constant;
    const auto by_u = by_variables.col(layout_.input(i));
    const auto by_rate = by_variables.col(layout_.inputRate(i));
    const auto by_second = by_variables.col(layout_.inputSecondRate(i));
    if (path.state < 0) {
      reduced.col(n + i) += by_u;
      reduced.col(n + U + i) += by_rate;
    } else if (path.rate_state < 0) {  // u' = (command - u) / tau
      reduced.col(path.state) -= by_rate / tau;
      reduced.col(n + i) += by_rate / tau;
    } else {  // u'' = (command - u - 2 tau u') / tau^2
      reduced.col(path.state) -= by_second / (tau * tau);
      reduced.col(path.rate_state) -= 2.0 / tau * by_second;
      reduced.col(n + i) += by_second / (tau * tau);
    }
  }
  return reduced;
}

MatrixXd Linearizer::calcRates(const MatrixXd& sensitivity) const {
  const int S = layout_.S;
  const int n = static_cast<int>(state_variables_.size());
  MatrixXd by_variables = MatrixXd::Zero(n, layout_.size());
  // phi' = omega (, omega' = epsilon)
  for (int i = 0; i < motion_states_ - S; ++i) by_variables(i, layout_.velocity(i)) = 1.0;
  // The first unknowns are the last rows' rates: eta, or epsilon.
  by_variables.middleRows(motion_states_ - S, S) = sensitivity.topRows(S);
  for (int i = 0; i < layout_.U; ++i) {
    const Path& path = paths_[at(i)];
    if (path.state >= 0) by_variables(path.state, layout_.inputRate(i)) = 1.0;
    if (path.rate_state >= 0) by_variables(path.rate_state, layout_.inputSecondRate(i)) = 1.0;
  }
  return reduce(by_variables);
}

MatrixXd Linearizer::calcFeedthrough(const VectorXd& v) {
  return calcRates(calcSensitivity(v)).rightCols(layout_.U);
}

// v' along the motion.
VectorXd Linearizer::calcVariableRates() const {
  VectorXd rates = VectorXd::Zero(layout_.size());
  rates(layout_.time()) = 1.0;
  for (int i = 0; i < layout_.S; ++i) {
    rates(layout_.angle(i)) = v_(layout_.velocity(i));
    rates(layout_.velocity(i)) = v_(layout_.acceleration(i));
    rates(layout_.acceleration(i)) = v_(layout_.jerk(i));
  }
  for (int i = 0; i < layout_.U; ++i) {
    rates(layout_.input(i)) = v_(layout_.inputRate(i));
    rates(layout_.inputRate(i)) = v_(layout_.inputSecondRate(i));
  }
  for (int m = 0; m < layout_.k && kind_ == MotionKind::kFormal; ++m) {
    rates(layout_.multiplier(m)) = v_(layout_.multiplierRate(m));
  }
  return rates;
}

MatrixXd Linearizer::calcFeedthroughRate() {
  if (feedthrough_.isZero(0.0)) return feedthrough_;
  const VectorXd rates = calcVariableRates();
  double h = 1e-3;
  for (int n = 0; n < rates.size(); ++n) {
    h = std::min(h, 1e-3 * std::max(1.0, std::abs(v_(n))) / (std::abs(rates(n)) + 1e-300));
  }
  const auto difference = [&](double step) -> MatrixXd {
    return calcFeedthrough(v_ + step * rates) - calcFeedthrough(v_ - step * rates);
  };
  return (8.0 * difference(h) - difference(2.0 * h)) / (12.0 * h);
}

void Linearizer::nameModel(LinearModel& model) const {
  const char* const levels[] = {"/angle", "/velocity", "/acceleration"};
  for (int n = 0; n < motion_states_; ++n) {
    model.states.push_back(shaftName(n % layout_.S) + levels[n / layout_.S]);
  }
  std::string jumps;
  for (int i = 0; i < layout_.U; ++i) {
    const CommandInputSettings& input = scene_.inputs[at(i)];
    model.inputs.push_back(input.name);
    if (paths_[at(i)].state >= 0) model.states.push_back("inputs/" + input.name);
    if (paths_[at(i)].rate_state >= 0) model.states.push_back("inputs/" + input.name + "/rate");
    if (input.hold == Hold::kRateLimit || input.hold == Hold::kFirstOrderHold) {
      model.notes.push_back(inQuotes(input.name) + " is what its hold (" + toString(input.hold) +
                            ") gives, not the command: that hold is not linear in it");
    }
    if (!feedthrough_.col(i).isZero(0.0)) jumps += (jumps.empty() ? "'" : ", '") + input.name + "'";
  }
  if (!jumps.empty()) {
    model.notes.push_back("accelerations as states are less what they jump by with " + jumps +
                          "; as outputs they are whole");
  }
  model.outputs = outputNames(scene_);
  if (program_->hasDifferences()) {
    model.notes.emplace_back(
        "some laws call opaque functions, or are too large: their derivatives are differences");
  }
}

LinearModel Linearizer::make(LinearForm form) {
  solveUnknowns();
  checkPoint();
  const int n = static_cast<int>(state_variables_.size());
  const int U = layout_.U;
  const MatrixXd sensitivity = calcSensitivity(v_);
  const MatrixXd by_variables = derivatives_;
  const VectorXd values = values_;
  // Formulas behind E, with what their unknowns do
  const int count = formulas_.equations();
  MatrixXd others = by_variables.bottomRows(by_variables.rows() - count);
  MatrixXd direct = others;
  for (const int y : formulas_.unknowns) direct.col(y).setZero();
  for (int q = 0; q < count; ++q) {
    direct += others.col(formulas_.unknowns[at(q)]) * sensitivity.row(q);
  }
  const MatrixXd rates = calcRates(sensitivity);
  const MatrixXd rows = reduce(direct);
  feedthrough_ = rates.rightCols(U);

  LinearModel model;
  model.time = point_.time;
  nameModel(model);
  const MatrixXd B1_rate = calcFeedthroughRate();
  const MatrixXd outputs = rows.bottomRows(formulas_.outputs);
  model.A = rates.leftCols(n);
  model.B = model.A * feedthrough_ + rates.middleCols(n, U) - B1_rate;
  model.C = outputs.leftCols(n);
  model.D = outputs.middleCols(n, U) + model.C * feedthrough_;
  model.x.resize(n);
  for (int j = 0; j < n; ++j) model.x(j) = v_(state_variables_[at(j)]);
  const VectorXd variable_rates = calcVariableRates();
  model.x_rate.resize(n);
  for (int j = 0; j < n; ++j) model.x_rate(j) = variable_rates(state_variables_[at(j)]);
  model.u = VectorXd(U);
  for (int i = 0; i < U; ++i) {
    model.u(i) = paths_[at(i)].state < 0 ? point_.input[at(i)] : point_.command[at(i)];
  }
  model.y = values.tail(formulas_.outputs);
  if (form == LinearForm::kMinimal) keepToManifold(calcManifoldRows(rows, sensitivity), model);
  return model;
}

MatrixXd Linearizer::calcManifoldRows(const MatrixXd& rows, const MatrixXd& sensitivity) const {
  const int n = static_cast<int>(state_variables_.size());
  const MatrixXd constraints =
      rows.topRows(formulas_.velocity_rows + formulas_.acceleration_rows).leftCols(n);
  MatrixXd reactions = rows.middleRows(constraints.rows(), formulas_.conserved_rows).leftCols(n);
  if (kind_ == MotionKind::kFormal) {
    // a = J^-1 (R - C^T lambda) stays 0.
    reactions = reduce(sensitivity).middleRows(layout_.S + layout_.k, layout_.S).leftCols(n);
  } else if (formulas_.conserved_rows == layout_.S && layout_.k > 0) {
    // Of a constant C: h.R, C h = 0
    MatrixXd C(layout_.k, layout_.S);
    for (int i = 0; i < layout_.S; ++i) {
      C.col(i) = derivatives_.col(layout_.jerk(i)).segment(layout_.S, layout_.k);
    }
    reactions = findKernel(C, 1e-12).transpose() * reactions;
  }
  MatrixXd all(constraints.rows() + reactions.rows(), n);
  all << constraints, reactions;
  return all;
}

void Linearizer::keepToManifold(const MatrixXd& G, LinearModel& model) const {
  const auto [kept, N] = findCoordinates(G, formulas_.velocity_rows, scene_.inertia.diagonal());
  std::vector<std::string> names;
  names.reserve(kept.size());
  for (const int j : kept) names.push_back(model.states[at(j)]);
  model.states = std::move(names);
  const auto choose = [&kept = kept](const MatrixXd& of) -> MatrixXd {
    MatrixXd chosen(static_cast<int>(kept.size()), of.cols());
    for (int j = 0; j < chosen.rows(); ++j) chosen.row(j) = of.row(kept[at(j)]);
    return chosen;
  };
  model.A = choose(model.A * N);
  model.B = choose(model.B);
  model.C = model.C * N;
  model.x = choose(model.x);
  model.x_rate = choose(model.x_rate);
}

}  // namespace

LinearModel linearize(const Scene& scene, const OperatingPoint& point, LinearForm form) {
  return Linearizer(scene, point).make(form);
}

std::vector<std::complex<double>> calcEigenvalues(const LinearModel& model, int* zero_index) {
  std::vector<std::complex<double>> eigenvalues = findEigenvalues(model.A, zero_index);
  std::stable_sort(
      eigenvalues.begin(), eigenvalues.end(),
      [](std::complex<double> a, std::complex<double> b) { return std::abs(a) < std::abs(b); });
  return eigenvalues;
}

}  // namespace variator_sim
