// Running resistance F of a vehicle on one of its shafts, through a gear and a wheel:
//     v = rho omega,   Q = -rho F(v, t)
// with rho = wheel_radius / ratio, m/rad (ratio: turns of the shaft per turn of the wheel) and, s
// = tanh(v/v_0) being the sign of v made smooth,
//   davis  a train:     F = (A + C v^2) s + B v + m g sin alpha
//   road   a road car:  F = (c_rr m g cos alpha + c_w v^2) s + m g sin alpha,  c_w = rho_air C_d
//   A/2
// v in m/s, F in N. F is odd in v on the level and as smooth as tanh; it falls short of the exact
// law by the part 2 exp(-2 v/v_0). It does not hold a vehicle at rest: on a slope below its
// resistance that creeps with about v_0 sin alpha / c_rr. `grade` is tan alpha, a constant or a
// table over time (two times continuously differentiable; the first and the last value hold beyond
// its ends).
// The inertia of the vehicle is not in it: add m rho^2 to the shaft's.
//
// Sources: W. J. Davis: The tractive resistance of electric locomotives and cars, General Electric
// Review 29 (1926); Guzzella, Sciarretta: Vehicle Propulsion Systems (2013), section 2.1.
#include "laws/gear_keys.h"
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

constexpr double kGravity = 9.80665;  // m/s^2, standard

/// Reads tan alpha. Vehicles run on slopes up to 45 degrees.
Expression readGrade(LawContext& scene) {
  const Range grades = Range::between(-1.0, 1.0, "1");
  ParameterReader& parameters = scene.parameters();
  const ParameterTree* tree = parameters.raw("grade");
  const bool is_table = tree != nullptr && tree->kind() == ParameterTree::Kind::kDictionary &&
                        tree->asDictionary().count("time") != 0;
  if (!is_table) return scene.quantity("grade", grades, 0.0);
  ParameterReader section = parameters.section("grade");
  const Table table = Table::read(section, {{"time", Range::any("s")}, {"grade", grades}},
                                  Table::Beyond::kConstant);
  section.finish();
  return scene.lookUp(table, scene.time());
}

/// (A + C v^2) s + B v
Expression readDavis(LawContext& scene, const Expression& v, const Expression& s) {
  scene.keys({"constant", "linear", "quadratic"});
  const Expression A = scene.quantity("constant", Range::notNegative("N"));
  const Expression B = scene.quantity("linear", Range::notNegative("N s/m"));
  return (A + scene.quantity("quadratic", Range::notNegative("N s^2/m^2")) * v * v) * s + B * v;
}

/// (c_rr m g cos alpha + c_w v^2) s
Expression readRoad(LawContext& scene, const Expression& v, const Expression& s,
                    const Expression& pressing) {
  scene.keys({"rolling_coefficient", "drag_area", "air_density"});
  const Expression c_rr = scene.quantity("rolling_coefficient", Range::notNegative("1"));
  const Expression drag_area = scene.quantity("drag_area", Range::notNegative("m^2"));
  const Expression c_w =
      0.5 * drag_area * scene.quantity("air_density", Range::positive("kg/m^3"), 1.2);
  return (c_rr * pressing + c_w * v * v) * s;
}

}  // namespace

void VehicleResistance::build(LawContext& scene) {
  scene.keys({"shaft", "law", "wheel_radius", "ratio", "regularization_speed", "grade", "mass"});
  ParameterReader& parameters = scene.parameters();
  const Shaft shaft = scene.shaft("shaft");
  const std::string law = parameters.choice("law", {"davis", "road"});
  const Expression rho = scene.quantity("wheel_radius", Range::positive("m")) / readRatio(scene);
  const Expression v = rho * shaft.velocity;
  const Expression s =
      tanh(v / scene.quantity("regularization_speed", Range::positive("m/s"), 0.1));
  Expression weight = 0.0;
  if (law == "road" || parameters.has("grade") || parameters.has("mass")) {
    weight = kGravity * scene.quantity("mass", Range::positive("kg"));
  }
  const Expression grade = readGrade(scene);
  const Expression cosine = 1.0 / sqrt(1.0 + grade * grade);
  const Expression level =
      law == "davis" ? readDavis(scene, v, s) : readRoad(scene, v, s, weight * cosine);
  const Expression F = level + weight * grade * cosine;
  scene.apply(shaft, -rho * F);
  scene.output("speed", v);
  scene.output("force", F);
}

}  // namespace variator_sim
