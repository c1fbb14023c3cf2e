/// Formulas of a scene as statements of C on rows of power series.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "expression/series_operation.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim {

/// Writes a double as C, exactly.
std::string literalOf(double value);
std::string listOf(const std::vector<double>& values);
std::string listOf(const std::vector<int>& values);

/// Every node of the formulas gets a row of coefficients, and a statement that computes coefficient
/// n by one of the functions of c_text.h.
class FormulaRows {
 public:
  /// The C function that holds a statement: of nodes without accelerations, of nodes with
  /// accelerations, or of nodes needed at order 0 only.
  enum class Part { kGiven, kAccelerated, kAtOnce };

  /// Uses rows from `first_row` on. `row_of_slot`: rows of the variables, by their slots.
  FormulaRows(const expression::Graph& graph, int first_row, std::map<int, int> row_of_slot)
      : graph_(graph), row_of_slot_(std::move(row_of_slot)), rows_(first_row) {}

  /// Makes the rows that `series` needs as series, then those that `at_once` needs at order 0.
  /// Throws std::invalid_argument for functions without series.
  void write(const std::vector<expression::Node>& series,
             const std::vector<expression::Node>& at_once);

  int rowOf(expression::Node node) const { return row_of_node_.at(node.index); }
  /// True when `node` depends on an acceleration.
  bool isAccelerated(expression::Node node) const { return accelerated_.count(node.index) > 0; }
  /// Returns a row with the constant `value`.
  int constantRow(double value);

  const std::string& statements(Part part) const { return text_[static_cast<std::size_t>(part)]; }
  /// The tables' points and pieces as C.
  const std::string& tables() const { return tables_; }
  const std::set<std::string>& functions() const { return functions_; }
  const std::map<double, int>& constants() const { return row_of_constant_; }
  /// The rows of series as operations of series_resolution.inc.
  const std::vector<expression::SeriesOperation>& operations() const { return operations_; }
  int rows() const { return rows_; }
  int branches() const { return branches_; }
  int pieces() const { return pieces_; }

 private:
  using Entry = expression::Graph::Entry;

  void writeNode(expression::Node node, Part part);
  std::string statementOf(const Entry& entry, int result);
  std::string statementOfFunction(const Entry& entry, int result);
  std::string statementOfBranch(const Entry& entry, int result);
  std::string powerOf(const Entry& entry, int result);
  std::string tableOf(const Entry& entry, int result);
  /// Writes "f(r[1], r[2], n);" and notes that f is used.
  std::string call(const std::string& function, const std::vector<std::string>& arguments);
  void noteOperation(const std::string& function, const std::vector<std::string>& arguments);
  std::string row(int index) const { return "r[" + std::to_string(index) + "]"; }
  std::string operand(const Entry& entry, int k) const;
  std::string addRow() { return row(rows_++); }
  /// Makes rows of x^n by the products of powerOf; the statements are appended to `text`.
  std::string multipliedPower(const std::string& base, int n, std::string& text);
  std::string nameOfTable(int number);
  std::string nameOfTable2(int number);
  bool isPair(const Entry& entry, expression::Operation other, int* partner);
  void noteGrowth(expression::Node node, const Entry& entry);

  const expression::Graph& graph_;
  std::map<int, int> row_of_slot_;
  std::map<int, int> row_of_node_;
  std::map<double, int> row_of_constant_;
  std::set<int> accelerated_;
  std::set<int> grows_;     ///< may overflow by an exp
  std::set<int> has_pole_;  ///< may be infinite for another reason
  /// Sine and cosine (hyperbolic: with the operand less one, negated) of an operand, made together.
  std::map<std::pair<bool, int>, std::pair<int, int>> pairs_;
  std::map<int, std::string> table_names_;
  std::map<int, std::string> table2_names_;
  std::set<std::string> functions_;
  std::vector<expression::SeriesOperation> operations_;
  bool is_series_ = false;  ///< true while series are written
  std::string text_[3];
  std::string tables_;
  int rows_;
  int branches_ = 0;
  int pieces_ = 0;
};

}  // namespace variator_sim
