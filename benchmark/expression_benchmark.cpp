// What a formula of a scene costs beside the same formula compiled into the program.
//
// "Latency": the next evaluation waits for the last one, as the stages of an integration step do.
// "Throughput": evaluations are independent, so the processor overlaps them. The state changes
// every time; nothing else competes for the caches. These numbers do not say what a whole step
// costs, nor what happens in a cold cache.
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>
#include <vector>

#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"

namespace {

using variator_sim::StateView;
using namespace variator_sim::expression;  // NOLINT(google-build-using-namespace)

/// Formulas of a scene with two shafts.
struct Formulas {
  Formulas() {
    symbols["t"] = graph.variable(slotOf(Source::kTime));
    rates.emplace_back(slotOf(Source::kTime), graph.constant(1.0));
    for (int i = 0; i < 2; ++i) {
      const std::string number = std::to_string(i + 1);
      const Node omega = graph.variable(slotOf(Source::kVelocity, i));
      const Node epsilon = graph.variable(slotOf(Source::kAcceleration, i));
      symbols["w" + number] = omega;
      symbols["e" + number] = epsilon;
      rates.emplace_back(slotOf(Source::kAngle, i), omega);
      rates.emplace_back(slotOf(Source::kVelocity, i), epsilon);
    }
    symbols["tau"] = graph.constant(0.2);
    symbols["k"] = graph.constant(0.02);
  }
  Node read(const std::string& text) { return parse(text, symbols, graph); }

  Graph graph;
  SymbolTable symbols;
  std::vector<Graph::Rate> rates;
};

struct State {
  double angle[2] = {0.1, 0.2};
  double velocity[2] = {5.0, 2.9};
  double acceleration[2] = {8.78, 6.02};
  double time = 1.3;
  StateView view() const { return {time, angle, velocity, acceleration, nullptr, nullptr}; }
};

// psi = tau (e2 - u e1)(1 + 0.05 (e1^2 + e2^2)) + w2 - u w1,  u = 0.6 + 0.2 sin(0.7 t): C and c0.
Tape makeVariatorRow() {
  Formulas formulas;
  const Node psi = formulas.read(
      "tau*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2)) + w2-(0.6+0.2*sin(0.7*t))*w1");
  Graph& graph = formulas.graph;
  return Tape(graph, {graph.differentiate(psi, slotOf(Source::kAcceleration, 0)),
                      graph.differentiate(psi, slotOf(Source::kAcceleration, 1)),
                      graph.totalDerivative(psi, formulas.rates)});
}

struct CompiledVariatorRow {
  __attribute__((noinline)) void evaluate(const StateView& state, double* row) const {
    const double u = 0.6 + 0.2 * std::sin(0.7 * state.time);
    const double u_rate = 0.2 * 0.7 * std::cos(0.7 * state.time);
    const double e1 = state.acceleration[0];
    const double e2 = state.acceleration[1];
    const double slip_rate = e2 - u * e1;
    const double stiffening = 1.0 + 0.05 * (e1 * e1 + e2 * e2);
    row[0] = tau * (0.1 * e1 * slip_rate - u * stiffening);
    row[1] = tau * (0.1 * e2 * slip_rate + stiffening);
    row[2] = e2 - u * e1 - u_rate * (tau * e1 * stiffening + state.velocity[0]);
  }
  double tau = 0.2;
};

// Rate of the motor's torque 12 x/(x^2 + 0.04), x = (50 - w1)/50.
Tape makeMotorRate() {
  Formulas formulas;
  const Node torque = formulas.read("12*((50-w1)/50)/(((50-w1)/50)^2+0.04)");
  return Tape(formulas.graph, {formulas.graph.totalDerivative(torque, formulas.rates)});
}

struct CompiledMotorRate {
  __attribute__((noinline)) void evaluate(const StateView& state, double* rate) const {
    const double x = (50.0 - state.velocity[0]) / 50.0;
    const double x_rate = state.acceleration[0] / -50.0;
    const double d = x * x + 0.04;
    rate[0] = 12.0 * x_rate * (0.04 - x * x) / (d * d);
  }
};

Tape makeLoad() {
  Formulas formulas;
  return Tape(formulas.graph, {formulas.read("k*w2^2")});
}

struct CompiledLoad {
  __attribute__((noinline)) void evaluate(const StateView& state, double* torque) const {
    torque[0] = k * (state.velocity[1] * state.velocity[1]);
  }
  double k = 0.02;
};

template <typename Program>
void runThroughput(benchmark::State& run, const Program& program) {
  State state;
  double values[3] = {};
  for (auto _ : run) {
    state.time += 1e-3;
    benchmark::DoNotOptimize(state);
    program.evaluate(state.view(), values);
    benchmark::DoNotOptimize(values);
  }
}

template <typename Program>
void runLatency(benchmark::State& run, const Program& program) {
  State state;
  double values[3] = {};
  for (auto _ : run) {
    // Everything the next evaluation reads hangs on the last value.
    const double nudge = 1e-9 * values[0];
    state.time += nudge + 1e-3;
    state.velocity[0] = 5.0 + nudge;
    state.velocity[1] = 2.9 + nudge;
    benchmark::DoNotOptimize(state);
    program.evaluate(state.view(), values);
    benchmark::DoNotOptimize(values);
  }
}

void variatorRowTape(benchmark::State& run) {
  runThroughput(run, makeVariatorRow());
}
void variatorRowCompiled(benchmark::State& run) {
  runThroughput(run, CompiledVariatorRow());
}
void variatorRowTapeLatency(benchmark::State& run) {
  runLatency(run, makeVariatorRow());
}
void variatorRowCompiledLatency(benchmark::State& run) {
  runLatency(run, CompiledVariatorRow());
}
void motorRateTape(benchmark::State& run) {
  runThroughput(run, makeMotorRate());
}
void motorRateCompiled(benchmark::State& run) {
  runThroughput(run, CompiledMotorRate());
}
void motorRateTapeLatency(benchmark::State& run) {
  runLatency(run, makeMotorRate());
}
void motorRateCompiledLatency(benchmark::State& run) {
  runLatency(run, CompiledMotorRate());
}
void loadTape(benchmark::State& run) {
  runThroughput(run, makeLoad());
}
void loadCompiled(benchmark::State& run) {
  runThroughput(run, CompiledLoad());
}

BENCHMARK(variatorRowCompiled);
BENCHMARK(variatorRowTape);
BENCHMARK(variatorRowCompiledLatency);
BENCHMARK(variatorRowTapeLatency);
BENCHMARK(motorRateCompiled);
BENCHMARK(motorRateTape);
BENCHMARK(motorRateCompiledLatency);
BENCHMARK(motorRateTapeLatency);
BENCHMARK(loadCompiled);
BENCHMARK(loadTape);

}  // namespace

BENCHMARK_MAIN();
