#include "dynamics/series_lanes.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

SeriesLanes::SeriesLanes(const MotionSeries& like, std::shared_ptr<KernelLibrary> library)
    : library_(std::move(library)),
      of_(like.library_),
      code_(reinterpret_cast<Code>(library_->find("series_step"))) {
  const Real zero = {};
  for (int which = 0; which < 2; ++which) {
    rows_[which].assign(like.program_.rowsSize(), zero);
    states_[which].assign(like.program_.statesSize() + 1, zero);
    inverse_[which].assign(sizeof like.own_[0].inverse / sizeof(double), zero);
  }
  constants_.assign(like.constants_count_ + 1, zero);
  for (int lane = 0; lane < kLanes; ++lane) {
    step_.unit[lane] = step_.next_unit[lane] = 1.0;
    step_.absolute[lane] = step_.relative[lane] = 1.0;
  }
}

void SeriesLanes::load(const MotionSeries& series, int lane) {
  const expression::SeriesProgram& program = series.program_;
  const double* const from = program.rows();
  // Velocities and angles are known to one order more than accelerations. The last place of a row
  // is kept by its recurrence.
  for (int row = 0; row < program.rowCount(); ++row) {
    const std::size_t at = program.offset(row);
    for (const std::size_t n : {at, at + 1, at + 2, program.offset(row + 1) - 1}) {
      rows_[0][n][lane] = rows_[1][n][lane] = from[n];
    }
  }
  for (std::size_t i = 0; i < program.statesSize(); ++i) {
    states_[used_][i][lane] = program.states()[i];
  }
  const int size = series.S + series.k_;
  const int count = size * size + 1 + 2 * series.S * series.S;
  for (int i = 0; i < count; ++i) {
    inverse_[used_][static_cast<std::size_t>(i)][lane] = series.own().inverse[i];
  }
  for (std::size_t i = 0; i < series.constants_count_; ++i) {
    constants_[i][lane] = series.constants_[i];
  }
  const SeriesStep& its = series.step_;
  for (int i = 0; i < series.S * series.S; ++i) {
    step_.inertia[i][lane] = its.inertia[i];
    step_.inertia_inverse[i][lane] = its.inertia_inverse[i];
  }
  for (int i = 0; i < series.S; ++i) {
    step_.is_neutral[i][lane] = its.is_neutral[i];
    step_.reaction[i][lane] = its.reaction[i];
  }
  step_.has_neutral = its.has_neutral;
  is_loaded_ = true;
  step_.absolute[lane] = its.absolute;
  step_.relative[lane] = its.relative;
  step_.decay[lane] = its.decay;
}

void SeriesLanes::give(const MotionSeries& series, int lane) {
  const SeriesStep& its = series.step_;
  step_.unit[lane] = its.unit;
  step_.next_unit[lane] = its.next_unit;
  step_.origin[lane] = its.origin;
  step_.time[lane] = its.time;
  step_.limit[lane] = its.limit;
  step_.limit_end[lane] = its.limit_end;
  step_.target[lane] = its.target;
  step_.horizon[lane] = its.horizon;
  step_.maximum[lane] = its.maximum;
  for (int n = 0; n < 3 * series.S; ++n) step_.x[n][lane] = its.x[n];
}

void SeriesLanes::goOn(int lane, int shafts) {
  const double length = step_.length[lane];
  const double reach = step_.horizon[lane] - step_.end[lane];
  step_.time[lane] = step_.end[lane];
  step_.limit[lane] = std::min(reach, step_.maximum[lane]);
  step_.limit_end[lane] =
      reach > step_.maximum[lane] ? step_.end[lane] + step_.limit[lane] : step_.horizon[lane];
  step_.unit[lane] = step_.next_unit[lane];
  step_.next_unit[lane] = MotionSeries::unitFor(length);
  for (int n = 0; n < 3 * shafts; ++n) step_.x[n][lane] = step_.x_new[n][lane];
}

void SeriesLanes::take(MotionSeries& series, int lane) {
  SeriesStep& its = series.step_;
  const int S = series.S;
  its.made = made_[lane] + step_.made;
  its.refused = step_.refused[lane];
  its.time = step_.time[lane];
  its.unit = step_.unit[lane];
  its.next_unit = step_.next_unit[lane];
  its.last = step_.last;
  its.limit = step_.limit[lane];
  its.length = step_.length[lane];
  its.end = step_.end[lane];
  its.doubt = step_.doubt[lane];
  is_spoilt_[lane] = is_spoilt_[lane] || std::isnan(its.doubt);
  series.lanes_ = this;
  for (int n = 0; n < 3 * S; ++n) its.x[n] = step_.x[n][lane];
  for (int made = 0; made < step_.made; ++made) {
    const series_lanes::SeriesNode& from = step_.node[made];
    SeriesNode& to = its.node[made_[lane] + made];
    to.end = from.end[lane];
    to.taken = from.taken[lane];
    to.length = from.length[lane];
    to.moved = from.moved[lane];
    to.projections = from.projections;
    for (int n = 0; n < 3 * S; ++n) to.x[n] = from.x[n][lane];
    for (int i = 0; i < S; ++i) {
      to.eta[i] = from.eta[i][lane];
      to.torque[i] = from.torque[i][lane];
      to.torque_rate[i] = from.torque_rate[i][lane];
      to.inertia[i] = from.inertia[i][lane];
    }
    for (int m = 0; m < series.k_; ++m) {
      to.row_length[m] = from.row_length[m][lane];
      to.multiplier[m] = from.multiplier[m][lane];
      for (int i = 0; i < S; ++i) to.C[m][i] = from.C[m][i][lane];
    }
  }
}

