// There may be more equations (model_formulas.h) than unknowns, most of them 0 = 0, and angles that
// nothing determines: steps are least-squares solutions of least length.
#include "variator_sim/trim.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>

#include "analysis/decompositions.h"
#include "analysis/model_formulas.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using expression::Node;

constexpr int kStarts = 96;
constexpr int kFurtherStarts = 48;  ///< away from the steady states that are known
constexpr double kResidual = 1e-10;
constexpr double kPi = 3.14159265358979323846;

double largestOf(const VectorXd& v) {
  return v.size() > 0 ? v.cwiseAbs().maxCoeff() : 0.0;
}

class Trim {
 public:
  /// `start`: of the scene, whose modes are those of the steady states.
  Trim(const Scene& scene, const TrimOptions& options, const OperatingPoint& start)
      : scene_(scene),
        options_(options),
        told_mode_(start.mode),
        mode_(modesAt(scene, start)),
        equations_(scene, mode_, scene.principle == Principle::kGauss),
        layout_(equations_.layout()),
        formulas_(makeBalance(equations_, scene, options.accelerating)),
        quantities_(listTrimQuantities(equations_, scene)) {
    base_ = VectorXd::Zero(layout_.size());
    for (int i = 0; i < layout_.S; ++i) {
      base_(layout_.angle(i)) = scene.initial.angle[at(i)];
      base_(layout_.velocity(i)) = scene.initial.velocity[at(i)];
      if (options.accelerating) base_(layout_.acceleration(i)) = 1.0;
    }
    for (int i = 0; i < layout_.U; ++i) base_(layout_.input(i)) = scene.inputs[at(i)].initial;
    stateFixed();
    chooseUnknowns();
    std::vector<Node> nodes;
    for (const NamedFormula& it : formulas_) nodes.push_back(it.formula);
    program_ = std::make_unique<DifferentiatedFormulas>(equations_, nodes);
  }
  TrimResult find() {
    TrimResult result;
    std::vector<Attempt> found;
    std::string outside;
    Attempt nearest;
    bool has_still = false;
    for (int n = 0; n < kStarts + kFurtherStarts; ++n) {
      if (n >= kStarts && found.empty()) break;
      const Attempt attempt =
          n < kStarts ? iterate(startAt(n), {}) : iterate(startAt(n - kStarts), found);
      if (!attempt.is_solution) {
        if (attempt.weighted < nearest.weighted) nearest = attempt;
        continue;
      }
      if (options_.accelerating && isStill(attempt.v)) {
        has_still = true;
        continue;
      }
      std::string fault = findInputBeyond(scene_, attempt.v.data() + layout_.input(0));
      if (fault.empty()) fault = leavesModes(attempt.v);
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
          (count == 1 ? "one steady state found" : std::to_string(count) + " steady states found") +
          std::string(" (a search, which may miss others)");
    } else if (!outside.empty()) {
      result.message = "no steady state within the limits" +
                       std::string(mode_.empty() ? " of the inputs" : "") + ": " + outside;
    } else if (has_still) {
      result.message = "no steady state with accelerations, but one with constant speeds";
    } else if (!std::isfinite(nearest.residual)) {
      result.message = "no steady state found: a law is not finite wherever one was looked for";
    } else {
      result.message = explainNone(nearest);
    }
    return result;
  }

