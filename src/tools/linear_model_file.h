/// Linear models as text.
#pragma once

#include <string>

#include "variator_sim/linear_model.h"

namespace variator_sim {

/// For reading: states, eigenvalues, notes; the matrices where `with_matrices`.
std::string describeModel(const LinearModel& model, bool with_matrices);

/// What the path of a model's file ends with: .csv, .npz or .mat. Throws UsageError for others.
std::string endingOfModel(const std::string& path);

/// The whole model as CSV, matrix,row,column,value, a line per entry: numbers to the bit.
std::string writeModel(const LinearModel& model);

}  // namespace variator_sim
