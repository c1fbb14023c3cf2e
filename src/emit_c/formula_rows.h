/// A SeriesProgram as statements of C: calls of the functions of runtime/operations.h.
#pragma once

#include <array>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "expression/series_statements.h"

namespace variator_sim {

/// Writes a double as C, exactly.
std::string literalOf(double value);
std::string listOf(const std::vector<double>& values);
std::string listOf(const std::vector<int>& values);

/// Every row of the program has its number in C, too; tables have further rows behind them.
class FormulaRows : private expression::SeriesStatements {
 public:
  /// The C function that holds a statement: of rows without accelerations, of those that the
  /// constraints need, the changes of these by accelerations that have been solved for, the other
  /// rows with accelerations, and rows that are needed at order 0 only.
  enum class Part { kGiven, kTried, kCorrected, kRest, kAtOnce };
  static constexpr int kParts = 5;

  /// The first `series` outputs of `program` are needed as series, the others at order 0.
  FormulaRows(const expression::SeriesProgram& program, int series);

  const std::string& statements(Part part) const { return text_[static_cast<std::size_t>(part)]; }
  /// The tables' points and pieces as C.
  const std::string& tables() const { return tables_; }
  /// Rows with a value that never changes.
  const std::vector<std::pair<int, double>>& constants() const { return program_.constants_; }
  /// Operations of rows that are series, with the modes and pieces of the emitted program.
  std::vector<expression::SeriesOperation> resolved() const;
  int rows() const { return rows_; }
  int modes() const { return modes_; }
  int pieces() const { return pieces_; }

 private:
  std::set<int> findSeries(int outputs) const;
  void noteGrowth(const Instruction& it);
  void add(Part part, const std::string& text);
  std::string statementOf(const Instruction& it);
  std::string number(double value, std::size_t place) const override;
  std::string mode(const Instruction& it) const override;
  std::string tableOf(const Instruction& it);
  std::string tableOfTwo(const Instruction& it);
  /// Writes a table, unless the same is there, and returns its name.
  std::string define(const std::string& type, const std::string& origin,
                     const std::vector<std::vector<double>>& points,
                     const std::vector<double>& pieces);
  /// True if the function may stay at a limit where its operand overflows.
  bool mayReachLimit(const Instruction& it) const;

  std::set<int> grows_;                             ///< rows that may overflow by an exp
  std::map<int, int> mode_of_state_;                ///< of branches
  std::map<int, int> piece_of_row_;                 ///< of tables
  std::map<std::string, std::string> table_names_;  ///< by contents
  std::array<std::string, kParts> text_;
  std::string tables_;
  std::set<int> in_series_;  ///< instructions
  int rows_;
  int modes_ = 0;
  int pieces_ = 0;
};

}  // namespace variator_sim
