/// Linear models as text.
#pragma once

#include <string>

#include "variator_sim/linear_model.h"

namespace variator_sim {

/// Returns a report of states, eigenvalues and notes, with the matrices if `with_matrices`.
std::string describeModel(const LinearModel& model, bool with_matrices);

/// Returns the extension of a model's file: .csv, .npz or .mat. Throws UsageError for others.
std::string endingOfModel(const std::string& path);

/// Returns the model as CSV, matrix,row,column,value, a line per entry, without loss of digits.
std::string writeModel(const LinearModel& model);

}  // namespace variator_sim
