/// Precomputes the operations of a SeriesProgram from order 1 on.
#pragma once

#include <vector>

#include "expression/series_program.h"

namespace variator_sim::expression {

class SeriesArranger {
 public:
  explicit SeriesArranger(SeriesProgram& program) : made_(program) {}

  /// Makes the operations of all parts of a program with complete instructions.
  void arrange();

 private:
  using Code = SeriesProgram::Code;
  using Instruction = SeriesProgram::Instruction;
  using Operation = SeriesProgram::Operation;
  using Kind = Operation::Kind;

  int place(int row) const { return row < 0 ? 0 : static_cast<int>(made_.offset(row)); }
  /// Returns false if coefficients from `order` on are 0.
  bool isWritten(int index, int order) const;
  /// Arranges the operations from `order` up to the next arranged order.
  std::vector<Operation> arrangeOrder(int order);
  Operation begin(int index, Kind kind) const;
  Operation arrange(int index);
  Operation sum(int index);
  /// Belongs to no instruction: it is executed also for a function that stays at its limit.
  Operation noteChange(Kind kind, int row) const;
  void arrangeChange(int index, std::vector<Operation>* operations);
  Operation changeOfProduct(int index) const;
  Operation changeOfSum(int index);

  SeriesProgram& made_;
};

}  // namespace variator_sim::expression
