/// The formulas of a scene as power series along steps that other schemes make.
#pragma once

#include <memory>
#include <vector>

#include "motion_program/motion_steps.h"
#include "variator_sim/command_input.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// A state of the motion as nodes have it.
struct SeriesPoint {
  double time;               ///< s, from `origin` on
  double origin;             ///< s
  const double* state;       ///< angles, velocities, accelerations: 3 S
  const double* multiplier;  ///< of gauss, or nullptr
};

/// All but its construction are [loop].
class SceneSeries {
 public:
  /// Returns nullptr for a scene with an element that is no formula. `signals`: the closed forms of
  /// the inputs, from the same origin on, which have to outlive it.
  static std::unique_ptr<SceneSeries> make(const Scene& scene, const CommandSignal* signals);

  const std::shared_ptr<const MotionProgram>& program() const { return program_; }
  int order() const { return program_->SCENE_ORDER; }

  /// Expands the motion at a point as far as steps of `limit` s need it; shows its series, which
  /// hold until the next expansion or question. `usual`: the length that a step there may have, s,
  /// 0: not known. False where there are none.
  bool expand(const SeriesPoint& point, double usual, double limit, vs_shown* to);
  /// The number of the last expansion.
  long expansion() const { return expansion_; }

  /// True where a function may do more between two states, `length` s apart, than schemes see of
  /// it: then isStepResolved tells. Both are asked step by step.
  bool mayHideAlong(const SeriesPoint& from, const SeriesPoint& to);
  /// True where the formulas do nothing along a step that their series along parabolas through its
  /// start, middle and end do not show.
  bool isStepResolved(const SeriesPoint& from, const SeriesPoint& middle, const SeriesPoint& to);

 private:
  SceneSeries(const Scene& scene, const CommandSignal* signals,
              std::shared_ptr<const MotionProgram> program);
  const vs_exchange& describe(const SeriesPoint& point, double usual = 0.0);
  bool isNoted(const SeriesPoint& point) const;
  void note(const SeriesPoint& point);

  const CommandSignal* const signals_;
  const std::shared_ptr<const MotionProgram> program_;
  std::unique_ptr<HostedSeries> host_;
  const int S;  // shafts
  const int inputs_;
  long expansion_ = 0;
  vs_exchange it_ = {};
  double state_[3 * kMaxShafts] = {};
  double multiplier_[kMaxConstraints] = {};
  double none_[kMaxConstraints + kMaxShafts] = {};
  vs_exchanged_signal input_[kMaxInputs] = {};
  std::vector<double> values_[3];  ///< of all rows: at the last step's end, and along a step
  double noted_[3 * kMaxShafts + kMaxInputs] = {};  ///< the state and inputs of values_[0]
  double noted_at_;                                 ///< s, its time
};

}  // namespace variator_sim
