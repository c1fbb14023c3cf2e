// There may be more equations (trim_equations.h) than unknowns, most of them 0 = 0, and angles that
// nothing determines: steps are the least ones that solve the linearised equations best.
#include "variator_sim/trim.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "analysis/decompositions.h"
#include "analysis/trim_equations.h"
#include "analysis/trim_names.h"
#include "variator_sim/nearest_name.h"

namespace variator_sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using expression::Node;

constexpr int kStarts = 96;
constexpr double kResidual = 1e-10;
constexpr double kPi = 3.14159265358979323846;

class Trim {
 public:
  Trim(const Scene& scene, const TrimOptions& options);
  TrimResult find();

 private:
  struct Attempt {
    bool is_solution = false;
    VectorXd v;
    double residual = std::numeric_limits<double>::infinity();
    double weighted = std::numeric_limits<double>::infinity();  ///< by the equations' own sizes
  };
  void stateFixed();
  void chooseUnknowns();
  void refuseAcceleration(int variable) const;
  void add(Node equation, std::string name) {
    formulas_.push_back(equation);
    names_.push_back(std::move(name));
  }
  /// Values and derivatives by the unknowns.
  void evaluate(VectorXd& v, VectorXd& F, MatrixXd& dF) const;
  VectorXd startAt(int n) const;
  double halton(int n, int dimension) const;
  /// The multipliers enter linearly: those that suit the others best.
  void fitMultipliers(VectorXd& v) const;
  VectorXd sizesOf(const VectorXd& v) const;
  /// F by the equations' own sizes
  VectorXd weigh(const VectorXd& F, const MatrixXd& dF, const VectorXd& v) const {
    return F.cwiseQuotient((dF.cwiseAbs() * sizesOf(v)).cwiseMax(1e-6));
  }
  Attempt iterate(VectorXd v) const;
  /// Speeds, accelerations and inputs: what steady states are told apart by.
  bool counts(int unknown) const;
  /// Directions, in unknowns by their sizes, that the linearised equations leave free; `counted`:
  /// otherwise of angles and multipliers alone.
  MatrixXd findFreeDirections(const VectorXd& v, bool counted) const;
  /// True where some way along `free` leads to another steady state, and v is no double root.
  bool isOneOfMany(const VectorXd& v, const MatrixXd& free) const;
  bool isSame(const VectorXd& a, const VectorXd& b) const;
  std::string leavesLimits(const VectorXd& v) const;
  bool isStill(const VectorXd& v) const;
  double distance(const VectorXd& v) const;
  std::string explainNone(const Attempt& nearest);
  TrimState stateOf(const Attempt& attempt, const MatrixXd& free) const;

  const Scene& scene_;
  const TrimOptions& options_;
  MotionEquations equations_;
  const VariableLayout& layout_;
  TrimNames trim_names_;
  std::vector<Node> formulas_;
  std::vector<std::string> names_;  ///< of the formulas, for messages
  std::unique_ptr<DifferentiatedFormulas> program_;
  std::vector<int> unknowns_;
  VectorXd base_;
};

Trim::Trim(const Scene& scene, const TrimOptions& options)
    : scene_(scene),
      options_(options),
      equations_(scene, scene.principle == Principle::kGauss),
      layout_(equations_.layout()),
      trim_names_(scene, layout_) {
  base_ = VectorXd::Zero(layout_.size());
  for (int i = 0; i < layout_.S; ++i) {
    base_(layout_.angle(i)) = scene.initial.angle[at(i)];
    base_(layout_.velocity(i)) = scene.initial.velocity[at(i)];
    if (options.accelerating) base_(layout_.acceleration(i)) = 1.0;
  }
  for (int i = 0; i < layout_.U; ++i) base_(layout_.input(i)) = scene.inputs[at(i)].initial;
  for (const NamedFormula& it : makeBalance(equations_, scene, options.accelerating)) {
    add(it.formula, it.name);
  }
  stateFixed();
  chooseUnknowns();
  program_ = std::make_unique<DifferentiatedFormulas>(equations_, formulas_);
}

