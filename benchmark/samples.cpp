/// The ship for 20 s with 100 samples a second: ours, each with all columns, beside peers by their
/// own dense output, with the state alone and with all columns. Rows as of work_precision; the
/// error is the largest of any angle, speed or acceleration at any sample.
///
/// usage: samples benchmark/scenes The reference is Odeint's fehlberg78 in long double from sample
/// to sample. The head has the cost of a sample of ours: of 1,000 a second, less a run without any.
#include <algorithm>
#include <array>
#include <boost/numeric/odeint.hpp>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#ifdef VARIATOR_SIM_WITH_SUNDIALS
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#endif

#include "peers/method.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

// Odeint copies its steppers with arrays that have no values yet; inlined, that is warned of here.
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"

namespace variator_sim::benchmark {
namespace {

namespace odeint = boost::numeric::odeint;

constexpr int kState = 6;
constexpr double kEnd = 20.0;
constexpr int kSamples = 2000;
constexpr double kFirstStep = 1e-3;

/// One sample as it is kept: beside the state Q, R, R', Lambda and psi.
struct Row {
  std::array<double, kState> x;
  double Q[2], R[2], rate[2], Lambda, psi;
};
using Rows = std::vector<Row>;

double timeOf(int sample, int count) {
  return kEnd * sample / count;
}

const Ship<double> kShip{SceneParameters{}};

/// Computes the other columns from a peer's state.
void completeRow(double t, Row* row) {
  const double* const x = row->x.data();
  double C[1][2];
  double c0[1];
  double gain[2];
  kShip.torque(t, x, x + 2, row->Q);
  kShip.torqueRate(t, x, x + 2, x + 4, gain);
  kShip.row(t, x, x + 2, x + 4, C, c0);
  kShip.residual(t, x, x + 2, x + 4, &row->psi);
  double A = 0.0;
  double right = c0[0];
  for (int i = 0; i < 2; ++i) {
    A += C[0][i] * C[0][i] / kShip.kInertia[i];
    right += C[0][i] * gain[i] / kShip.kInertia[i];
    row->R[i] = kShip.kInertia[i] * x[4 + i] - row->Q[i];
  }
  row->Lambda = -right / A;
  for (int i = 0; i < 2; ++i) row->rate[i] = C[0][i] * row->Lambda;
}

/// A run: how it is called, and rows at kSamples times by a tolerance.
struct Sampler {
  std::string name;
  std::string form;
  std::function<void(double tolerance, bool all, Rows* rows)> run;
  bool all = true;
};

template <class Number>
using StateOf = std::array<Number, kState>;

template <class Number>
StateOf<Number> initial() {
  StateOf<Number> x;
  Ship<Number>::initial(x.data());
  return x;
}

template <class Stepper>
void runOdeint(Stepper stepper, bool all, Rows* rows) {
  const auto system = [](const StateOf<double>& x, StateOf<double>& dxdt, double t) {
    calcDerivative(kShip, t, x.data(), dxdt.data());
  };
  stepper.initialize(initial<double>(), 0.0, kFirstStep);
  for (int n = 1; n <= kSamples; ++n) {
    const double t = timeOf(n, kSamples);
    Row& row = (*rows)[static_cast<std::size_t>(n - 1)];
    while (stepper.current_time() < t) stepper.do_step(system);
    stepper.calc_state(t, row.x);
    if (all) completeRow(t, &row);
  }
}

void runDopri5(double tolerance, bool all, Rows* rows) {
  using Stepper = odeint::runge_kutta_dopri5<StateOf<double>>;
  runOdeint(odeint::make_dense_output<Stepper>(tolerance, tolerance), all, rows);
}

void runBulirschStoer(double tolerance, bool all, Rows* rows) {
  runOdeint(odeint::bulirsch_stoer_dense_out<StateOf<double>>(tolerance, tolerance), all, rows);
}

#ifdef VARIATOR_SIM_WITH_SUNDIALS
/// CVODE's Adams methods, whose output at a time asked for is its own interpolation.
void runCvode(double tolerance, bool all, Rows* rows) {
  SUNContext context = nullptr;
  SUNContext_Create(nullptr, &context);
  N_Vector y = N_VNew_Serial(kState, context);
  const StateOf<double> x0 = initial<double>();
  std::copy(x0.begin(), x0.end(), NV_DATA_S(y));
  void* const memory = CVodeCreate(CV_ADAMS, context);
  const CVRhsFn evaluate = [](realtype t, N_Vector x, N_Vector dxdt, void* /*data*/) {
    calcDerivative(kShip, t, static_cast<const double*>(NV_DATA_S(x)), NV_DATA_S(dxdt));
    return 0;
  };
  CVodeInit(memory, evaluate, 0.0, y);
  CVodeSStolerances(memory, tolerance, tolerance);
  SUNNonlinearSolver solver = SUNNonlinSol_FixedPoint(y, 0, context);
  CVodeSetNonlinearSolver(memory, solver);
  CVodeSetMaxNumSteps(memory, 1000000);
  for (int n = 1; n <= kSamples; ++n) {
    const double t = timeOf(n, kSamples);
    Row& row = (*rows)[static_cast<std::size_t>(n - 1)];
    realtype reached = 0.0;
    if (CVode(memory, t, y, &reached, CV_NORMAL) < 0) row.x[0] = std::nan("");
    std::copy_n(NV_DATA_S(y), kState, row.x.begin());
    if (all) completeRow(t, &row);
  }
  void* freed = memory;
  CVodeFree(&freed);
  SUNNonlinSolFree(solver);
  N_VDestroy(y);
  SUNContext_Free(&context);
}
#endif

/// One simulation for each tolerance, as a program keeps it, and reset for every run.
class Ours {
 public:
  explicit Ours(const std::string& folder) {
    BuiltinComponentFactory factory;
    scene_ = readScene(readYamlFile(folder + "/ship.yaml"), factory);
    scene_.solver.machine_code = MachineCode::kAlways;
    scene_.solver.maximum_step = kEnd;  // peers have no longest one
  }
  Simulation& at(double tolerance) {
    if (simulation_ == nullptr || tolerance != tolerance_) {
      scene_.solver.relative_tolerance = scene_.solver.absolute_tolerance = tolerance;
      simulation_ = std::make_unique<Simulation>(scene_);
      tolerance_ = tolerance;
      if (!simulation_->loadMachineCode(true)) std::fputs("no machine code\n", stderr);
    }
    return *simulation_;
  }
  void run(double tolerance, int samples, Row* rows) {
    Simulation& simulation = at(tolerance);
    simulation.reset();
    for (int n = 1; n <= samples; ++n) {
      simulation.advanceTo(timeOf(n, samples));
      const Sample& sample = simulation.sample();
      Row& row = rows[(n - 1) % kSamples];
      for (int i = 0; i < 2; ++i) {
        const auto at = static_cast<std::size_t>(i);
        row.x[at] = sample.angle[i];
        row.x[2 + at] = sample.velocity[i];
        row.x[4 + at] = sample.acceleration[i];
        row.Q[i] = sample.applied_torque[i];
        row.R[i] = sample.reaction_torque[i];
        row.rate[i] = sample.reaction_torque_rate[i];
      }
      row.Lambda = sample.multiplier[0];
      row.psi = sample.residual[0];
    }
  }

