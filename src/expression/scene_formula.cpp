// Formulas of a scene: the meaning of their names.
#include <algorithm>
#include <cstddef>
#include <iterator>
#include <map>
#include <set>

#include "characters.h"
#include "operations.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {

namespace {

/// True for `prefix` followed by digits only.
bool isNumbered(const std::string& name, const std::string& prefix) {
  return name.size() > prefix.size() && name.compare(0, prefix.size(), prefix) == 0 &&
         std::all_of(name.begin() + static_cast<std::ptrdiff_t>(prefix.size()), name.end(),
                     isDigit);
}

constexpr const char* kPrefixes[] = {"phi", "w", "e", "j"};

/// True for `prefix` with an index or with the name of a shaft.
bool isVariable(const std::string& name, const std::string& prefix,
                const std::vector<std::string>& shafts) {
  if (isNumbered(name, prefix)) return true;
  const std::size_t begin = prefix.size() + 1;
  return name.size() > begin && name.compare(0, begin, prefix + "_") == 0 &&
         std::find(shafts.begin(), shafts.end(), name.substr(begin)) != shafts.end();
}

/// Explains why the name of a variable has no meaning here; empty if it has one.
std::string explainName(const std::string& name, const std::vector<std::string>& shafts,
                        FormulaKind kind) {
  if (kind != FormulaKind::kOrder3 && isVariable(name, "j", shafts)) {
    return "jerks occur in constraints of order 3 only";
  }
  const std::map<FormulaKind, const char*> without_accelerations = {
      {FormulaKind::kOrder1, "a constraint of order 1 may depend on t, phi and w only"},
      {FormulaKind::kTorque,
       "a torque may depend on t, phi and w only (with e its rate would need the jerk)"},
      {FormulaKind::kQuantity,
       "a quantity of a law may depend on t, phi, w, inputs and tables only"}};
  const auto refused = without_accelerations.find(kind);
  if (refused != without_accelerations.end() && isVariable(name, "e", shafts)) {
    return refused->second;
  }
  if (name.compare(0, 2, "Q_") == 0) {
    return "--explain calls the torque of an element so; rate, when, set and outputs may read "
           "ELEMENT_torque, elsewhere write its formula, or take the column ELEMENT/SHAFT/torque "
           "(--columns elements)";
  }
  if (name.compare(0, 2, "G_") == 0 || name == "Z" || name == "constraint_measure") {
    return "outputs may read it; the motion follows from it, and so do states and events";
  }
  for (const char* prefix : kPrefixes) {
    if (!isNumbered(name, prefix)) continue;
    std::vector<std::string> names;
    for (std::size_t i = 1; i <= shafts.size(); ++i) names.push_back(prefix + std::to_string(i));
    return "the scene has " + std::to_string(shafts.size()) +
           (shafts.size() == 1 ? " shaft: " : " shafts: ") + joinNames(names);
  }
  return "";
}

/// Throws SceneError when a parameter's name is ambiguous.
void checkParameterName(const std::string& name, const std::string& path,
                        const ComponentContext& context) {
  const std::string shown = inQuotes(name);
  if (!isValidName(name)) {
    throw SceneError(path, shown +
                               " is not a valid name (a letter or '_', then letters, digits and "
                               "'_')");
  }
  std::string taken = describeTakenName(name, context.shaftNames());
  if (context.symbols().inputs.count(name) != 0 || context.symbols().played.count(name) != 0) {
    taken = "already the name of an input";
  }
  if (context.symbols().values.count(name) != 0 &&
      context.symbols().of_elements->count(name) == 0) {
    taken = "already the name of a controller";
  }
  if (context.symbols().tables.count(name) != 0) taken = "already the name of a table";
  if (!taken.empty()) throw SceneError(path, shown + " is " + taken + "; choose another");
}

/// Returns the variables of a formula by their names.
SymbolTable nameVariables(const ComponentContext& context, FormulaKind kind, Graph& graph) {
  SymbolTable named;
  named["t"] = graph.variable(slotOf(Source::kTime));
  for (int i = 0; i < context.shaftCount(); ++i) {
    const std::string shaft = context.shaftNames()[static_cast<std::size_t>(i)];
    for (const std::string& of : {std::to_string(i + 1), "_" + shaft}) {
      named["phi" + of] = graph.variable(slotOf(Source::kAngle, i));
      named["w" + of] = graph.variable(slotOf(Source::kVelocity, i));
      if (kind == FormulaKind::kOrder2 || kind == FormulaKind::kOrder3 ||
          kind == FormulaKind::kOutput) {
        named["e" + of] = graph.variable(slotOf(Source::kAcceleration, i));
      }
      if (kind == FormulaKind::kOrder3) named["j" + of] = graph.variable(slotOf(Source::kJerk, i));
    }
  }
  for (const auto& [input, index] : context.symbols().inputs) {
    named[input] = graph.variable(slotOf(Source::kInput, index));
  }
  for (const auto& [input, table] : context.symbols().played) {
    named[input] = graph.table(table, graph.variable(slotOf(Source::kTime)));
  }
  for (const auto& [name, value] : context.symbols().values) named[name] = value;
  return named;
}

/// `reader` holds the formula and, in some components, its parameters.
Node readWithParameters(ComponentContext& context, ParameterReader& reader, const std::string& key,
                        const std::map<std::string, double>& parameters, FormulaKind kind,
                        Graph& graph) {
  const std::string text = reader.formula(key, kind == FormulaKind::kTorque ? "N m" : "");

  SymbolTable symbols = nameVariables(context, kind, graph);
  for (const auto& [name, make] : context.symbols().observed) {
    // (One that does not occur is there for messages.)
    const bool is_free = symbols.count(name) + parameters.count(name) == 0;
    if (kind == FormulaKind::kOutput && is_free)
      symbols[name] = text.find(name) != std::string::npos ? make() : Node{};
  }
  for (const auto& [parameter, value] : parameters) {
    checkParameterName(parameter, reader.keyPath("parameters") + "/" + parameter, context);
    symbols[parameter] = graph.constant(value);
  }
  std::set<std::string> used;
  Node formula;
  try {
    const NameExplainer explain = [&](const std::string& unknown) {
      if (context.symbols().of_elements->count(unknown) != 0) {
        if (kind == FormulaKind::kOutput) {
          return std::string(
              "outputs are read by other outputs only, by those behind them in the list");
        }
        return std::string(
            "rate, when, set and outputs may read what elements and reactions do, but laws may "
            "not, from which it follows");
      }
      return explainName(unknown, context.shaftNames(), kind);
    };
    formula = parse(text, symbols, graph, explain, context.symbols().tables, &used,
                    [&](Node x, double seconds, const std::string& written) {
                      const int input = context.addDelay(x, seconds, written, reader.keyPath(key));
                      return graph.variable(slotOf(Source::kInput, input));
                    });
  } catch (const ExpressionError& error) {
    throw SceneError(reader.keyPath(key), error.what());
  }
  for (const auto& parameter : parameters) {
    if (used.count(parameter.first) != 0) continue;
    throw SceneError(reader.keyPath("parameters") + "/" + parameter.first,
                     inQuotes(parameter.first) + " is not read by the formula " + inQuotes(text) +
                         "; remove it, or read it there");
  }
  return formula;
}

}  // namespace

std::string describeTakenName(const std::string& name, const std::vector<std::string>& shafts) {
  if (name == "pi") return "already the name of a number";
  if (findFunction(name) != nullptr) return "already the name of a function";
  const bool is_variable = name == "t" || std::any_of(std::begin(kPrefixes), std::end(kPrefixes),
                                                      [&](const char* prefix) {
                                                        return isVariable(name, prefix, shafts);
                                                      });
  if (!is_variable) return "";
  return "the name of a variable (t, phi1.., w1.., e1.. and j1.. are, and the same with the names "
         "of shafts: w_" +
         shafts.front() + ")";
}

Node readFormula(ComponentContext& context, const std::string& key, FormulaKind kind,
                 Graph& graph) {
  ParameterReader& reader = context.parameters();
  return readWithParameters(context, reader, key, reader.numberDictionary("parameters"), kind,
                            graph);
}

Node readFormula(ComponentContext& context, ParameterReader& section, const std::string& key,
                 FormulaKind kind, Graph& graph) {
  return readWithParameters(context, section, key, {}, kind, graph);
}

}  // namespace variator_sim::expression
