/// Steps of several motions at once: series_step.inc with vectors for numbers, as machine code.
/// Eight lanes fill the widest vectors of processors and share the overhead of a step.
///
/// The motions differ only in their numbers, times and steps. A motion keeps its lane from step to
/// step; its bits are those of steps alone. Coefficients stay in the lanes until the motion fetches
/// them.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "dynamics/motion_series.h"
#include "machine_code/kernel_library.h"

namespace variator_sim {

namespace series_lanes {
/// Numbers per vector in the C.
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

/// One thread may use it at a time.
class SeriesLanes {
 public:
  static constexpr int kLanes = series_lanes::kLanes;

  /// `library`: that of `like`, see MotionSeries::loadLanes; at least all of the series to come
  /// share their machine code with it.
  SeriesLanes(const MotionSeries& like, std::shared_ptr<KernelLibrary> library);

  /// Returns true if the lanes give the numbers of `series` alone. Not in the loop.
  bool agreesWith(MotionSeries& series);
  /// Returns true if `series` shares this machine code and all data common to the lanes.
  bool fits(const MotionSeries& series) const {
    return series.library_ == of_ && (!is_loaded_ || series.step_.has_neutral == step_.has_neutral);
  }
  /// Steps each motion, in the lane of its index, until some have made all their steps: true for
  /// these. The caller passes the others again; nullptr leaves a lane idle.
  std::array<bool, kLanes> make(const std::array<MotionSeries*, kLanes>& series);
  /// Copies the coefficients of the last step in `lane` to `series`; StepsTogether lists the rows.
  void fetch(MotionSeries& series, int lane, int begin, int end) const;

 private:
  using Real = series_lanes::Real;
  using Step = series_lanes::SeriesStep;
  using Code = void (*)(Step* step);

  void load(const MotionSeries& series, int lane);
  void give(const MotionSeries& series, int lane);
  /// Continues from the end of the lane's last step, as series_step.inc does.
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
  bool is_spoilt_[kLanes] = {};  ///< by numbers that are not finite
  int made_[kLanes] = {};        ///< steps made of the current batch
  int used_ = 0;                 ///< series of the coming step; the other one is the next step's
  Step step_ = {};
};

}  // namespace variator_sim