void Trim::stateFixed() {
  expression::Graph& graph = equations_.graph();
  for (const TrimChoice& choice : options_.fix) {
    const int variable = trim_names_.findVariable(choice.name);
    refuseAcceleration(variable);
    if (variable >= 0) {
      base_(variable) = choice.value;
      continue;
    }
    const TrimNames::Quantity quantity = trim_names_.findQuantity(choice.name);
    const Node node = quantity.output >= 0   ? scene_.outputs[at(quantity.output)].node()
                      : quantity.is_reaction ? equations_.reaction(quantity.shaft)
                                             : equations_.torque(quantity.shaft);
    add(graph.subtract(node, graph.constant(choice.value)), inQuotes(choice.name));
  }
}

void Trim::refuseAcceleration(int variable) const {
  const bool is_acceleration =
      variable >= layout_.acceleration(0) && variable < layout_.acceleration(layout_.S);
  if (!is_acceleration || options_.accelerating) return;
  throw SceneError("", inQuotes(trim_names_.nameOf(variable)) +
                           " is 0 where speeds are constant; steady states with accelerations "
                           "are those in constant ratios (--accelerating)");
}

void Trim::chooseUnknowns() {
  std::vector<int> free;
  for (int i = 0; i < layout_.S; ++i) {
    const auto reads = [&](Node node) {
      return equations_.graph().dependsOn(node, layout_.slot(layout_.angle(i)));
    };
    if (std::any_of(formulas_.begin(), formulas_.end(), reads)) {
      free.push_back(layout_.angle(i));
    }
    free.push_back(layout_.velocity(i));
    if (options_.accelerating) free.push_back(layout_.acceleration(i));
  }
  for (const TrimChoice& choice : options_.free) {
    const int variable = trim_names_.findFree(choice.name);
    refuseAcceleration(variable);
    if (std::isfinite(choice.value)) base_(variable) = choice.value;
    free.push_back(variable);
  }
  for (const TrimChoice& choice : options_.fix) {
    const int variable = trim_names_.findVariable(choice.name);
    for (const TrimChoice& other : options_.free) {
      if (variable < 0 || trim_names_.findFree(other.name) != variable) continue;
      throw SceneError("", inQuotes(choice.name) + " is both fixed and free");
    }
    free.erase(std::remove(free.begin(), free.end(), variable), free.end());
  }
  for (int m = 0; m < layout_.k; ++m) {
    free.push_back(layout_.multiplier(m));
    free.push_back(layout_.multiplierRate(m));
  }
  for (int i = 0; i < layout_.S; ++i) {
    if (options_.accelerating) free.push_back(layout_.jerk(i));
    free.push_back(layout_.auxiliary(i));
  }
  if (options_.accelerating) free.push_back(layout_.growth());
  std::sort(free.begin(), free.end());
  free.erase(std::unique(free.begin(), free.end()), free.end());
  unknowns_ = std::move(free);
}

void Trim::evaluate(VectorXd& v, VectorXd& F, MatrixXd& dF) const {
  MatrixXd all;
  program_->evaluate(v, F, all);
  dF.resize(F.size(), static_cast<int>(unknowns_.size()));
  for (int j = 0; j < dF.cols(); ++j) dF.col(j) = all.col(unknowns_[at(j)]);
}

double Trim::halton(int n, int dimension) const {
  constexpr int kPrimes[] = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37};
  const int base = kPrimes[dimension % 12];
  double value = 0.0;
  double part = 1.0;
  for (int rest = n + 7 * (dimension / 12); rest > 0; rest /= base) {
    part /= base;
    value += part * (rest % base);
  }
  return value;
}

VectorXd Trim::startAt(int n) const {
  VectorXd v = base_;
  if (n == 0) return v;
  double size = 1.0;
  for (int i = 0; i < layout_.S; ++i) size = std::max(size, std::abs(base_(layout_.velocity(i))));
  constexpr double kParts[] = {1.0, 0.3, 3.0, 30.0, 10.0, 100.0};
  size *= kParts[n % 6];
  const bool is_positive = n % 4 < 2;  // where most steady states are
  for (int j = 0; j < static_cast<int>(unknowns_.size()); ++j) {
    const int variable = unknowns_[at(j)];
    const double place = halton(n, j);
    const double both = is_positive ? place : 2.0 * place - 1.0;
    if (variable >= layout_.velocity(0) && variable < layout_.jerk(0)) {
      v(variable) = size * both;
    } else if (variable < layout_.velocity(0)) {
      if (n % 2 == 0) v(variable) = base_(variable) + kPi * (2.0 * place - 1.0);
    } else if (variable >= layout_.input(0) && variable < layout_.multiplier(0)) {
      const CommandInputSettings& input = scene_.inputs[at(variable - layout_.input(0))];
      const bool has_limits = std::isfinite(input.minimum) && std::isfinite(input.maximum);
      v(variable) = has_limits ? input.minimum + place * (input.maximum - input.minimum)
                               : base_(variable) + size * both;
    }
  }
  return v;
}

