/// Looks inside a step for the first change of a branch.
///
/// One guard after the other is enclosed (guard.h) over the step, as far as what was found before;
/// where the enclosure stays on its branch nothing can have happened, however briefly. Other parts
/// are halved, the earlier half first, until they are as short as the resolution: there the branch
/// at the end decides. So an even number of crossings is found as well as an odd one. A guard that
/// is linear is one polynomial: where its coefficients change their sign once there is one root,
/// and it is narrowed at once (Descartes' rule of signs). Of a guard that is known at single states
/// only many of them are looked at, and around every least distance more.
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "dynamics/system.h"
#include "integrate/step_curve.h"
#include "variator_sim/guard.h"

namespace variator_sim {

/// The result of a search in a step, whose parts run from 0 to 1.
struct GuardFinding {
  enum class Kind {
    kClear,     ///< every guard stays on its branch
    kCrossing,  ///< `guard` leaves it between `clear` and `beyond`
    kUnknown    ///< too much to look at: nothing is known behind `clear`
  };
  Kind kind = Kind::kClear;
  double clear = 1.0;
  double beyond = 1.0;
  int guard = -1;
};

class GuardSearch {
 public:
  /// Brings inputs to a time, for guards that read them.
  using View = std::function<StateView(double time, const double* angle, const double* velocity,
                                       const double* acceleration)>;

  /// Encloses all inputs, kMaxInputs at the most, over a time.
  using InputRange = std::function<void(const Interval& time, Interval* inputs)>;

  void setGuards(std::vector<GuardPtr> guards, View view, InputRange input_range);
  bool isEmpty() const { return guards_.empty(); }
  int count() const { return static_cast<int>(guards_.size()); }
  const Guard& guard(int index) const { return *guards_[static_cast<std::size_t>(index)]; }

  /// Whether some law itself jumps at an edge.
  bool hasJumps() const;
  /// The motion stands at `state`: its branches are those of the step to come. [loop]
  void moveBase(const StateView& state);
  /// The branch of a guard at the base; Guard::kOnEdge where none can be told. [loop]
  int side(int index) const { return sides_[static_cast<std::size_t>(index)]; }
  /// Whether a guard has left its branch at `state`. [loop]
  bool hasLeft(int index, const StateView& state) const;
  bool hasAnyLeft(const StateView& state) const;

  /// A guard along whose edge the motion goes on is left alone until it has kept its branch for
  /// some steps. [loop]
  void mute(int index);
  /// The same for the next step alone, where the edge lies within rounding of the accelerations at
  /// `state`. [loop]
  void muteOnEdge(int index, const StateView& state, int shafts);

  /// Whether the guard's argument is zero but for rounding at `state`: its sign there decides
  /// nothing. [loop]
  bool isNear(int index, const StateView& state, int shafts);

  /// In the step that is looked at a guard is left alone. [loop]
  void ignore(int index) { ignored_[static_cast<std::size_t>(index)] = 1; }
  void ignoreNone() { std::fill(ignored_.begin(), ignored_.end(), 0); }

  /// Leaves none of them alone any more.
  void reset();

  /// True when no guard can leave its branch in `box`, which holds all states of the step from the
  /// base; it gets its inputs here. [loop]
  bool isClear(StateBox& box);
  /// The view of the step at `part`. [loop]
  StateView at(const StepCurve& curve, double part);
  /// The first crossing in a step from the base that went along `curve`; `resolution` is the
  /// shortest part that can be told from none. [loop]
  GuardFinding find(const StepCurve& curve, double resolution);

 private:
  /// Branches of guards that start on an edge, or within rounding of it: those that they come to
  /// first. Until then their signs decide nothing. Those that stay on their branches in `box`,
  /// which holds the step from `first` on, are not looked at.
  void settleSides(const StepCurve& curve, double resolution, const StateView& first,
                   const StateBox& box);
  /// Whether a guard keeps its branch between two parts of the step, by its value in the middle and
  /// its rate between: these tell even where its argument is a small difference of what moves much.
  bool staysByRate(std::size_t i, const StepCurve& curve, double from, double to,
                   const Interval& rate);
  /// Gives `box` the inputs over its time.
  void addInputs(StateBox& box);
  /// A guard that is linear: `first` is its value at the beginning.
  void findLinear(std::size_t i, const StepCurve& curve, double resolution, double first,
                  GuardFinding* finding);
  /// A guard that is known over a box.
  void findEnclosed(std::size_t i, const StepCurve& curve, double resolution,
                    GuardFinding* finding);
  enum class Verdict { kClear, kUnclear, kStands, kFound };
  /// A guard that crosses its edge at most once between two parts of the step: `is_clear` tells of
  /// a part whether the guard cannot have left its branch before.
  template <class IsClear>
  Verdict crossOnce(std::size_t i, const StepCurve& curve, double resolution, double clear,
                    double end, const IsClear& is_clear, GuardFinding* finding);
  /// Looks at the first `count` of `parts_`, which are polynomials as far as the finding before, by
  /// `look` at them between two parts of the step.
  template <class Look>
  void halve(std::size_t i, const StepCurve& curve, double resolution, std::size_t count,
             const Look& look, GuardFinding* finding);
  /// True, and noted, when a guard has left its branch by `end`; up to `clear` it has not.
  bool noteIfLeft(std::size_t i, const StepCurve& curve, double clear, double end,
                  GuardFinding* finding);
  void findOpaque(int index, const StepCurve& curve, double resolution, GuardFinding* finding);
  double distanceAt(int index, const StepCurve& curve, double part);

  std::vector<GuardPtr> guards_;
  View view_;
  InputRange input_range_;
  std::vector<int> sides_;
  std::vector<int> step_sides_;  ///< the same, edges settled
  std::vector<double> leaves_;   ///< the part of the step at which a guard has left rounding
  std::vector<int> muted_;       ///< steps for which it still has to keep its branch
  std::vector<char> ignored_;
  std::size_t last_ = 0;  ///< that could not be excluded: looked at first
  bool has_opaque_ = false;
  bool reads_inputs_ = false;  ///< an enclosed guard does
  Interval inputs_[kMaxInputs];
  std::vector<StepCurve::Coefficients> parts_;
  double angle_[kMaxShafts] = {};
  double velocity_[kMaxShafts] = {};
  double acceleration_[kMaxShafts] = {};
};

/// Watches the stages of a step: whether one of them lies behind a jump that the step, which begins
/// before it, does not cross.
class JumpWatch final : public StageWatch {
 public:
  explicit JumpWatch(const GuardSearch& guards) : guards_(guards) {}
  void begin() {
    is_on_ = true;
    has_left_ = false;
  }
  /// True when a stage lay behind a jump. [loop]
  bool end() {
    is_on_ = false;
    return has_left_;
  }
  /// A stage at `state`. [loop]
  void note(const StateView& state) override {
    if (!is_on_ || has_left_) return;
    for (int i = 0; i < guards_.count() && !has_left_; ++i) {
      has_left_ = guards_.guard(i).jumps() && guards_.hasLeft(i, state);
    }
  }

 private:
  const GuardSearch& guards_;
  bool is_on_ = false;
  bool has_left_ = false;
};

}  // namespace variator_sim
