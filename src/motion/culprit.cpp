#include "motion/culprit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <vector>

#include "expression/term_maker.h"
#include "laws/guarded_function.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/expression/guards.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

/// Reads the scene, and its numbers, with the defaults that were taken, into `numbers`. Nothing if
/// an element is another package's, or a number is not allowed.
std::optional<Scene> read(const ParameterTree& tree, std::map<std::string, double>* numbers) {
  BuiltinComponentFactory factory;
  std::optional<Scene> scene;
  ParameterReader::noteNumbers(numbers);
  try {
    scene = readScene(tree, factory);
  } catch (const std::exception&) {
  }
  ParameterReader::noteNumbers(nullptr);
  return scene;
}

/// Returns the variables' names in formulas of the scene; tables and rates of inputs have none.
expression::Names nameVariables(const Scene& scene) {
  using expression::slotOf;
  using expression::Source;
  expression::Names names;
  names.variables[slotOf(Source::kTime)] = {"t", ""};
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const std::string& shaft = scene.shafts[static_cast<std::size_t>(i)];
    names.variables[slotOf(Source::kAngle, i)] = {"phi_" + shaft, ""};
    names.variables[slotOf(Source::kVelocity, i)] = {"w_" + shaft, ""};
    names.variables[slotOf(Source::kAcceleration, i)] = {"e_" + shaft, ""};
  }
  for (int i = 0; i < scene.inputCount(); ++i) {
    names.variables[slotOf(Source::kInput, i)] = {scene.inputs[static_cast<std::size_t>(i)].name,
                                                  ""};
  }
  return names;
}

/// Returns the formulas of an element in the order in which the motion uses them.
std::vector<expression::Node> formulasOf(const Law& element) {
  std::vector<expression::Node> nodes;
  if (const auto* const torque = dynamic_cast<const Torque*>(&element)) {
    for (const auto& [shaft, node] : torque->torques()) nodes.push_back(node);
    for (const auto& [shaft, node] : torque->rates()) nodes.push_back(node);
  } else {
    const auto& law = dynamic_cast<const Constraint&>(element);
    if (law.order() < 3) nodes.push_back(law.function());  // no state has jerks
    nodes.insert(nodes.end(), law.row().begin(), law.row().end());
  }
  return nodes;
}

/// Returns the first element of which `is_meant` is true, or null.
template <class IsMeant>
const Law* findElement(const Scene& scene, const IsMeant& is_meant) {
  const std::vector<const Law*> laws = scene.laws();
  const auto found = std::find_if(laws.begin(), laws.end(), is_meant);
  return found == laws.end() ? nullptr : *found;
}

/// A state near another one, to be changed.
struct Beside {
  Beside(const StateView& state, int S) : view(state) {
    std::copy_n(state.angle, S, angle);
    std::copy_n(state.velocity, S, velocity);
    view.angle = angle;
    view.velocity = velocity;
  }
  Beside(const Beside&) = delete;
  Beside& operator=(const Beside&) = delete;

  double angle[kMaxShafts] = {};
  double velocity[kMaxShafts] = {};
  StateView view;
};

/// Returns the size of the output of an element at `state`.
double calcSize(const Law& element, const StateView& state, int S) {
  const auto* const law = dynamic_cast<const Torque*>(&element);
  if (law == nullptr) return dynamic_cast<const Constraint&>(element).calcResidual(state);
  double torque[kMaxShafts] = {};
  law->addTorque(state, torque);
  double sum = 0.0;
  for (int i = 0; i < S; ++i) sum += torque[i];
  return sum != 0.0 ? sum : torque[0] - torque[S - 1];
}

}  // namespace

std::string describe(const Law& element) {
  const bool is_torque = dynamic_cast<const Torque*>(&element) != nullptr;
  return (is_torque ? "torque " : "constraint ") + inQuotes(element.name());
}

double toOneDigit(double value, bool is_up) {
  const double exponent = std::floor(std::log10(std::abs(value)));
  const double digits = std::abs(value) * std::pow(10.0, -exponent);
  char text[64];
  std::snprintf(text, sizeof text, "%.0fe%.0f",
                is_up ? std::ceil(digits - 1e-9) : std::floor(digits + 1e-9), exponent);
  return std::copysign(std::strtod(text, nullptr), value);
}

std::string assign(const std::string& path, double value) {
  return "'" + path + ": " + formatNumber(value) + "'";
}

/// A value for each shaft; 0 by default.
struct Culprits::Shafts {
  double values[kMaxShafts] = {};
  double& operator[](int i) { return values[i]; }
  double largest() const {
    double most = 0.0;
    for (const double value : values) most = std::max(most, std::abs(value));
    return most;
  }
};

