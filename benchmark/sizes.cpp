// Chains of n shafts joined by elastic couplings and n/4 variators of order 1, beside programs by
// hand: the variators' second shafts eliminated, the rest in a band. Boost.Odeint plays the soft
// chain, CVODE with a banded matrix the stiff one. Times are the least of many runs of 20 s at
// tolerances of 1e-3 to 1e-11; a row has the least of those whose error at the end, of the speeds,
// is within the target. The reference is Odeint's fehlberg78 at 1e-14, or CVODE at 1e-13.
#ifdef VARIATOR_SIM_WITH_SUNDIALS
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>
#endif

#include <algorithm>
#include <boost/numeric/odeint.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim::benchmark {
namespace {

using State = std::vector<double>;

constexpr double kEnd = 20.0;  // s
constexpr double kTargets[] = {1e-6, 1e-9};

struct Chain {
  int shafts;
  double stiffness;  ///< N m/rad
  double damping;    ///< N m s/rad

  static double inertia(int i) { return 1.0 + 0.1 * std::sin(i); }
  static bool isDriven(int i) {
    return i % 4 == 2;
  }  ///< by the shaft before it, through a variator
  static double ratio(int i, double t) { return 1.0 + 0.2 * std::sin(0.5 * t + i); }
  static double ratioRate(int i, double t) { return 0.1 * std::cos(0.5 * t + i); }
};

/// The chain by hand: (w, twist behind it) of each shaft; a driven shaft has no w, and the one
/// before it no twist.
class ByHand {
 public:
  explicit ByHand(const Chain& chain) : chain_(chain), w_(size()), torque_(size()), speed_(size()) {
    int next = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const int n = static_cast<int>(i);
      speed_[i] = Chain::isDriven(n) ? -1 : next++;
      twist_.push_back(n + 1 < chain.shafts && !Chain::isDriven(n + 1) ? next++ : -1);
    }
    states_ = next;
  }
  State initial() const {
    State x(static_cast<std::size_t>(states_), 0.0);
    double w = 1.0;
    for (std::size_t i = 0; i < size(); ++i) {
      if (speed_[i] < 0) w *= Chain::ratio(static_cast<int>(i), 0.0);
      if (speed_[i] >= 0) x[static_cast<std::size_t>(speed_[i])] = w;
    }
    return x;
  }
  void rates(const double* x, double* dxdt, double t) {
    for (std::size_t i = 0; i < size(); ++i) {
      w_[i] = speed_[i] >= 0 ? x[speed_[i]] : w_[i - 1] * Chain::ratio(static_cast<int>(i), t);
      torque_[i] = 0.0;
    }
    torque_.front() = 20.0 * (1.0 + 0.3 * std::sin(3.0 * t));
    torque_.back() -= 0.3 * w_.back();
    for (std::size_t i = 0; i + 1 < size(); ++i) {
      if (twist_[i] < 0) continue;
      const double slip = w_[i] - w_[i + 1];
      const double torque = chain_.stiffness * x[twist_[i]] + chain_.damping * slip;
      dxdt[twist_[i]] = slip;
      torque_[i] -= torque;
      torque_[i + 1] += torque;
    }
    for (std::size_t i = 0; i < size(); ++i) {
      const int n = static_cast<int>(i);
      if (speed_[i] < 0) continue;
      double force = torque_[i];
      double inertia = Chain::inertia(n);
      if (i + 1 < size() && speed_[i + 1] < 0) {
        const double r = Chain::ratio(n + 1, t);
        const double driven = Chain::inertia(n + 1);
        force += r * (torque_[i + 1] - driven * Chain::ratioRate(n + 1, t) * w_[i]);
        inertia += r * r * driven;
      }
      dxdt[speed_[i]] = force / inertia;
    }
  }
  State speeds(const State& x) const {
    State w;
    for (std::size_t i = 0; i < size(); ++i) {
      w.push_back(speed_[i] >= 0 ? x[static_cast<std::size_t>(speed_[i])]
                                 : w.back() * Chain::ratio(static_cast<int>(i), kEnd));
    }
    return w;
  }

 private:
  std::size_t size() const { return static_cast<std::size_t>(chain_.shafts); }

  const Chain chain_;
  State w_, torque_;
  std::vector<int> speed_, twist_;
  int states_ = 0;
};

template <class Stepper>
State playOdeint(const Chain& chain, double tolerance) {
  namespace odeint = boost::numeric::odeint;
  ByHand machine(chain);
  State x = machine.initial();
  const auto system = [&](const State& y, State& dydt, double t) {
    machine.rates(y.data(), dydt.data(), t);
  };
  odeint::integrate_adaptive(odeint::make_controlled<Stepper>(tolerance, tolerance), system, x, 0.0,
                             kEnd, 0.01);
  return machine.speeds(x);
}

