#include "model/scene_symbols.h"

#include <memory>

#include "variator_sim/component_context.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim {
namespace {

/// Rejects names of inputs and tables that formulas cannot use.
void checkFormulaNames(const SceneNames& scene, const char* list,
                       const std::vector<std::string>& names) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string taken = expression::describeTakenName(names[i], scene.shafts);
    if (taken.empty()) continue;
    throw SceneError(elementPath(list, i),
                     inQuotes(names[i]) + " is " + taken + " in formulas; choose another");
  }
}

NamedTable readTable(ParameterReader& reader) {
  for (const char* key : {"x", "y", "values", "beyond"}) reader.allow(key);
  const bool is_linear = reader.choice("beyond", {"constant", "linear"}, "constant") == "linear";
  const Table::Beyond beyond = is_linear ? Table::Beyond::kLinear : Table::Beyond::kConstant;
  NamedTable table;
  if (reader.has("y")) {
    table.of_two = std::make_shared<Table2>(Table2::read(reader, {"x", "y", "values"}, beyond));
  } else {
    table.of_one = std::make_shared<Table>(
        Table::read(reader, {"x", Range::any()}, {"values", Range::any()}, beyond));
  }
  return table;
}

}  // namespace

SceneSymbols readSceneSymbols(ParameterReader& root, const SceneNames& names,
                              std::vector<CommandInputSettings>& inputs) {
  checkFormulaNames(names, "inputs", names.inputs);
  checkFormulaNames(names, "tables", names.tables);
  SceneSymbols symbols;
  for (const std::string& name : names.inputs) {
    ParameterReader reader = root.section(name);
    ComponentContext context(name, reader, names.shafts, inputs);
    symbols.inputs[name] = context.addInput(readCommandInput(reader, name));
    reader.finish();
  }
  for (const std::string& name : names.tables) {
    ParameterReader reader = root.section(name);
    symbols.tables[name] = readTable(reader);
    reader.finish();
  }
  return symbols;
}

}  // namespace variator_sim
