#include "integrate/runtime_steps.h"

#include <algorithm>
#include <cmath>

#include "integrate/series_stiffness.h"
#include "variator_sim/errors.h"

namespace variator_sim {

void RuntimeSteps::prepare(const Scene& scene) {
  try {
    program_ = std::make_unique<MotionProgram>(scene);
  } catch (const SceneError&) {
    return;  // another way of stepping suits it
  }
  steps_ = interpretMotion(*program_);
  it_.state = state_;
  it_.multiplier = multiplier_;
  it_.reaction = reaction_;
  it_.input = signal_;
  it_.jerk = jerk_;
  it_.torque = torque_;
  it_.torque_rate = torque_rate_;
  it_.entry = entry_;
  it_.size = length_;
}

MoreCode RuntimeSteps::machineCode() {
  if (program_ == nullptr) return {};
  return {program_->writeKernel(), [this](const auto& library) { return use(library); }};
}

bool RuntimeSteps::use(const std::shared_ptr<KernelLibrary>& library) {
  std::unique_ptr<MotionSteps> compiled = runMotion(library, *program_);
  if (compiled == nullptr) return false;
  const vs_exchange kept = it_;
  double made[2];
  double state[2][3 * kMaxShafts];
  scene_status status[2];
  const std::unique_ptr<MotionSteps> interpreted = interpretMotion(*program_);
  for (MotionSteps* const tried : {interpreted.get(), compiled.get()}) {
    const int n = tried == compiled.get() ? 1 : 0;
    describeStart();
    tried->takeOver(it_);
    status[n] = tried->advance(step_.settings.maximum_step, &it_);
    made[n] = it_.made;
    std::copy_n(state_, 3 * S, state[n]);
  }
  it_ = kept;
  const bool is_right = status[0] == status[1] &&
                        (status[0] != SCENE_OK ||
                         (made[0] == made[1] && std::equal(state[0], state[0] + 3 * S, state[1])));
  if (is_right) next_steps_ = std::move(compiled);
  takes_next_ = is_right;
  library_ = is_right ? library : nullptr;
  return is_right;
}

bool RuntimeSteps::share(const RuntimeSteps& other) {
  if (program_ == nullptr) return true;
  return other.library_ != nullptr && program_->structure() == other.program_->structure() &&
         use(other.library_);
}

void RuntimeSteps::describeStart() {
  it_.time = step_.absolute(start_.time);
  it_.time_rest = 0.0;
  std::copy(start_.x.begin(), start_.x.end(), state_);
  if (!integrates_torque_) {
    std::copy_n(start_.dxdt.data() + S, S, state_ + 2 * S);
    system_.accelerations().calcMultipliers(step_.viewOf(start_), multiplier_);
  }
  const KeptReaction kept = system_.reaction().kept();
  for (int i = 0; i < S; ++i) reaction_[i] = kept.value[i];
  for (int n = 0; n < drivetrain_.inputCount(); ++n) {
    const CommandSignal::Closed from = drivetrain_.signal(n).closed();
    signal_[n] = {from.form,
                  from.start,
                  from.target,
                  from.slope,
                  from.inverse_tau,
                  from.linear,
                  start_.time - from.since,
                  from.end - from.since};
  }
  it_.usual = step_.next_length;
}

void RuntimeSteps::enter() {
  if (takes_next_) steps_.swap(next_steps_);
  takes_next_ = false;
  describeStart();
  steps_->takeOver(it_);
  is_entered_ = true;
  made_since_ = 0;
}

bool RuntimeSteps::make() {
  if (steps_ == nullptr || !step_.stepper->stepsBySeries() || start_.time == refused_at_) {
    return false;
  }
  const double left = std::min(size_.endOfReach() - start_.time, step_.settings.maximum_step);
  if (!(left > shortestStep(start_.time))) return false;
  if (!is_entered_ || made_since_ == kMostBetween || start_.time != at_) enter();
  const scene_status status = steps_->advance(left, &it_);
  const bool is_finite =
      std::all_of(state_, state_ + 3 * S, [](double x) { return std::isfinite(x); });
  if (status != SCENE_OK || !is_finite || !(it_.made > shortestStep(start_.time))) {
    refuse(status);
    return false;
  }
  ++made_since_;
  refused_at_ = -1.0;
  return takeEnd(left);
}

void RuntimeSteps::refuse(scene_status status) {
  refused_at_ = start_.time;
  is_entered_ = false;
  // An implicit step may go on from here although no series does.
  const bool has_no_series = status == SCENE_NOT_FINITE || status == SCENE_TOO_MANY_STEPS;
  if (!has_no_series || !step_.choice.giveUp()) return;
  step_.stepper = &step_.choice.stepper();
  size_.forgetErrors();
  step_.next_length = size_.chooseFirst();
}

bool RuntimeSteps::takeEnd(double left) {
  const bool is_whole = std::abs(it_.made - left) <= 1e-15 * left;
  end_.time = start_.time + (is_whole ? left : it_.made);
  std::copy_n(state_, end_.x.size(), end_.x.begin());
  std::copy_n(state_ + S, 2 * S, end_.dxdt.begin());
  for (int i = 0; i < S; ++i) {
    if (integrates_torque_) end_.dxdt[2 * S + i] = jerk_[i];
    end_.torque[i] = torque_[i];
    end_.torque_rate[i] = torque_rate_[i];
  }
  RowWatch::Row rows[kMaxRows];
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) std::copy_n(entry_ + S * m, S, rows[m]);
  if (!step_.rows.noteStraight(rows, length_)) {
    is_entered_ = false;
    end_ = start_;
    return false;
  }
  at_ = end_.time;
  has_crossed_ = has_crossed_ || it_.is_event != 0;
  step_.checks.noteTorqueSize(torque_);
  ++step_.statistics.steps;
  if (it_.passed >= 0) ++step_.statistics.kinks;
  drivetrain_.countRightHandSide();
  step_.statistics.rejected_steps += static_cast<std::uint64_t>(it_.rejections);
  step_.phase = StepPhase::kStepping;
  step_.is_in_corner = false;
  step_.next_length = it_.usual;
  return true;
}

