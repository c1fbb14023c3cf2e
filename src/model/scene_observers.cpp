#include "model/scene_observers.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "model/formula_laws.h"
#include "variator_sim/expression/state_derivatives.h"

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

/// A row of C j = -c0, of a constraint or of an element that holds.
struct Row {
  std::vector<Node> C;
  std::vector<Node> D;
  Node c0;
  Node counts;  ///< 1 while the row is on, else 0
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
        shafts_(scene->shaftCount()) {
    std::set<int> inputs;
    for (int i = 0; i < scene_.inputCount(); ++i) inputs.insert(i);
    rates_ = expression::ratesOf(graph_, shafts_, inputs);
  }

  Node reaction(int i) {
    collect("R_" + scene_.shafts[at(i)]);
    return reaction_[at(i)];
  }
  Node reactionRate(int i) {
    const std::vector<Node>& x = jerks("Rr_" + scene_.shafts[at(i)]);
    Node sum = rest(i);
    for (int j = 0; j < shafts_; ++j)
      sum = plus(sum, times(inertia_[at(shafts_ * i + j)], x[at(j)]));
    return withRates(sum);
  }
  Node jerk(int i) { return withRates(jerks("j_" + scene_.shafts[at(i)])[at(i)]); }
  Node multiplier(int m) {
    const std::string name = scene_.constraints[at(m)]->name() + "_multiplier";
    const bool is_classical = scene_.principle == Principle::kGauss;
    return withRates((is_classical ? multipliers(name) : jerks(name))[at(shafts_ + m)]);
  }

 private:
  Node plus(Node a, Node b) {
    return graph_.isConstant(a, 0.0) ? b : graph_.isConstant(b, 0.0) ? a : graph_.add(a, b);
  }
  Node minus(Node a, Node b) { return graph_.isConstant(b, 0.0) ? a : graph_.subtract(a, b); }
  Node times(Node a, Node b) {
    return graph_.isConstant(a, 0.0) || graph_.isConstant(b, 0.0) ? zero() : graph_.multiply(a, b);
  }
  Node zero() { return graph_.constant(0.0); }
  Node variable(Source source, int i) { return graph_.variable(slotOf(source, i)); }

  [[noreturn]] static void refuse(const std::string& name, const std::string& reason) {
    throw SceneError(name, reason);
  }

  /// Makes J, n - Q, R and the rows. Throws SceneError for what `name` cannot be told of.
  void collect(const std::string& name) {
    for (const ConstraintPtr& it : scene_.constraints) {
      if (it->holdings().empty()) continue;
      refuse(name,
             "is not known beside the losses of " + inQuotes(it->name()) +
                 "; the columns reaction_torque, reaction_torque_rate and multiplier tell it");
    }
    if (!reaction_.empty()) return;
    const std::vector<Node> torque = sumTorques(scene_, &Torque::torques);
    for (int i = 0; i < shafts_; ++i) {
      for (int j = 0; j < shafts_; ++j) {
        const Node mean = graph_.constant(scene_.inertia(i, j));
        inertia_.push_back(i == j ? addHarmonics(graph_, scene_, i, mean) : mean);
      }
      const Node inertia = inertia_[at(shafts_ * i + i)];
      connection_.push_back(graph_.isConstant(inertia) ? zero() : connectionOf(graph_, inertia, i));
      Node sum = minus(times(connection_.back(), variable(Source::kVelocity, i)), torque[at(i)]);
      given_.push_back(sum);
      for (int j = 0; j < shafts_; ++j) {
        sum = plus(sum, times(inertia_[at(shafts_ * i + j)], variable(Source::kAcceleration, j)));
      }
      reaction_.push_back(sum);
    }
    for (const ConstraintPtr& it : scene_.constraints) {
      const std::vector<Node> C(it->row().begin(), it->row().end() - 1);
      rows_.push_back({C, it->direction().empty() ? C : it->direction(), it->row().back(),
                       graph_.constant(1.0)});
    }
    int held = 0;
    for (const TorquePtr& element : scene_.torques) {
      for (const Holding& it : element->holdings()) {
        Row row;
        const Node slip = it.slip.in(graph_);
        for (int i = 0; i < shafts_; ++i) {
          row.C.push_back(graph_.differentiate(slip, slotOf(Source::kVelocity, i)));
        }
        row.D = row.C;
        row.c0 = rate(rate(slip));
        row.counts = variable(Source::kHeld, heldSlot(HeldValue::kCounts, held++));
        rows_.push_back(std::move(row));
      }
    }
  }

  Node rate(Node node) { return graph_.totalDerivative(node, rates_); }
  /// R' without jerks.
  Node rest(int i) { return rate(reaction_[at(i)]); }

