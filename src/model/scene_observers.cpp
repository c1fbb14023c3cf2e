#include <algorithm>
#include <functional>
#include <memory>
#include <utility>

#include "model/formula_laws.h"
#include "model/scene_readers.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/units.h"

namespace variator_sim {
namespace {

using expression::Graph;
using expression::heldSlot;
using expression::HeldValue;
using expression::Node;
using expression::slotOf;
using expression::Source;

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

using Vector = std::vector<Expression>;

/// A row of C j = -c0, of a constraint or of an element that holds.
struct Row {
  Vector C;
  Vector D;
  Expression c0;
  Expression counts;  ///< 1 while the row is on, else 0
};

/// Reactions, their rates, multipliers and jerks as formulas of t, phi, omega, epsilon. With
/// R = J epsilon + n - Q, and R' = J j + rest, where `rest` has no jerk,
///     generalized_gauss   J j - C' Lambda  = -rest + 1/2 J' omega J^-1 R,        C j = -c0
///     gauss               J x - D' lambda  = Q - n,                               C x = C epsilon
///                         (J - lambda dD/depsilon) j - D' lambda' = -rest + D'' lambda,  C j = -c0
/// where D'' stands for the rate of D' with constant accelerations.
class Reactions {
 public:
  Reactions(Scene* scene, bool knows_rates)
      : scene_(*scene),
        graph_(*scene->graph),
        knows_rates_(knows_rates),
        shafts_(scene->shaftCount()),
        rates_(ratesOfAll(graph_, scene_)) {}

  Node reaction(int i) {
    collect("R_" + scene_.shafts[at(i)]);
    return reaction_[at(i)].in(graph_);
  }
  Node reactionRate(int i) {
    const Vector& x = jerks("Rr_" + scene_.shafts[at(i)]);
    Expression sum = rate(reaction_[at(i)]);
    for (int j = 0; j < shafts_; ++j) sum += inertia_[at(shafts_ * i + j)] * x[at(j)];
    return withRates(sum);
  }
  Node jerk(int i) { return withRates(jerks("j_" + scene_.shafts[at(i)])[at(i)]); }
  Node multiplier(int m) {
    const std::string name = scene_.constraints[at(m)]->name() + "_multiplier";
    return withRates((isClassical() ? multipliers(name) : jerks(name))[at(shafts_ + m)]);
  }

 private:
  bool isClassical() const { return scene_.principle == Principle::kGauss; }
  Expression of(Node node) { return {graph_, node}; }
  Expression variable(Source source, int i) { return of(graph_.variable(slotOf(source, i))); }
  Expression by(const Expression& of, Source source, int i) {
    return {graph_, graph_.differentiate(of.in(graph_), slotOf(source, i))};
  }
  /// Returns the derivative by time without accelerations' rates.
  Expression rate(const Expression& it) {
    return of(graph_.totalDerivative(it.in(graph_), rates_));
  }

