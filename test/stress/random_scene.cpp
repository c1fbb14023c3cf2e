#include "stress/random_scene.h"

#include "stress/random.h"
#include "support/scenes.h"

namespace variator_sim::test {
namespace {

std::string number(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.4g", value);
  return buffer;
}

/// Writes formulas over the shafts of one scene.
class Formulas {
 public:
  Formulas(Random& random, int shafts) : random_(random), shafts_(shafts) {}

  std::string variable(const char* letter) {
    return letter + std::to_string(1 + random_.below(shafts_));
  }
  /// t, an angle or a velocity; velocities most often.
  std::string slowVariable() {
    const int kind = random_.below(6);
    return kind == 0 ? "t" : kind == 1 ? variable("phi") : variable("w");
  }
  std::string coefficient(double low, double high) {
    return "(" + number(random_.between(low, high) * (random_.happens(0.5) ? 1.0 : -1.0)) + ")";
  }
  /// A smooth function of `variable` of about the size `size`, any sign.
  std::string smooth(const std::string& variable, double size) {
    const std::string a = coefficient(0.3 * size, size);
    const std::string b = number(random_.between(0.3, 2.0));
    const std::string c = number(random_.between(-1.0, 1.0));
    const std::string v = b + "*" + variable + "+" + c;
    switch (random_.below(9)) {
      case 0:
        return a + "*sin(" + v + ")";
      case 1:
        return a + "*tanh(" + v + ")";
      case 2:
        return a + "/(1+(" + v + ")^2)";
      case 3:
        return a + "*exp(-(" + v + ")^2)";
      case 4:
        return a + "/(2+cos(" + v + "))";
      case 5:
        return a + "*atan(" + v + ")";
      case 6:
        return a + "*sqrt(1+0.1*(" + v + ")^2)";
      case 7:
        return a + "*log(2+(" + v + ")^2)";
      default:
        return a + "*sin(" + v + ")*cos(" + slowVariable() + ")";
    }
  }
  /// "(a + smooth)": does not vanish.
  std::string factor() {
    const std::string a = coefficient(0.4, 1.6);
    if (random_.happens(0.4)) return a;
    return "(" + a + "+" + smooth(slowVariable(), 0.15) + ")";
  }

  /// f of order 1: a velocity that follows from others.
  std::string order1() {
    std::string f;
    for (int i = 1; i <= shafts_; ++i) {
      if (random_.happens(0.3) && shafts_ > 2) continue;
      f += (f.empty() ? "" : "+") + factor() + "*w" + std::to_string(i);
    }
    if (f.empty()) f = variable("w") + "-0.5*" + variable("w");
    if (random_.happens(0.4)) f += "+" + smooth("t", 0.5);
    return f;
  }
  /// psi of order 2: slip of some kind, often nonlinear in the accelerations.
  std::string order2() {
    std::string psi;
    for (int i = 1; i <= shafts_; ++i) {
      if (random_.happens(0.3) && shafts_ > 2) continue;
      const std::string e = "e" + std::to_string(i);
      psi += (psi.empty() ? "" : "+") + factor() + "*" + e;
      // less than the slope of the linear part, so C does not vanish
      if (random_.happens(0.25)) psi += "+" + smooth(e, 0.1);
      if (random_.happens(0.7)) psi += "+" + factor() + "*w" + std::to_string(i);
    }
    if (psi.empty()) psi = "e1+w1";
    if (random_.happens(0.5)) psi += "+" + smooth(slowVariable(), 1.0);
    if (random_.happens(0.1)) psi += "+" + coefficient(0.01, 0.05) + "*" + variable("e") + "^2";
    return psi;
  }
  /// C eta + c0 of order 3.
  std::string order3() {
    std::string row;
    for (int i = 1; i <= shafts_; ++i) {
      if (random_.happens(0.3) && shafts_ > 2) continue;
      const std::string n = std::to_string(i);
      const std::string a = factor();
      row += (row.empty() ? "" : "+") + a + "*(j" + n + "+" + number(random_.between(0.5, 3.0)) +
             "*e" + n + "+" + number(random_.between(0.5, 3.0)) + "*w" + n + ")";
    }
    if (row.empty()) row = "j1+2*e1+w1";
    return row + "+" + smooth("t", 1.0);
  }
  std::string torque(int shaft) {
    std::string q = "-" + number(random_.between(0.05, 1.5)) + "*w" + std::to_string(shaft);
    const int terms = random_.below(3);
    for (int n = 0; n < terms; ++n) q += "+" + smooth(slowVariable(), 2.0);
    if (random_.happens(0.2)) {
      const std::string w = "w" + std::to_string(shaft);
      q += "-0.02*" + w + "*abs(" + w + ")";
    }
    return q;
  }