void Trim::fitMultipliers(VectorXd& v) const {
  VectorXd F;
  MatrixXd dF;
  evaluate(v, F, dF);
  std::vector<int> linear;
  for (int j = 0; j < static_cast<int>(unknowns_.size()); ++j) {
    const int variable = unknowns_[at(j)];
    const bool is_multiplier = variable >= layout_.multiplier(0) && variable < layout_.growth();
    const bool is_auxiliary = variable >= layout_.auxiliary(0) && variable < layout_.input(0);
    if (is_multiplier || is_auxiliary) linear.push_back(j);
  }
  if (linear.empty() || !F.allFinite() || !dF.allFinite()) return;
  const MatrixXd columns = chooseColumns(dF, linear);
  const VectorXd change = solveLeastSquares(columns, -F);
  for (std::size_t n = 0; n < linear.size(); ++n) {
    v(unknowns_[at(linear[n])]) += change(static_cast<int>(n));
  }
}

VectorXd Trim::sizesOf(const VectorXd& v) const {
  VectorXd sizes(static_cast<int>(unknowns_.size()));
  for (int j = 0; j < sizes.size(); ++j) sizes(j) = std::max(1.0, std::abs(v(unknowns_[at(j)])));
  return sizes;
}

Trim::Attempt Trim::iterate(VectorXd v) const {
  constexpr int kIterations = 80;
  constexpr double kLongest = 4.0;  // of each unknown's size
  fitMultipliers(v);
  VectorXd F;
  MatrixXd dF;
  Attempt attempt;
  for (int round = 0; round < kIterations; ++round) {
    evaluate(v, F, dF);
    if (!F.allFinite() || !dF.allFinite()) return attempt;
    const VectorXd sizes = sizesOf(v);
    const VectorXd rows = (dF.cwiseAbs() * sizes).cwiseMax(1e-300);
    const VectorXd weighted = weigh(F, dF, v);
    attempt.v = v;
    attempt.residual = F.size() > 0 ? F.cwiseAbs().maxCoeff() : 0.0;
    attempt.weighted = F.size() > 0 ? weighted.cwiseAbs().maxCoeff() : 0.0;
    // As small as numbers of this size allow
    const VectorXd allowed = (1e-14 * rows).cwiseMax(kResidual);
    attempt.is_solution = (F.cwiseAbs().array() <= allowed.array()).all();
    const double merit = weighted.norm();
    if (merit == 0.0) return attempt;

    const VectorXd weights = rows.cwiseMax(1e-6).cwiseInverse();
    VectorXd step =
        solveLeastSquares(weights.asDiagonal() * dF * sizes.asDiagonal(), -weighted, 1e-11);
    const double longest = step.cwiseAbs().maxCoeff();
    if (longest > kLongest) step *= kLongest / longest;
    bool is_better = false;
    for (double part = 1.0; part > 1e-6 && !is_better; part *= 0.5) {
      VectorXd next = v;
      for (int j = 0; j < step.size(); ++j) next(unknowns_[at(j)]) += part * sizes(j) * step(j);
      VectorXd F_next;
      MatrixXd unused;
      evaluate(next, F_next, unused);
      is_better = F_next.allFinite() && F_next.cwiseProduct(weights).norm() < merit;
      if (is_better) v = next;
    }
    if (!is_better) return attempt;
  }
  return attempt;
}

bool Trim::counts(int unknown) const {
  const int variable = unknowns_[at(unknown)];
  return (variable >= layout_.velocity(0) && variable < layout_.jerk(0)) ||
         (variable >= layout_.input(0) && variable < layout_.multiplier(0));
}

