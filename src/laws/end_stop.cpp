// The lowest and the highest angle of a shaft, which it meets by an impact with Newton's
// restitution:
//     phi >= lower,  T_lower >= 0,  omega+ = -e omega- at phi = lower
//     phi <= upper,  T_upper <= 0,  omega+ = -e omega- at phi = upper
#include "variator_sim/laws.h"

namespace variator_sim {

void EndStop::build(LawContext& scene) {
  scene.keys({"shaft", "lower", "upper", "restitution"});
  ParameterReader& parameters = scene.parameters();
  const Shaft shaft = scene.shaft("shaft");
  const double restitution = scene.number("restitution", Range::between(0.0, 1.0, "1"), 0.0);
  const bool has_lower = parameters.has("lower");
  if (!has_lower) parameters.require("upper", "an angle, rad ('lower', 'upper' or both)");
  double lower = 0.0;
  for (const char* key : {"lower", "upper"}) {
    if (!parameters.has(key)) continue;
    const bool is_lower = std::string(key) == "lower";
    const double angle = scene.number(key, Range::any("rad"));
    if (is_lower) lower = angle;
    if (!is_lower && has_lower && !(angle > lower)) {
      throw parameters.error(key, "is not above 'lower'; allowed: a larger angle");
    }
    Holding stop;
    stop.side = scene.side();
    stop.slip = is_lower ? shaft.velocity : -shaft.velocity;
    stop.gap = is_lower ? shaft.angle - angle : angle - shaft.angle;
    stop.upper = 0.0;
    stop.slides_backward = false;
    stop.restitution = restitution;
    stop.part = key;
    scene.hold(stop);
  }
}

}  // namespace variator_sim
