// A motor by its steady torque-speed characteristic. With d = +-1 the direction of rotation it is
// built for and w = d omega its speed in that direction (rad/s):
//     Q = d u M(w)                               N m
// u is the command from 0 to 1 (a throttle, a current limit), 1 when there is none.
//
// `characteristic`:
//   kloss  induction motor: breakdown torque M_k at the slip s_k, synchronous speed w_s;
//              M = 2 M_k / (s/s_k + s_k/s) = 2 M_k x / (1 + x^2),  s = (w_s - w)/w_s,  x = s/s_k
//          (the second form is regular at s = 0). Above w_s it brakes. Stator resistance
//          neglected. Source: M. Kloss, Archiv fuer Elektrotechnik 5 (1916) 59-87.
//   table  M through measured points over w: two times continuously differentiable, no overshoot
//          (table.h). Beyond the ends by `beyond`: constant (default) or linear.
//   dc     permanent-magnet or separately excited DC motor, inductance neglected; either
//              M = M_0 (1 - w/w_0)          stall torque M_0, no-load speed w_0
//          or by its circuit, with the commanded or constant voltage U and no u:
//              M = k (U - k w)/R            k torque constant, R resistance of the armature
//          Source: Fitzgerald, Kingsley, Umans: Electric Machinery, chapter 7.
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

double readDirection(ParameterReader& parameters) {
  const int direction = parameters.integer("direction", -1, 1, 1);
  if (direction == 0) {
    throw parameters.error("direction", "0 is no direction; allowed: 1, -1");
  }
  return direction;
}

/// M = 2 M_k x / (1 + x^2),  x = s/s_k
Expression readKloss(LawContext& scene, const Expression& w) {
  scene.keys({"breakdown_torque", "synchronous_speed", "critical_slip", "command"});
  const Expression M_k = scene.quantity("breakdown_torque", Range::positive("N m"));
  const Expression w_s = scene.quantity("synchronous_speed", Range::positive("rad/s"));
  const Expression s_k = scene.quantity("critical_slip", Range::positive("1"));
  const Expression x = 1.0 / s_k - w / (s_k * w_s);
  return 2.0 * M_k * x / (1.0 + x * x);
}

Expression readTable(LawContext& scene, const Expression& w) {
  scene.keys({"table", "command"});
  ParameterReader section = scene.parameters().section("table", {"speed", "torque", "beyond"});
  const Table table =
      Table::read(section, {{"speed", Range::any("rad/s")}, {"torque", Range::any("N m")}},
                  section.choice("beyond", Table::beyondWords(), "constant"));
  section.finish();
  return scene.lookUp(table, w);
}

/// M = M_0 (1 - w/w_0)
Expression readLine(LawContext& scene, const Expression& w) {
  scene.keys({"stall_torque", "no_load_speed", "command"});
  const Expression M_0 = scene.quantity("stall_torque", Range::positive("N m"));
  return M_0 - M_0 / scene.quantity("no_load_speed", Range::positive("rad/s")) * w;
}

bool isCircuit(const ParameterReader& parameters) {
  return parameters.has("torque_constant") || parameters.has("resistance") ||
         parameters.has("voltage");
}

/// k (U - k w)/R
Expression readCircuit(LawContext& scene, const Expression& w) {
  scene.keys({"torque_constant", "resistance", "voltage"});
  const Expression k = scene.quantity("torque_constant", Range::positive("N m/A"));
  const Expression R = scene.quantity("resistance", Range::positive("ohm"));
  return k / R * scene.quantity("voltage", Range::any("V")) - k * (k / R) * w;
}

}  // namespace

void MotorCurve::build(LawContext& scene) {
  scene.keys({"shaft", "characteristic", "direction"});
  ParameterReader& parameters = scene.parameters();
  const Shaft shaft = scene.shaft("shaft");
  const std::string characteristic = parameters.choice("characteristic", {"kloss", "table", "dc"});
  const double d = readDirection(parameters);
  const Expression w = d * shaft.velocity;
  if (characteristic == "dc" && isCircuit(parameters)) {
    scene.apply(shaft, d * readCircuit(scene, w));
    return;
  }
  const Expression M = characteristic == "kloss"   ? readKloss(scene, w)
                       : characteristic == "table" ? readTable(scene, w)
                                                   : readLine(scene, w);
  const Expression u = scene.quantity("command", Range::between(0.0, 1.0, "1"), 1.0);
  scene.apply(shaft, d * (u * M));
}

}  // namespace variator_sim