MatrixXd Trim::findFreeDirections(const VectorXd& v, bool counted) const {
  VectorXd there = v;
  VectorXd F;
  MatrixXd dF;
  evaluate(there, F, dF);
  const VectorXd sizes = sizesOf(v);
  const VectorXd rows = (dF.cwiseAbs() * sizes).cwiseMax(1e-6);
  const MatrixXd scaled = rows.cwiseInverse().asDiagonal() * dF * sizes.asDiagonal();
  std::vector<int> columns;
  for (int j = 0; j < scaled.cols(); ++j) {
    if (counted || !counts(j)) columns.push_back(j);
  }
  const MatrixXd kernel = findKernel(chooseColumns(scaled, columns), 1e-8);
  MatrixXd free = MatrixXd::Zero(scaled.cols(), kernel.cols());
  for (int j = 0; j < kernel.rows(); ++j) free.row(columns[at(j)]) = kernel.row(j);
  return free;
}

bool Trim::isOneOfMany(const VectorXd& v, const MatrixXd& free) const {
  constexpr double kWay = 0.05;  // of each unknown's size
  const VectorXd sizes = sizesOf(v);
  for (int column = 0; column < free.cols(); ++column) {
    VectorXd direction = free.col(column);
    for (int j = 0; j < direction.size(); ++j) {
      if (!counts(j)) direction(j) = 0.0;
    }
    const double length = direction.cwiseAbs().maxCoeff();
    if (length < 1e-7) continue;
    VectorXd beside = v;
    for (int j = 0; j < sizes.size(); ++j) {
      beside(unknowns_[at(j)]) += kWay * sizes(j) * free(j, column) / length;
    }
    const Attempt attempt = iterate(beside);
    double moved = 0.0;
    for (int j = 0; j < sizes.size(); ++j) {
      const int variable = unknowns_[at(j)];
      if (!counts(j) || !attempt.is_solution) continue;
      moved = std::max(moved, std::abs(attempt.v(variable) - v(variable)) / sizes(j));
    }
    if (moved > 0.5 * kWay && moved < 2.0 * kWay) return true;
  }
  return false;
}

bool Trim::isSame(const VectorXd& a, const VectorXd& b) const {
  const VectorXd sizes = sizesOf(a);
  VectorXd difference(sizes.size());
  for (int j = 0; j < sizes.size(); ++j) {
    difference(j) = (a(unknowns_[at(j)]) - b(unknowns_[at(j)])) / sizes(j);
  }
  const MatrixXd free = findFreeDirections(a, false);
  difference -= free * (free.transpose() * difference);
  for (int j = 0; j < sizes.size(); ++j) {
    if (unknowns_[at(j)] >= layout_.velocity(0)) continue;
    // A turn more is the same place.
    const double angle = difference(j) * sizes(j);
    difference(j) = angle - 2.0 * kPi * std::round(angle / (2.0 * kPi));
  }
  return difference.cwiseAbs().maxCoeff() < 1e-6;
}

std::string Trim::leavesLimits(const VectorXd& v) const {
  for (int i = 0; i < layout_.U; ++i) {
    const CommandInputSettings& input = scene_.inputs[at(i)];
    const double value = v(layout_.input(i));
    const double slack = 1e-9 * std::max(1.0, std::abs(value));
    if (value >= input.minimum - slack && value <= input.maximum + slack) continue;
    return inQuotes(input.name) + " would have to be " + formatNumber(value) + ", allowed is " +
           Range::between(input.minimum, input.maximum).toText();
  }
  return "";
}

bool Trim::isStill(const VectorXd& v) const {
  return v.segment(layout_.acceleration(0), layout_.S).cwiseAbs().maxCoeff() < 1e-6;
}

TrimState Trim::stateOf(const Attempt& attempt, const MatrixXd& free) const {
  TrimState state;
  // What Newton's iteration leaves of 0 where it converges slowly
  const VectorXd v = (attempt.v.array().abs() < 1e-30).select(0.0, attempt.v);
  OperatingPoint& point = state.point;
  point.time = v(layout_.time());
  for (int i = 0; i < layout_.S; ++i) {
    point.angle.push_back(v(layout_.angle(i)));
    point.velocity.push_back(v(layout_.velocity(i)));
    point.acceleration.push_back(v(layout_.acceleration(i)));
  }
  for (int i = 0; i < layout_.U; ++i) point.input.push_back(v(layout_.input(i)));
  point.input_rate.assign(point.input.size(), 0.0);
  point.command = point.input;
  state.residual = attempt.residual;
  for (int j = 0; j < free.rows(); ++j) {
    const std::string name = trim_names_.nameOf(unknowns_[at(j)]);
    if (counts(j) && free.row(j).norm() > 1e-7) state.undetermined.push_back(name);
  }
  return state;
}