 private:
  Scene scene_;
  std::unique_ptr<Simulation> simulation_;
  double tolerance_ = 0.0;
};

std::vector<StateOf<long double>> makeReference() {
  const Ship<long double> ship{SceneParameters{}};
  using State = StateOf<long double>;
  const auto system = [&ship](const State& x, State& dxdt, long double t) {
    calcDerivative(ship, t, x.data(), dxdt.data());
  };
  State x = initial<long double>();
  std::vector<State> rows;
  for (int n = 1; n <= kSamples; ++n) {
    const long double from = 20.0L * (n - 1) / kSamples;
    using Stepper = odeint::runge_kutta_fehlberg78<State, long double>;
    odeint::integrate_adaptive(odeint::make_controlled<Stepper>(1e-17L, 1e-17L), system, x, from,
                               20.0L * n / kSamples, 1e-3L);
    rows.push_back(x);
  }
  return rows;
}

double errorOf(const Rows& rows, const std::vector<StateOf<long double>>& reference) {
  long double largest = 0.0L;
  for (std::size_t n = 0; n < rows.size(); ++n) {
    for (std::size_t i = 0; i < kState; ++i) {
      const long double exact = reference[n][i];
      const long double error = std::abs(rows[n].x[i] - exact) / std::max(1.0L, std::abs(exact));
      if (!(error >= 0.0L)) return std::nan("");
      largest = std::max(largest, error);
    }
  }
  return static_cast<double>(largest);
}

/// The least time of a run, s, of many in `seconds`.
template <class Run>
double leastTime(double seconds, const Run& run) {
  double least = std::numeric_limits<double>::infinity();
  const auto start = std::chrono::steady_clock::now();
  do {
    const auto begin = std::chrono::steady_clock::now();
    run();
    least = std::min(least, secondsSince(begin));
  } while (secondsSince(start) < seconds);
  return least;
}

int measure(const std::string& folder) {
  Ours ours(folder);
  constexpr int kDense = 20000;
  constexpr double kUsual = 1e-9;
  Rows dense(kSamples);  // which stays in the cache
  ours.at(kUsual);
  double with = std::numeric_limits<double>::infinity();
  double without = with;
  for (int round = 0; round < 5; ++round) {
    with = std::min(with, leastTime(0.1, [&] { ours.run(kUsual, kDense, dense.data()); }));
    without = std::min(without, leastTime(0.1, [&] { ours.run(kUsual, 1, dense.data()); }));
  }
  std::printf("# a sample: %.1f ns\n", 1e9 * (with - without) / kDense);

  std::vector<Sampler> samplers;
  samplers.push_back({"ours auto", "all columns", [&ours](double tolerance, bool, Rows* rows) {
                        ours.run(tolerance, kSamples, rows->data());
                      }});
  for (const bool all : {false, true}) {
    const std::string form = all ? "all columns" : "state alone";
    samplers.push_back({"odeint dopri5", form, runDopri5, all});
    samplers.push_back({"odeint bulirsch_stoer", form, runBulirschStoer, all});
#ifdef VARIATOR_SIM_WITH_SUNDIALS
    samplers.push_back({"sundials cvode adams", form, runCvode, all});
#endif
  }
  const auto reference = makeReference();
  std::puts("scene,method,form,tolerance,error,milliseconds,status");
  for (int exponent = 3; exponent <= 13; ++exponent) {
    const double tolerance = std::pow(10.0, -exponent);
    std::vector<double> best(samplers.size(), std::numeric_limits<double>::infinity());
    std::vector<double> error(samplers.size());
    Rows rows(kSamples);
    ours.at(tolerance);
    constexpr int kRounds = 4;  // the machine's other work comes and goes
    for (int round = 0; round < kRounds; ++round) {
      for (std::size_t n = 0; n < samplers.size(); ++n) {
        const Sampler& it = samplers[n];
        best[n] = std::min(best[n], leastTime(0.02, [&] { it.run(tolerance, it.all, &rows); }));
        if (round == 0) error[n] = errorOf(rows, reference);
      }
    }
    for (std::size_t n = 0; n < samplers.size(); ++n) {
      std::printf("ship,%s,%s,%.0e,%.3e,%.5f,%s\n", samplers[n].name.c_str(),
                  samplers[n].form.c_str(), tolerance, error[n], 1e3 * best[n],
                  std::isfinite(error[n]) ? "ok" : "failed");
    }
  }
  return 0;
}

}  // namespace
}  // namespace variator_sim::benchmark

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  return variator_sim::benchmark::measure(argv[1]);
}