template <class Rate>
const Law* Culprits::findLargest(const Rate& rate, double least) const {
  const Law* found = nullptr;
  for (const Law* const element : scene_.laws()) {
    const double its = rate(*element);
    if (!(its > least)) continue;
    least = its;
    found = element;
  }
  return found;
}

const Law* Culprits::findSteepest() const {
  return findLargest([&](const Law& element) { return calcRounding(element, state_); }, 0.0);
}

const Law* Culprits::findFastest(double least) const {
  constexpr double kLittle = 1e-6;  // rad, rad/s
  Beside turned(state_, S);
  Beside faster(state_, S);
  Shafts size;
  for (int i = 0; i < S; ++i) {
    turned.angle[i] += i % 2 == 0 ? kLittle : -kLittle;
    faster.velocity[i] += i % 2 == 0 ? kLittle : -kLittle;
    size[i] = state_.acceleration[i];
  }
  // 1/s: d(omega')/d(omega), the root of d(omega')/d(phi), and the law's explicit rate.
  const auto rate = [&](const Law& element) {
    const double by_velocity = calcAnswer(element, state_, faster.view).largest();
    const double by_angle = calcAnswer(element, state_, turned.view).largest();
    const double most = std::max(by_velocity / kLittle, std::sqrt(by_angle / kLittle));
    const auto* const torque = dynamic_cast<const Torque*>(&element);
    if (!(size.largest() > 0.0) || torque == nullptr) return most;
    Shafts torque_rate;
    Shafts by_itself;
    torque->addTorqueRate(state_, torque_rate.values);
    inertia_.solve(torque_rate.values, by_itself.values);
    return std::max(most, by_itself.largest() / size.largest());
  };
  return findLargest(rate, least);
}

double Culprits::calcUnattainable(const Law& element) const {
  constexpr double kFar = 0.015;  // of the speed, or rad/s
  double most = calcRounding(element, state_);
  const auto try_speed = [&](int i, double speed) {
    Beside around(state_, S);
    around.velocity[i] = speed;
    most = std::max(most, calcRounding(element, around.view));
  };
  for (int i = 0; i < S; ++i) {
    const double speed = state_.velocity[i];
    double by = kFar * std::max(1.0, std::abs(speed));
    while (by > 1e-9) {
      by *= 0.7;
      try_speed(i, speed - by);
      try_speed(i, speed + by);
    }
    // A narrower layer lies at the speed 0, or at that of another shaft.
    try_speed(i, 0.0);
    for (int other = 0; other < S; ++other) try_speed(i, state_.velocity[other]);
  }
  return most;
}

/// Returns the change of the accelerations by `element` for a change of the state, rad/s^2.
Culprits::Shafts Culprits::calcAnswer(const Law& element, const StateView& here,
                                      const StateView& beside) const {
  Shafts answer;
  if (const auto* const torque = dynamic_cast<const Torque*>(&element)) {
    Shafts before;
    Shafts change;
    torque->addTorque(here, before.values);
    torque->addTorque(beside, change.values);
    for (int i = 0; i < S; ++i) change[i] -= before[i];
    inertia_.solve(change.values, answer.values);
    return answer;
  }
  // J epsilon changes by C^T l, so that C epsilon makes up for the change of psi.
  const auto& constraint = dynamic_cast<const Constraint&>(element);
  double C[kMaxShafts];
  const auto calcResidual = [&](const StateView& state) {
    if (constraint.order() < 3) return constraint.calcResidualAndJacobian(state, C);
    double c0;
    constraint.calcRow(state, C, &c0);
    return c0;
  };
  const double after = calcResidual(beside);
  const double psi = after - calcResidual(here);
  double A = 0.0;
  inertia_.solve(C, answer.values);
  for (int i = 0; i < S; ++i) A += C[i] * answer[i];
  for (int i = 0; i < S; ++i) answer[i] *= psi / A;
  return answer;
}

/// Returns the accelerations that four roundings of the state make, in tolerances.
double Culprits::calcRounding(const Law& element, const StateView& here) const {
  // Uses a multiple of four roundings, of different sign and size: see StepChecks::round.
  constexpr double kTimes = 64.0;
  constexpr double kFour = 4.0 * std::numeric_limits<double>::epsilon();
  Beside beside(here, S);
  for (double* values : {beside.angle, beside.velocity}) {
    for (int i = 0; i < S; ++i) {
      const double by = kTimes * kFour * (1.0 + 0.3 * (i % 3));
      values[i] += (i % 2 == 0 ? by : -by) * std::max(1e-6, std::abs(values[i]));
    }
  }
  Shafts answer = calcAnswer(element, here, beside.view);
  const SolverSettings& solver = scene_.solver;
  for (int i = 0; i < S; ++i) {
    // A motion passes through small accelerations.
    const double size = std::min(1.0, std::abs(state_.acceleration[i]));
    answer[i] /= kTimes * (solver.absolute_tolerance + solver.relative_tolerance * size);
  }
  return answer.largest();
}

