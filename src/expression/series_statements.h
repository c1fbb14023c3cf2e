/// Writes the instructions of a SeriesProgram as C: calls of the functions of runtime/operations.h.
#pragma once

#include <cstddef>
#include <string>

#include "expression/series_program.h"

namespace variator_sim::expression {

class SeriesStatements {
 protected:
  using Code = SeriesProgram::Code;
  using Instruction = SeriesProgram::Instruction;
  using Piece = SeriesProgram::Piece;
  using Term = SeriesProgram::Term;

  explicit SeriesStatements(const SeriesProgram& program) : program_(program) {}
  ~SeriesStatements() = default;

  /// Writes the statement that computes coefficient n of an instruction's results.
  std::string compute(const Instruction& it) const;
  /// Writes the statements that correct coefficient n of its results for those of the
  /// accelerations; the changes of its operands are declared before. Functions without a simple
  /// change are computed anew by `computed`; so are quotients unless `changes_quotients`.
  std::string correct(const Instruction& it, const std::string& computed,
                      bool changes_quotients = false) const;
  /// True if no function calls for the change of its result.
  static bool isRate(const Instruction& it) {
    return it.code == Code::kRate || it.code == Code::kWronskian;
  }
  static bool hasTwoResults(const Instruction& it) {
    return it.code == Code::kSinCos || it.code == Code::kSinhCosh;
  }

  static std::string row(int n) { return "r[" + std::to_string(n) + "]"; }
  static std::string change(int row) { return "d" + std::to_string(row); }

  const SeriesProgram& program_;

 private:
  /// Writes constant `place` of SeriesProgram::addStructure.
  virtual std::string number(double value, std::size_t place) const = 0;
  /// Writes the place of a mode.
  virtual std::string mode(const Instruction& it) const = 0;

  std::string constant(const Instruction& it) const;
  /// Appends factor x, Term `place`, to a sum.
  std::string addTerm(const std::string& sum, int place, const std::string& x) const;
  std::string sumOfTerms(const Instruction& it) const;
  std::string call(const Instruction& it) const;
  std::string changeOf(const Instruction& it) const;
};

}  // namespace variator_sim::expression
