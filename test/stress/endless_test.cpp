// At rest on and beside laws that jump or bend sharply: sign, if, clamp, max, tanh, Friction, loads
// below and above what holds, switches in time and of inputs at the instant of commands. Each scene
// reaches the right end within a few attempted steps, or stops by name; none goes on for ever.
//
//     endless_test SEED   plays one scene and prints it
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>

#include "stress/methods.h"
#include "stress/random.h"

namespace variator_sim::test {
namespace {

/// mass v' = load(t) - law(v), where v is the speed of what holds and law rises with v, at once
/// where it jumps. Shaft b of inertia 2 follows a by 0.6 (geared), or law acts between a and b
/// (contact).
struct RestScene {
  std::string yaml;
  std::vector<TimedCommand> commands;
  std::string csv = "time,topic,value\n";
  double end = 2.0;
  double mass = 1.0;
  double start = 0.0;  ///< v at time 0
  double slack = 0.0;  ///< rad/s, of what the law leaves open
  bool is_geared = false;
  bool is_contact = false;
  std::function<double(double t)> load;
  std::function<double(double v, double t)> law;

  std::vector<double> times() const { return evenly(end, 4); }
  std::vector<std::array<double, 2>> reference() const;
};

/// Euler's implicit method: its equation has one solution for every law that does not fall, jumps
/// included, and each step dissipates.
std::vector<std::array<double, 2>> RestScene::reference() const {
  std::vector<std::array<double, 2>> ends;
  constexpr int kSteps = 4000;
  const double h = end / kSteps;
  double v = start;
  double momentum = start;  // of both, by contact: inertias 1 and 2, b at rest
  for (int n = 1; n <= kSteps; ++n) {
    const double t = (n - 0.5) * h;
    const double aim = v + h * load(t) / (is_contact ? 1.0 : mass);
    double low = -1e4;
    double high = 1e4;
    for (int i = 0; i < 70; ++i) {
      const double middle = 0.5 * (low + high);
      (middle + h / mass * law(middle, t) < aim ? low : high) = middle;
    }
    v = high;
    momentum += h * load(t);
    if (n % (kSteps / 4) != 0) continue;
    if (is_contact) {
      ends.push_back({(momentum + 2.0 * v) / 3.0, (momentum - v) / 3.0});
    } else {
      ends.push_back({v, is_geared ? 0.6 * v : 0.0});
    }
  }
  return ends;
}

std::string replaced(std::string text, const std::string& name, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(name, at)) != std::string::npos; at += by.size()) {
    text.replace(at, name.size(), by);
  }
  return text;
}

