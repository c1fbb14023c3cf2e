#include "integrate/row_watch.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace variator_sim {

void RowWatch::look() {
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    looked_at_.length_squared[m] = system_.rowLengthSquared(m);
    copyRow(system_.row(m), looked_at_.row[m]);
  }
}

RowWatch::Verdict RowWatch::note(bool is_start) {
  system_.reaction().noteRows(looked_at_.row);
  if (!areLong(looked_at_.length_squared)) return Verdict::kVanished;
  if (drivetrain_.hasConstantJacobian()) return Verdict::kGood;
  const bool is_comparable = !is_start && !std::exchange(has_new_rows_, false);
  if (is_comparable && haveTurned()) return Verdict::kTurned;
  remember(looked_at_.row);
  return Verdict::kGood;
}

bool RowWatch::areLong(const double* lengths_squared) {
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    const double length_squared = lengths_squared[m];
    reference_[m] = std::max(reference_[m], length_squared);
    if (length_squared <= kVanished * kVanished * reference_[m]) {
      vanished_ = m;
      measure_ = std::sqrt(length_squared / reference_[m]);
      return false;
    }
  }
  return true;
}

void RowWatch::remember(const Row* rows) {
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    copyRow(rows[m], rows_[m]);
  }
}

bool RowWatch::haveTurned() const {
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    double turned[kMaxShafts];
    drivetrain_.inertia().solve(looked_at_.row[m], turned);
    double product = 0.0;
    for (int i = 0; i < S; ++i) product += rows_[m][i] * turned[i];
    if (!(product > 0.0)) return true;
  }
  return false;
}

}  // namespace variator_sim