  /// Puts the rates of variables and, where they are known, of states in the place of input rates.
  Node withRates(Node node) {
    std::vector<Graph::Rate> values;
    for (const SceneState& it : scene_.states) {
      if (knows_rates_) values.emplace_back(slotOf(Source::kInputRate, it.input), it.rate);
    }
    for (int i = 0; i < scene_.inputCount(); ++i) {
      if (scene_.inputs[at(i)].kind == InputKind::kVariable)
        values.emplace_back(slotOf(Source::kInputRate, i), zero());
    }
    return values.empty() ? node : graph_.substitute(node, values);
  }

  /// Solves [J -D'; C 0] [x; mu] = b, by elimination without pivots: those of J are positive, and
  /// those of the rest are of C J^-1 D'. Rows that are off are mu = 0.
  std::vector<Node> solve(std::vector<Node> M, std::vector<Node> b) {
    const int n = static_cast<int>(b.size());
    const auto entry = [&M, n](int i, int j) -> Node& { return M[at(n * i + j)]; };
    for (int p = 0; p < n; ++p) {
      for (int i = p + 1; i < n; ++i) {
        if (graph_.isConstant(entry(i, p), 0.0)) continue;
        const Node factor = graph_.divide(entry(i, p), entry(p, p));
        for (int j = p + 1; j < n; ++j)
          entry(i, j) = minus(entry(i, j), times(factor, entry(p, j)));
        b[at(i)] = minus(b[at(i)], times(factor, b[at(p)]));
      }
    }
    for (int i = n - 1; i >= 0; --i) {
      for (int j = i + 1; j < n; ++j) b[at(i)] = minus(b[at(i)], times(entry(i, j), b[at(j)]));
      b[at(i)] = graph_.divide(b[at(i)], entry(i, i));
    }
    return b;
  }
  std::vector<Node> solveRows(std::vector<Node> force, const std::vector<Node>& inertia,
                              const std::vector<Node>& right) {
    const int n = shafts_ + static_cast<int>(rows_.size());
    std::vector<Node> M(at(n * n), zero());
    for (int i = 0; i < shafts_; ++i) {
      std::copy_n(inertia.begin() + shafts_ * i, shafts_, M.begin() + n * i);
    }
    for (int m = shafts_; m < n; ++m) {
      const Row& row = rows_[at(m - shafts_)];
      for (int i = 0; i < shafts_; ++i) {
        M[at(n * i + m)] = graph_.negate(row.D[at(i)]);
        M[at(n * m + i)] = times(row.counts, row.C[at(i)]);
      }
      M[at(n * m + m)] = graph_.subtract(graph_.constant(1.0), row.counts);
      force.push_back(times(row.counts, right[at(m - shafts_)]));
    }
    return solve(std::move(M), std::move(force));
  }

  /// Returns x, lambda of gauss.
  const std::vector<Node>& multipliers(const std::string& name) {
    collect(name);
    if (!multipliers_.empty()) return multipliers_;
    if (scene_.hasOrder3()) {
      refuse(name,
             "is not known under 'principle: gauss' beside a constraint of order 3; the "
             "column multiplier tells it");
    }
    std::vector<Node> force;
    std::vector<Node> right;
    for (int i = 0; i < shafts_; ++i) force.push_back(graph_.negate(given_[at(i)]));
    for (const Row& row : rows_) {
      right.push_back(zero());
      for (int i = 0; i < shafts_; ++i) {
        right.back() = plus(right.back(), times(row.C[at(i)], variable(Source::kAcceleration, i)));
      }
    }
    return multipliers_ = solveRows(std::move(force), inertia_, right);
  }

  /// Returns j, Lambda of generalized_gauss or lambda' of gauss.
  const std::vector<Node>& jerks(const std::string& name) {
    collect(name);
    if (!jerks_.empty()) return jerks_;
    const bool is_classical = scene_.principle == Principle::kGauss;
    if (!is_classical && !scene_.nameOfDirection().empty()) {
      refuse(name,
             "is not known beside " + inQuotes(scene_.nameOfDirection()) +
                 ", whose reaction is not along its gradient, under 'principle: "
                 "generalized_gauss'; the columns reaction_torque_rate and multiplier tell it");
    }
    std::vector<Node> force;
    std::vector<Node> right;
    std::vector<Node> matrix = inertia_;
    for (int i = 0; i < shafts_; ++i) force.push_back(graph_.negate(rest(i)));
    for (const Row& row : rows_) right.push_back(graph_.negate(row.c0));
    if (is_classical) {
      const std::vector<Node> lambda = multipliers(name);
      for (int i = 0; i < shafts_; ++i) {
        for (std::size_t m = 0; m < rows_.size(); ++m) {
          const Node D = rows_[m].D[at(i)];
          const Node of = lambda[at(shafts_) + m];
          force[at(i)] = plus(force[at(i)], times(rate(D), of));
          for (int j = 0; j < shafts_; ++j) {
            Node& entry = matrix[at(shafts_ * i + j)];
            entry =
                minus(entry, times(of, graph_.differentiate(D, slotOf(Source::kAcceleration, j))));
          }
        }
      }
    } else {
      const std::vector<Node> pull = solve(inertia_, reaction_);  // J^-1 R
      for (int i = 0; i < shafts_; ++i)
        force[at(i)] = plus(force[at(i)], times(connection_[at(i)], pull[at(i)]));
    }
    return jerks_ = solveRows(std::move(force), matrix, right);
  }