RestScene makeRestScene(std::uint64_t seed) {
  Random random(seed);
  RestScene scene;
  const auto oneOf = [&](const std::vector<double>& values) { return random.oneOf(values); };
  const double H = oneOf({1.0, 1.0, 10.0, 400.0});
  const double width = std::pow(10.0, -1.0 - random.below(9));
  const double start = random.happens(0.6) ? 0.0 : oneOf({1.0, -1.0, 0.1, 10.0, width});
  const int body = random.below(4);  // alone twice as often
  scene.is_geared = body == 2;
  scene.is_contact = body == 3;
  scene.mass = scene.is_geared ? 1.72 : scene.is_contact ? 2.0 / 3.0 : 1.0;
  scene.start = start;
  scene.end = oneOf({1.0, 2.0, 2.0, 5.0});
  const double edge = oneOf({0.25, 0.5, 0.7, 1.0}) * scene.end;
  const double part = oneOf({0.0, 0.25, 0.5, 0.9, 0.999, 1.001, 1.5, 3.0});
  const double L1 = H * part;
  const double L2 = H * oneOf({0.0, -0.5, 0.6, 1.5, -2.0});

  // what drives
  std::string load;
  std::string input = "hold: zero_order, initial: 0.0";
  const auto command = [&](double time, double value) {
    scene.commands.push_back({time, 0, value});
    scene.csv += plainly(time) + ",u," + plainly(value) + "\n";
  };
  const auto before = [](double t, double instant, double x, double y) {
    return t < instant ? x : y;
  };
  // (The mean of the two where an implicit step spans the edge is not needed: edges fall on steps.)
  switch (random.below(9)) {
    case 0:
      load = plainly(L1);
      scene.load = [L1](double) { return L1; };
      break;
    case 1:
      load = "if(t<" + plainly(edge) + "," + plainly(L1) + "," + plainly(L2) + ")";
      scene.load = [=](double t) { return before(t, edge, L1, L2); };
      break;
    case 2:  // with a command at the same instant that nothing needs
      load = "if(t<" + plainly(edge) + "," + plainly(L1) + "," + plainly(L2) + ")+0*u";
      command(edge, 1.0);
      scene.load = [=](double t) { return before(t, edge, L1, L2); };
      break;
    case 3:
      load = "u+" + plainly(0.5 * L1) + "*(1+sign(t-" + plainly(edge) + "))";
      command(edge, L2);
      scene.load = [=](double t) { return before(t, edge, 0.0, L1 + L2); };
      break;
    case 4:  // a ramp that ends where it holds no more, or on it
      input = "hold: rate_limit, rate: " + plainly(H / edge) + ", initial: 0.0";
      command(0.0, L1);
      load = "u";
      scene.load = [=](double t) { return std::min(L1, H / edge * t); };
      break;
    case 5:  // and one that ends on a switch
      input = "hold: " +
              std::string(random.happens(0.5) ? "rate_limit, rate: " + plainly(1.0 / edge)
                                              : "first_order_hold, period: " + plainly(edge)) +
              ", initial: 0.0";
      command(0.0, 1.0);
      load = "if(u<1," + plainly(L1) + "," + plainly(L2) + ")";
      scene.load = [=](double t) { return before(t, edge, L1, L2); };
      break;
    case 6:  // a lag that ends on a switch of its own rounding, long after the end
      input = "hold: first_order_lag, time_constant: " + plainly(edge) + ", initial: 0.0";
      command(0.0, 1.0);
      load = plainly(L1) + "*if(u<1,1,2)";
      scene.load = [=](double) { return L1; };
      break;
    case 7:
      load = plainly(L1) + "*sin(3*t)";
      scene.load = [=](double t) { return L1 * std::sin(3.0 * t); };
      break;
    default:  // commands on and off
      for (int n = 0; n < 4; ++n) command(0.25 * n * scene.end, n % 2 == 0 ? L1 : L2);
      load = "u";
      scene.load = [=](double t) {
        return static_cast<int>(4.0 * t / scene.end) % 2 == 0 ? L1 : L2;
      };
      break;
  }
  // what holds: a formula of V, or Friction
  std::string law;
  std::string friction;
  const auto tanh = [=](double v) { return std::tanh(v / width); };
  const std::string h = plainly(H);
  const std::string x = "(V/" + plainly(width) + ")";
  switch (random.below(14)) {
    case 0:
    case 1:
      law = h + "*sign(V)";
      scene.law = [=](double v, double) { return v > 0.0 ? H : v < 0.0 ? -H : 0.0; };
      break;
    case 2:
      law = random.happens(0.5) ? "if(V>0," + h + ",-" + h + ")" : "if(V>=0," + h + ",-" + h + ")";
      scene.law = [=](double v, double) { return v > 0.0 ? H : -H; };
      break;
    case 3:
      law = h + "*clamp(" + x + ",-1,1)";
      scene.law = [=](double v, double) { return H * std::clamp(v / width, -1.0, 1.0); };
      break;
    case 4:
      law = h + "*max(-1,min(1," + x + "))";
      scene.law = [=](double v, double) { return H * std::clamp(v / width, -1.0, 1.0); };
      break;
    case 5:
      law = h + "*V/(abs(V)+" + plainly(width) + ")";
      scene.law = [=](double v, double) { return H * v / (std::abs(v) + width); };
      break;
    case 6:
      law = h + "*tanh" + x;
      scene.law = [=](double v, double) { return H * tanh(v); };
      break;
    case 7:
      law = "if(tanh" + x + ">0," + h + "*tanh" + x + "," + plainly(0.7 * H) + "*tanh" + x + ")";
      scene.law = [=](double v, double) { return (v > 0.0 ? H : 0.7 * H) * tanh(v); };
      break;
    case 8:  // another one behind an edge in time
      law = "if(t<" + plainly(edge) + "," + h + "," + plainly(1.6 * H) + ")*tanh" + x;
      scene.law = [=](double v, double t) { return before(t, edge, H, 1.6 * H) * tanh(v); };
      break;
    case 9:
      friction = "regularization_speed: " + plainly(width);
      scene.law = [=](double v, double) { return H * tanh(v); };
      break;
    case 10:
      friction = "viscous: 0.3, regularization_speed: " + plainly(width);
      scene.law = [=](double v, double) { return H * tanh(v) + 0.3 * v; };
      break;
    case 11:  // rests, or creeps at the default width of 0.01 rad/s
      friction = "viscous: 0.1";
      scene.law = [=](double v, double) { return H * std::tanh(v / 0.01) + 0.1 * v; };
      scene.slack = 0.08;
      break;
    case 12: {  // a freewheel, driven
      const double c = 1.0 / width;
      const std::string drive = random.happens(0.5) ? "sin(t)" : "5*sin(31*t)";
      const double a = drive == "sin(t)" ? 1.0 : 5.0;
      const double z = drive == "sin(t)" ? 1.0 : 31.0;
      law = "V-max(0," + plainly(c) + "*(" + drive + "-V))";
      scene.law = [=](double v, double t) {
        return v - std::max(0.0, c * (a * std::sin(z * t) - v));
      };
      scene.slack = 0.1 * a;
      break;
    }
    default: {  // the torque falls at a speed, or turns around there
      const double turn = oneOf({0.5, -1.0});
      const double at = oneOf({1.0, 1.0, 2.0}) * (L1 > 0.0 ? 1.0 : 0.5);
      law = "if(V<" + plainly(at) + ",-" + h + "," + plainly(-turn * H) + ")";
      scene.law = [=](double v, double) { return v < at ? -H : -turn * H; };
      break;
    }
  }

  const std::string V = scene.is_contact ? "(w1-w2)" : "w1";
  std::string& yaml = scene.yaml;
  const bool has_two = scene.is_geared || scene.is_contact;
  yaml = has_two ? "shafts: [a, b]\nb: {inertia: 2.0}\n" : "shafts: [a]\n";
  yaml += "a: {inertia: 1.0}\ninputs: [u]\nu: {topic: u, " + input + "}\ntorques: [load, law]\n" +
          "load: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"" + load + "\"}\n";
  if (!friction.empty()) {
    yaml += "law: {type: variator_sim/Friction, " +
            std::string(scene.is_contact ? "shafts: [a, b]" : "shaft: a") + ", coulomb: " + h +
            ", " + friction + "}\n";
  } else {
    yaml += "law: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"-(" +
            replaced(law, "V", V) + ")\"" + (scene.is_contact ? ", reaction_on: b" : "") + "}\n";
  }
  if (scene.is_geared) {
    yaml += "constraints: [g]\ng: ";
    yaml += random.happens(0.5)
                ? "{type: variator_sim/KinematicRatio, shafts: [a, b], ratio: 0.6}\n"
                : "{type: variator_sim/SlipRatio, shafts: [a, b], time_constant: 0.1, "
                  "ratio: 0.6}\n";
  }
  yaml += "principle: " + std::string(random.oneOf(kPrinciples)) + "\ninitial: {velocity: [" +
          plainly(start) + (has_two ? ", " + plainly(scene.is_geared ? 0.6 * start : 0.0) : "") +
          "], project: true}\n";
  const StepperKind stepper =
      random.happens(0.4) ? StepperKind::kAuto : random.oneOf(kAdaptiveSteppers);
  const double tolerance = oneOf({1e-9, 1e-9, 1e-6, 1e-4});
  yaml += std::string("solver: {stepper: ") + toString(stepper) +
          ", relative_tolerance: " + plainly(tolerance) +
          ", absolute_tolerance: " + plainly(tolerance) + "}\n";
  return scene;
}

/// The result of a scene, of a size that a pipe transfers atomically.
struct Verdict {
  char kind[24] = "endless";
  double error = 0.0;  ///< rad/s
  double attempts = 0.0;
  char message[400] = "";
};

void write(char* to, std::size_t size, const std::string& text) {
  std::strncpy(to, text.c_str(), size - 1);
}

Verdict examine(const RestScene& rest) {
  Verdict verdict;
  const auto name = [&](const std::string& kind, const std::string& message) {
    write(verdict.kind, sizeof verdict.kind, kind);
    write(verdict.message, sizeof verdict.message, message);
  };
  try {
    Scene scene = sceneFromText(rest.yaml);
    scene.solver.machine_code = MachineCode::kNever;
    if (!takes(scene, scene.solver.stepper)) scene.solver.stepper = StepperKind::kAuto;
    // Stability limits the steps of explicit schemes to some width/H: a scheme by name may take
    // millions of them, and says so. `auto` has no such excuse.
    constexpr int kExplicitSteps = 20000;  // a second
    const StepperKind stepper = scene.solver.stepper;
    if (stepper != StepperKind::kAuto && stepper != StepperKind::kRadau) {
      scene.solver.maximum_steps = kExplicitSteps;
    }
    const test::Run run = play(scene, rest.times(), rest.commands);
    if (run.reason == StopReason::kProjectionFailed && run.samples.empty()) {
      name("refused", run.message);
      return verdict;
    }
    verdict.attempts = static_cast<double>(run.statistics.steps + run.statistics.rejected_steps);
    const auto exact = rest.reference();
    double largest = std::abs(rest.start);
    for (std::size_t n = 0; n < run.samples.size(); ++n) {
      for (std::size_t i = 0; i < 2; ++i) {
        largest = std::max(largest, std::abs(exact[n][i]));
        const double off = std::abs(run.samples[n].velocity[i] - exact[n][i]);
        const double error = off / (0.01 * largest + 2e-3 + rest.slack);
        verdict.error = error <= verdict.error ? verdict.error : error == error ? error : HUGE_VAL;
      }
    }
    name(!(verdict.error <= 1.0)           ? "wrong"
         : run.reason != StopReason::kNone ? toString(run.reason)
         : verdict.attempts > 100000       ? "crawls"
                                           : "right",
         run.message);
  } catch (const SceneError& error) {
    name("refused", error.what());
  }
  return verdict;
}

/// Verdicts of a child, which is begun anew when a scene has taken `limit` seconds of its time; no
/// more after `most` of these.
std::vector<Verdict> examineAll(const std::vector<std::uint64_t>& seeds, int limit, int most) {
  std::vector<Verdict> verdicts;
  while (verdicts.size() < seeds.size() && most > 0) {
    int ends[2];
    if (pipe(ends) != 0) break;
    std::fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
      close(ends[0]);
      for (std::size_t n = verdicts.size(); n < seeds.size(); ++n) {
        const itimerval timer{{0, 0}, {limit, 0}};
        setitimer(ITIMER_PROF, &timer, nullptr);  // SIGPROF ends it
        const Verdict verdict = examine(makeRestScene(seeds[n]));
        if (::write(ends[1], &verdict, sizeof verdict) != sizeof verdict) _exit(1);
      }
      _exit(0);
    }
    close(ends[1]);
    Verdict verdict;
    while (read(ends[0], &verdict, sizeof verdict) == sizeof verdict) verdicts.push_back(verdict);
    close(ends[0]);
    waitpid(child, nullptr, 0);
    if (verdicts.size() < seeds.size()) {
      verdicts.emplace_back();
      --most;
      if (isLongForm()) std::printf("%zu of %zu\n", verdicts.size(), seeds.size());
    }
  }
  return verdicts;
}

