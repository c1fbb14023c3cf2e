// Steps of a motion by its series: series_step.inc for the interpreter, and the code around a step
// of either kind.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "dynamics/motion_series.h"
#include "expression/series_dot.h"

namespace variator_sim {

using Part = expression::SeriesProgram::Part;

/// The functions that series_step.inc calls.
struct SeriesInterpreter {
  static MotionSeries& of(const SeriesStep* it) { return *static_cast<MotionSeries*>(it->host); }
  static void order(SeriesStep* it, int n) { of(it).continueTo(n); }
  static void begin(SeriesStep* it, Part part) {
    of(it).program_.begin(part);
    it->limits = it->limits != 0 || of(it).program_.hasLimit() ? 1 : 0;
  }
  static void velocityLevel(SeriesStep* it, double* level) {
    of(it).drivetrain_.copyVelocityLevel(stateOf(*it), level);
  }
  static void accelerationLevel(SeriesStep* it, double* level) {
    of(it).drivetrain_.copyAccelerationLevel(stateOf(*it), level);
  }
  static StateView stateOf(const SeriesStep& it) {
    const int S = it.layout->shafts;
    return {it.origin + it.end, it.x_new,         it.x_new + S,           it.x_new + 2 * S,
            it.input[0],        it.input_rate[0], it.input_second_rate[0]};
  }
  static const expression::SeriesProgram& program(const SeriesStep* it) { return of(it).program_; }
  static void turn(SeriesStep* it) { of(it).turn(); }
  static void goOn(SeriesStep* it) {
    of(it).turn();
    of(it).noteUnits();
  }
};

namespace {

inline void seriesOrder(SeriesStep* it, int /*next*/, int n) {
  SeriesInterpreter::order(it, n);
}
inline void seriesBeginGiven(SeriesStep* it) {
  SeriesInterpreter::begin(it, Part::kGiven);
}
inline void seriesBeginAccelerated(SeriesStep* it) {
  SeriesInterpreter::begin(it, Part::kAccelerated);
}
inline void seriesVelocityLevel(SeriesStep* it, double* level) {
  SeriesInterpreter::velocityLevel(it, level);
}
inline void seriesAccelerationLevel(SeriesStep* it, double* level) {
  SeriesInterpreter::accelerationLevel(it, level);
}
using series_step::Real;
using namespace expression;  // NOLINT: its operations are many
#include "expression/series_resolution.inc"
double seriesHidden(const SeriesStep* it, int last) {
  return SeriesInterpreter::program(it).mayHide(last, it->powers) ? 1.0 : 0.0;
}
inline void seriesTurn(SeriesStep* it) {
  SeriesInterpreter::turn(it);
}
inline void seriesGoOn(SeriesStep* it) {
  SeriesInterpreter::goOn(it);
}

// Components of a sample at once.
#define SERIES_SOME 2
using Some = expression::Two;
inline Some seriesSpread(double a) {
  return Some{a, a};
}
inline Some seriesLoad(const double* from) {
  return expression::loadTwo(from);
}

}  // namespace

#define LAYOUT (*it->layout)

namespace series_plain {
namespace arithmetic = expression::plain;
#include "dynamics/series_interpreted.inc"
}  // namespace series_plain

VARIATOR_SIM_BEGIN_FUSED
namespace series_fused {
namespace arithmetic = expression::fused;
#include "dynamics/series_interpreted.inc"
}  // namespace series_fused
VARIATOR_SIM_END_FUSED

void MotionSeries::continueTo(int n) {
  if (expression::fusesProducts()) {
    series_fused::SeriesOrder(*this).make(n);
  } else {
    series_plain::SeriesOrder(*this).make(n);
  }
}

const MotionSeries::StepCodes& MotionSeries::interpretedCodes() {
  static constexpr StepCodes kPlain = {series_plain::seriesStride, series_plain::seriesBegin,
                                       series_plain::seriesTabulate, series_plain::seriesSample};
  static constexpr StepCodes kFused = {series_fused::seriesStride, series_fused::seriesBegin,
                                       series_fused::seriesTabulate, series_fused::seriesSample};
  return expression::fusesProducts() ? kFused : kPlain;
}

void MotionSeries::findLayout() {
  const Inertia& inertia = drivetrain_.inertia();
  int thirds = 0;
  int firsts = 0;
  for (int m = 0; m < k_; ++m) {
    thirds += drivetrain_.constraint(m).order() == 3 ? 1 : 0;
    firsts += drivetrain_.constraint(m).order() == 1 ? 1 : 0;
  }
  SeriesLayout& to = layout_;
  const auto at = [this](int row) { return static_cast<int>(program_.offset(row)); };
  to.shafts = S;
  to.rows = k_;
  to.velocity_rows = firsts;
  to.order = last_order_;
  to.least = drivetrain_.readsAngles() ? 0 : S;
  to.is_inertia_constant = inertia.isConstant() ? 1 : 0;
  to.is_inertia_diagonal = inertia.isDiagonal() ? 1 : 0;
  to.is_row_constant = drivetrain_.hasConstantJacobian() ? 1 : 0;
  to.has_residuals = thirds == 0 ? 1 : 0;
  to.is_time_in_torque = drivetrain_.torquesReadTime() ? 1 : 0;
  to.time_at = at(row_of_time_);
  for (int i = 0; i < S; ++i) {
    int level = 0;
    for (const int row : {row_of_angle_[i], row_of_velocity_[i], row_of_acceleration_[i]}) {
      to.component_at[level * S + i] = at(row);
      ++level;
    }
    to.torque_at[i] = at(row_of_torque_[i]);
    to.reaction_at[i] = at(row_of_reaction_rate_[i]);
    if (inertia.isConstant()) continue;
    to.inertia_at[i] = at(row_of_inertia_[i]);
    to.inertial_torque_at[i] = at(row_of_inertial_torque_[i]);
  }
  for (int m = 0; m < k_; ++m) {
    to.constraint_order[m] = drivetrain_.constraint(m).order();
    to.multiplier_at[m] = at(row_of_multiplier_[m]);
    to.residual_at[m] = at(row_of_residual_[m]);
    for (int i = 0; i < S; ++i) to.entry_at[m * S + i] = at(entryRow(m, i));
  }
  makes_whole_steps_ = !is_classical_ && scene_.principle == Principle::kGeneralizedGauss &&
                       (inertia.isConstant() || inertia.isDiagonal()) &&
                       (thirds == 0 || thirds == k_) && !program_.readsTables();
  if (!makes_whole_steps_) return;
  makes_samples_ = thirds == 0;
  findSampled();
}

void MotionSeries::keepReaction(const KeptReaction& kept) {
  step_.has_neutral = kept.exists ? 1 : 0;
  for (int i = 0; i < S; ++i) {
    step_.is_neutral[i] = kept.is_free[i] ? 1.0 : 0.0;
    step_.reaction[i] = kept.value[i];
  }
}

bool MotionSeries::isNextBegunAt(double t) const {
  return is_next_begun_ && t == step_.end && drivetrain_.origin() == step_.origin;
}

void MotionSeries::prepare(SeriesStep* step) {
  step->layout = &layout_;
  step->host = this;
  step->constants = constants_;
  step->tables[0] = drivetrain_.kernelTables();
  step->input[0] = drivetrain_.inputs();
  step->input_rate[0] = drivetrain_.inputRates();
  step->input_second_rate[0] = drivetrain_.inputSecondRates();
  step->origin = drivetrain_.origin();
}

bool MotionSeries::beginWhole(double t, const double* x) {
  prepare(&step_);
  step_.next_rows = program_.rows();
  step_.next_states = program_.states();
  step_.next_inverse = own().inverse;
  step_.unit = step_.next_unit = own().unit;
  step_.end = t;
  std::copy_n(x, 3 * S, step_.x_new);
  step_.doubt = 0.0;
  step_.limits = 0;
  stepCodes().arrive(&step_);
  program_.noteLimit(step_.limits != 0);
  return step_.doubt == 0.0;
}

bool MotionSeries::beginStep(double t, const double* x, double unit) {
  if (!begin(t, x, unit, layout_.order)) return false;
  if (!program_.isDecided() || !extendTo(1)) return false;
  turn();
  setInputs(t, layout_.order);
  turn();
  prepare(&step_);
  return true;
}

double MotionSeries::unitFor(double length) {
  return series_plain::seriesPowerOfTwoAbove(length);
}

const SeriesStep& MotionSeries::stride(double t, const double* x, const Aim& aim) {
  const double unit = unitFor(aim.length);
  const Reach& reach = aim.reach;
  step_.made = 0;
  step_.refused = 1.0;
  step_.limit = reach.longestFrom(t);
  step_.limit_end = reach.horizon - t <= reach.maximum ? reach.horizon : t + step_.limit;
  step_.is_limited = step_.limit <= aim.length ? 1 : 0;
  const bool could_be_together = together_ != nullptr && !codes_.empty();
  const bool is_together = could_be_together && step_.is_limited == 0;
  const bool is_in_lanes = aim.goes_on && lanes_ != nullptr;
  double here = step_.next_unit;  // the unit of the series already begun
  if (is_in_lanes && is_together) {
    ++stamp_;
  } else {
    lanes_ = nullptr;
    if (aim.goes_on && !is_in_lanes) {
      turn();
      ++stamp_;
    } else {
      // A series begun in the lanes is begun here in the same way.
      if (!is_in_lanes) here = unitFor(aim.before);
      if (!beginStep(t, x, here)) return step_;
    }
  }
  most_ = last_order_;
  step_.unit = here;
  step_.next_unit = unit;
  noteUnits();
  step_.time = t;
  step_.absolute = aim.absolute;
  step_.relative = aim.relative;
  step_.decay = aim.decay;
  // A motion that steps with others makes a single step only if necessary.
  const bool waits_for_others = could_be_together && !is_together;
  step_.most = waits_for_others ? 1 : std::min<int>(reach.most, series_step::kSeriesStride);
  step_.watches_rest = reach.watches_rest ? 1 : 0;
  step_.target = reach.target;
  step_.horizon = reach.horizon;
  step_.maximum = reach.maximum;
  step_.counts = 1.0;
  forEachComponent(0, 3 * S, [&](int n) { step_.x[n] = x[n]; });
  pointAtRows();
  is_next_begun_ = false;
  if (is_together && together_->make(*this)) {
    fetched_ = 0;
  } else {
    if (lanes_ != nullptr) {
      step_.made = 0;
      return step_;
    }
    stepCodes().step(&step_);
    // Each step of machine code has switched to the rows of the other series.
    if (step_codes_.step != nullptr && step_.made % 2 == 0) turn();
  }
  noteUnits();
  own().order = step_.last;
  own_[1 - used_].order = 1;
  is_next_begun_ = step_.refused == 0.0;
  if (is_next_begun_) strode_ = stamp_;
  if (std::isnan(step_.doubt)) program_.clear();
  return step_;
}

void MotionSeries::noteUnits() {
  own().unit = step_.unit;
  own_[1 - used_].unit = step_.next_unit;
}

void MotionSeries::pointAtRows() {
  step_.rows = program_.rows();
  step_.states = program_.states();
  step_.inverse = own().inverse;
  program_.turn();
  step_.next_rows = program_.rows();
  step_.next_states = program_.states();
  program_.turn();
  step_.next_inverse = own_[1 - used_].inverse;
}

}  // namespace variator_sim
#undef LAYOUT
