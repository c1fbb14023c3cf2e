#include "motion_program/scene_series.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "variator_sim/errors.h"

namespace variator_sim {

std::unique_ptr<SceneSeries> SceneSeries::make(const Scene& scene, const CommandSignal* signals) {
  try {
    auto program = std::make_shared<MotionProgram>(scene);
    if (program->HAS_SERIES == 0) return nullptr;
    return std::unique_ptr<SceneSeries>(new SceneSeries(scene, signals, std::move(program)));
  } catch (const SceneError&) {
    return nullptr;
  }
}

SceneSeries::SceneSeries(const Scene& scene, const CommandSignal* signals,
                         std::shared_ptr<const MotionProgram> program)
    : signals_(signals),
      program_(std::move(program)),
      host_(hostSeries(*program_)),
      S(scene.shaftCount()),
      inputs_(scene.inputCount()),
      noted_at_(std::numeric_limits<double>::quiet_NaN()) {
  it_.state = state_;
  it_.multiplier = multiplier_;
  it_.reaction = none_;
  it_.longest = none_;
  it_.input = input_;
  for (auto& values : values_) values.resize(static_cast<std::size_t>(program_->SCENE_ROWS));
}

const vs_exchange& SceneSeries::describe(const SeriesPoint& point, double usual) {
  it_.time = point.origin + point.time;
  it_.time_rest = (point.origin - it_.time) + point.time;
  std::copy_n(point.state, 3 * S, state_);
  if (point.multiplier != nullptr) {
    std::copy_n(point.multiplier, program_->CONSTRAINTS, multiplier_);
  }
  for (int n = 0; n < inputs_; ++n) {
    const CommandSignal::Closed from = signals_[n].closed();
    input_[n] = {from.form,
                 from.start,
                 from.target,
                 from.slope,
                 from.inverse_tau,
                 from.linear,
                 point.time - from.since,
                 from.end - from.since};
  }
  it_.usual = usual;
  return it_;
}

bool SceneSeries::expand(const SeriesPoint& point, double usual, double limit, vs_shown* to) {
  ++expansion_;
  return host_->expand(describe(point, usual), limit, to);
}

bool SceneSeries::isNoted(const SeriesPoint& point) const {
  constexpr double kRounding = 1e-14;
  const auto isSame = [](double value, double noted) {
    return std::abs(value - noted) <= kRounding * std::abs(value);
  };
  if (!isSame(point.origin + point.time, noted_at_)) return false;
  if (!std::equal(point.state, point.state + 3 * S, noted_, isSame)) return false;
  for (int n = 0; n < inputs_; ++n) {
    if (!isSame(signals_[n].value(point.time), noted_[3 * S + n])) return false;
  }
  return true;
}

void SceneSeries::note(const SeriesPoint& point) {
  noted_at_ = point.origin + point.time;
  std::copy_n(point.state, 3 * S, noted_);
  for (int n = 0; n < inputs_; ++n) noted_[3 * S + n] = signals_[n].value(point.time);
}

bool SceneSeries::mayHideAlong(const SeriesPoint& from, const SeriesPoint& to) {
  const expression::SeriesProgram& rows = program_->rows().program();
  if (!rows.canHide()) return false;
  // (They differ from the last step's end after a command or the end of an input's closed form.)
  if (!isNoted(from)) host_->evaluate(describe(from), values_[0].data());
  host_->evaluate(describe(to), values_[1].data());
  const bool may_hide = rows.haveArgumentsGoneFar(values_[0].data(), values_[1].data());
  std::swap(values_[0], values_[1]);
  note(to);
  return may_hide;
}

/// c_0 + c_1 s + c_2 s^2 through x(0), x(1/2), x(1)
static void fit(double start, double middle, double end, double* c) {
  c[0] = start;
  c[1] = 4.0 * middle - 3.0 * start - end;
  c[2] = 2.0 * (start + end - 2.0 * middle);
}

bool SceneSeries::isStepResolved(const SeriesPoint& from, const SeriesPoint& middle,
                                 const SeriesPoint& to) {
  vs_path path = {};
  path.length = to.time - from.time;
  for (int i = 0; i < S; ++i) {
    const auto fitTo = [&](int n, double* c) {
      fit(from.state[n], middle.state[n], to.state[n], c);
    };
    fitTo(S + i, path.velocity + 3 * i);
    fitTo(2 * S + i, path.acceleration + 3 * i);
  }
  noted_at_ = std::numeric_limits<double>::quiet_NaN();
  const SeriesPoint* const points[] = {&from, &middle, &to};
  const double* at[3];
  for (int n = 0; n < 3; ++n) {
    host_->evaluate(describe(*points[n]), values_[n].data());
    at[n] = values_[n].data();
  }
  path.at = at;
  return host_->isResolvedAlong(describe(from), path);
}

}  // namespace variator_sim
