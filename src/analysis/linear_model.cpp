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
#include "analysis/model_formulas.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr const char* kLostRank =
    "the constraints' derivatives by the highest rates have lost rank here (or a value is not "
    "finite): there is no linear model at this state";

/// Solves M x = right with rows and columns of M scaled to like sizes. Throws SceneError if M is
/// singular or not finite.
MatrixXd solveScaled(const MatrixXd& M, const MatrixXd& right) {
  const auto inverse_of = [](const VectorXd& sizes) -> VectorXd {
    return (sizes.array() > 0.0).select(sizes.cwiseInverse(), 1.0);
  };
  const VectorXd row = inverse_of(M.cwiseAbs().rowwise().maxCoeff());
  const MatrixXd by_rows = row.asDiagonal() * M;
  const VectorXd column = inverse_of(by_rows.cwiseAbs().colwise().maxCoeff().transpose());
  const MatrixXd scaled = by_rows * column.asDiagonal();
  MatrixXd solution;
  if (!scaled.allFinite() || !solveSquare(scaled, row.asDiagonal() * right, 1e-13, solution)) {
    throw SceneError("", kLostRank);
  }
  return column.asDiagonal() * solution;
}

/// States that determine the others: x = N x_kept for all x with G x = 0.
struct ManifoldCoordinates {
  std::vector<int> kept;
  MatrixXd N;
};

/// Leaves out velocities (columns `shafts` to 2 `shafts` - 1) for the first `velocity_rows` rows of
/// G and accelerations, the columns behind them, for the others, which may be dependent: those that
/// the rows turn most in the metric of `inertia` (one entry a shaft). Throws SceneError if the rows
/// have lost rank.
ManifoldCoordinates findCoordinates(const MatrixXd& G, int velocity_rows, const VectorXd& inertia) {
  const int n = static_cast<int>(G.cols());
  const int S = static_cast<int>(inertia.size());
  const int others = static_cast<int>(G.rows()) - velocity_rows;
  std::vector<int> dependent;
  MatrixXd rows(0, n);
  // (`rank`: the number of rows that have to be independent, or -1.)
  const auto leave_out = [&](const MatrixXd& of, int first, int rank) {
    if (of.rows() == 0) return;
    const MatrixXd scaled =
        of.middleCols(first, S) * inertia.cwiseSqrt().cwiseInverse().asDiagonal();
    const IndependentRows found = findIndependentRows(scaled, 1e-9);
    const auto independent_rows = static_cast<int>(found.pivots.size());
    if (rank < 0) rank = independent_rows;
    if (independent_rows < rank) throw SceneError("", kLostRank);
    for (int j = 0; j < rank; ++j) dependent.push_back(first + found.pivots[at(j)]);
    const MatrixXd independent = found.transform.topRows(rank) * of;
    MatrixXd both(rows.rows() + rank, n);
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
    coordinates.N(coordinates.kept[at(j)], j) = 1.0;
  }
  if (dependent.empty()) return coordinates;
  const MatrixXd by_dependent = chooseColumns(rows, dependent);
  const MatrixXd follows = solveScaled(by_dependent, -by_kept);
  for (int j = 0; j < follows.rows(); ++j) {
    coordinates.N.row(dependent[at(j)]) = follows.row(j);
  }
  return coordinates;
}

