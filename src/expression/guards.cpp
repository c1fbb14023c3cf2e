#include "variator_sim/expression/guards.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "interval_program.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
/// The part of themselves by which operands are widened to see a formula's rounding.
constexpr double kRounding = 16.0 * std::numeric_limits<double>::epsilon();

/// Returns `node` as a linear form of the state and the time, if it is written as one.
std::optional<LinearValue> findLinearValue(const Graph& graph, Node node) {
  using Form = std::map<int, double>;  // by slot; kNumber: the constant term
  constexpr int kNumber = -1;
  std::map<int, Form> forms;
  for (const int i : graph.listReachable({node})) {
    const Graph::Entry& entry = graph.entry({i});
    Form form;
    const auto add = [&](int operand, double factor) {
      for (const auto& [slot, value] : forms[entry.operands[operand]]) form[slot] += factor * value;
    };
    const auto isNumber = [&](int operand) { return graph.isConstant({entry.operands[operand]}); };
    const auto numberOf = [&](int operand) {
      return graph.constantValue({entry.operands[operand]});
    };
    if (entry.operation == Operation::kConstant) {
      form[kNumber] = entry.value;
    } else if (entry.operation == Operation::kVariable &&
               sourceOf(entry.slot) <= Source::kAcceleration) {
      form[entry.slot] = 1.0;
    } else if (entry.operation == Operation::kNegate) {
      add(0, -1.0);
    } else if (entry.operation == Operation::kAdd || entry.operation == Operation::kSubtract) {
      add(0, 1.0);
      add(1, entry.operation == Operation::kAdd ? 1.0 : -1.0);
    } else if (entry.operation == Operation::kMultiply && (isNumber(0) || isNumber(1))) {
      add(isNumber(0) ? 1 : 0, numberOf(isNumber(0) ? 0 : 1));
    } else if (entry.operation == Operation::kDivide && isNumber(1)) {
      add(0, 1.0 / numberOf(1));
    } else {
      return std::nullopt;
    }
    forms[i] = std::move(form);
  }
  LinearValue linear;
  for (const auto& [slot, value] : forms[node.index]) {
    if (!std::isfinite(value)) return std::nullopt;
    if (slot == kNumber) continue;
    const int kind = static_cast<int>(sourceOf(slot)) - static_cast<int>(Source::kAngle);
    (kind < 0 ? linear.time : linear.state[kind * kMaxShafts + indexOf(slot)]) = value;
  }
  return linear;
}

/// A switching function given by the value of a formula.
class FormulaGuard : public Guard {
 public:
  int branch(const StateView& state) const override { return branchOf(distance(state)); }
  bool mayLeave(const StateBox& box, int branch) const override {
    const Interval range = enclosure_.evaluate(box);
    if (branch == kOnEdge) return range.low != range.high || branchOf(range.low) != kOnEdge;
    const Interval kept = bounds(branch);
    const bool is_above = std::isinf(kept.low) || range.low > kept.low;
    const bool is_below = std::isinf(kept.high) || range.high < kept.high;
    return !(is_above && is_below);
  }
  bool isOpaque() const override { return is_opaque_; }
  double distance(const StateView& state) const override {
    double value;
    tape_.evaluate(state, &value);
    return value;
  }
  Interval rate(const StateBox& box) const override {
    return rate_ ? rate_->evaluate(box) : Guard::rate(box);
  }
  const LinearValue* linear() const override { return linear_ ? &*linear_ : nullptr; }
  StateSet reads() const override {
    return rate_ ? enclosure_.reads() | rate_->reads() : enclosure_.reads();
  }
  bool readsTime() const override { return enclosure_.readsTime() || enclosure_.readsInputs(); }
  bool readsInputs() const override { return enclosure_.readsInputs(); }

 protected:
  FormulaGuard(Graph& graph, Node node, bool jumps, const char* function = "")
      : Guard(jumps, function),
        tape_(graph, {node}),
        enclosure_(graph, node),
        rate_(rateOf(graph, node)),
        linear_(findLinearValue(graph, node)),
        is_opaque_(graph.hasOpaque({node})) {}
  Interval enclose(const StateBox& box, double rounding = 0.0) const {
    return enclosure_.evaluate(box, rounding);
  }
  virtual int branchOf(double value) const = 0;

