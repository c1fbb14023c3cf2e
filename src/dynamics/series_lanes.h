/// Whole steps of several motions in one: series_step.inc where each number is a vector, of machine
/// code. With eight a vector is as wide as processors have them, and what a step costs beside its
/// numbers is shared by as many.
///
/// The motions differ in numbers alone, and in where each of them is: its time, its step. A motion
/// keeps its lane from step to step; the bits are those that it has alone. Coefficients stay in the
/// lanes until somebody asks for them.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "dynamics/motion_series.h"
#include "machine_code/kernel_library.h"

namespace variator_sim {

namespace series_lanes {
/// What is a vector in the C.
constexpr int kLanes = 8;
struct alignas(8 * kLanes) Real {
  double lane[kLanes];
  double& operator[](int n) { return lane[n]; }
  double operator[](int n) const { return lane[n]; }
};
#define SERIES_LANES kLanes
#include "dynamics/series_step_data.inc"
#undef SERIES_LANES
}  // namespace series_lanes

/// Of one thread at a time.
class SeriesLanes {
 public:
  static constexpr int kLanes = series_lanes::kLanes;

  /// `library`: that of `like`, see MotionSeries::loadLanes; at least all of the series to come
  /// share their machine code with it.
  SeriesLanes(const MotionSeries& like, std::shared_ptr<KernelLibrary> library);

  /// Whether the lanes give the numbers of `series` alone. Not in the loop.
  bool agreesWith(MotionSeries& series);
  /// Whether it shares the machine code that this belongs to, and what no lane has of its own.
  bool fits(const MotionSeries& series) const {
    return series.library_ == of_ && (!is_loaded_ || series.step_.has_neutral == step_.has_neutral);
  }
  /// Steps of each, in the lane that is its place, until some have made all that they want: true
  /// for these. The others are to be given again; nullptr leaves a lane alone.
  std::array<bool, kLanes> make(const std::array<MotionSeries*, kLanes>& series);
  /// Writes the coefficients of the last step in `lane` where `series` has its own; of which rows:
  /// see StepsTogether.
  void fetch(MotionSeries& series, int lane, int begin, int end) const;

 private:
  using Real = series_lanes::Real;
  using Step = series_lanes::SeriesStep;
  using Code = void (*)(Step* step);

  void load(const MotionSeries& series, int lane);
  void give(const MotionSeries& series, int lane);
  /// From the end of its last step, as series_step.inc goes on.
  void goOn(int lane, int shafts);
  void take(MotionSeries& series, int lane);
  void clear(int lane);

  std::shared_ptr<KernelLibrary> library_;
  const KernelLibrary* of_;  ///< the code of one motion
  Code code_;
  std::vector<Real> rows_[2];
  std::vector<Real> states_[2];
  std::vector<Real> inverse_[2];
  std::vector<Real> constants_;
  bool is_loaded_ = false;
  bool is_spoilt_[kLanes] = {};  ///< by numbers that are none
  int made_[kLanes] = {};        ///< steps of those that it is in the middle of
  int used_ = 0;  ///< the series of the step to come; the other one is that of the next
  Step step_ = {};
};

}  // namespace variator_sim