/// Returns the relative change of an element, which has become `changed`, at another state.
double Culprits::calcChange(const Law& changed, const Law& element) const {
  double change = 0.0;
  double size = 0.0;
  for (int i = 0; i < S; ++i) {
    Beside elsewhere(state_, S);
    elsewhere.velocity[i] += std::max(1.0, 0.1 * std::abs(state_.velocity[i]));
    const double before = calcSize(element, elsewhere.view, S);
    size += std::abs(before);
    change += std::abs(calcSize(changed, elsewhere.view, S) - before);
  }
  return change / size;
}

std::string Culprits::findRemedy(const Law& element, double factor) const {
  std::map<std::string, double> numbers;
  ParameterTree tree = scene_.resolved;
  if (tree.kind() != ParameterTree::Kind::kDictionary) return "";
  setValue(tree, "verify_derivatives", ParameterTree::boolean(false));
  if (!read(tree, &numbers)) return "";
  const double most = calcUnattainable(element);
  double least = std::numeric_limits<double>::infinity();
  std::string best;
  for (const auto& [path, now] : numbers) {
    const bool is_its = path.rfind(element.name() + "/", 0) == 0;
    if (!is_its || path.find('[') != std::string::npos || now == 0.0) continue;
    for (const double then : {toOneDigit(now * factor, true), toOneDigit(now / factor, false)}) {
      ParameterTree other = tree;
      setValue(other, path, ParameterTree::real(then));
      const std::optional<Scene> scene = read(other, nullptr);
      if (!scene) continue;
      const Law& changed =
          *findElement(*scene, [&](const Law* it) { return it->name() == element.name(); });
      if (!(factor * calcUnattainable(changed) <= 2.0 * most)) continue;
      const double change = calcChange(changed, element);
      if (!(change < least)) continue;
      least = change;
      best = assign(path, then) + " (it is " + formatNumber(now) + ")";
    }
  }
  return best;
}

const Law* findOwner(const Scene& scene, expression::Node argument) {
  return findElement(scene, [&](const Law* element) {
    const std::vector<expression::Branch> branches =
        expression::findBranches(*scene.graph, formulasOf(*element));
    return std::any_of(branches.begin(), branches.end(), [&](const expression::Branch& it) {
      return it.argument.index == argument.index;
    });
  });
}

std::string findNonFinitePart(const Scene& scene, const Law& element, const StateView& state) {
  constexpr std::size_t kMost = 500;
  const int S = scene.shaftCount();
  const expression::Graph& graph = *scene.graph;
  std::vector<expression::Node> parts;
  for (const expression::Node formula : formulasOf(element)) {
    for (const int n : graph.listReachable({formula})) parts.push_back({n});
    if (parts.size() > kMost) return "";
  }
  const expression::Tape tape(graph, parts);
  double ahead = 0.0;
  for (int power = -14; power <= -1; ahead = std::pow(10.0, power), ++power) {
    Beside there(state, S);
    there.view.time += ahead;
    for (int i = 0; i < S; ++i) {
      const double epsilon = state.acceleration[i];
      there.angle[i] += ahead * state.velocity[i];
      if (std::isfinite(epsilon)) there.velocity[i] += ahead * epsilon;
    }
    // Operands precede their users.
    const double* const begin = tape.evaluate(there.view);
    const double* const end = begin + parts.size();
    const double* const bad = std::find_if(begin, end, [](double x) { return !std::isfinite(x); });
    if (bad == end) continue;
    try {
      const auto part = parts[static_cast<std::size_t>(bad - begin)];
      const expression::Terms terms = makeTerms(graph, {part}, nameVariables(scene));
      return terms.shared.empty() ? toText(*terms.roots.front()) : "";
    } catch (const std::out_of_range&) {  // a table
      return "";
    }
  }
  return "";
}

std::string describeThrown(const Law& element) {
  const expression::Graph& graph = element.graph();
  for (const int n : graph.listReachable(formulasOf(element))) {
    const expression::Graph::Entry& entry = graph.entry({n});
    if (entry.operation != expression::Operation::kOpaque) continue;
    const auto* const function = dynamic_cast<const GuardedFunction*>(graph.opaqueOf(entry).get());
    if (function == nullptr) continue;
    std::string thrown = function->thrown();
    if (!thrown.empty()) return thrown;
  }
  return "";
}

const Law* findThrower(const Scene& scene) {
  return findElement(scene, [](const Law* it) { return !describeThrown(*it).empty(); });
}

}  // namespace variator_sim
