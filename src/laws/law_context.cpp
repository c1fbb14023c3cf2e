#include "variator_sim/law_context.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "laws/quantity.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/named_outputs.h"

namespace variator_sim {

using expression::Source;

Expression LawContext::variable(int slot) {
  expression::Graph& graph = *context_.graph();
  return {graph, graph.variable(slot)};
}

void LawContext::keys(std::initializer_list<const char*> keys) {
  for (const char* key : keys) parameters().allow(key);
}

Shaft LawContext::shaftAt(int index) {
  return {index, variable(slotOf(Source::kAngle, index)),
          variable(slotOf(Source::kVelocity, index)),
          variable(slotOf(Source::kAcceleration, index)), variable(slotOf(Source::kJerk, index))};
}

Shaft LawContext::shaft(const std::string& key) {
  return shaftAt(context_.readShaft(key));
}

std::vector<Shaft> LawContext::shafts(const std::string& key, int count) {
  std::vector<Shaft> shafts;
  for (const int index : context_.readShafts(key, count)) shafts.push_back(shaftAt(index));
  return shafts;
}

Expression LawContext::quantity(ParameterReader& section, const std::string& key,
                                const Range& range, std::optional<double> default_value) {
  if (!default_value || section.has(key)) return readQuantity(context_, section, key, range);
  return section.number(key, range, default_value);
}

Expression LawContext::command(const Range& range) {
  const int input = context_.addInput(readCommandInput(parameters(), context_.name(), range));
  return variable(slotOf(Source::kInput, input));
}

bool LawContext::readsVelocities(const Expression& formula) const {
  expression::Graph& graph = *context_.graph();
  bool reads = false;
  for (int i = 0; i < context_.shaftCount(); ++i) {
    reads = reads || graph.dependsOn(formula.in(graph), slotOf(Source::kVelocity, i));
  }
  return reads;
}

Expression LawContext::time() {
  return variable(slotOf(Source::kTime));
}

Expression LawContext::function(std::shared_ptr<const OpaqueFunction> f,
                                std::vector<Expression> arguments) {
  const auto count = static_cast<std::size_t>(f->argumentCount());
  if (arguments.size() != count) {
    throw SceneError(place_, "its opaque function takes " + std::to_string(count) +
                                 (count == 1 ? " argument" : " arguments") + ", not " +
                                 std::to_string(arguments.size()));
  }
  expression::Graph& graph = *context_.graph();
  expression::Node nodes[OpaqueFunction::kMostArguments];
  for (std::size_t i = 0; i < count; ++i) nodes[i] = arguments[i].in(graph);
  // The graph and its programs may outlive the component, so f keeps its library loaded.
  const OpaqueFunction* const raw = f.get();
  const std::shared_ptr<const OpaqueFunction> held(
      raw, [f = std::move(f), libraries = context_.libraries()](const OpaqueFunction*) mutable {
        f.reset();
        libraries.reset();
      });
  return {graph, graph.opaque(held, nodes)};
}

Expression LawContext::lookUp(const Table& table, const Expression& x) {
  expression::Graph& graph = *context_.graph();
  return {graph, graph.table(std::make_shared<const Table>(table), x.in(graph))};
}

Expression LawContext::smoothStep(const Expression& x, double begin, double end) {
  // A table that levels off at both ends is exactly that polynomial between two points.
  return lookUp(Table::through({begin, end}, {0.0, 1.0}, Table::Beyond::kConstant), x);
}

NamedOutputs::NamedOutputs(const LawContext& law) {
  expression::Graph& graph = *law.component().graph();
  for (const auto& [name, value] : law.outputs()) {
    names_.push_back(name);
    nodes_.push_back(value.in(graph));
  }
  tape_ = expression::Tape(graph, nodes_);
}

Expression LawContext::side() {
  const int number = context_.graph()->countHold();
  if (number >= kMaxHolds) {
    throw SceneError(place_, "is one element that holds too many; allowed: " +
                                 std::to_string(kMaxHolds) + " in one scene");
  }
  return variable(slotOf(Source::kInput, kMaxInputs + number));
}

void LawContext::hold(const Holding& holding) {
  expression::Graph& graph = *context_.graph();
  const expression::Node slip = holding.slip.in(graph);
  holdings_.push_back(holding);
  if (holding.losses) return;
  for (int i = 0; i < context_.shaftCount(); ++i) {
    const Shaft shaft = shaftAt(i);
    const Expression C(graph, graph.differentiate(slip, slotOf(Source::kVelocity, i)));
    if (!C.isConstant() || C.value() != 0.0) apply(shaft, -C * holding.torque);
  }
}

void LawContext::apply(const Shaft& shaft, const Expression& torque) {
  const auto same = std::find_if(torques_.begin(), torques_.end(),
                                 [&](const auto& other) { return other.first == shaft.index; });
  if (same == torques_.end()) {
    torques_.emplace_back(shaft.index, torque);
  } else {
    same->second += torque;
  }
}

}  // namespace variator_sim
