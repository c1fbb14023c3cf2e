#include "motion/observation.h"

#include <algorithm>

namespace variator_sim {

scene_status Observation::look(double at, Sample* sample, double* jerk) {
  vs_seen_hold seen_hold[kMaxHolds];
  double on_shaft[kMaxHolds * kMaxShafts];
  vs_seen seen = {sample->angle,
                  sample->velocity,
                  sample->acceleration,
                  sample->applied_torque,
                  sample->reaction_torque,
                  sample->reaction_torque_rate,
                  sample->reaction_torque_covariant_rate,
                  sample->residual,
                  sample->multiplier,
                  0.0,
                  seen_hold,
                  on_shaft,
                  seen_input_,
                  jerk};
  const scene_status status = program_.see(at, &seen);
  kinetic_ = seen.kinetic;
  for (int h = 0; h < program_.text().HOLDS; ++h) {
    const vs_seen_hold& from = seen_hold[h];
    HeldElement& held = held_[h];
    held = {from.mode, from.torque, from.slip, from.reserve, from.heat, {}};
    std::copy_n(on_shaft + h * scene_.shaftCount(), scene_.shaftCount(), held.on_shaft);
    input_value_[kMaxInputs + h] = from.side;
    const auto valueOf = [&](expression::HeldValue value) -> double& {
      return held_value_[expression::heldSlot(value, h)];
    };
    valueOf(expression::HeldValue::kMultiplier) = from.multiplier;
    valueOf(expression::HeldValue::kMode) = from.mode;
    valueOf(expression::HeldValue::kCounts) = from.counts;
  }
  return status;
}

StateView Observation::view(double time, const double* angle, const double* velocity,
                            const double* acceleration) {
  for (int i = 0; i < scene_.inputCount(); ++i) {
    CommandSignal::Moment moment = inputs_.at(i, time);
    const InputKind kind = scene_.inputs[static_cast<std::size_t>(i)].kind;
    if (kind != InputKind::kCommanded) moment.value = seen_input_[3 * i];
    if (kind == InputKind::kDelayed) {
      moment.rate = seen_input_[3 * i + 1];
      moment.second_rate = seen_input_[3 * i + 2];
    }
    input_value_[i] = moment.value;
    input_rate_[i] = moment.rate;
    input_second_rate_[i] = moment.second_rate;
  }
  return {
      time,         angle,       velocity,           acceleration,
      input_value_, input_rate_, input_second_rate_, program_.text().HOLDS > 0 ? held_ : nullptr,
      held_value_};
}

}  // namespace variator_sim
