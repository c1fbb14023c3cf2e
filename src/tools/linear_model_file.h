/// Linear models as text and as files of other programs.
#pragma once

#include <string>

#include "variator_sim/linear_model.h"

namespace variator_sim {

/// For reading: states, eigenvalues, notes; the matrices where `with_matrices`.
std::string describeModel(const LinearModel& model, bool with_matrices);

/// Throws UsageError for a path with another ending than those of writeModel.
void checkModelPath(const std::string& path);

/// The whole model, in the format that the path ends with:
///     .csv   matrix,row,column,value, a line per entry
///     .npz   NumPy's: A, B, C, D, x, u, y, x_rate, time; states, inputs, outputs as texts
///     .mat   MATLAB's level 4: the same, names as matrices of characters
std::string writeModel(const LinearModel& model, const std::string& path);

}  // namespace variator_sim