 private:
  struct Attempt {
    bool is_solution = false;
    VectorXd v;
    double residual = std::numeric_limits<double>::infinity();
    double weighted = std::numeric_limits<double>::infinity();  ///< by the sizes of the equations
  };
  /// The equations at v, linearised in the unknowns.
  struct Linearized {
    VectorXd F;
    MatrixXd dF;
    VectorXd sizes;    ///< sizes of the unknowns
    VectorXd rows;     ///< sizes of the equations, from those of the unknowns
    VectorXd weights;  ///< their reciprocals, bounded
    VectorXd weighted() const { return F.cwiseProduct(weights); }
    MatrixXd scaled() const { return weights.asDiagonal() * dF * sizes.asDiagonal(); }
  };
  void stateFixed() {
    expression::Graph& graph = equations_.graph();
    for (const TrimChoice& choice : options_.fix) {
      const TrimQuantity& quantity = findQuantity(choice.name, true);
      refuseAcceleration(quantity.variable);
      if (quantity.variable >= 0) {
        base_(quantity.variable) = choice.value;
      } else {
        const Node equation = graph.subtract(quantity.formula, graph.constant(choice.value));
        formulas_.push_back({equation, inQuotes(choice.name)});
      }
    }
  }
  void chooseUnknowns() {
    std::set<int> unknowns;
    for (int i = 0; i < layout_.S; ++i) {
      const auto reads = [&](const NamedFormula& it) {
        return equations_.graph().dependsOn(it.formula, layout_.slot(layout_.angle(i)));
      };
      if (std::any_of(formulas_.begin(), formulas_.end(), reads)) {
        unknowns.insert(layout_.angle(i));
      }
      unknowns.insert(layout_.velocity(i));
      if (options_.accelerating) unknowns.insert({layout_.acceleration(i), layout_.jerk(i)});
      unknowns.insert(layout_.auxiliary(i));
    }
    for (int m = 0; m < layout_.k; ++m) {
      unknowns.insert({layout_.multiplier(m), layout_.multiplierRate(m)});
    }
    if (options_.accelerating) unknowns.insert(layout_.growth());
    for (const SceneState& state : scene_.states) {
      if (state.trims_to_rest) unknowns.insert(layout_.input(state.input));
    }
    std::set<int> free;
    for (const TrimChoice& choice : options_.free) {
      const int variable = findQuantity(choice.name, false).variable;
      refuseAcceleration(variable);
      if (std::isfinite(choice.value)) base_(variable) = choice.value;
      free.insert(variable);
    }
    unknowns.insert(free.begin(), free.end());
    for (const TrimChoice& choice : options_.fix) {
      const int variable = findQuantity(choice.name, true).variable;
      if (variable >= 0 && free.count(variable) > 0) {
        throw SceneError("", inQuotes(choice.name) + " is both fixed and free");
      }
      unknowns.erase(variable);
    }
    unknowns_.assign(unknowns.begin(), unknowns.end());
  }
  static bool isIn(int variable, int first, int end) { return variable >= first && variable < end; }
  /// True for velocities and accelerations.
  bool isSpeed(int variable) const { return isIn(variable, layout_.velocity(0), layout_.jerk(0)); }
  bool isInput(int variable) const {
    return isIn(variable, layout_.input(0), layout_.multiplier(0));
  }
  void refuseAcceleration(int variable) const {
    const bool is_acceleration = isIn(variable, layout_.acceleration(0), layout_.jerk(0));
    if (!is_acceleration || options_.accelerating) return;
    throw SceneError("", inQuotes(nameOf(variable)) +
                             " is 0 where speeds are constant; steady states with accelerations "
                             "are those in constant ratios (--accelerating)");
  }
  const TrimQuantity& findQuantity(const std::string& name, bool is_fixed) const {
    std::vector<std::string> names;
    for (const TrimQuantity& quantity : quantities_) {
      if (!is_fixed && quantity.variable <= layout_.time()) continue;
      // (Samples call an output so.)
      const bool is_output = quantity.variable < 0 && name == "outputs/" + quantity.name;
      if (quantity.name == name || is_output) return quantity;
      names.push_back(quantity.name);
    }
    throw SceneError("", inQuotes(name) + " cannot be " + (is_fixed ? "fixed" : "free") +
                             suggestAmong(name, names));
  }
  std::string nameOf(int variable) const {
    const auto is_it = [&](const TrimQuantity& it) { return it.variable == variable; };
    const auto found = std::find_if(quantities_.begin(), quantities_.end(), is_it);
    return found == quantities_.end() ? "" : found->name;
  }

