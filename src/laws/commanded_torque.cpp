// Q[shaft] += gain u.
#include "variator_sim/laws.h"

namespace variator_sim {

void CommandedTorque::build(LawContext& scene) {
  scene.keys({"shaft", "gain"});
  const double gain = scene.number("gain", Range::any(), 1.0);
  const Shaft shaft = scene.shaft("shaft");
  // With a gain the command may be of any kind, a position of a throttle, say.
  const bool is_torque = !scene.parameters().has("gain");
  scene.apply(shaft, gain * scene.command(Range::any(is_torque ? "N m" : "")));
}

}  // namespace variator_sim
