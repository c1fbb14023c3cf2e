/// Parses formulas of a scene to nodes of a Graph.
#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "variator_sim/component_context.h"
#include "variator_sim/errors.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// Largest depth of parentheses and function calls.
constexpr int kMaxNesting = 200;

/// A text that is not a formula. what() describes the error and its column, and shows the place.
class ExpressionError : public Error {
 public:
  /// `column` counts characters of `text` from 1.
  ExpressionError(const std::string& message, const std::string& text, int column);
  int column() const { return column_; }

 private:
  int column_;
};

using SymbolTable = std::map<std::string, Node>;
/// Explains why a name has no meaning here ("the scene has 2 shafts: w1, w2"); for an empty string
/// the parser suggests the nearest name.
using NameExplainer = std::function<std::string(const std::string& name)>;

/// Returns the node for delay(x, seconds), written as `text`. Throws ExpressionError or SceneError.
using DelayMaker = std::function<Node(Node x, double seconds, const std::string& text)>;

/// Returns the node of `graph` for `text`. Throws ExpressionError.
///
/// From loosest to tightest: + -; * /; unary + -; ^. All are left-associative but ^: a^b^c is
/// a^(b^c), -a^2 is -(a^2), and 2^-3 is 2^(-3). Names are those of `symbols`, the functions, pi and
/// `tables`, which are called as functions are. if(a < b, x, y) is x if a < b, y if not, and NaN if
/// a and b cannot be compared; <, <=, > and >= are allowed nowhere else. Numbers are 1, 1., .5,
/// 1e-9 (2e1 is twenty: a product needs its *). White space has no meaning. A constant part without
/// a finite value (log(-1)) and a division by a constant zero are errors. delay(x, T) is what
/// `delay` makes of it; T is a positive constant. `used`, if not null, receives the symbols that
/// occur.
Node parse(const std::string& text, const SymbolTable& symbols, Graph& graph,
           const NameExplainer& explain = {}, const NamedTables& tables = {},
           std::set<std::string>* used = nullptr, const DelayMaker& delay = {});

/// The names of all functions, sorted.
std::vector<std::string> functionNames();
/// True for a letter or underscore, then letters, digits and underscores.
bool isValidName(const std::string& name);

/// The variables that a component's formula may read. Each has names with its shafts, w_drive, and
/// with an index, w1; the scene's inputs and tables have their own names.
enum class FormulaKind {
  kTorque,    ///< t, phi1.., w1..; e1.. is an error that says why
  kOrder1,    ///< t, phi1.., w1..
  kOrder2,    ///< t, phi1.., w1.., e1..
  kOrder3,    ///< t, phi1.., w1.., e1.., and j1.. linearly
  kQuantity,  ///< a number of a law: t, phi1.., w1..
  kOutput     ///< t, phi1.., w1.., e1..
};

/// Reads the formula at `key` of a component, with its `parameters` as constants, each of which it
/// has to read; variables have the slots of tape.h. Throws SceneError at `key` or at the parameter
/// at fault.
Node readFormula(ComponentContext& context, const std::string& key, FormulaKind kind, Graph& graph);
/// The same for a dictionary of the component, without parameters.
Node readFormula(ComponentContext& context, ParameterReader& section, const std::string& key,
                 FormulaKind kind, Graph& graph);

/// "the name of a variable", "already the name of a function", ..: describes why `name` is not free
/// for another element that formulas read in a scene of these shafts. Empty if it is free.
std::string describeTakenName(const std::string& name, const std::vector<std::string>& shafts);

}  // namespace variator_sim::expression
