// A variator without slip whose ratio is imposed, order 1 (rad/s), on the shafts a and b:
//     f = omega_b - i(t) omega_a
// Source: Artobolevskii, Zinov'ev, Umnov: Equations of motion of a machine aggregate with a
// variator, Dokl. Akad. Nauk SSSR 173 (1967) no. 5, 1017-1020 (in Russian).
//
// Its reaction is along the gradient of f (Chetaev), or along D = (-i, 1), in the ratio of the
// speeds. These differ where i follows a speed: with D the gear takes no power, D omega = f = 0.
//
// With losses the shaft a gives q + L where q = i lambda goes through, lambda on b, and
//     L = s max((1/e_1 - 1) s q + b_1/e_1, (e_2 - 1) s q + e_2 b_2)      N m,  s = sign(omega_a):
// the first where a drives. At rest L is what holds, between its values for s = 1 and -1: with
// (e_2 - 1) q + e_2 b_2 above q, as where e_2 is small, no torque on b moves the gear
// (self-locking). Source: Pelchen, Schweiger, Otter: Modeling and simulating the efficiency of
// gearboxes and of planetary gearboxes, 2nd Int. Modelica Conference 2002, 257-266; e_1 and e_2 are
// their mesh efficiencies, b_1 and b_2 their bearing torques, on a.
#include "variator_sim/laws.h"

namespace variator_sim {

namespace {

using Both = std::pair<Expression, Expression>;

/// Reads a quantity for a driving and a driven shaft a, or one for both.
Both readBoth(LawContext& scene, const std::string& key, const Range& range, double default_value) {
  const ParameterTree* const given = scene.parameters().raw(key);
  if (given != nullptr && given->kind() == ParameterTree::Kind::kDictionary &&
      (given->asDictionary().count("driving") > 0 || given->asDictionary().count("driven") > 0)) {
    ParameterReader section = scene.parameters().section(key);
    Both both = {scene.quantity(section, "driving", range, {}),
                 scene.quantity(section, "driven", range, {})};
    section.finish();
    return both;
  }
  const Expression one = scene.quantity(key, range, default_value);
  return {one, one};
}

/// Losses take all of a torque on `from` where the efficiency is 0: it moves nothing at any load.
void refuseSelfLocking(LawContext& scene, const Shaft& from, const Shaft& to,
                       const Expression& efficiency) {
  if (!efficiency.isConstant() || efficiency.value() > 0.0) return;
  const std::vector<std::string>& names = scene.shaftNames();
  const std::string driver = inQuotes(names[static_cast<std::size_t>(from.index)]);
  throw scene.parameters().error(
      "efficiency", "is 0 where " + driver + " drives: a self-locking gear, torque on " + driver +
                        " cannot turn " + inQuotes(names[static_cast<std::size_t>(to.index)]) +
                        "; allowed: a number in (0, 1], with a 'bearing' torque that holds the "
                        "loads that occur");
}

bool isAlways(const Both& both, double value) {
  return both.first.isConstant() && both.second.isConstant() && both.first.value() == value &&
         both.second.value() == value;
}

}  // namespace

void KinematicRatio::build(LawContext& scene) {
  scene.keys({"shafts", "ratio", "efficiency", "bearing", "reaction"});
  const std::vector<Shaft> s = scene.shafts("shafts", 2);
  const Expression i = scene.quantity("ratio", Range::any("1"));
  const auto [e_1, e_2] = readBoth(scene, "efficiency", {0.0, 1.0, true, true, "1"}, 1.0);
  refuseSelfLocking(scene, s[0], s[1], e_1);
  refuseSelfLocking(scene, s[1], s[0], e_2);
  const auto [b_1, b_2] = readBoth(scene, "bearing", Range::notNegative("N m"), 0.0);
  const bool is_gradient =
      scene.parameters().choice("reaction", {"lossless", "gradient"}, "lossless") == "gradient";
  scene.constrain(s[1].velocity - i * s[0].velocity);
  scene.output("ratio", i);
  expression::Graph& graph = *scene.graph();
  if (!is_gradient && expression::reads(graph, {i.in(graph)}, expression::Source::kVelocity)) {
    scene.react(s[0], -i);
    scene.react(s[1], 1.0);
  }
  if (isAlways({e_1, e_2}, 1.0) && isAlways({b_1, b_2}, 0.0)) return;
  Holding gear;
  gear.slip = s[0].velocity;
  gear.side = scene.side();
  gear.losses = Losses{{i * (1.0 / e_1 - 1.0), i * (e_2 - 1.0)}, {b_1 / e_1, e_2 * b_2}};
  scene.hold(gear);
}

}  // namespace variator_sim
