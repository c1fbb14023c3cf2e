#include "analysis/motion_equations.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/decompositions.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using expression::Graph;
using expression::Node;
using expression::slotOf;
using expression::Source;

std::vector<int> modesAt(const Scene& scene, const OperatingPoint& point) {
  std::vector<int> mode = point.mode;
  const std::vector<SceneHold> holds = collectHolds(scene);
  for (std::size_t h = 0; h < mode.size(); ++h) {
    if (holds[h].load < 0 || mode[h] == 0) continue;
    Graph& graph = *scene.graph;
    StateView state{};
    state.time = point.time;
    state.angle = point.angle.data();
    state.velocity = point.velocity.data();
    double slip = expression::Tape(graph, {holds[h].slip}).evaluate(state)[0];
    // (At rest it slides to the side to which it begins to move.)
    if (slip == 0.0) {
      state.velocity = point.acceleration.data();
      slip = expression::Tape(graph, {holds[h].slip}).evaluate(state)[0];
    }
    mode[h] = (slip < 0.0 ? -1 : 1) * (mode[h] > 0 ? 1 : 3);
  }
  return mode;
}

int VariableLayout::slot(int n) const {
  if (n == 0) return slotOf(Source::kTime);
  if (n < velocity(0)) return slotOf(Source::kAngle, n - angle(0));
  if (n < acceleration(0)) return slotOf(Source::kVelocity, n - velocity(0));
  if (n < input(0)) return slotOf(Source::kAcceleration, n - acceleration(0));
  if (n < inputRate(0)) return slotOf(Source::kInput, n - input(0));
  if (n < inputSecondRate(0)) return slotOf(Source::kInputRate, n - inputRate(0));
  return slotOf(Source::kInputSecondRate, n - inputSecondRate(0));
}

StateView VariableLayout::view(const VectorXd& v) const {
  const double* const data = v.data();
  return {data[0],         data + angle(0),     data + velocity(0),       data + acceleration(0),
          data + input(0), data + inputRate(0), data + inputSecondRate(0)};
}

VectorXd VariableLayout::valuesAt(const OperatingPoint& point) const {
  VectorXd v = VectorXd::Zero(size());
  v(time()) = point.time;
  for (const auto& [values, first] : {std::pair{&point.angle, angle(0)},
                                      {&point.velocity, velocity(0)},
                                      {&point.acceleration, acceleration(0)},
                                      {&point.input, input(0)},
                                      {&point.input_rate, inputRate(0)},
                                      {&point.input_second_rate, inputSecondRate(0)}}) {
    std::copy(values->begin(), values->end(), v.data() + first);
  }
  return v;
}

MotionEquations::MotionEquations(const Scene& scene, const std::vector<int>& mode,
                                 bool with_rates_of_d)
    : scene_(scene),
      formulas_(collectFormulas(scene)),
      graph_(*scene.graph),
      J_(graph_, scene),
      with_rates_of_d_(with_rates_of_d) {
  scene.refuseDelays("linear models, steady states and checks of the principle have no past here");
  if (!scene.nameOfDirection().empty()) {
    throw SceneError(
        scene.nameOfDirection(),
        "has a reaction that is not along its gradient, which linear models and steady "
        "states here do not know; allowed: 'reaction: gradient'");
  }
  layout_.S = scene.shaftCount();
  layout_.k = scene.constraintCount();
  layout_.U = scene.inputCount();
  rates_ = ratesOfAll(graph_, scene);
  for (int i = 0; i < layout_.S; ++i) {
    rates_.emplace_back(layout_.slot(layout_.acceleration(i)), variable(layout_.jerk(i)));
  }
  for (int m = 0; m < layout_.k; ++m) {
    const Constraint& it = *scene.constraints[at(m)];
    constraints_.push_back(rowOf(m, it.order(), "constraint " + inQuotes(it.name())));
  }
  takeModes(mode);
}

void MotionEquations::takeModes(const std::vector<int>& mode) {
  for (std::size_t h = 0; h < mode.size(); ++h) {
    const SceneHold& hold = holds()[h];
    const bool slides = mode[h] != 0 && mode[h] != 2;
    sides_.emplace_back(graph_.entry(hold.side).slot, graph_.constant(slides ? mode[h] : 0.0));
    const std::size_t before = constraints_.size();
    if (mode[h] == 0) addStuck(static_cast<int>(h));
    if (mode[h] != 0 && hold.load >= 0) refuseLosses(hold, LossMode(mode[h]));
    const bool counts = constraints_.size() > before;
    const auto set = [&](expression::HeldValue value, Node node) {
      const int slot = expression::heldSlot(value, static_cast<int>(h));
      sides_.emplace_back(slotOf(Source::kHeld, slot), node);
    };
    const int told = hold.load >= 0 && slides ? (LossMode(mode[h]).line == 0 ? 1 : -1) : mode[h];
    set(expression::HeldValue::kMode, graph_.constant(told));
    set(expression::HeldValue::kCounts, graph_.constant(counts ? 1.0 : 0.0));
    set(expression::HeldValue::kMultiplier,
        counts ? variable(layout_.multiplier(static_cast<int>(before))) : graph_.constant(0.0));
  }
  for (Node& torque : formulas_.torque) torque = inModes(torque);
  layout_.k = static_cast<int>(constraints_.size());
  for (ConstraintFormulas& it : constraints_) {
    for (Node& D : it.D) {
      D = inModes(D);
      if (with_rates_of_d_) it.D_rate.push_back(rate(D));
    }
  }
}

