#include "variator_sim/torques/commanded_torque.h"

namespace variator_sim {

void CommandedTorque::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key : {"shaft", "gain"}) parameters.allow(key);
  shaft_ = context.readShaft("shaft");
  gain_ = parameters.number("gain", Range::any(), 1.0);
  input_ = context.addInput(readCommandInput(parameters, context.name()));
}

void CommandedTorque::doAddTorque(const StateView& state, double* torque) const {
  torque[shaft_] += gain_ * state.input[input_];
}

void CommandedTorque::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  torque_rate[shaft_] += gain_ * state.input_rate[input_];
}

void CommandedTorque::doAddTorqueRateDerivatives(const StateView& /*state*/,
                                                 double* /*derivatives*/) const {}

}  // namespace variator_sim
