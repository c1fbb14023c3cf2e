/// Formulas as text: from the scene to a node of a Graph.
#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "variator_sim/component_context.h"
#include "variator_sim/errors.h"
#include "variator_sim/expression/graph.h"
#include "variator_sim/scene_symbols.h"

namespace variator_sim::expression {

/// Parentheses and function calls may be this deep.
constexpr int kMaxNesting = 200;

/// A text that is not a formula. what() says what is wrong, at which column, and shows the place.
class ExpressionError : public Error {
 public:
  /// `column` counts characters of `text` from 1.
  ExpressionError(const std::string& message, const std::string& text, int column);
  int column() const { return column_; }

 private:
  int column_;
};

using SymbolTable = std::map<std::string, Node>;
/// Says why a name has no meaning here ("the scene has 2 shafts: w1, w2"), or an empty string: then
/// the nearest name is suggested.
using NameExplainer = std::function<std::string(const std::string& name)>;

/// The node of `graph` that `text` means. Throws ExpressionError.
///
/// From loosest to tightest: + -; * /; unary + -; ^. All are left-associative but ^: a^b^c is
/// a^(b^c), -a^2 is -(a^2), and 2^-3 is 2^(-3). Names are those of `symbols`, the functions, pi and
/// `tables`, which are called as functions are. if(a < b, x, y) is x where a < b, y where not, and
/// NaN where a and b cannot be compared; <, <=, > and >= stand nowhere else.
/// Numbers are 1, 1., .5, 1e-9 (2e1 is twenty: a product needs its *). White space means nothing.
/// A constant part without a finite value (log(-1)) and a division by a constant zero are errors.
/// So is a function of one of the variables `linear`, a product of two, a power, a division by one:
/// in them the formula is to be linear as it is written. `used`, where it is not null, becomes the
/// symbols that occur.
Node parse(const std::string& text, const SymbolTable& symbols, Graph& graph,
           const NameExplainer& explain = {}, const SymbolTable& linear = {},
           const NamedTables& tables = {}, std::set<std::string>* used = nullptr);

/// The names of all functions, sorted.
std::vector<std::string> functionNames();
/// A letter or underscore, then letters, digits and underscores.
bool isValidName(const std::string& name);

/// Which variables a component's formula may read. Each has the names of its shafts, w_drive,
/// beside those with an index, w1; the scene's inputs and tables have theirs.
enum class FormulaKind {
  kTorque,    ///< t, phi1.., w1..; e1.. is an error that says why
  kOrder1,    ///< t, phi1.., w1..
  kOrder2,    ///< t, phi1.., w1.., e1..
  kOrder3,    ///< t, phi1.., w1.., e1.., and j1.. linearly
  kQuantity,  ///< a number of a law: t, phi1.., w1..
  kOutput     ///< t, phi1.., w1.., e1..
};

/// The formula at `key` of a component, with its `parameters` as constants, each of which it has to
/// read; variables have the slots of tape.h. Throws SceneError at `key` or at the parameter at
/// fault.
Node readFormula(ComponentContext& context, const std::string& key, FormulaKind kind, Graph& graph);
/// The same of a dictionary of the component's, without parameters.
Node readFormula(ComponentContext& context, ParameterReader& section, const std::string& key,
                 FormulaKind kind, Graph& graph);

/// "the name of a variable", "already the name of a function", ..: what keeps `name` from being
/// given to anything else that formulas read in a scene of these shafts. Empty where nothing does.
std::string describeTakenName(const std::string& name, const std::vector<std::string>& shafts);

}  // namespace variator_sim::expression