void RuntimeSteps::interpolate(double time, State& x) const {
  const double theta = (time - start_.time) / it_.unit;
  const int last = integrates_torque_ ? it_.last : it_.last + 1;
  for (int n = 0; n < x.size(); ++n) {
    const double* const c = it_.rows[n];
    double sum = c[last];
    for (int k = last - 1; k >= 0; --k) sum = sum * theta + c[k];
    x[n] = sum;
  }
}

double RuntimeSteps::calcWork(double theta) const {
  // sum_n p_n tau^(n+1) / (n+1), p_n = sum_i sum_k Q_ik omega_i,n-k
  const double tau = theta * it_.made / it_.unit;
  double power = it_.unit * tau;
  double sum = 0.0;
  for (int n = 0; n <= it_.last; ++n, power *= tau) {
    double p = 0.0;
    for (int i = 0; i < S; ++i) {
      const double* const Q = it_.rows[3 * S + i];
      const double* const omega = it_.rows[S + i];
      for (int k = 0; k <= n; ++k) p += Q[k] * omega[n - k];
    }
    sum += p * power / (n + 1);
  }
  return sum;
}

double RuntimeSteps::stiffness() const {
  const int last = integrates_torque_ ? it_.last : it_.last + 1;
  if (last < series_stiffness::kDerivatives) return 0.0;
  const int most = last;
  const int early = std::max(2, most / 4);
  double early_bound = 2.0 * series_stiffness::kFaint;
  for (int k = 1; k <= early; ++k) early_bound *= most / (series_stiffness::kE * k);
  return series_stiffness::estimate(it_.rows, system_.readsAngles() ? 0 : S, end_.x.size(), last,
                                    it_.usual / it_.unit, early, early_bound, tolerance_);
}

}  // namespace variator_sim
