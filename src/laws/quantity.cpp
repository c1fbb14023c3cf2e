#include "laws/quantity.h"

#include <cmath>
#include <memory>

#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/table.h"

namespace variator_sim {
namespace {

using expression::Graph;
using expression::slotOf;
using expression::Source;

Expression inputVariable(ComponentContext& context, int index) {
  Graph& graph = *context.graph();
  return {graph, graph.variable(slotOf(Source::kInput, index))};
}

Expression readCommanded(ComponentContext& context, ParameterReader& section, const Range& range) {
  for (const char* known : {"times", "values", "input", "topic"}) section.allow(known);
  const CommandInputSettings settings = readCommandInput(section, context.name(), range);
  section.finish();
  try {
    return inputVariable(context, context.addInput(settings));
  } catch (const SceneError& error) {
    // The context reports the topic as a key of the component itself.
    throw SceneError(section.keyPath("topic"), error.message());
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
  const int index = context.useInput(name, path);
  const CommandInputSettings& input = context.inputSettings(index);
  for (const double value : {input.minimum, input.maximum, input.initial}) {
    if (std::isinf(value) || range.contains(value)) continue;
    throw SceneError(
        path, "the input " + inQuotes(name) + " may be " + ParameterTree::real(value).toText() +
                  " by its min, max and initial; allowed here: a number " + range.toText());
  }
  context.limitInput(index, range);
  return inputVariable(context, index);
}

}  // namespace

Expression readQuantity(ComponentContext& context, ParameterReader& section, const std::string& key,
                        const Range& range) {
  using Kind = ParameterTree::Kind;
  const std::string expected =
      "a number (" + range.toText() +
      "), a formula, a table over time {times: [...], values: [...]}, a commanded input "
      "{topic: ...} or one of the scene's inputs {input: NAME}";
  const ParameterTree& tree = section.require(key, expected.c_str());
  const Kind kind = tree.kind();
  if (kind == Kind::kInteger || kind == Kind::kReal) return section.number(key, range);
  if (kind == Kind::kText) {
    if (section.isNumber(key)) return section.number(key, range);
    Graph& graph = *context.graph();
    const Expression formula(
        graph, readFormula(context, section, key, expression::FormulaKind::kQuantity, graph));
    if (formula.isConstant() && !range.contains(formula.value())) {
      throw SceneError(section.keyPath(key), inQuotes(tree.asText()) + " is " +
                                                 ParameterTree::real(formula.value()).toText() +
                                                 "; allowed: a number " + range.toText());
    }
    return formula;
  }
  if (kind != Kind::kDictionary) {
    throw SceneError(section.keyPath(key), tree.toText() + " is no value; expected " + expected);
  }
  ParameterReader dictionary = section.section(key);
  if (dictionary.has("times") || dictionary.has("values")) {
    const Table table = Table::read(dictionary, {"times", Range::any("s")}, {"values", range},
                                    Table::Beyond::kConstant);
    dictionary.finish();
    return overTime(context, std::make_shared<const Table>(table));
  }
  if (dictionary.has("input")) return readShared(context, dictionary, range);
  return readCommanded(context, dictionary, range);
}

}  // namespace variator_sim
