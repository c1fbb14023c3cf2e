/// The formulas of a motion as statements, one for each row or two: calls of the functions of
/// runtime/operations.h and tables.h, which MotionInterpreter executes and kernels and emitted
/// programs have as text.
#pragma once

#include <array>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "expression/series_program.h"

namespace variator_sim {

class MotionRows {
 public:
  using Code = expression::SeriesProgram::Code;
  using Instruction = expression::SeriesProgram::Instruction;
  using Term = expression::SeriesProgram::Term;

  /// The function of the runtime that holds a statement: vs_given (no accelerations), vs_tried
  /// (with accelerations, and constraints read it), vs_rest (others with accelerations), vs_at_once
  /// (needed at order 0 only). vs_corrected has the changes of vs_tried.
  enum class Part { kGiven, kTried, kRest, kAtOnce };

  struct Statement {
    const Instruction* it = nullptr;
    int limit = -1;  ///< a row; where it has overflowed the function may stay at its limit
    int mode = -1;   ///< the first of its modes
    int rows = -1;   ///< of a table: the first of its further rows
    int table = -1;  ///< index in tables()
    int piece = -1;  ///< of a table or an opaque function: the first of its places
    const OpaqueFunction* function = nullptr;
  };
  /// One variable or two; pieces as those of vs_table and vs_table_of_two.
  struct DenseTable {
    std::string origin;
    std::vector<std::vector<double>> points;
    std::vector<double> pieces;
  };

  /// The first `series` outputs of `program` are needed as series, the others at order 0.
  MotionRows(const expression::SeriesProgram& program, int series);

  const std::vector<Statement>& statements(Part part) const {
    return statements_[static_cast<std::size_t>(part)];
  }
  const std::vector<DenseTable>& tables() const { return tables_; }
  /// Rows with a value that never changes.
  const std::vector<std::pair<int, double>>& constants() const { return program_.constants_; }
  /// Terms of sums: those of an instruction from aux[0] on, aux[1] of them.
  const std::vector<Term>& terms() const { return program_.terms_; }
  /// The rows of the accelerations.
  const std::vector<int>& accelerations() const { return program_.accelerations_; }
  const expression::SeriesProgram& program() const { return program_; }
  /// Operations of rows that are series, with their modes and pieces here.
  std::vector<expression::SeriesOperation> resolved() const;
  static bool hasTwoResults(const Instruction& it) {
    return it.code == Code::kSinCos || it.code == Code::kSinhCosh;
  }
  int rows() const { return rows_; }
  int modes() const { return modes_; }
  int pieces() const { return pieces_; }

  /// Writes the functions of all parts, with the tables before them, or for a program that reads
  /// them and all numbers from vs_numbers.
  std::string write(bool shares) const;
  /// Returns vs_numbers::constants: factors of terms, then constants of instructions.
  std::vector<double> numbers() const;
  /// The place of an instruction's constant there.
  std::size_t placeOf(const Instruction& it) const {
    return program_.terms_.size() + static_cast<std::size_t>(&it - program_.instructions_.data());
  }

 private:
  class Writer;  // motion_rows_text.cpp
  using Piece = expression::SeriesProgram::Piece;

  void noteGrowth(const Instruction& it);
  Statement make(const Instruction& it);
  /// Returns the index of a table, which is added unless the same is there.
  int add(DenseTable table);
  static DenseTable cut(const Piece& piece);
  static DenseTable cutTwo(const Piece& piece);
  /// Returns a row by whose overflow the function may stay at a limit, or -1.
  int limitOf(const Instruction& it) const;

  const expression::SeriesProgram& program_;
  std::set<int> grows_;               ///< rows that may overflow by an exp
  std::map<int, int> mode_of_state_;  ///< of branches
  std::map<int, int> piece_of_row_;   ///< of tables and opaque functions
  std::array<std::vector<Statement>, 4> statements_;
  std::vector<DenseTable> tables_;
  std::set<int> in_series_;  ///< results
  int rows_;
  int modes_ = 0;
  int pieces_ = 0;
};

}  // namespace variator_sim
