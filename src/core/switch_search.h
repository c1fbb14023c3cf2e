/// Steps that end where a law has a kink.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace variator_sim {

/// Looks for the length of a step from a given state at which the first of some switches (functions
/// of the state that are zero at the kinks of a scene's laws) changes its sign.
///
/// Trial steps of different length from the same state tell on which side of the kink they end. A
/// bracket of lengths shrinks around it: by the secant through its ends, with the Illinois rule
/// (the end that stays counts half from its second time on), and half the resolution aimed too far.
/// Then a step is made to the near end of the bracket, which has seen nothing of the kink in any
/// stage, and one across the bracket (the hop), which is too short for the kink to matter.
class SwitchSearch {
 public:
  /// What is to be done after a trial step.
  enum class Verdict { kAccept, kRepeat };

  void setCount(int count) {
    const auto size = static_cast<std::size_t>(count);
    base_.assign(size, 0.0);
    clear_.assign(size, 0.0);
    beyond_.assign(size, 0.0);
    trial_.assign(size, 0.0);
  }
  bool isEmpty() const { return base_.empty(); }
  /// Where the values of the switches at the end of a trial are to be written.
  double* trial() { return trial_.data(); }

  /// The motion stands where `trial` was taken.
  void moveBase() { base_ = trial_; }
  /// A new step begins at the base. Lengths are found to within `resolution` parts of the first
  /// one.
  void beginStep(double resolution) {
    clear_length_ = 0.0;
    beyond_length_ = std::numeric_limits<double>::infinity();
    relative_resolution_ = resolution;
    clear_ = base_;
    last_side_ = 0;
    trials_ = 0;
    hop_ = 0.0;
  }
  /// The length of the hop that has to follow an accepted step; 0: none.
  double hop() const { return hop_; }
  /// Whether a kink was met in this step.
  bool hasMet() const { return std::isfinite(beyond_length_); }

  /// A good trial of `length` ended with the values in `trial`; no length below `smallest` can be
  /// told from another. kRepeat: with the length `next`.
  Verdict note(double length, double smallest, double* next) {
    hop_ = 0.0;
    if (++trials_ > kMostTrials) return Verdict::kAccept;
    if (crosses(trial_)) {
      if (!hasMet()) resolution_ = std::max(relative_resolution_ * length, smallest);
      beyond_ = trial_;
      beyond_length_ = length;
      if (last_side_ == 1) halve(clear_);
      last_side_ = 1;
    } else {
      if (!hasMet()) return Verdict::kAccept;
      clear_ = trial_;
      clear_length_ = length;
      if (last_side_ == -1) halve(beyond_);
      last_side_ = -1;
    }
    if (beyond_length_ - clear_length_ <= resolution_) {
      if (last_side_ == 1 && clear_length_ == 0.0) return Verdict::kAccept;  // a kink at the base
      if (last_side_ == -1) {
        hop_ = beyond_length_ - clear_length_ + 2.0 * smallest;
        return Verdict::kAccept;
      }
      *next = clear_length_;
      return Verdict::kRepeat;
    }
    *next = guess();
    return Verdict::kRepeat;
  }

  /// A trial of `length` had too large an error and ended with the values in `trial`. True when
  /// that is beyond a kink, which tells why: then with the length `next`, up to the kink.
  bool noteRejected(double length, double smallest, double* next) {
    if (++trials_ > kMostTrials || !crosses(trial_)) return false;
    if (!(length - clear_length_ > 2.0 * smallest)) return false;
    if (!hasMet()) resolution_ = std::max(relative_resolution_ * length, smallest);
    beyond_ = trial_;
    beyond_length_ = length;
    last_side_ = 1;
    *next = std::max(clear_length_ + smallest, guess());
    return *next < length;
  }

 private:
  bool crosses(const std::vector<double>& values) const {
    for (std::size_t i = 0; i < base_.size(); ++i) {
      if (crosses(i, values[i])) return true;
    }
    return false;
  }
  /// A switch that starts at zero has no side yet. (Signs, as products may underflow.)
  bool crosses(std::size_t i, double value) const {
    return (base_[i] > 0.0 && value < 0.0) || (base_[i] < 0.0 && value > 0.0);
  }
  static void halve(std::vector<double>& values) {
    for (double& value : values) value *= 0.5;
  }
  double guess() const {
    const double width = beyond_length_ - clear_length_;
    double part = 1.0;  // of the bracket: the first root
    for (std::size_t i = 0; i < base_.size(); ++i) {
      if (crosses(i, beyond_[i])) part = std::min(part, clear_[i] / (clear_[i] - beyond_[i]));
    }
    if (!(part >= 0.0)) part = 0.5;
    // Never so near an end that nothing is gained should the root lie elsewhere.
    const double margin = std::min(0.1, 0.5 * resolution_ / width);
    part = std::min(std::max(part + 0.5 * resolution_ / width, margin), 1.0 - margin);
    return clear_length_ + part * width;
  }

  /// Two switches that cross side by side may keep the secant from converging fast.
  static constexpr int kMostTrials = 200;

  std::vector<double> base_;    // at the beginning of the step
  std::vector<double> clear_;   // at the longest trial that has crossed nothing
  std::vector<double> beyond_;  // at the shortest that has
  std::vector<double> trial_;
  double clear_length_ = 0.0;
  double beyond_length_ = std::numeric_limits<double>::infinity();
  double relative_resolution_ = 0.0;
  double resolution_ = 0.0;
  int last_side_ = 0;
  int trials_ = 0;
  double hop_ = 0.0;
};

}  // namespace variator_sim
