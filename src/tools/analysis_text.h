/// Linear models and steady states for the command line and for Python.
#pragma once

#include <string>

#include "variator_sim/linear_model.h"
#include "variator_sim/motion_state.h"

namespace variator_sim {

/// Returns a report of states, eigenvalues and notes, with the matrices if `with_matrices`.
std::string describeModel(const LinearModel& model, bool with_matrices);

/// Returns the extension of a model's file: .csv, .npz or .mat. Throws UsageError for others.
std::string endingOfModel(const std::string& path);

/// Returns the model as CSV, matrix,row,column,value, a line per entry, without loss of digits.
std::string writeModel(const LinearModel& model);

/// Returns a state from which a motion can continue, its inputs constant.
MotionState makeState(const OperatingPoint& point, const Scene& scene);

/// Returns "stable, ..." or "unstable: ...", by the eigenvalues of the linear model there, or why
/// that is not known.
std::string describeStability(const Scene& scene, const OperatingPoint& point);

}  // namespace variator_sim
