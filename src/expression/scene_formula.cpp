// Formulas of a scene: what their names mean.
#include <algorithm>
#include <cstddef>

#include "characters.h"
#include "function_table.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/nearest_name.h"

namespace variator_sim::expression {

namespace {

/// True for `prefix` followed by digits only.
bool isNumbered(const std::string& name, const std::string& prefix) {
  return name.size() > prefix.size() && name.compare(0, prefix.size(), prefix) == 0 &&
         std::all_of(name.begin() + static_cast<std::ptrdiff_t>(prefix.size()), name.end(),
                     isDigit);
}

/// "w1, w2".
std::string listNumbered(const std::string& prefix, int count) {
  std::vector<std::string> names;
  for (int i = 1; i <= count; ++i) {
    names.push_back(prefix + std::to_string(i));
  }
  return joinNames(names);
}

/// Why a numbered name means nothing in a scene of `shaft_count` shafts, or an empty string.
std::string explainName(const std::string& name, int shaft_count, FormulaKind kind) {
  const bool order3 = kind == FormulaKind::kOrder3 || kind == FormulaKind::kOrder3WithoutJerks;
  if (isNumbered(name, "j") && !order3) {
    return "jerks occur in constraints of order 3 only";
  }
  if (kind == FormulaKind::kOrder1 && isNumbered(name, "e")) {
    return "a constraint of order 1 may depend on t, phi and w only";
  }
  if (kind == FormulaKind::kTorque && isNumbered(name, "e")) {
    return "a torque may depend on t, phi and w only (with e its rate would need the jerk)";
  }
  for (const char* prefix : {"phi", "w", "e", "j"}) {
    if (isNumbered(name, prefix)) {
      return "the scene has " + std::to_string(shaft_count) +
             (shaft_count == 1 ? " shaft: " : " shafts: ") + listNumbered(prefix, shaft_count);
    }
  }
  return "";
}

/// Throws SceneError when a parameter's name cannot be told from something else.
void checkParameterName(const std::string& name, const std::string& path) {
  const std::string quoted = "'" + name + "'";
  if (!isValidName(name)) {
    throw SceneError(path, quoted +
                               " is not a valid name (a letter or '_', then letters, digits and "
                               "'_')");
  }
  if (name == "pi" || findFunction(name) != nullptr) {
    throw SceneError(path, quoted + " is already the name of " +
                               (name == "pi" ? "a number" : "a function") + "; choose another");
  }
  const bool is_variable = name == "t" || isNumbered(name, "phi") || isNumbered(name, "w") ||
                           isNumbered(name, "e") || isNumbered(name, "j");
  if (is_variable) {
    throw SceneError(path, quoted +
                               " is the name of a variable (t, phi1.., w1.., e1.. and j1.. are); "
                               "choose another");
  }
}

}  // namespace

Node readFormula(ComponentContext& context, const std::string& key, FormulaKind kind,
                 Graph& graph) {
  ParameterReader& reader = context.parameters();
  const std::string text = reader.formula(key);
  const std::map<std::string, double> parameters = reader.numberDictionary("parameters");

  SymbolTable symbols;
  SymbolTable jerks;
  symbols["t"] = graph.variable(slotOf(Source::kTime));
  for (int i = 0; i < context.shaftCount(); ++i) {
    const std::string number_text = std::to_string(i + 1);
    symbols["phi" + number_text] = graph.variable(slotOf(Source::kAngle, i));
    symbols["w" + number_text] = graph.variable(slotOf(Source::kVelocity, i));
    if (kind != FormulaKind::kTorque && kind != FormulaKind::kOrder1) {
      symbols["e" + number_text] = graph.variable(slotOf(Source::kAcceleration, i));
    }
    if (kind == FormulaKind::kOrder3) {
      const Node jerk = graph.variable(slotOf(Source::kJerk, i));
      symbols["j" + number_text] = jerks["j" + number_text] = jerk;
    } else if (kind == FormulaKind::kOrder3WithoutJerks) {
      symbols["j" + number_text] = graph.constant(0.0);
    }
  }
  for (const auto& [parameter, value] : parameters) {
    checkParameterName(parameter, reader.keyPath("parameters") + "/" + parameter);
    symbols[parameter] = graph.constant(value);
  }
  try {
    const NameExplainer explain = [&](const std::string& unknown) {
      return explainName(unknown, context.shaftCount(), kind);
    };
    return parse(text, symbols, graph, explain, jerks);
  } catch (const ExpressionError& error) {
    throw SceneError(reader.keyPath(key), error.what());
  }
}

}  // namespace variator_sim::expression