 private:
  /// Returns nothing for formulas that jump or read a variable whose rate a box does not hold.
  static std::optional<IntervalProgram> rateOf(Graph& graph, Node node) {
    std::vector<Graph::Rate> rates;
    for (const int i : graph.listReachable({node})) {
      const Graph::Entry& entry = graph.entry({i});
      const Operation operation = entry.operation;
      if (operation == Operation::kSign || operation == Operation::kSelect) return std::nullopt;
      if (operation != Operation::kVariable && operation != Operation::kOpaque) continue;
      const Source source =
          operation == Operation::kVariable ? sourceOf(entry.slot) : Source::kInput;
      const int index = indexOf(entry.slot);
      const int slot = entry.slot;
      if (source == Source::kTime) {
        rates.emplace_back(slot, graph.constant(1.0));
      } else if (source == Source::kAngle || source == Source::kVelocity) {
        const Source next = source == Source::kAngle ? Source::kVelocity : Source::kAcceleration;
        rates.emplace_back(slot, graph.variable(slotOf(next, index)));
      } else {
        return std::nullopt;
      }
    }
    return IntervalProgram(graph, graph.totalDerivative(node, rates));
  }

  Tape tape_;
  IntervalProgram enclosure_;
  std::optional<IntervalProgram> rate_;
  std::optional<LinearValue> linear_;
  bool is_opaque_;  ///< intervals cannot enclose it
};

/// The sign of a formula as mode.
class SignGuard final : public FormulaGuard {
 public:
  SignGuard(Graph& graph, Node node, bool jumps, const char* function = "")
      : FormulaGuard(graph, node, jumps, function) {}

  bool isRounding(const StateBox& box) const override {
    const Interval range = enclose(box);
    const Interval rounded = enclose(box, kRounding);
    const double noise = std::max(range.low - rounded.low, rounded.high - range.high);
    return std::isfinite(noise) && range.low >= -noise && range.high <= noise;
  }
  Interval bounds(int branch) const override {
    return branch > 0 ? Interval{0.0, kUnbounded} : Interval{-kUnbounded, 0.0};
  }

 private:
  int branchOf(double value) const override {
    return value > 0.0 ? 1 : (value < 0.0 ? -1 : kOnEdge);
  }
};

/// The piece of a table, between two of its points, that contains the value of a formula.
///
/// At a point of a smooth table only the third derivative jumps. If the argument passes it by less
/// than `kSlack` of the distance to the next, the value keeps all digits: an argument that settles
/// on a point (an idle speed, a released pedal) must not cause endless event localization. Kinks
/// and jumps of other tables have no slack.
class PointsGuard final : public FormulaGuard {
 public:
  PointsGuard(Graph& graph, const Passage& passage)
      : FormulaGuard(graph, passage.argument, passage.smoothness == 0),
        points_(passage.points),
        is_smooth_(passage.smoothness > 1) {
    const std::vector<double>& points = points_;
    for (std::size_t k = 0; k < points.size(); ++k) {
      double distance = kUnbounded;
      if (k > 0) distance = points[k] - points[k - 1];
      if (k + 1 < points.size()) distance = std::min(distance, points[k + 1] - points[k]);
      slack_.push_back(is_smooth_ ? kSlack * distance : 0.0);
    }
  }

  bool isRounding(const StateBox& box) const override {
    if (is_smooth_) return false;
    const Interval range = enclose(box);
    const Interval rounded = enclose(box, kRounding);
    const double noise = std::max(range.low - rounded.low, rounded.high - range.high);
    const auto point = std::lower_bound(points_.begin(), points_.end(), range.high - noise);
    return std::isfinite(noise) && point != points_.end() && range.low >= *point - noise &&
           range.high <= *point + noise;
  }
  Interval bounds(int branch) const override {
    const auto below = static_cast<std::size_t>(branch);
    return {branch == 0 ? -kUnbounded : points_[below - 1] - slack_[below - 1],
            below == points_.size() ? kUnbounded : points_[below] + slack_[below]};
  }

 private:
  static constexpr double kSlack = 1e-5;
  int branchOf(double value) const override {
    const auto above = std::lower_bound(points_.begin(), points_.end(), value);
    const bool on_point = above != points_.end() && *above == value;
    return on_point || std::isnan(value) ? kOnEdge : static_cast<int>(above - points_.begin());
  }
  std::vector<double> points_;
  std::vector<double> slack_;  ///< slack of each point
  bool is_smooth_;
};

