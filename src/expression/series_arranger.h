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
  Operation begin(int index, Kind kind) const;
  Operation arrange(int index);
  Operation sum(int index);
  void arrangeChange(int index, std::vector<Operation>* operations);
  Operation changeOfProduct(int index) const;
  Operation changeOfSum(int index);

  SeriesProgram& made_;
};

}  // namespace variator_sim::expression