 private:
  Random& random_;
  int shafts_;
};

/// The keys of an input's hold.
std::string randomHold(Random& random) {
  switch (random.below(5)) {
    case 0:
      return "hold: first_order_lag, time_constant: " + number(random.between(0.02, 1.0));
    case 1:
      return "hold: rate_limit, rate: " + number(random.between(0.5, 20.0));
    case 2:
      return "hold: first_order_hold, period: " + number(random.between(0.02, 0.5));
    case 3:
      return "hold: second_order_lag, time_constant: " + number(random.between(0.05, 1.0));
    default:
      return "hold: zero_order";
  }
}

std::string listOfNames(const std::vector<RandomScene::Component>& components) {
  std::string names;
  for (const auto& component : components) names += (names.empty() ? "" : ", ") + component.name;
  return "[" + names + "]";
}

std::string listOfNumbers(const std::vector<double>& values) {
  std::string text;
  for (double value : values) text += (text.empty() ? "" : ", ") + number(value);
  return "[" + text + "]";
}

}  // namespace

std::string RandomScene::yaml() const {
  std::ostringstream text;
  text << "shafts: " << listOfNames(shafts) << "\n";
  for (const Component& shaft : shafts) text << shaft.name << ": " << shaft.line << "\n";
  if (!couplings.empty()) {
    text << "inertia_coupling:\n";
    for (const std::string& coupling : couplings) text << "- " << coupling << "\n";
  }
  text << "torques: " << listOfNames(torques) << "\n";
  for (const Component& torque : torques) text << torque.name << ": " << torque.line << "\n";
  text << "constraints: " << listOfNames(constraints) << "\n";
  for (const Component& constraint : constraints) {
    text << constraint.name << ": " << constraint.line << "\n";
  }
  text << "principle: " << principle << "\n";
  text << "initial: {angle: " << listOfNumbers(angle) << ", velocity: " << listOfNumbers(velocity)
       << ", project: true}\n";
  return text.str();
}

std::string RandomScene::csv() const {
  std::string text = "time,topic,value\n";
  for (const Command& command : commands) {
    text += number(command.time) + "," + command.topic + "," + number(command.value) + "\n";
  }
  return text;
}

RandomScene makeRandomScene(std::uint64_t seed) {
  Random random(seed);
  RandomScene scene;
  // small scenes are what people have: two shafts and one constraint most often
  static constexpr int kShaftCounts[] = {1, 2, 2, 2, 2, 3, 3, 4, 5, 6, 7, 8};
  const int s = kShaftCounts[random.below(12)];
  Formulas formulas(random, s);
  if (random.happens(0.3)) scene.principle = "gauss";

  for (int i = 1; i <= s; ++i) {
    const double inertia = std::pow(10.0, random.between(-1.0, 1.0));
    std::string line = "{inertia: " + number(inertia) + "}";
    if (random.happens(0.1)) {
      line = "{inertia: {mean: " + number(inertia) +
             ", harmonics: [{order: " + std::to_string(1 + random.below(3)) +
             ", cos: " + number(0.2 * inertia * random.between(-1.0, 1.0)) + "}]}}";
    }
    scene.shafts.push_back({"s" + std::to_string(i), line});
    scene.angle.push_back(random.happens(0.5) ? 0.0 : random.between(-1.0, 1.0));
    scene.velocity.push_back(random.happens(0.1) ? 0.0 : random.between(-4.0, 4.0));
  }
  if (s > 1 && random.happens(0.1)) {
    scene.couplings.push_back("[s1, s2, " + number(random.between(-0.03, 0.03)) + "]");
  }

  int inputs = 0;
  const auto addInput = [&](const std::string& keys) {
    const std::string topic = "u" + std::to_string(++inputs);
    const int commands = random.below(4);
    for (int n = 0; n < commands; ++n) {
      scene.commands.push_back({0.01 * (1 + random.below(199)), topic,
                                std::round(100.0 * random.between(-4.0, 4.0)) / 100.0});
    }
    return "topic: " + topic + ", " + keys;
  };
  for (int i = 1; i <= s; ++i) {
    const std::string shaft = "shaft: s" + std::to_string(i);
    const std::string q = "q" + std::to_string(i);
    if (random.happens(0.8)) {
      scene.torques.push_back({q, "{type: variator_sim/ExpressionTorque, " + shaft +
                                      ", torque: \"" + formulas.torque(i) + "\"}"});
    }
    if (random.happens(0.3)) {
      scene.torques.push_back({"m" + std::to_string(i), "{type: variator_sim/CommandedTorque, " +
                                                            shaft + ", " +
                                                            addInput(randomHold(random)) + "}"});
    }
    if (i > 1 && random.happens(0.2)) {
      scene.torques.push_back(
          {"c" + std::to_string(i), "{type: variator_sim/ElasticCoupling, shafts: [s" +
                                        std::to_string(i - 1) + ", s" + std::to_string(i) +
                                        "], stiffness: " + number(random.between(1.0, 40.0)) +
                                        ", damping: " + number(random.between(0.0, 1.0)) +
                                        ", ratio: " + number(random.between(0.3, 1.5)) + "}"});
    }
  }
  std::stable_sort(scene.commands.begin(), scene.commands.end(),
                   [](const auto& a, const auto& b) { return a.time < b.time; });

  const int most = std::min(4, s - 1);
  const int k = most == 0 ? 0 : random.happens(0.08) ? 0 : 1 + random.below(most);
  for (int m = 1; m <= k; ++m) {
    const int kind = random.below(10);
    const std::string name = "k" + std::to_string(m);
    if (kind == 0 && s >= 2) {
      const int a = random.below(s - 1) + 1;
      scene.constraints.push_back(
          {name, "{type: variator_sim/SlipRatio, shafts: [s" + std::to_string(a) + ", s" +
                     std::to_string(a + 1) +
                     "], time_constant: " + number(random.between(0.05, 1.0)) + ", ratio: {" +
                     addInput(randomHold(random)) + ", initial: 0.7}}"});
      continue;
    }
    const int order = kind <= 6 ? 2 : kind <= 8 ? 1 : 3;
    const std::string formula = order == 1   ? formulas.order1()
                                : order == 2 ? formulas.order2()
                                             : formulas.order3();
    scene.constraints.push_back(
        {name, "{type: variator_sim/ExpressionConstraint, order: " + std::to_string(order) +
                   ", expression: \"" + formula + "\"}"});
  }
  std::stable_sort(scene.commands.begin(), scene.commands.end(),
                   [](const auto& a, const auto& b) { return a.time < b.time; });
  return scene;
}

namespace {

Scene withMethod(Scene scene, StepperKind stepper, double tolerance) {
  scene.solver.stepper = stepper;
  // A motion that needs more is about to escape: it may stop by that name.
  scene.solver.maximum_steps = 20000;
  return withTolerance(std::move(scene), tolerance);
}

/// How far small differences at the start grow in this motion: the largest difference at any
/// sample over the difference at the start, each in the measure of calcDifference.
double calcGrowth(const Scene& scene, const std::vector<TimedCommand>& commands,
                  const std::vector<double>& times, const Run& reference, const Sample& start) {
  constexpr double kDifference = 1e-7;
  const int s = scene.shaftCount();
  double growth = 1.0;
  for (int direction = 0; direction < 3; ++direction) {
    Scene moved = scene;
    moved.initial.project = true;
    const auto shifted = [&](const double* values, int column) {
      std::vector<double> result(values, values + s);
      for (int i = 0; i < s; ++i) {
        const double sign = ((i + 1) * (direction + 2) + column * direction) % 3 - 1.0;
        result[static_cast<std::size_t>(i)] +=
            kDifference * (0.5 + sign) * (1.0 + std::abs(values[i]));
      }
      return result;
    };
    moved.initial.angle = shifted(start.angle, 0);
    moved.initial.velocity = shifted(start.velocity, 1);
    if (scene.principle == Principle::kGeneralizedGauss) {
      moved.initial.acceleration = shifted(start.acceleration, 2);
    }
    const Run run = play(moved, times, commands);
    const double difference =
        calcDifference(run, reference, s, kDifference, kDifference, Columns::kAll);
    if (std::isfinite(difference)) growth = std::max(growth, difference);
  }
  return growth;
}

}  // namespace

Finding examine(const Scene& scene, const std::vector<TimedCommand>& commands, double duration) {
  Finding finding;
  const std::vector<double> times = evenly(duration, 16);
  const Scene tight = withMethod(scene, StepperKind::kFehlberg78, 1e-12);
  std::vector<double> all_times = times;
  all_times.insert(all_times.begin(), 0.0);
  Run reference = play(tight, all_times, commands);
  if (reference.samples.empty()) {
    finding.kind = Finding::Kind::kRefused;
    finding.name = toString(reference.reason);
    finding.message = reference.message;
    return finding;
  }
  const Sample start = reference.samples.front();
  reference.samples.erase(reference.samples.begin());
  const double growth = calcGrowth(tight, commands, times, reference, start);
  finding.allowed = kAllowed * growth;

  struct Method {
    StepperKind stepper;
    double tolerance;
  };
  for (const Method method : {Method{StepperKind::kAuto, 1e-6}, Method{StepperKind::kAuto, 1e-4},
                              Method{StepperKind::kRadau, 1e-8}}) {
    const Run run = play(withMethod(scene, method.stepper, method.tolerance), times, commands);
    const double error = calcDifference(run, reference, scene.shaftCount(), method.tolerance,
                                        method.tolerance, Columns::kAll);
    const std::string label =
        std::string(toString(method.stepper)) + " at " + text(method.tolerance);
    if (!(error <= finding.allowed)) {
      finding.kind = Finding::Kind::kWrong;
      finding.error = error;
      finding.message = label + ": " + text(error) + " tolerances, " + text(finding.allowed) +
                        " allowed (errors grow by " + text(growth) + ")";
      return finding;
    }
    finding.error = std::max(finding.error, error / growth);
    if (run.reason != StopReason::kNone || reference.reason != StopReason::kNone) {
      finding.kind = Finding::Kind::kStops;
      finding.name = toString(run.reason != StopReason::kNone ? run.reason : reference.reason);
      finding.message =
          label + ": " + (run.reason != StopReason::kNone ? run.message : reference.message);
      // A run may stop where another one goes on; but where the motion ends it ends for all.
      if (run.reason == StopReason::kNone) {
        finding.message = label + " goes on where the reference stops: " + reference.message;
      }
    }
  }
  return finding;
}

Finding examine(const RandomScene& random) {
  try {
    const Scene scene = sceneFromText(random.yaml());
    std::vector<TimedCommand> commands;
    for (const RandomScene::Command& command : random.commands) {
      for (int i = 0; i < scene.inputCount(); ++i) {
        if (scene.inputs[static_cast<std::size_t>(i)].topic == command.topic) {
          commands.push_back({command.time, i, command.value});
        }
      }
    }
    return examine(scene, commands, random.duration);
  } catch (const SceneError& error) {
    Finding finding;
    finding.kind = Finding::Kind::kRefused;
    finding.name = "SceneError";
    finding.message = error.what();
    return finding;
  }
}

RandomScene shrink(const RandomScene& random) {
  RandomScene smallest = random;
  const auto isWrong = [](const RandomScene& scene) {
    return examine(scene).kind == Finding::Kind::kWrong;
  };
  // Elements of `list`, one at a time, as long as the fault stays.
  const auto thin = [&](auto list) {
    bool changed = false;
    for (std::size_t n = (smallest.*list).size(); n-- > 0;) {
      RandomScene smaller = smallest;
      auto& elements = smaller.*list;
      elements.erase(elements.begin() + static_cast<std::ptrdiff_t>(n));
      if (!isWrong(smaller)) continue;
      smallest = std::move(smaller);
      changed = true;
    }
    return changed;
  };
  bool changed = true;
  while (changed) {
    changed = thin(&RandomScene::commands);
    changed = thin(&RandomScene::torques) || changed;
    changed = thin(&RandomScene::constraints) || changed;
    changed = thin(&RandomScene::couplings) || changed;
    RandomScene shorter = smallest;
    shorter.duration *= 0.5;
    if (shorter.duration > 0.01 && isWrong(shorter)) {
      smallest = shorter;
      changed = true;
    }
  }
  return smallest;
}

}  // namespace variator_sim::test