  /// Makes J, n - Q, R and the rows. Throws SceneError for what `name` cannot be told of.
  void collect(const std::string& name) {
    for (const ConstraintPtr& it : scene_.constraints) {
      if (it->holdings().empty()) continue;
      throw SceneError(name, "is not known beside the losses of " + inQuotes(it->name()) +
                                 "; the columns reaction_torque, reaction_torque_rate and "
                                 "multiplier tell it");
    }
    if (!scene_.inertia_formulas.empty()) {
      throw SceneError(name,
                       "is not known beside inertias that are formulas; the columns "
                       "reaction_torque, reaction_torque_rate and multiplier tell it");
    }
    if (!reaction_.empty()) return;
    scene_.formulas_read_inertia = true;
    for (const Node node : inertiaOf(graph_, scene_)) inertia_.push_back(of(node));
    const std::vector<Node> torque = sumTorques(scene_);
    for (int i = 0; i < shafts_; ++i) {
      connection_.push_back(of(connectionOf(graph_, inertia_[at(shafts_ * i + i)].in(graph_), i)));
      given_.push_back(connection_.back() * variable(Source::kVelocity, i) - of(torque[at(i)]));
      reaction_.push_back(given_.back());
      for (int j = 0; j < shafts_; ++j)
        reaction_.back() += inertia_[at(shafts_ * i + j)] * variable(Source::kAcceleration, j);
    }
    const auto all = [this](auto begin, auto end) {
      Vector made;
      for (; begin != end; ++begin) made.push_back(of(*begin));
      return made;
    };
    for (const ConstraintPtr& it : scene_.constraints) {
      const Vector C = all(it->row().begin(), it->row().end() - 1);
      const Vector D = all(it->direction().begin(), it->direction().end());
      rows_.push_back({C, D.empty() ? C : D, of(it->row().back()), 1.0});
    }
    int held = 0;
    for (const TorquePtr& element : scene_.torques) {
      for (const Holding& it : element->holdings()) {
        Vector C;
        for (int i = 0; i < shafts_; ++i) C.push_back(by(it.slip, Source::kVelocity, i));
        rows_.push_back({C, C, rate(rate(it.slip)),
                         variable(Source::kHeld, heldSlot(HeldValue::kCounts, held++))});
      }
    }
  }

  /// Puts the rates of variables and, where they are known, of states in the place of input rates.
  Node withRates(const Expression& it) {
    std::vector<Graph::Rate> values;
    for (const SceneState& state : scene_.states) {
      if (knows_rates_) values.emplace_back(slotOf(Source::kInputRate, state.input), state.rate);
    }
    for (int i = 0; i < scene_.inputCount(); ++i) {
      if (scene_.inputs[at(i)].kind == InputKind::kVariable)
        values.emplace_back(slotOf(Source::kInputRate, i), graph_.constant(0.0));
    }
    return graph_.substitute(it.in(graph_), values);
  }

  /// Solves M x = b by elimination without pivots: those of J are positive, and those behind them
  /// are of C J^-1 D'.
  static Vector solve(Vector M, Vector b) {
    const int n = static_cast<int>(b.size());
    for (int p = 0; p < n; ++p) {
      for (int i = p + 1; i < n; ++i) {
        const Expression factor = M[at(n * i + p)] / M[at(n * p + p)];
        for (int j = p + 1; j < n; ++j) M[at(n * i + j)] -= factor * M[at(n * p + j)];
        b[at(i)] -= factor * b[at(p)];
      }
    }
    for (int i = n - 1; i >= 0; --i) {
      for (int j = i + 1; j < n; ++j) b[at(i)] -= M[at(n * i + j)] * b[at(j)];
      b[at(i)] = b[at(i)] / M[at(n * i + i)];
    }
    return b;
  }
  /// Solves [J -D'; C 0] [x; mu] = [force; right]; of rows that are off mu = 0.
  Vector solveRows(const Vector& inertia, Vector force, const Vector& right) {
    const int n = shafts_ + static_cast<int>(rows_.size());
    Vector M(at(n * n));
    for (int i = 0; i < shafts_; ++i) {
      std::copy_n(inertia.begin() + shafts_ * i, shafts_, M.begin() + n * i);
    }
    for (int m = shafts_; m < n; ++m) {
      const Row& row = rows_[at(m - shafts_)];
      for (int i = 0; i < shafts_; ++i) {
        M[at(n * i + m)] = -row.D[at(i)];
        M[at(n * m + i)] = row.counts * row.C[at(i)];
      }
      M[at(n * m + m)] = 1.0 - row.counts;
      force.push_back(row.counts * right[at(m - shafts_)]);
    }
    return solve(std::move(M), std::move(force));
  }