  VectorXd unknownsOf(const VectorXd& v) const { return chooseRows(v, unknowns_); }
  VectorXd sizesOf(const VectorXd& v) const { return unknownsOf(v).cwiseAbs().cwiseMax(1.0); }
  /// Returns v with its unknowns changed by `change`.
  VectorXd moved(VectorXd v, const VectorXd& change) const {
    for (int j = 0; j < change.size(); ++j) v(unknowns_[at(j)]) += change(j);
    return v;
  }
  Linearized linearize(const VectorXd& v) const {
    Linearized it;
    MatrixXd all;
    program_->evaluate(v, it.F, all);
    it.dF = chooseColumns(all, unknowns_);
    it.sizes = sizesOf(v);
    it.rows = it.dF.cwiseAbs() * it.sizes;
    it.weights = it.rows.cwiseMax(1e-6).cwiseInverse();
    return it;
  }
  VectorXd startAt(int n) const {
    VectorXd v = base_;
    if (n == 0) return v;
    double size = 1.0;
    for (int i = 0; i < layout_.S; ++i) size = std::max(size, std::abs(base_(layout_.velocity(i))));
    constexpr double kParts[] = {1.0, 0.3, 3.0, 30.0, 10.0, 100.0};
    size *= kParts[n % 6];
    const bool is_positive = n % 4 < 2;  // most steady states are there
    for (int j = 0; j < static_cast<int>(unknowns_.size()); ++j) {
      const int variable = unknowns_[at(j)];
      const double place = halton(n, j);
      const double both = is_positive ? place : 2.0 * place - 1.0;
      if (isSpeed(variable)) {
        v(variable) = size * both;
      } else if (variable < layout_.velocity(0)) {
        if (n % 2 == 0) v(variable) = base_(variable) + kPi * (2.0 * place - 1.0);
      } else if (isInput(variable)) {
        const CommandInputSettings& input = scene_.inputs[at(variable - layout_.input(0))];
        const bool has_limits = std::isfinite(input.minimum) && std::isfinite(input.maximum);
        v(variable) = has_limits ? input.minimum + place * (input.maximum - input.minimum)
                                 : base_(variable) + size * both;
      }
    }
    return v;
  }
  /// Returns v with the best multipliers, which enter linearly.
  VectorXd fitMultipliers(const VectorXd& v) const {
    const Linearized here = linearize(v);
    if (!here.F.allFinite() || !here.dF.allFinite()) return v;
    MatrixXd by_multipliers = here.dF;
    for (int j = 0; j < by_multipliers.cols(); ++j) {
      const int variable = unknowns_[at(j)];
      const bool is_linear = isIn(variable, layout_.multiplier(0), layout_.growth()) ||
                             isIn(variable, layout_.auxiliary(0), layout_.input(0));
      if (!is_linear) by_multipliers.col(j).setZero();
    }
    return moved(v, solveLeastSquares(by_multipliers, -here.F));
  }
  /// Lets a known solution u push attempts away: the equations at v are multiplied by
  /// 1 + 1 / |v - u|^2. Returns the logarithm of the product, and its slope along `step`.
  std::pair<double, double> calcPush(const VectorXd& v, const std::vector<Attempt>& known,
                                     const VectorXd& step) const {
    double value = 0.0;
    double slope = 0.0;
    for (const Attempt& it : known) {
      const VectorXd way = countedOf((unknownsOf(v) - unknownsOf(it.v)).cwiseQuotient(sizesOf(v)));
      const double squared = std::max(way.squaredNorm(), 1e-12);
      value += std::log1p(1.0 / squared);
      slope -= 2.0 * way.dot(step) / (squared * (squared + 1.0));
    }
    return {value, slope};
  }
  Attempt iterate(VectorXd v, const std::vector<Attempt>& known) const {
    constexpr int kIterations = 80;
    constexpr double kLongest = 4.0;  // of each unknown's size
    v = fitMultipliers(v);
    Attempt attempt;
    Linearized here = linearize(v);
    for (int round = 0; round < kIterations; ++round) {
      if (!here.F.allFinite() || !here.dF.allFinite()) return attempt;
      const VectorXd weighted = here.weighted();
      attempt.v = v;
      attempt.residual = largestOf(here.F);
      attempt.weighted = largestOf(weighted);
      // The least residual that rounding of numbers of this size allows.
      const VectorXd allowed = (1e-14 * here.rows).cwiseMax(kResidual);
      attempt.is_solution = (here.F.cwiseAbs().array() <= allowed.array()).all();
      const double merit = weighted.norm();
      if (merit == 0.0) return attempt;

      VectorXd step = solveLeastSquares(here.scaled(), -weighted, 1e-11);
      const auto [push, slope] = calcPush(v, known, step);
      if (slope != 1.0) step /= 1.0 - slope;  // (Newton's iteration for the product)
      const double longest = step.cwiseAbs().maxCoeff();
      if (longest > kLongest) step *= kLongest / longest;
      bool is_better = false;
      for (double part = 1.0; part > 1e-6 && !is_better; part *= 0.5) {
        const VectorXd next = moved(v, part * here.sizes.cwiseProduct(step));
        Linearized there = linearize(next);
        const double change = calcPush(next, known, step).first - push;
        is_better = there.F.allFinite() &&
                    there.F.cwiseProduct(here.weights).norm() * std::exp(change) < merit;
        if (!is_better) continue;
        v = next;
        here = std::move(there);
      }
      if (!is_better) return attempt;
    }
    return attempt;
  }
  /// True for speeds, accelerations and inputs, which distinguish steady states.
  bool counts(int unknown) const {
    return isSpeed(unknowns_[at(unknown)]) || isInput(unknowns_[at(unknown)]);
  }
  /// Returns only these unknowns, the others 0.
  VectorXd countedOf(VectorXd unknowns) const {
    for (int j = 0; j < unknowns.size(); ++j) {
      if (!counts(j)) unknowns(j) = 0.0;
    }
    return unknowns;
  }
  /// Returns directions, in unknowns by their sizes, that the linearised equations leave free;
  /// `counted`: otherwise of angles and multipliers alone.
  MatrixXd findFreeDirections(const VectorXd& v, bool counted) const {
    const MatrixXd scaled = linearize(v).scaled();
    std::vector<int> columns;
    for (int j = 0; j < scaled.cols(); ++j) {
      if (counted || !counts(j)) columns.push_back(j);
    }
    const MatrixXd kernel = findKernel(chooseColumns(scaled, columns), 1e-8);
    MatrixXd free = MatrixXd::Zero(scaled.cols(), kernel.cols());
    for (int j = 0; j < kernel.rows(); ++j) free.row(columns[at(j)]) = kernel.row(j);
    return free;
  }
  /// True if a step along `free` leads to another steady state, and v is no double root.
  bool isOneOfMany(const VectorXd& v, const MatrixXd& free) const {
    constexpr double kWay = 0.05;  // of each unknown's size
    const VectorXd sizes = sizesOf(v);
    for (int column = 0; column < free.cols(); ++column) {
      const VectorXd direction = free.col(column);
      const double length = largestOf(countedOf(direction));
      if (length < 1e-7) continue;
      const Attempt attempt = iterate(moved(v, kWay / length * sizes.cwiseProduct(direction)), {});
      if (!attempt.is_solution) continue;
      const VectorXd change = unknownsOf(attempt.v) - unknownsOf(v);
      const double way = largestOf(countedOf(change.cwiseQuotient(sizes)));
      if (way > 0.5 * kWay && way < 2.0 * kWay) return true;
    }
    return false;
  }
  bool isSame(const VectorXd& a, const VectorXd& b) const {
    const VectorXd sizes = sizesOf(a);
    VectorXd difference = (unknownsOf(a) - unknownsOf(b)).cwiseQuotient(sizes);
    const MatrixXd free = findFreeDirections(a, false);
    difference -= free * (free.transpose() * difference);
    for (int j = 0; j < sizes.size(); ++j) {
      if (unknowns_[at(j)] >= layout_.velocity(0)) continue;
      // Angles a full turn apart are the same place.
      const double angle = difference(j) * sizes(j);
      difference(j) = angle - 2.0 * kPi * std::round(angle / (2.0 * kPi));
    }
    return difference.cwiseAbs().maxCoeff() < 1e-6;
  }
  /// Returns what is not negative where losses are in a mode; `torque`: that they hold with.
  std::vector<Node> conditionsOfLosses(const SceneHold& it, int mode, Node torque) {
    expression::Graph& graph = equations_.graph();
    const auto lineOf = [&](int side, int line) {  // s T
      const Node lambda = equations_.variable(layout_.multiplier(it.load));
      const Node load = graph.multiply(equations_.inModes(it.slope[line]), lambda);
      return graph.add(graph.multiply(graph.constant(side), load),
                       equations_.inModes(it.base[line]));
    };
    if (mode != 0) {
      const LossMode is(mode);
      return {graph.multiply(graph.constant(is.side), it.slip),
              graph.subtract(lineOf(is.side, is.line), lineOf(is.side, 1 - is.line))};
    }
    std::vector<Node> conditions;
    for (const int side : {1, -1}) {
      const Node most = graph.maximum(lineOf(side, 0), lineOf(side, 1));
      conditions.push_back(graph.subtract(most, graph.multiply(graph.constant(side), torque)));
    }
    return conditions;
  }
  /// Returns why the elements do not stay in their modes there; "" if they do.
  std::string leavesModes(const VectorXd& v) {
    expression::Graph& graph = equations_.graph();
    for (std::size_t h = 0; h < mode_.size(); ++h) {
      const SceneHold& it = equations_.holds()[h];
      const bool is_stuck = mode_[h] == 0;
      Node torque = graph.constant(0.0);  // of a row that others imply
      for (int m = scene_.constraintCount(); m < layout_.k; ++m) {
        if (equations_.constraints()[at(m)].velocity != it.slip) continue;
        torque = graph.negate(equations_.variable(layout_.multiplier(m)));
      }
      std::vector<Node> conditions;  // not negative in the mode
      if (it.load >= 0) conditions = conditionsOfLosses(it, mode_[h], torque);
      if (it.load < 0 && mode_[h] == 1) conditions.push_back(it.slip);
      if (it.load < 0 && mode_[h] == -1) conditions.push_back(graph.negate(it.slip));
      if (is_stuck && it.law.upper) conditions.push_back(graph.subtract(it.upper, torque));
      if (is_stuck && it.law.lower) conditions.push_back(graph.subtract(torque, it.lower));
      if (mode_[h] != 2 && it.law.level) conditions.push_back(it.level);
      for (const Node condition : conditions) {
        const double left = expression::Tape(graph, {condition}).evaluate(layout_.view(v))[0];
        if (left >= -1e-8 * std::max(1.0, v.cwiseAbs().maxCoeff())) continue;
        return inQuotes(it.element->nameOf(it.law)) + " would not stay " + modeName(told_mode_[h]) +
               (is_stuck ? ", by " + formatNumber(-left) + " N m" : "") +
               "; the modes are those of the scene's start";
      }
    }
    return "";
  }
  bool isStill(const VectorXd& v) const {
    return v.segment(layout_.acceleration(0), layout_.S).cwiseAbs().maxCoeff() < 1e-6;
  }
  double distance(const VectorXd& v) const {
    const VectorXd difference = unknownsOf(v) - unknownsOf(base_);
    return countedOf(difference.cwiseQuotient(sizesOf(base_))).squaredNorm();
  }
  std::string explainNone(const Attempt& nearest) {
    const VectorXd weighted = linearize(nearest.v).weighted();
    // A residual that is spread over many equations is the fault of no single one.
    constexpr double kPart = 0.1;
    std::vector<std::string> left;
    bool reads_time = false;
    for (int n = 0; n < weighted.size(); ++n) {
      if (std::abs(weighted(n)) < kPart * nearest.weighted) continue;
      const auto& [formula, name] = formulas_[at(n)];
      left.push_back(name.empty() ? "the torques" : name);
      reads_time =
          reads_time || equations_.graph().dependsOn(formula, layout_.slot(layout_.time()));
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
  TrimState stateOf(const Attempt& attempt, const MatrixXd& free) const {
    TrimState state;
    // Newton's iteration leaves such remainders of 0 if it converges slowly.
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
    point.mode = told_mode_;
    state.residual = attempt.residual;
    for (int j = 0; j < free.rows(); ++j) {
      const std::string name = nameOf(unknowns_[at(j)]);
      if (counts(j) && free.row(j).norm() > 1e-7) state.undetermined.push_back(name);
    }
    return state;
  }

  const Scene& scene_;
  const TrimOptions& options_;
  const std::vector<int> told_mode_;  ///< of elements that hold
  const std::vector<int> mode_;       ///< the same, of modesAt
  MotionEquations equations_;
  const VariableLayout& layout_;
  std::vector<NamedFormula> formulas_;
  std::vector<TrimQuantity> quantities_;
  std::unique_ptr<DifferentiatedFormulas> program_;
  std::vector<int> unknowns_;
  VectorXd base_;
};

}  // namespace

TrimResult trim(const Scene& scene, const TrimOptions& options) {
  OperatingPoint start;
  if (!scene.holdNames().empty()) start = Simulation(scene).operatingPoint();
  TrimResult result = Trim(scene, options, start).find();
  if (!start.mode.empty()) result.message += "; modes: " + describeModes(scene, start.mode);
  return result;
}

}  // namespace variator_sim