class Linearizer {
 public:
  Linearizer(const Scene& scene, const OperatingPoint& point)
      : scene_(scene),
        point_(point),
        kind_(kindOf(scene)),
        equations_(scene, modesAt(scene, point), kind_ == MotionKind::kFormal),
        layout_(equations_.layout()),
        formulas_(makeModelFormulas(equations_, scene)),
        motion_states_((kind_ == MotionKind::kClassical ? 2 : 3) * layout_.S),
        v_(layout_.valuesAt(point)) {
    chooseStates();
    chainVariables();
    program_ = std::make_unique<DifferentiatedFormulas>(equations_, formulas_.all);
  }
  LinearModel make(LinearForm form) {
    solveUnknowns();
    checkPoint();
    const int n = states();
    const int U = layout_.U;
    const MatrixXd variables = calcVariables(v_);
    const MatrixXd rates = ratesOfStates(variables);
    // The formulas behind E, along the solutions of E.
    const MatrixXd rows =
        derivatives_.bottomRows(derivatives_.rows() - formulas_.equations()) * variables;
    const VectorXd values = values_;
    feedthrough_ = rates.rightCols(U);

    LinearModel model;
    model.time = point_.time;
    nameModel(model);
    const MatrixXd B1_rate = calcFeedthroughRate();
    const auto output_count = static_cast<Eigen::Index>(formulas_.outputs.size());
    const MatrixXd outputs = rows.bottomRows(output_count);
    model.A = rates.leftCols(n);
    model.B = model.A * feedthrough_ + rates.middleCols(n, U) - B1_rate;
    model.C = outputs.leftCols(n);
    model.D = outputs.middleCols(n, U) + model.C * feedthrough_;
    model.x = chooseRows(v_, state_variables_);
    model.x_rate = ratesOfStates(v_);
    model.u = VectorXd(U);
    for (int i = 0; i < U; ++i) {
      model.u(i) = stateOf(layout_.input(i)) < 0 ? point_.input[at(i)] : point_.command[at(i)];
    }
    std::vector<int> commanded;
    for (int i = 0; i < U; ++i) {
      if (scene_.inputs[at(i)].kind != InputKind::kState) commanded.push_back(i);
    }
    model.B = chooseColumns(model.B, commanded);
    model.D = chooseColumns(model.D, commanded);
    model.u = chooseRows(model.u, commanded);
    model.y = values.tail(output_count);
    if (form == LinearForm::kMinimal) keepToManifold(calcManifoldRows(rows, variables), model);
    return model;
  }

