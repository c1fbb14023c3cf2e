/// What a SeriesProgram does from order 1 on, with everything found out beforehand that can be.
#pragma once

#include <vector>

#include "expression/series_program.h"

namespace variator_sim::expression {

class SeriesArranger {
 public:
  explicit SeriesArranger(SeriesProgram& program) : made_(program) {}

  /// Makes the operations of all parts of a program whose instructions are there.
  void arrange();

 private:
  using Code = SeriesProgram::Code;
  using Instruction = SeriesProgram::Instruction;
  using Operation = SeriesProgram::Operation;
  using Kind = Operation::Kind;

  int place(int row) const { return row < 0 ? 0 : static_cast<int>(made_.offset(row)); }
  /// False where coefficients from `order` on are 0.
  bool isWritten(int index, int order) const;
  /// Of order `order` and of those beyond it up to the next one that is arranged.
  std::vector<Operation> arrangeOrder(int order);
  Operation begin(int index, Kind kind) const;
  Operation arrange(int index);
  Operation sum(int index);
  /// Of no instruction: it is carried out where a function stays at its limit, too.
  Operation noteChange(Kind kind, int row) const;
  void arrangeChange(int index, std::vector<Operation>* operations);
  Operation changeOfProduct(int index) const;
  Operation changeOfSum(int index);

  SeriesProgram& made_;
};

}  // namespace variator_sim::expression
