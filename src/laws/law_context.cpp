#include "variator_sim/law_context.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "laws/guarded_function.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/law.h"

namespace variator_sim {

using expression::Graph;
using expression::Source;

namespace {

Expression variable(ComponentContext& context, Source source, int index = 0) {
  Graph& graph = *context.graph();
  return {graph, graph.variable(slotOf(source, index))};
}

Expression readCommanded(ComponentContext& context, ParameterReader& section, const Range& range) {
  section.allow({"times", "values", "input", "topic"});
  const CommandInputSettings settings = readCommandInput(section, context.name(), range);
  section.finish();
  try {
    return variable(context, Source::kInput, context.addInput(settings));
  } catch (const SceneError& error) {
    // The context reports the topic as a key of the component itself.
    throw section.error("topic", error.message());
  }
}

Expression overTime(ComponentContext& context, const std::shared_ptr<const Table>& table) {
  Graph& graph = *context.graph();
  return {graph, graph.table(table, graph.variable(slotOf(Source::kTime)))};
}

/// Returns one of the scene's inputs, whose own limits have to stay within `range`.
Expression readShared(ComponentContext& context, ParameterReader& section, const Range& range) {
  const std::string path = section.keyPath("input");
  const std::string name = section.text("input");
  section.finish();
  const auto played = context.symbols().played.find(name);
  if (played != context.symbols().played.end()) return overTime(context, played->second);
  std::vector<std::string> names;
  for (const auto& it : context.symbols().inputs) names.push_back(it.first);
  placeOf(name, names, path, "is not in the list inputs");
  const int index = context.symbols().inputs.at(name);
  CommandInputSettings& input = context.input(index);
  for (const double value : {input.minimum, input.maximum, input.initial}) {
    if (std::isinf(value) || range.contains(value)) continue;
    throw SceneError(path, "the input " + inQuotes(name) + " may be " + formatReal(value) +
                               " by its min, max and initial; allowed here: a number " +
                               range.toText());
  }
  // Commands beyond limits that the input does not state are clamped and counted.
  const bool is_commanded = input.kind == InputKind::kCommanded;
  if (is_commanded && std::isinf(input.minimum) && range.minimum_included) {
    input.minimum = range.minimum;
  }
  if (is_commanded && std::isinf(input.maximum) && range.maximum_included) {
    input.maximum = range.maximum;
  }
  return variable(context, Source::kInput, index);
}

/// Reads a quantity of a law in one of its forms.
Expression readQuantity(ComponentContext& context, ParameterReader& section, const std::string& key,
                        const Range& range) {
  using Kind = ParameterTree::Kind;
  const std::string expected =
      "a number (" + range.toText() +
      "), a formula, a table over time {times: [...], values: [...]}, a commanded input "
      "{topic: ...} or one of the scene's inputs {input: NAME}";
  const ParameterTree& tree = section.require(key, expected);
  const Kind kind = tree.kind();
  if (kind == Kind::kInteger || kind == Kind::kReal) return section.number(key, range);
  if (kind == Kind::kText) {
    if (ParameterReader::isNumber(tree)) return section.number(key, range);
    Graph& graph = *context.graph();
    const Expression formula(
        graph, readFormula(context, section, key, expression::FormulaKind::kQuantity, graph));
    if (formula.isConstant() && !range.contains(formula.value())) {
      throw section.error(key, inQuotes(tree.asText()) + " is " + formatReal(formula.value()) +
                                   "; allowed: a number " + range.toText());
    }
    return formula;
  }
  if (kind != Kind::kDictionary) {
    throw section.error(key, tree.toText() + " is no value; expected " + expected);
  }
  ParameterReader dictionary = section.section(key);
  if (dictionary.has("times") || dictionary.has("values")) {
    const Table table = Table::read(dictionary, {{"times", Range::any("s")}, {"values", range}},
                                    Table::Beyond::kConstant);
    dictionary.finish();
    return overTime(context, std::make_shared<const Table>(table));
  }
  if (dictionary.has("input")) return readShared(context, dictionary, range);
  return readCommanded(context, dictionary, range);
}

/// Returns the function behind its guard, the same one for each call.
std::shared_ptr<const GuardedFunction> guard(const Graph& graph,
                                             std::shared_ptr<const OpaqueFunction> function,
                                             const std::shared_ptr<const void>& libraries) {
  for (int n = 0; n < graph.size(); ++n) {
    const Graph::Entry& entry = graph.entry({n});
    if (entry.operation != expression::Operation::kOpaque) continue;
    auto guarded = std::dynamic_pointer_cast<const GuardedFunction>(graph.opaqueOf(entry));
    if (guarded != nullptr && guarded->isOf(function.get())) return guarded;
  }
  return std::make_shared<const GuardedFunction>(std::move(function), libraries);
}

}  // namespace

int ComponentContext::addInput(const CommandInputSettings& settings) {
  const std::string path = parameters_.keyPath("topic");
  for (const CommandInputSettings& other : inputs_) {
    if (other.topic == settings.topic) {
      throw SceneError(path, "topic " + inQuotes(settings.topic) + " is used twice: by " +
                                 inQuotes(other.owner) + " and by " + inQuotes(settings.owner) +
                                 "; every commanded input needs a topic of its own");
    }
  }
  return addTo(inputs_, settings, path);
}

int ComponentContext::addDelay(expression::Node node, double seconds, const std::string& text,
                               const std::string& path) {
  const auto same = std::find_if(inputs_.begin(), inputs_.end(), [&](const auto& other) {
    return other.kind == InputKind::kDelayed && other.delayed == node && other.delay == seconds;
  });
  if (same != inputs_.end()) return static_cast<int>(same - inputs_.begin());
  CommandInputSettings made;
  made.kind = InputKind::kDelayed;
  made.topic = made.name = text;
  made.owner = name_;
  made.delayed = node;
  made.delay = seconds;
  return addTo(inputs_, made, path);
}

void LawContext::keys(std::initializer_list<const char*> keys) {
  for (const char* key : keys) parameters().allow(key);
}

Shaft LawContext::shaftAt(int index) {
  return {index, variable(*this, Source::kAngle, index), variable(*this, Source::kVelocity, index),
          variable(*this, Source::kAcceleration, index), variable(*this, Source::kJerk, index)};
}

Shaft LawContext::shaft(const std::string& key) {
  const std::string path = parameters().keyPath(key);
  return shaftAt(placeOf(parameters().text(key), shaftNames(), path, "is not a shaft"));
}

std::vector<Shaft> LawContext::shafts(const std::string& key, int count) {
  const std::vector<std::string> names = parameters().names(key);
  const std::string path = parameters().keyPath(key);
  const std::string expected = "expected a list of " + std::to_string(count) + " different shafts";
  if (static_cast<int>(names.size()) != count) {
    throw SceneError(path, expected + ", got " +
                               (parameters().has(key) ? "[" + joinNames(names) + "]" : "nothing") +
                               "; allowed: " + joinNames(shaftNames()));
  }
  std::vector<Shaft> shafts;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const int index = placeOf(names[i], shaftNames(), elementPath(path, i), "is not a shaft");
    for (const Shaft& other : shafts) {
      if (other.index != index) continue;
      throw SceneError(path, expected + ", got " + inQuotes(names[i]) + " twice");
    }
    shafts.push_back(shaftAt(index));
  }
  return shafts;
}