  /// Returns x, lambda of gauss.
  const Vector& multipliers(const std::string& name) {
    collect(name);
    if (!multipliers_.empty()) return multipliers_;
    if (scene_.hasOrder3()) {
      throw SceneError(name,
                       "is not known under 'principle: gauss' beside a constraint of order 3; "
                       "the column multiplier tells it");
    }
    Vector force;
    Vector right(rows_.size());
    for (int i = 0; i < shafts_; ++i) {
      force.push_back(-given_[at(i)]);
      for (std::size_t m = 0; m < rows_.size(); ++m)
        right[m] += rows_[m].C[at(i)] * variable(Source::kAcceleration, i);
    }
    return multipliers_ = solveRows(inertia_, std::move(force), right);
  }

  /// Returns j, Lambda of generalized_gauss or lambda' of gauss.
  const Vector& jerks(const std::string& name) {
    collect(name);
    if (!jerks_.empty()) return jerks_;
    if (!isClassical() && !scene_.nameOfDirection().empty()) {
      throw SceneError(name, "is not known beside " + inQuotes(scene_.nameOfDirection()) +
                                 ", whose reaction is not along its gradient, under 'principle: "
                                 "generalized_gauss'; the columns reaction_torque_rate and "
                                 "multiplier tell it");
    }
    Vector force;
    Vector right;
    Vector matrix = inertia_;
    for (const Row& row : rows_) right.push_back(-row.c0);
    const Vector known = isClassical() ? multipliers(name) : solve(inertia_, reaction_);
    for (int i = 0; i < shafts_; ++i) {
      force.push_back(-rate(reaction_[at(i)]));
      if (!isClassical()) force.back() += connection_[at(i)] * known[at(i)];  // J^-1 R
      for (std::size_t m = 0; m < rows_.size() && isClassical(); ++m) {
        const Expression& D = rows_[m].D[at(i)];
        const Expression& lambda = known[at(shafts_) + m];
        force.back() += rate(D) * lambda;
        for (int j = 0; j < shafts_; ++j)
          matrix[at(shafts_ * i + j)] -= lambda * by(D, Source::kAcceleration, j);
      }
    }
    return jerks_ = solveRows(matrix, std::move(force), right);
  }

