/// The rows of C along a motion: whether one vanishes, or is stepped over where it does.
#pragma once

#include <algorithm>
#include <iterator>

#include "dynamics/shaft_count.h"
#include "dynamics/system.h"

namespace variator_sim {

/// Rows are compared in the metric J^-1. All are [loop].
class RowWatch {
 public:
  enum class Verdict {
    kGood,
    kTurned,   ///< by more than 90 degrees since the last ones: the step passed over a zero of C
    kVanished  ///< `vanished()` has
  };
  using Row = double[kMaxShafts];

  explicit RowWatch(System& system)
      : S(system.shafts()), system_(system), drivetrain_(system.drivetrain()) {}

  void reset() {
    std::fill(std::begin(reference_), std::end(reference_), 0.0);
    has_new_rows_ = false;
  }

  /// The rows have been so long before: the square of the longest that row m has been.
  void remember(int m, double length_squared) { reference_[m] = length_squared; }

  /// Remembers the rows of the last derivative taken: where a step has ended or a motion begins.
  void look();
  /// Judges those that were looked at last. Where a motion begins (`is_start`) there are none to
  /// compare them with.
  Verdict note(bool is_start);
  /// The next ones are not compared with those before.
  void noteAnew() { has_new_rows_ = true; }

  /// The constraint whose row has vanished, and its length as a part of the longest it has been.
  int vanished() const { return vanished_; }
  double measure() const { return measure_; }
  /// Squared length of the longest that row m has been.
  double reference(int m) const { return reference_[m]; }
  const double* references() const { return reference_; }
  /// C at the last end of a step that was good.
  const Row* rows() const { return rows_; }

 private:
  /// Rows of C with their squared lengths.
  struct Rows {
    Row row[kMaxRows] = {};
    double length_squared[kMaxRows] = {};
  };
  /// Not as a loop of any length: that becomes a call.
  void copyRow(const double* from, double* to) const {
    forEachComponent(0, S, [&](int i) { to[i] = from[i]; });
  }
  bool haveTurned() const;
  /// True where none is short beside the longest it has been.
  bool areLong(const double* lengths_squared);
  void remember(const Row* rows);

  /// A row of C shorter than this part of the longest it has been counts as zero.
  static constexpr double kVanished = 1e-10;

  const int S;  // shafts
  System& system_;
  Drivetrain& drivetrain_;  // the system's
  double reference_[kMaxRows] = {};
  Row rows_[kMaxRows] = {};
  Rows looked_at_;
  bool has_new_rows_ = false;
  int vanished_ = -1;
  double measure_ = 0.0;
};

}  // namespace variator_sim