void MotionEquations::refuseLosses(const SceneHold& hold, LossMode mode) {
  const std::string name = hold.element->nameOf(hold.law);
  const bool is_gauss = scene_.principle == Principle::kGauss;
  if (isFormal(scene_)) {
    throw SceneError(name,
                     "has losses, which linear models and steady states here do not know beside a "
                     "constraint of order 3 under 'principle: gauss'; allowed: orders 1 and 2");
  }
  // R' = D^T lambda' + dD/dt^T lambda: with a D that changes, lambda would be a state.
  if (is_gauss || graph_.isConstant(inModes(hold.slope[mode.line]))) return;
  throw SceneError(name,
                   "has losses whose part of the torque changes, which linear models and steady "
                   "states under 'principle: generalized_gauss' do not know; allowed: a ratio "
                   "and efficiencies that are numbers, or 'principle: gauss'");
}

void MotionEquations::addStuck(int hold) {
  const SceneHold& it = holds()[at(hold)];
  constraints_.push_back(rowOf(scene_.constraintCount() + hold, 1,
                               "the stuck element " + inQuotes(it.element->nameOf(it.law))));
  if (!constraints_.back().has_constant_C) return;
  // A row that others imply leaves the motion as it is without it.
  std::size_t constant = 0;
  MatrixXd C = MatrixXd::Zero(constraints_.size(), layout_.S);
  for (std::size_t m = 0; m < constraints_.size(); ++m) {
    if (!constraints_[m].has_constant_C) continue;
    ++constant;
    for (int i = 0; i < layout_.S; ++i) {
      C(static_cast<int>(m), i) = graph_.constantValue(constraints_[m].C[at(i)]);
    }
  }
  if (findIndependentRows(C, 1e-9).pivots.size() < constant) constraints_.pop_back();
}

ConstraintFormulas MotionEquations::rowOf(int row, int order, const std::string& name) {
  ConstraintFormulas made;
  made.name = name;
  const auto C = formulas_.entry.begin() + row * layout_.S;
  const auto D = formulas_.direction.begin() + row * layout_.S;
  made.C.assign(C, C + layout_.S);
  made.D.assign(D, D + layout_.S);
  made.has_constant_C =
      std::all_of(made.C.begin(), made.C.end(), [this](Node it) { return graph_.isConstant(it); });
  const Node residual = formulas_.residual[at(row)];
  if (order == 1) made.velocity = formulas_.velocity_residual[at(row)];
  if (order < 3) {
    made.acceleration = residual;
    made.jerk = rate(residual);
    return made;
  }
  made.jerk = residual;
  for (int i = 0; i < layout_.S; ++i) {
    made.jerk = graph_.add(made.jerk, graph_.multiply(made.C[at(i)], variable(layout_.jerk(i))));
  }
  return made;
}

bool MotionEquations::hasDiagonalInertia() const {
  return scene_.inertia.isDiagonal(0.0) && scene_.inertia_formulas.empty();
}

Node MotionEquations::reaction(int i) {
  Node sum = graph_.negate(torque(i));
  for (int j = 0; j < layout_.S; ++j) {
    sum = graph_.add(sum, graph_.multiply(inertia(i, j), variable(layout_.acceleration(j))));
  }
  return hasConstantInertia() ? sum : graph_.add(sum, J_.inertialTorque(i));
}

Node MotionEquations::connection(int i) {
  return sum(hasConstantInertia() ? 0 : layout_.S, [&](int j) {
    return graph_.multiply(J_.connection(i, j), variable(layout_.auxiliary(j)));
  });
}

Node MotionEquations::balance(int i) {
  return graph_.subtract(reaction(i), combine(i, layout_.multiplier(0)));
}

Node MotionEquations::balanceOfRates(int i) {
  Node rest = graph_.subtract(rate(reaction(i)), combine(i, layout_.multiplierRate(0)));
  if (!with_rates_of_d_) return graph_.subtract(rest, connection(i));
  for (int m = 0; m < layout_.k; ++m) {
    const Node turn = constraints_[at(m)].D_rate[at(i)];
    rest = graph_.subtract(rest, graph_.multiply(variable(layout_.multiplier(m)), turn));
  }
  return rest;
}

Node MotionEquations::auxiliaryTorque(int i) {
  return sum(layout_.S,
             [&](int j) { return graph_.multiply(inertia(i, j), variable(layout_.auxiliary(j))); });
}

Node MotionEquations::combine(int i, int first) {
  return sum(layout_.k, [&](int m) {
    return graph_.multiply(constraints_[at(m)].D[at(i)], variable(first + m));
  });
}

DifferentiatedFormulas::DifferentiatedFormulas(MotionEquations& equations,
                                               const std::vector<Node>& formulas)
    : layout_(equations.layout()), count_(static_cast<int>(formulas.size())) {
  Graph& graph = equations.graph();
  std::vector<Node> outputs = formulas;
  for (int n = 0; n < layout_.size(); ++n) {
    for (int f = 0; f < count_; ++f) {
      const Node derivative = graph.differentiate(formulas[at(f)], layout_.slot(n));
      if (graph.isConstant(derivative, 0.0)) continue;
      outputs.push_back(derivative);
      entries_.emplace_back(f, n);
    }
  }
  has_differences_ = graph.hasDifference(outputs);
  tape_ = expression::Tape(graph, outputs);
}

void DifferentiatedFormulas::evaluate(const VectorXd& v, VectorXd& values,
                                      MatrixXd& derivatives) const {
  endIfInterrupted();
  const double* const computed = tape_.evaluate(layout_.view(v));
  values = Eigen::Map<const VectorXd>(computed, count_);
  derivatives = MatrixXd::Zero(count_, layout_.size());
  for (std::size_t n = 0; n < entries_.size(); ++n) {
    derivatives(entries_[n].first, entries_[n].second) = computed[count_ + static_cast<int>(n)];
  }
}

}  // namespace variator_sim
