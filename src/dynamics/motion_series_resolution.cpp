// Checks that the series of a motion's formulas resolve the formulas along a step.
#include "dynamics/motion_series.h"

namespace variator_sim {

bool MotionSeries::isResolved(double length, double absolute, double relative,
                              const double* const* at) const {
  double inertia[kMaxShafts];
  for (int i = 0; i < S; ++i) inertia[i] = drivetrain_.inertia().entry(i, i);
  const bool moves = !isInertiaConstant();
  const expression::SeriesOutputs outputs = {S,
                                             k_,
                                             row_of_velocity_,
                                             row_of_acceleration_,
                                             row_of_torque_,
                                             row_of_residual_,
                                             row_of_entry_[0],
                                             layout_.constraint_order,
                                             kMaxShafts,
                                             inertia,
                                             moves ? row_of_inertia_ : nullptr,
                                             row_of_inertial_torque_,
                                             row_of_connection_,
                                             absolute,
                                             relative,
                                             length,
                                             0,
                                             0,
                                             nullptr};
  return program_.isResolved(length / own().unit, own().order, outputs, at);
}

void MotionSeries::setVariables(double t, double h, double part, const double* x) {
  ++stamp_;
  is_next_begun_ = false;
  fetched_ = kMostSampled;
  own().unit = h;
  own().order = kStepOrder;
  setInputs(t + part * h, 0);  // by their closed form at t
  setState(drivetrain_.origin() + t + part * h, x);
}

void MotionSeries::beginArguments() {
  if (begin_code_ != nullptr) {
    beginRows();
  } else {
    program_.begin(expression::SeriesProgram::Part::kArguments);
  }
}

bool MotionSeries::mayHideAlong(double t, double h, const double* x, const double* x_end) {
  if (!program_.canHide()) return false;
  setVariables(t, h, 0.0, x);
  // (They differ from the last step's end after a command or the end of an input's closed form.)
  if (!program_.areArgumentsNoted()) {
    beginArguments();
    program_.noteArguments();
  }
  setVariables(t, h, 1.0, x_end);
  beginArguments();
  const bool may_hide = program_.haveArgumentsGoneFar();
  program_.noteArguments();
  return may_hide;
}

bool MotionSeries::isStepResolved(double t, double h, const double* x, const double* x_middle,
                                  const double* x_end, double absolute, double relative) {
  struct Parabolas final : expression::AccelerationSolver {
    explicit Parabolas(MotionSeries& series) : it(series) {}
    void solve(int n) override {
      for (int i = 0; i < it.S; ++i) {
        it.program_.set(it.row_of_acceleration_[i], n, n < 3 ? epsilon[i][n] : 0.0);
      }
    }
    MotionSeries& it;
    double epsilon[kMaxShafts][3];
  } parabolas(*this);
  // c_0 + c_1 s + c_2 s^2, s = (t - t_0) / h
  const auto fit = [&](int n, double* c) {
    c[0] = x[n];
    c[1] = 4.0 * x_middle[n] - 3.0 * x[n] - x_end[n];
    c[2] = 2.0 * (x[n] + x_end[n] - 2.0 * x_middle[n]);
  };
  const double* const along[] = {x, x_middle, x_end};
  for (const int n : {2, 1, 0}) {  // The series begin at the last one.
    setVariables(t, h, 0.5 * n, along[n]);
    beginRows();
    for (std::size_t r = 0; r < rows_along_[n].size(); ++r) {
      rows_along_[n][r] = program_.coefficients(static_cast<int>(r))[0];
    }
  }
  for (int i = 0; i < S; ++i) {
    double omega[3];
    fit(S + i, omega);
    fit(2 * S + i, parabolas.epsilon[i]);
    for (int n = 1; n <= kStepOrder; ++n) {
      program_.set(row_of_velocity_[i], n, n < 3 ? omega[n] : 0.0);
      program_.set(row_of_angle_[i], n, n < 4 ? h * omega[n - 1] / n : 0.0);
    }
  }
  setInputs(t, kStepOrder);
  program_.set(row_of_time_, 1, h);
  for (int n = 1; n <= kStepOrder; ++n) {
    for (int i = 0; i < S; ++i) program_.set(row_of_acceleration_[i], n, 0.0);
    program_.extend(n, true, parabolas);
  }
  const double* const at[] = {rows_along_[0].data(), rows_along_[1].data(), rows_along_[2].data()};
  const bool is_resolved = isResolved(h, absolute, relative, at);
  double poison = 0.0;  // 0 * finite = 0
  for (int r = 0; r < program_.rowCount(); ++r) {
    for (int n = 0; n <= kStepOrder; ++n) poison += 0.0 * program_.coefficients(r)[n];
  }
  if (poison != 0.0) program_.clear();
  return is_resolved;
}

}  // namespace variator_sim