/// Limits steps: a switching function repeats its operands, so nested ones could fill any memory.
void count(Graph& graph, Node node) {
  constexpr std::size_t kMostSteps = 500000;
  if (graph.countGuardSteps(graph.listReachable({node}).size(), kMostSteps)) return;
  throw std::length_error(
      "in the scene's formulas abs, min, max, sign, clamp, if and tables stand too often within "
      "each other");
}

/// A function with branches, as formulas write it. Functions that jump come last.
struct Branching {
  Operation operation;
  const char* function;
  bool jumps;
};
constexpr Branching kBranching[] = {{Operation::kAbs, "abs", false},
                                    {Operation::kMin, "min", false},
                                    {Operation::kMax, "max", false},
                                    {Operation::kSign, "sign", true},
                                    {Operation::kSelect, "if", true}};

bool isTime(const Graph::Entry& entry) {
  return entry.operation == Operation::kVariable && entry.slot == slotOf(Source::kTime);
}

}  // namespace

std::vector<Passage> findPassages(const Graph& graph, const std::vector<Node>& nodes) {
  std::set<std::tuple<int, std::vector<double>, int>> found;
  for (const int i : graph.listReachable(nodes)) {
    const Graph::Entry& entry = graph.entry({i});
    if (entry.operation == Operation::kTable) {
      const Table& table = *graph.tableOf(entry);
      found.emplace(entry.operands[0], table.points(), table.smoothness());
    } else if (entry.operation == Operation::kTable2) {
      const Table2& table = *graph.table2Of(entry);
      found.emplace(entry.operands[0], table.pointsX(), table.smoothness());
      found.emplace(entry.operands[1], table.pointsY(), table.smoothness());
    }
  }
  std::vector<Passage> passages;
  for (const auto& [argument, points, smoothness] : found) {
    if (graph.isConstant(Node{argument})) continue;
    passages.push_back({Node{argument}, points, smoothness});
  }
  return passages;
}

std::vector<Branch> findBranches(Graph& graph, const std::vector<Node>& nodes) {
  // Key: the index of the node whose sign decides; value: the last such entry of kBranching.
  std::map<int, const Branching*> found;
  for (const int i : graph.listReachable(nodes)) {
    const Graph::Entry entry = graph.entry({i});
    const auto* const it =
        std::find_if(std::begin(kBranching), std::end(kBranching),
                     [&](const Branching& one) { return one.operation == entry.operation; });
    if (it == std::end(kBranching)) continue;
    const Node first{entry.operands[0]};
    const Node node =
        operandCount(entry.operation) == 1 ? first : graph.subtract(first, {entry.operands[1]});
    if (graph.isConstant(node)) continue;
    const Branching*& known = found.emplace(node.index, it).first->second;
    known = std::max(known, it);
  }
  std::vector<Branch> branches;
  branches.reserve(found.size());
  for (const auto& [index, it] : found) branches.push_back({Node{index}, it->function, it->jumps});
  return branches;
}

std::vector<double> findInstants(const Graph& graph, const std::vector<Node>& nodes) {
  std::vector<double> instants;
  for (const Passage& it : findPassages(graph, nodes)) {
    if (!isTime(graph.entry(it.argument)) || it.smoothness < 3) continue;
    instants.insert(instants.end(), it.points.begin(), it.points.end());
  }
  return instants;
}

std::vector<GuardPtr> findGuards(Graph& graph, const std::vector<Node>& nodes) {
  std::vector<GuardPtr> guards;
  for (const Branch& it : findBranches(graph, nodes)) {
    count(graph, it.argument);
    guards.push_back(std::make_shared<SignGuard>(graph, it.argument, it.jumps, it.function));
  }
  for (const Passage& it : findPassages(graph, nodes)) {
    if (isTime(graph.entry(it.argument)) && it.smoothness == 3) continue;
    count(graph, it.argument);
    if (graph.hasOpaque({it.argument})) {
      for (const double point : it.points) {
        const Node distance = graph.subtract(it.argument, graph.constant(point));
        guards.push_back(std::make_shared<SignGuard>(graph, distance, it.smoothness == 0));
      }
      continue;
    }
    guards.push_back(std::make_shared<PointsGuard>(graph, it));
  }
  return guards;
}

}  // namespace variator_sim::expression