 private:
  void chooseStates() {
    for (int n = 0; n < motion_states_; ++n) state_variables_.push_back(layout_.angle(n));
    for (int i = 0; i < layout_.U; ++i) {
      const CommandInputSettings& input = scene_.inputs[at(i)];
      if (input.kind == InputKind::kState) state_variables_.push_back(layout_.input(i));
      if (input.kind != InputKind::kCommanded) continue;
      if (input.hold == Hold::kFirstOrderLag || input.hold == Hold::kSecondOrderLag) {
        state_variables_.push_back(layout_.input(i));
      }
      if (input.hold == Hold::kSecondOrderLag) {
        state_variables_.push_back(layout_.inputRate(i));
        // (tau d/dt + 1)^2 u = command
        const double tau = input.hold_parameter;
        v_(layout_.inputSecondRate(i)) =
            (point_.command[at(i)] - point_.input[at(i)] - 2.0 * tau * point_.input_rate[at(i)]) /
            (tau * tau);
      }
    }
  }
  void chainVariables() {
    const int n = states();
    const int U = layout_.U;
    chain_ = MatrixXd::Zero(layout_.size(), n + 2 * U);
    for (int j = 0; j < n; ++j) chain_(state_variables_[at(j)], j) = 1.0;
    for (int i = 0; i < U; ++i) {
      const int state = stateOf(layout_.input(i));
      const int rate_state = stateOf(layout_.inputRate(i));
      const double tau = scene_.inputs[at(i)].hold_parameter;
      if (scene_.inputs[at(i)].kind == InputKind::kState) continue;
      if (state < 0) {
        chain_(layout_.input(i), n + i) = 1.0;
        chain_(layout_.inputRate(i), n + U + i) = 1.0;
      } else if (rate_state < 0) {  // u' = (command - u) / tau
        chain_(layout_.inputRate(i), state) = -1.0 / tau;
        chain_(layout_.inputRate(i), n + i) = 1.0 / tau;
      } else {  // u'' = (command - u - 2 tau u') / tau^2
        chain_(layout_.inputSecondRate(i), state) = -1.0 / (tau * tau);
        chain_(layout_.inputSecondRate(i), rate_state) = -2.0 / tau;
        chain_(layout_.inputSecondRate(i), n + i) = 1.0 / (tau * tau);
      }
    }
  }
  void solveUnknowns() {
    const int count = formulas_.equations();
    const VectorXd given = v_;
    for (int round = 0; round < 10; ++round) {
      program_->evaluate(v_, values_, derivatives_);
      const VectorXd change = solveScaled(byUnknowns(), -values_.head(count));
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
  void checkPoint() {
    const int first = formulas_.equations();
    for (int r = 0; r < formulas_.velocity_rows + formulas_.acceleration_rows; ++r) {
      const double value = values_(first + r);
      // The residual that a relative change of 1e-7 of the state makes.
      double scale = 0.0;
      for (int n = 0; n < layout_.size(); ++n) {
        scale += std::abs(derivatives_(first + r, n)) * std::max(1.0, std::abs(v_(n)));
      }
      if (std::abs(value) <= 1e-7 * scale) continue;
      throw SceneError(
          "", "the state does not satisfy the constraints: a residual is " + formatNumber(value));
    }
  }
  /// Returns E's derivatives by its unknowns, at the last evaluation.
  MatrixXd byUnknowns() const {
    return chooseColumns(derivatives_.topRows(formulas_.equations()), formulas_.unknowns);
  }
  /// Returns all variables along the solutions of E, at v, by the columns of chain_.
  MatrixXd calcVariables(const VectorXd& v) {
    program_->evaluate(v, values_, derivatives_);
    const MatrixXd sensitivity =
        solveScaled(byUnknowns(), -derivatives_.topRows(formulas_.equations()) * chain_);
    MatrixXd variables = chain_;
    for (int q = 0; q < sensitivity.rows(); ++q) {
      variables.row(formulas_.unknowns[at(q)]) = sensitivity.row(q);
    }
    return variables;
  }
  /// Returns the rates of the model's states: rows of such a matrix, or of the variables.
  MatrixXd ratesOfStates(const MatrixXd& variables) const {
    MatrixXd rates(states(), variables.cols());
    for (int j = 0; j < states(); ++j)
      rates.row(j) = variables.row(rateOf(state_variables_[at(j)]));
    return rates;
  }
  MatrixXd calcFeedthroughRate() {
    if (feedthrough_.isZero(0.0)) return feedthrough_;
    // v' along the motion
    VectorXd rates = VectorXd::Zero(layout_.size());
    rates(layout_.time()) = 1.0;
    double h = 1e-3;
    for (int n = 0; n < rates.size(); ++n) {
      if (rateOf(n) >= 0) rates(n) = v_(rateOf(n));
      h = std::min(h, 1e-3 * std::max(1.0, std::abs(v_(n))) / (std::abs(rates(n)) + 1e-300));
    }
    const auto difference = [&](double step) -> MatrixXd {
      return ratesOfStates(calcVariables(v_ + step * rates) - calcVariables(v_ - step * rates))
          .rightCols(layout_.U);
    };
    return (8.0 * difference(h) - difference(2.0 * h)) / (12.0 * h);
  }
  /// Returns the equations that keep the motion on its manifold, by the model's states.
  MatrixXd calcManifoldRows(const MatrixXd& rows, const MatrixXd& variables) const {
    const int n = states();
    const MatrixXd constraints =
        rows.topRows(formulas_.velocity_rows + formulas_.acceleration_rows).leftCols(n);
    MatrixXd reactions = rows.middleRows(constraints.rows(), formulas_.conserved_rows).leftCols(n);
    if (kind_ == MotionKind::kFormal) {
      // a = J^-1 (R - C^T lambda) stays 0.
      reactions = variables.middleRows(layout_.auxiliary(0), layout_.S).leftCols(n);
    } else if (formulas_.conserved_rows == layout_.S && layout_.k > 0) {
      // A constant D keeps h.R for every h with D h = 0.
      MatrixXd D(layout_.k, layout_.S);
      for (int m = 0; m < layout_.k; ++m) {
        D.row(m) = -derivatives_.col(layout_.multiplierRate(m)).head(layout_.S).transpose();
      }
      reactions = findKernel(D, 1e-12).transpose() * reactions;
    }
    MatrixXd all(constraints.rows() + reactions.rows(), n);
    all << constraints, reactions;
    return all;
  }
  void keepToManifold(const MatrixXd& G, LinearModel& model) const {
    const auto [kept, N] = findCoordinates(G, formulas_.velocity_rows, scene_.inertia.diagonal());
    std::vector<std::string> names;
    names.reserve(kept.size());
    for (const int j : kept) names.push_back(model.states[at(j)]);
    model.states = std::move(names);
    model.A = chooseRows(model.A * N, kept);
    model.B = chooseRows(model.B, kept);
    model.C = model.C * N;
    model.x = chooseRows(model.x, kept);
    model.x_rate = chooseRows(model.x_rate, kept);
  }
  void nameModel(LinearModel& model) const {
    const char* const levels[] = {"/angle", "/velocity", "/acceleration"};
    for (int n = 0; n < motion_states_; ++n) {
      model.states.push_back(shaftName(n % layout_.S) + levels[n / layout_.S]);
    }
    std::string jumps;
    for (int i = 0; i < layout_.U; ++i) {
      const CommandInputSettings& input = scene_.inputs[at(i)];
      if (input.kind == InputKind::kState) {
        model.states.push_back("states/" + input.name);
        continue;
      }
      model.inputs.push_back(input.name);
      if (stateOf(layout_.input(i)) >= 0) model.states.push_back("inputs/" + input.name);
      if (stateOf(layout_.inputRate(i)) >= 0)
        model.states.push_back("inputs/" + input.name + "/rate");
      if (input.hold == Hold::kRateLimit || input.hold == Hold::kFirstOrderHold) {
        model.notes.push_back(inQuotes(input.name) + " is what its hold (" + toString(input.hold) +
                              ") gives, not the command: that hold is not linear in it");
      }
      if (!feedthrough_.col(i).isZero(0.0))
        jumps += (jumps.empty() ? "'" : ", '") + input.name + "'";
    }
    if (!jumps.empty()) {
      model.notes.push_back("accelerations as states are less what they jump by with " + jumps +
                            "; as outputs they are whole");
    }
    model.outputs = formulas_.outputs;
    for (const Output& output : scene_.outputs) {
      if (!output.reads_principle) continue;
      model.notes.push_back("the output " + inQuotes(output.name) +
                            " reads how the reactions change and is left out");
    }
    const std::string modes = describeModes(scene_, point_.mode);
    if (!modes.empty()) model.notes.push_back("in the mode that holds there: " + modes);
    if (program_->hasDifferences()) {
      model.notes.emplace_back(
          "some laws call opaque functions: their derivatives are differences");
    }
  }
  std::string shaftName(int i) const { return scene_.shafts[at(i)]; }
  /// Returns the model's state that a variable is, or -1.
  int stateOf(int variable) const {
    const auto found = std::find(state_variables_.begin(), state_variables_.end(), variable);
    return found == state_variables_.end() ? -1
                                           : static_cast<int>(found - state_variables_.begin());
  }
  int states() const { return static_cast<int>(state_variables_.size()); }
  /// Returns the variable that is the rate of another one, or -1.
  int rateOf(int variable) const {
    if (variable >= layout_.angle(0) && variable < layout_.jerk(0)) return variable + layout_.S;
    const int m = variable - layout_.multiplier(0);
    if (kind_ == MotionKind::kFormal && m >= 0 && m < layout_.k) return layout_.multiplierRate(m);
    const int input = variable - layout_.input(0);
    if (input >= 0 && input < layout_.U) return layout_.inputRate(input);
    const int rate = variable - layout_.inputRate(0);
    return rate >= 0 && rate < layout_.U ? layout_.inputSecondRate(rate) : -1;
  }

  const Scene& scene_;
  const OperatingPoint& point_;
  const MotionKind kind_;
  MotionEquations equations_;
  const VariableLayout& layout_;
  ModelFormulas formulas_;
  std::unique_ptr<DifferentiatedFormulas> program_;
  std::vector<int> state_variables_;  ///< variables that are states of the model
  /// The variables by the model's states (columns 0..n-1), commands and the rates of commands.
  MatrixXd chain_;
  int motion_states_;  ///< the first states: (phi, omega[, epsilon])
  VectorXd v_;
  VectorXd values_;
  MatrixXd derivatives_;
  MatrixXd feedthrough_;  ///< B1
};

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