TEST(RestReference, KnowsMotionsThatOthersHaveComputed) {
  RestScene wheel;
  wheel.end = 3.0;
  wheel.load = [](double) { return 0.0; };
  wheel.law = [](double v, double t) { return v - std::max(0.0, 1e5 * (std::sin(t) - v)); };
  EXPECT_NEAR(wheel.reference().back()[0], 0.371435852926, 1e-3);
  RestScene hoist;  // 100 against 400 holds, against 60 it does not
  hoist.load = [](double) { return 100.0; };
  for (const double H : {400.0, 60.0}) {
    hoist.law = [H](double v, double) { return v > 0.0 ? H : -H; };
    EXPECT_NEAR(hoist.reference().back()[0], 2.0 * std::max(0.0, 100.0 - H), 1e-9) << H;
  }
}

TEST(Endless, NoSceneAtRestOnASwitchIs) {
  std::vector<std::uint64_t> seeds = givenSeeds(150, 20000);
  // Contacts of a width of 1e-9 rad/s at 5 to 300 rad/s, whose torques are mostly rounding, took
  // millions of steps; friction of 1e-6 rad/s let go 0.016 s late.
  const auto late = {500814, 502158, 502587, 503229, 503565, 501520};
  if (seeds.size() > 1) seeds.insert(seeds.end(), late.begin(), late.end());
  const std::vector<Verdict> verdicts = examineAll(seeds, 5, sizeOf(2, 20000));

  Hazard hazard("rest", "laws that jump or bend sharply at rest, made at random",
                "widths 1e-1 to 1e-9, all steppers");
  std::map<std::string, int> counts;
  for (std::size_t n = 0; n < verdicts.size(); ++n) {
    const Verdict& verdict = verdicts[n];
    const std::uint64_t seed = seeds[n];
    const std::string kind = verdict.kind;
    const int of_kind = ++counts[kind];
    const bool is_bad =
        kind == "wrong" || kind == "endless" || kind == "crawls" || kind == "refused";
    if (is_bad || kind == "right") {
      hazard.judge(is_bad ? HUGE_VAL : verdict.error, kind + " seed " + std::to_string(seed), 1.0);
    } else {
      hazard.named(kind, "seed " + std::to_string(seed));
    }
    if (seeds.size() > 1 && (kind == "right" || of_kind > 3)) continue;
    const RestScene scene = makeRestScene(seed);
    std::printf("seed %llu: %s, error %.3g of what is allowed, %.0f attempted steps %s\n%s%s",
                static_cast<unsigned long long>(seed), verdict.kind, verdict.error,
                verdict.attempts, verdict.message, scene.yaml.c_str(), scene.csv.c_str());
    const auto exact = scene.reference();
    for (std::size_t i = 0; i < exact.size(); ++i) {
      std::printf("# %.17g s: velocities %.9g %.9g\n", scene.times()[i], exact[i][0], exact[i][1]);
    }
  }
  for (const auto& [kind, number] : counts) std::printf("%s: %d\n", kind.c_str(), number);
  EXPECT_EQ(verdicts.size(), seeds.size()) << "too many were endless to go on";
}

}  // namespace
}  // namespace variator_sim::test