/// How far speeds, accelerations and inputs are from the start.
double Trim::distance(const VectorXd& v) const {
  const VectorXd sizes = sizesOf(base_);
  double sum = 0.0;
  for (int j = 0; j < sizes.size(); ++j) {
    const int variable = unknowns_[at(j)];
    if (!counts(j)) continue;
    sum += std::pow((v(variable) - base_(variable)) / sizes(j), 2);
  }
  return sum;
}

std::string Trim::explainNone(const Attempt& nearest) {
  VectorXd v = nearest.v;
  VectorXd F;
  MatrixXd dF;
  evaluate(v, F, dF);
  const VectorXd weighted = weigh(F, dF, v);
  // What is left is spread over all that have a part in it: none of them alone is to blame.
  constexpr double kPart = 0.1;
  std::vector<std::string> left;
  bool reads_time = false;
  for (int n = 0; n < F.size(); ++n) {
    if (std::abs(weighted(n)) < kPart * nearest.weighted) continue;
    const std::string& name = names_[at(n)];
    left.push_back(name.empty() ? "the torques" : name);
    const int time = layout_.slot(layout_.time());
    reads_time = reads_time || equations_.graph().dependsOn(formulas_[at(n)], time);
  }
  std::sort(left.begin(), left.end());
  left.erase(std::unique(left.begin(), left.end()), left.end());
  std::string text = "no steady state found from " + std::to_string(kStarts) +
                     " starts; the nearest leaves " + formatNumber(nearest.residual) + " in " +
                     left.front();
  for (std::size_t n = 1; n < left.size(); ++n) text += " and " + left[n];
  if (left.size() > 1) text += " together";
  if (reads_time) return text + " (laws read the time: what they do changes)";
  if (!options_.fix.empty()) return text + " (is too much fixed, or too little free?)";
  if (options_.accelerating) return text;
  return text +
         ": whatever is free does not change it (--accelerating finds accelerations in constant "
         "ratios; --free NAME frees an input)";
}

TrimResult Trim::find() {
  TrimResult result;
  std::vector<Attempt> found;
  std::string outside;
  Attempt nearest;
  bool has_still = false;
  for (int n = 0; n < kStarts; ++n) {
    const Attempt attempt = iterate(startAt(n));
    if (!attempt.is_solution) {
      if (attempt.weighted < nearest.weighted) nearest = attempt;
      continue;
    }
    if (options_.accelerating && isStill(attempt.v)) {
      has_still = true;
      continue;
    }
    const std::string fault = leavesLimits(attempt.v);
    if (!fault.empty()) {
      outside = fault;
      continue;
    }
    const auto is_known = [&](const Attempt& other) { return isSame(other.v, attempt.v); };
    if (std::any_of(found.begin(), found.end(), is_known)) continue;
    found.push_back(attempt);
    const MatrixXd free = findFreeDirections(attempt.v, true);
    if (!isOneOfMany(attempt.v, free)) continue;
    const TrimState state = stateOf(attempt, free);
    result.states = {state};
    result.message = "infinitely many steady states, this is one: not determined is " +
                     joinNames(state.undetermined) + " (fix one more of them)";
    return result;
  }
  std::stable_sort(found.begin(), found.end(), [this](const Attempt& a, const Attempt& b) {
    return distance(a.v) < distance(b.v);
  });
  for (const Attempt& attempt : found) result.states.push_back(stateOf(attempt, MatrixXd()));
  const std::size_t count = result.states.size();
  if (count > 0) {
    result.message =
        count == 1 ? "one steady state found" : std::to_string(count) + " steady states found";
  } else if (!outside.empty()) {
    result.message = "no steady state within the limits of the inputs: " + outside;
  } else if (has_still) {
    result.message = "no steady state with accelerations, but one with constant speeds";
  } else if (!std::isfinite(nearest.residual)) {
    result.message = "no steady state found: a law is not finite wherever one was looked for";
  } else {
    result.message = explainNone(nearest);
  }
  return result;
}

}  // namespace

TrimResult trim(const Scene& scene, const TrimOptions& options) {
  return Trim(scene, options).find();
}

}  // namespace variator_sim
