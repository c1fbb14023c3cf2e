// Chains of n shafts joined by elastic couplings and n/4 variators of order 1, beside programs by
// hand: the variators' second shafts eliminated, the rest in a band. Boost.Odeint plays the soft
// chain, CVODE with a banded matrix the stiff one. Times are the least of many runs of 20 s at
// tolerances of 1e-3 to 1e-11; a row has the least of those whose error at the end, of the speeds,
// is within the target. The reference is Odeint's fehlberg78 at 1e-14, or CVODE at 1e-13.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "peers/chain.h"
#include "peers/error.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim::benchmark {
namespace {

constexpr double kTargets[] = {1e-6, 1e-9};

Scene makeScene(const Chain& chain, double tolerance) {
  const auto number = [](double value) {
    char digits[40];
    std::snprintf(digits, sizeof digits, "%.17g", value);
    return std::string(digits);
  };
  std::string shafts, torques = "drive, load", constraints, text, speeds;
  double w = 1.0;
  for (int i = 0; i < chain.shafts; ++i) {
    const std::string own = "s" + std::to_string(i), before = "s" + std::to_string(i - 1);
    if (Chain::isDriven(i)) w *= Chain::ratio(i, 0.0);
    shafts += (i > 0 ? ", " : "") + own;
    speeds += (i > 0 ? ", " : "") + number(w);
    text += own + ": {inertia: " + number(Chain::inertia(i)) + "}\n";
    if (i == 0) continue;
    const std::string name = "c" + std::to_string(i);
    (Chain::isDriven(i) ? constraints : torques) +=
        (Chain::isDriven(i) && constraints.empty() ? "" : ", ") + name;
    text += name +
            (Chain::isDriven(i)
                 ? ": {type: variator_sim/ExpressionConstraint, order: 1, expression: \"w_" + own +
                       " - w_" + before + "*(1 + 0.2*sin(0.5*t + " + std::to_string(i) + "))\"}\n"
                 : ": {type: variator_sim/ElasticCoupling, shafts: [" + before + ", " + own +
                       "], stiffness: " + number(chain.stiffness) +
                       ", damping: " + number(chain.damping) + "}\n");
  }
  text +=
      "drive: {type: variator_sim/ExpressionTorque, shaft: s0, torque: \"20*(1 + 0.3*sin(3*t))\"}\n"
      "load: {type: variator_sim/ExpressionTorque, shaft: s" +
      std::to_string(chain.shafts - 1) + ", torque: \"-0.3*w_s" + std::to_string(chain.shafts - 1) +
      "\"}\n";
  ParameterTree tree = readYamlText(
      "shafts: [" + shafts + "]\ntorques: [" + torques + "]\nconstraints: [" + constraints + "]\n" +
          text + "principle: gauss\ninitial: {velocity: [" + speeds + "], project: true}\n",
      "chain");
  tree.asDictionary()["solver"] =
      ParameterTree::dictionary({{"relative_tolerance", ParameterTree::real(tolerance)},
                                 {"absolute_tolerance", ParameterTree::real(tolerance)},
                                 {"machine_code", ParameterTree::text("always")}});
  BuiltinComponentFactory factory;
  return readScene(tree, factory);
}

/// The least time, s, in which a run keeps within each target.
struct Best {
  double seconds[2] = {HUGE_VAL, HUGE_VAL};

  void note(const std::function<State()>& play, const State& reference) {
    using Clock = std::chrono::steady_clock;
    double least = HUGE_VAL, spent = 0.0;
    State w;
    for (int run = 0; run < 200 && spent < 0.3; ++run) {
      const Clock::time_point begin = Clock::now();
      w = play();
      const double taken = std::chrono::duration<double>(Clock::now() - begin).count();
      least = std::min(least, taken);
      spent += taken;
    }
    const double error = calcError(w.data(), reference.data(), w.size());
    for (std::size_t n = 0; n < 2; ++n) {
      if (error <= kTargets[n]) seconds[n] = std::min(seconds[n], least);
    }
  }
};

void tell(const char* name, const Chain& chain) {
  const bool is_stiff = chain.stiffness > 1e4;
  Best ours, peers;
  const State reference = is_stiff ? playCvode(chain, 1e-13) : playFehlberg78(chain, 1e-14);
  for (double tolerance = 1e-3; tolerance > 0.5e-11; tolerance *= 0.1) {
    Simulation simulation(makeScene(chain, tolerance));
    if (!simulation.loadMachineCode(true)) std::fprintf(stderr, "sizes: no machine code\n");
    ours.note(
        [&] {
          simulation.reset();
          simulation.advanceTo(kEnd);
          const double* const w = simulation.sample().velocity;
          return State(w, w + chain.shafts);
        },
        reference);
    if (is_stiff) {
      peers.note([&] { return playCvode(chain, tolerance); }, reference);
    } else {
      peers.note([&] { return playDopri5(chain, tolerance); }, reference);
      peers.note([&] { return playFehlberg78(chain, tolerance); }, reference);
    }
  }
  std::printf("| %s | %d |", name, chain.shafts);
  for (std::size_t n = 0; n < 2; ++n) {
    std::printf(" %.3g | %.3g | %.2f |", 1e3 * ours.seconds[n], 1e3 * peers.seconds[n],
                peers.seconds[n] / ours.seconds[n]);
  }
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace
}  // namespace variator_sim::benchmark

int main() {
  using variator_sim::benchmark::Chain;
  std::printf(
      "| chain | shafts | 1e-6: ours, ms | peer, ms | peer / ours | 1e-9: ours, ms | "
      "peer, ms | peer / ours |\n|---|---|---|---|---|---|---|---|\n");
  for (const int shafts : {8, 16, 32, 64}) {
    variator_sim::benchmark::tell("soft", Chain{shafts, 400.0, 2.0});
  }
  for (const int shafts : {8, 16, 32, 64}) {
    variator_sim::benchmark::tell("stiff", Chain{shafts, 4e5, 4e3});
  }
}