  const Scene& scene_;
  Graph& graph_;
  const bool knows_rates_;
  const int shafts_;
  std::vector<Graph::Rate> rates_;  ///< of all variables but accelerations
  std::vector<Node> inertia_;       ///< J_ij
  std::vector<Node> connection_;    ///< 1/2 J_i' omega_i
  std::vector<Node> given_;         ///< n - Q
  std::vector<Node> reaction_;      ///< R
  std::vector<Row> rows_;
  std::vector<Node> multipliers_;
  std::vector<Node> jerks_;
};

/// The torque of an element on a shaft, with that which its stuck parts hold with:
///     Q_i + sum C_i lambda
Node torqueOn(const Scene& scene, const Torque& element, int shaft, Node applied, int first_hold) {
  Graph& graph = *scene.graph;
  Node sum = applied;
  for (const Holding& it : element.holdings()) {
    const Node C = graph.differentiate(it.slip.in(graph), slotOf(Source::kVelocity, shaft));
    const Node lambda =
        graph.variable(slotOf(Source::kHeld, heldSlot(HeldValue::kMultiplier, first_hold++)));
    sum = graph.add(sum, graph.multiply(C, lambda));
  }
  return sum;
}

}  // namespace

void nameObservers(Scene* scene, bool knows_rates) {
  SceneSymbols& symbols = scene->symbols;
  Graph& graph = *scene->graph;
  symbols.observed.clear();
  // (An input that has such a name keeps it.)
  const auto add = [&](const std::string& name, std::function<Node()> make) {
    if (symbols.inputs.count(name) == 0 && symbols.played.count(name) == 0)
      symbols.observed.emplace(name, std::move(make));
  };
  const auto addOutputs = [&](const auto& element) {
    const NamedOutputs& outputs = element.outputs();
    for (std::size_t i = 0; i < outputs.names().size(); ++i) {
      add(element.name() + "_" + outputs.names()[i], [node = outputs.nodes()[i]] { return node; });
    }
  };
  int held = 0;
  const auto addHolds = [&](const Law& element) {
    for (const Holding& it : element.holdings()) {
      std::string name = element.nameOf(it);
      std::replace(name.begin(), name.end(), '/', '_');
      const Node slip = it.slip.in(graph);
      const int slot = slotOf(Source::kHeld, heldSlot(HeldValue::kMode, held++));
      add(name + "_slip", [slip] { return slip; });
      add(name + "_mode", [&graph, slot] { return graph.variable(slot); });
    }
  };
  for (const TorquePtr& torque : scene->torques) {
    addOutputs(*torque);
    const int first = held;
    const Torque* const it = torque.get();
    addHolds(*it);
    add(it->name() + "_power", [scene, it, first] {
      Node power = scene->graph->constant(0.0);
      for (const auto& [shaft, value] : it->torques()) {
        const Node velocity = scene->graph->variable(slotOf(Source::kVelocity, shaft));
        const Node whole = torqueOn(*scene, *it, shaft, value, first);
        power = scene->graph->add(power, scene->graph->multiply(whole, velocity));
      }
      return power;
    });
    if (it->torques().empty()) continue;
    add(it->name() + "_torque", [scene, it, first] {
      const auto& [shaft, value] = it->torques()[0];
      return torqueOn(*scene, *it, shaft, value, first);
    });
  }
  const auto reactions = std::make_shared<Reactions>(scene, knows_rates);
  for (int m = 0; m < scene->constraintCount(); ++m) {
    const Constraint& constraint = *scene->constraints[at(m)];
    addOutputs(constraint);
    addHolds(constraint);
    add(constraint.name() + "_multiplier", [reactions, m] { return reactions->multiplier(m); });
  }
  for (int i = 0; i < scene->shaftCount(); ++i) {
    const std::string& shaft = scene->shafts[at(i)];
    add("R_" + shaft, [reactions, i] { return reactions->reaction(i); });
    add("Rr_" + shaft, [reactions, i] { return reactions->reactionRate(i); });
    add("j_" + shaft, [reactions, i] { return reactions->jerk(i); });
  }
}

}  // namespace variator_sim