#ifdef VARIATOR_SIM_WITH_SUNDIALS
State playCvode(const Chain& chain, double tolerance) {
  constexpr int kBand = 4;
  ByHand machine(chain);
  State x = machine.initial();
  const auto n = static_cast<sunindextype>(x.size());
  SUNContext context = nullptr;
  SUNContext_Create(nullptr, &context);
  N_Vector y = N_VMake_Serial(n, x.data(), context);
  SUNMatrix matrix = SUNBandMatrix(n, kBand, kBand, context);
  SUNLinearSolver solver = SUNLinSol_Band(y, matrix, context);
  void* const cvode = CVodeCreate(CV_BDF, context);
  const auto rates = [](realtype t, N_Vector at, N_Vector dxdt, void* of) {
    static_cast<ByHand*>(of)->rates(NV_DATA_S(at), NV_DATA_S(dxdt), t);
    return 0;
  };
  CVodeInit(cvode, rates, 0.0, y);
  CVodeSetUserData(cvode, &machine);
  CVodeSStolerances(cvode, tolerance, tolerance);
  CVodeSetLinearSolver(cvode, solver, matrix);
  CVodeSetMaxNumSteps(cvode, 1000000);
  CVodeSetStopTime(cvode, kEnd);
  double reached = 0.0;
  const int flag = CVode(cvode, kEnd, y, &reached, CV_NORMAL);
  void* closed = cvode;
  CVodeFree(&closed);
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  N_VDestroy(y);
  SUNContext_Free(&context);
  return flag < 0 ? State(static_cast<std::size_t>(chain.shafts), NAN) : machine.speeds(x);
}
#endif

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
    double least = HUGE_VAL, spent = 0.0, error = 0.0;
    State w;
    for (int run = 0; run < 200 && spent < 0.3; ++run) {
      const Clock::time_point begin = Clock::now();
      w = play();
      const double taken = std::chrono::duration<double>(Clock::now() - begin).count();
      least = std::min(least, taken);
      spent += taken;
    }
    for (std::size_t i = 0; i < w.size(); ++i) {
      const double off = std::abs(w[i] - reference[i]) / std::max(1.0, std::abs(reference[i]));
      error = std::isnan(off) ? HUGE_VAL : std::max(error, off);
    }
    for (std::size_t n = 0; n < 2; ++n) {
      if (error <= kTargets[n]) seconds[n] = std::min(seconds[n], least);
    }
  }
};

void tell(const char* name, const Chain& chain) {
  namespace odeint = boost::numeric::odeint;
  using Fehlberg = odeint::runge_kutta_fehlberg78<State>;
  const bool is_stiff = chain.stiffness > 1e4;
  Best ours, peers;
  State reference;
#ifdef VARIATOR_SIM_WITH_SUNDIALS
  if (is_stiff) reference = playCvode(chain, 1e-13);
#endif
  if (!is_stiff) reference = playOdeint<Fehlberg>(chain, 1e-14);
  double compiling = 0.0;
  for (double tolerance = 1e-3; tolerance > 0.5e-11; tolerance *= 0.1) {
    Simulation simulation(makeScene(chain, tolerance));
    const auto begin = std::chrono::steady_clock::now();
    if (!simulation.loadMachineCode(true)) std::fprintf(stderr, "sizes: no machine code\n");
    compiling = std::max(
        compiling, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    if (reference.empty()) reference.assign(static_cast<std::size_t>(chain.shafts), NAN);
    ours.note(
        [&] {
          simulation.reset();
          simulation.advanceTo(kEnd);
          const double* const w = simulation.sample().velocity;
          return State(w, w + chain.shafts);
        },
        reference);
    if (!is_stiff) {
      using Dopri5 = odeint::runge_kutta_dopri5<State>;
      peers.note([&] { return playOdeint<Dopri5>(chain, tolerance); }, reference);
      peers.note([&] { return playOdeint<Fehlberg>(chain, tolerance); }, reference);
    }
#ifdef VARIATOR_SIM_WITH_SUNDIALS
    if (is_stiff) peers.note([&] { return playCvode(chain, tolerance); }, reference);
#endif
  }
  std::printf("| %s | %d |", name, chain.shafts);
  for (std::size_t n = 0; n < 2; ++n) {
    std::printf(" %.3g | %.3g | %.2f |", 1e3 * ours.seconds[n], 1e3 * peers.seconds[n],
                peers.seconds[n] / ours.seconds[n]);
  }
  std::printf(" %.1f |\n", compiling);
  std::fflush(stdout);
}

}  // namespace
}  // namespace variator_sim::benchmark

int main() {
  using variator_sim::benchmark::Chain;
  std::printf(
      "| chain | shafts | 1e-6: ours, ms | peer, ms | peer / ours | 1e-9: ours, ms | "
      "peer, ms | peer / ours | compiling, s |\n|---|---|---|---|---|---|---|---|---|\n");
  for (const int shafts : {8, 16, 32, 64}) {
    variator_sim::benchmark::tell("soft", Chain{shafts, 400.0, 2.0});
  }
  for (const int shafts : {8, 16, 32, 64}) {
    variator_sim::benchmark::tell("stiff", Chain{shafts, 4e5, 4e3});
  }
}
