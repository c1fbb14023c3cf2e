/// Tables as the texts of the runtime read them.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/table.h"

namespace variator_sim::expression {

/// One variable or two; pieces as those of vs_table and vs_table_of_two.
struct DenseTable {
  std::string origin;
  std::vector<std::vector<double>> points;
  std::vector<double> pieces;
};

/// Returns the derivative of this order of a table.
DenseTable cut(const Table& table, const int (&order)[2]);

}  // namespace variator_sim::expression