Expression LawContext::quantity(ParameterReader& section, const std::string& key,
                                const Range& range, std::optional<double> default_value) {
  if (!default_value || section.has(key)) return readQuantity(*this, section, key, range);
  return section.number(key, range, default_value);
}

Expression LawContext::command(const Range& range) {
  const int input = addInput(readCommandInput(parameters(), name(), range));
  return variable(*this, Source::kInput, input);
}

Expression LawContext::time() {
  return variable(*this, Source::kTime);
}

Expression LawContext::function(std::shared_ptr<const OpaqueFunction> f,
                                std::vector<Expression> arguments) {
  if (f == nullptr) {
    throw SceneError(place(),
                     "its opaque function is a null pointer; allowed: an object of a class "
                     "derived from variator_sim::OpaqueFunction");
  }
  const auto count = static_cast<std::size_t>(f->argumentCount());
  if (arguments.size() != count) {
    throw SceneError(place(), "its opaque function takes " + std::to_string(count) +
                                  (count == 1 ? " argument" : " arguments") + ", not " +
                                  std::to_string(arguments.size()));
  }
  Graph& graph = *ComponentContext::graph();
  expression::Node nodes[OpaqueFunction::kMostArguments];
  for (std::size_t i = 0; i < count; ++i) nodes[i] = arguments[i].in(graph);
  const std::shared_ptr<const GuardedFunction> guarded = guard(graph, std::move(f), libraries());
  const Expression value(graph, graph.opaque(guarded, nodes));
  if (value.isConstant() && !guarded->thrown().empty()) {
    throw SceneError(place(),
                     "its opaque function threw, at constant arguments: " + guarded->thrown());
  }
  return value;
}

Expression LawContext::lookUp(const Table& table, const Expression& x) {
  Graph& graph = *ComponentContext::graph();
  return {graph, graph.table(std::make_shared<const Table>(table), x.in(graph))};
}

Expression LawContext::smoothStep(const Expression& x, double begin, double end) {
  // A table that levels off at both ends is exactly that polynomial between two points.
  return lookUp(Table::through({begin, end}, {0.0, 1.0}, Table::Beyond::kConstant), x);
}

void Law::configure(LawContext& law) {
  name_ = law.name();
  shaft_count_ = law.shaftCount();
  graph_ = law.graph();
  build(law);
  holdings_ = law.holdings();
  derive(law);
  for (const auto& [name, value] : law.outputs()) outputs_.emplace_back(name, value.in(*graph_));
}

Expression LawContext::side() {
  const int number = graph()->countHold();
  if (number >= kMaxHolds) {
    throw SceneError(place(), "is one element that holds too many; allowed: " +
                                  std::to_string(kMaxHolds) + " in one scene");
  }
  return variable(*this, Source::kInput, kMaxInputs + number);
}

void LawContext::hold(const Holding& holding) {
  Graph& graph = *ComponentContext::graph();
  const expression::Node slip = holding.slip.in(graph);
  holdings_.push_back(holding);
  if (holding.losses) return;
  for (int i = 0; i < shaftCount(); ++i) {
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