  Scene& scene_;
  Graph& graph_;
  const bool knows_rates_;
  const int shafts_;
  std::vector<Graph::Rate> rates_;  ///< of all variables but accelerations
  Vector inertia_;                  ///< J_ij
  Vector connection_;               ///< 1/2 J_i' omega_i
  Vector given_;                    ///< n - Q
  Vector reaction_;                 ///< R
  std::vector<Row> rows_;
  Vector multipliers_;
  Vector jerks_;
};

/// The torque of an element on a shaft, with that which its stuck parts hold with:
///     Q_i + sum C_i lambda
Expression torqueOn(Graph& graph, const Torque& element, int shaft, Node applied, int first_hold) {
  Expression sum(graph, applied);
  for (const Holding& it : element.holdings()) {
    const int velocity = slotOf(Source::kVelocity, shaft);
    const Expression C(graph, graph.differentiate(it.slip.in(graph), velocity));
    const int lambda = slotOf(Source::kHeld, heldSlot(HeldValue::kMultiplier, first_hold++));
    sum += C * Expression(graph, graph.variable(lambda));
  }
  return sum;
}

using Name = std::function<void(const std::string&, std::function<Node()>)>;

/// Names the outputs of an element and what it holds with; returns the number of its holds.
int nameLaw(const Law& element, int first_hold, const Name& add) {
  Graph& graph = element.graph();
  for (const auto& [name, node] : element.outputs()) {
    add(element.name() + "_" + name, [value = node] { return value; });
  }
  int hold = first_hold;
  for (const Holding& it : element.holdings()) {
    std::string name = element.nameOf(it);
    std::replace(name.begin(), name.end(), '/', '_');
    const Node slip = it.slip.in(graph);
    const int mode = slotOf(Source::kHeld, heldSlot(HeldValue::kMode, hold));
    const int multiplier = slotOf(Source::kHeld, heldSlot(HeldValue::kMultiplier, hold++));
    add(name + "_slip", [slip] { return slip; });
    add(name + "_mode", [&graph, mode] { return graph.variable(mode); });
    if (it.losses) continue;
    add(name + "_torque", [&graph, slides = it.torque.in(graph), multiplier] {
      return graph.subtract(slides, graph.variable(multiplier));
    });
  }
  return hold - first_hold;
}

void nameTorque(const Torque* it, int first_hold, const Name& add) {
  Graph& graph = it->graph();
  add(it->name() + "_power", [&graph, it, first_hold] {
    Expression power = 0.0;
    for (const auto& [shaft, value] : it->torques()) {
      const Expression velocity(graph, graph.variable(slotOf(Source::kVelocity, shaft)));
      power += torqueOn(graph, *it, shaft, value, first_hold) * velocity;
    }
    return power.in(graph);
  });
  if (it->torques().empty()) return;
  add(it->name() + "_torque", [&graph, it, first_hold] {
    const auto& [shaft, value] = it->torques()[0];
    return torqueOn(graph, *it, shaft, value, first_hold).in(graph);
  });
}

}  // namespace

void nameObservers(Scene* scene, bool knows_rates) {
  SceneSymbols& symbols = scene->symbols;
  symbols.observed.clear();
  const Name add = [&symbols](const std::string& name, std::function<Node()> make) {
    // (An input that has such a name keeps it.)
    if (symbols.inputs.count(name) == 0 && symbols.played.count(name) == 0)
      symbols.observed.emplace(name, std::move(make));
  };
  const auto reactions = std::make_shared<Reactions>(scene, knows_rates);
  int held = 0;  // elements that hold, so far
  for (const TorquePtr& torque : scene->torques) {
    const int first = held;
    held += nameLaw(*torque, first, add);
    nameTorque(torque.get(), first, add);
  }
  for (int m = 0; m < scene->constraintCount(); ++m) {
    const Constraint& constraint = *scene->constraints[at(m)];
    held += nameLaw(constraint, held, add);
    add(constraint.name() + "_multiplier", [reactions, m] { return reactions->multiplier(m); });
  }
  for (int i = 0; i < scene->shaftCount(); ++i) {
    const std::string& shaft = scene->shafts[at(i)];
    add("R_" + shaft, [reactions, i] { return reactions->reaction(i); });
    add("Rr_" + shaft, [reactions, i] { return reactions->reactionRate(i); });
    add("j_" + shaft, [reactions, i] { return reactions->jerk(i); });
  }
}

void namePrinciple(Scene* scene) {
  int number = kFirstObserved;
  const auto add = [&](const std::string& name) {
    scene->symbols.observed.emplace(name, [&graph = *scene->graph, input = number++] {
      return graph.variable(slotOf(Source::kInput, input));
    });
  };
  for (const std::string& shaft : scene->shafts) add("G_" + shaft);
  add("Z");
  add("constraint_measure");
}

Output readOutput(ComponentContext& context) {
  Graph& graph = *context.graph();
  ParameterReader& reader = context.parameters();
  reader.allow("unit");
  Output output;
  output.name = context.name();
  output.si = readFormula(context, "expression", expression::FormulaKind::kOutput, graph);
  output.node = output.si;
  if (reader.has("unit")) {
    output.unit = reader.text("unit");
    const Unit unit = requireUnit(output.unit, reader.keyPath("unit"));
    if (unit.zero != 0.0) output.node = graph.subtract(output.node, graph.constant(unit.zero));
    output.node = graph.divide(graph.multiply(output.node, graph.constant(unit.denominator)),
                               graph.constant(unit.numerator));
  }
  const std::set<int> inputs = expression::indicesIn(graph, {output.node}, Source::kInput);
  output.reads_principle = !inputs.empty() && *inputs.rbegin() >= kFirstObserved;
  return output;
}

}  // namespace variator_sim