void SeriesLanes::clear(int lane) {
  for (std::vector<Real>& rows : rows_) {
    for (Real& number : rows) number[lane] = 0.0;
  }
  is_spoilt_[lane] = false;
}

std::array<bool, SeriesLanes::kLanes> SeriesLanes::make(
    const std::array<MotionSeries*, kLanes>& series) {
  used_ = 1 - used_;  // the next series were begun there
  step_.most = series_lanes::kSeriesStride;
  for (int lane = 0; lane < kLanes; ++lane) {
    if (series[lane] == nullptr) continue;
    if (made_[lane] > 0) {
      goOn(lane, series[lane]->S);
    } else {
      if (series[lane]->lanes_ != this) {
        if (is_spoilt_[lane]) clear(lane);
        load(*series[lane], lane);
      }
      give(*series[lane], lane);
    }
    step_.most = std::min(step_.most, series[lane]->step_.most - made_[lane]);
  }
  // A lane without a motion continues with its data, but never calls a deleted motion.
  const MotionSeries& any = **std::find_if(series.begin(), series.end(),
                                           [](const MotionSeries* it) { return it != nullptr; });
  step_.watches_rest = 0;
  for (int lane = 0; lane < kLanes; ++lane) {
    step_.counts[lane] = series[lane] != nullptr ? 1.0 : 0.0;
    if (series[lane] != nullptr && series[lane]->step_.watches_rest != 0) step_.watches_rest = 1;
    const SeriesStep& its = (series[lane] != nullptr ? *series[lane] : any).step_;
    step_.tables[lane] = its.tables[0];
    step_.input[lane] = its.input[0];
    step_.input_rate[lane] = its.input_rate[0];
    step_.input_second_rate[lane] = its.input_second_rate[0];
  }
  step_.rows = rows_[used_].data();
  step_.states = states_[used_].data();
  step_.inverse = inverse_[used_].data();
  step_.next_rows = rows_[1 - used_].data();
  step_.next_states = states_[1 - used_].data();
  step_.next_inverse = inverse_[1 - used_].data();
  step_.constants = constants_.data();
  step_.is_limited = 0;
  code_(&step_);
  // Each step has switched to the rows of the other series.
  if (step_.made % 2 == 0) used_ = 1 - used_;
  std::array<bool, kLanes> have_ended{};
  for (int lane = 0; lane < kLanes; ++lane) {
    if (series[lane] == nullptr) continue;
    take(*series[lane], lane);
    const SeriesStep& its = series[lane]->step_;
    have_ended[lane] = its.made == its.most || step_.goes_on[lane] == 0.0;
    made_[lane] = have_ended[lane] ? 0 : its.made;
  }
  return have_ended;
}

bool SeriesLanes::agreesWith(MotionSeries& series) {
  if (code_ == nullptr) return false;
  for (int state = 0; state < 8; ++state) {
    series.stepAside(state, 1.0);
    const SeriesStep alone = series.step_;
    series.stepAside(state, 1.0, [&] {
      std::array<MotionSeries*, kLanes> all{};
      all.fill(&series);
      while (!make(all)[0]) {
      }
      series.lanes_ = nullptr;
    });
    const SeriesStep& together = series.step_;
    if (alone.refused != 0.0) continue;
    bool is_same = alone.made == together.made && together.refused == 0.0;
    for (int n = 0; n < alone.made && is_same; ++n) {
      const SeriesNode& one = alone.node[n];
      const SeriesNode& other = together.node[n];
      is_same = std::equal(one.x, one.x + 3 * series.S, other.x) &&
                std::equal(one.eta, one.eta + series.S, other.eta) && one.taken == other.taken &&
                one.length == other.length && one.moved == other.moved;
    }
    if (!is_same) return false;
  }
  is_loaded_ = false;  // no series owns the lanes' data
  return true;
}

void SeriesLanes::fetch(MotionSeries& series, int lane, int begin, int end) const {
  double* const to = series.program_.rows();
  const std::vector<Real>& rows = rows_[used_];
  const int count = step_.last + 2;
  for (int n = begin; n < end; ++n) {
    const auto at = static_cast<std::size_t>(series.layout_.sampled_at[n]);
    for (std::size_t k = at; k < at + static_cast<std::size_t>(count); ++k) to[k] = rows[k][lane];
  }
}

}  // namespace variator_sim
