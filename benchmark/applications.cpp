// The scenes of config/applications with their commands, 60 s each: ours beside programs written by
// hand for each machine (peers/machines.h), all stepped by the same schedule: from stop to stop, on
// to samples by dense output. The error is the largest |w - reference| / max(1, |reference|) over
// the speeds of all shafts at 100 samples; the reference is the machine by hand in long double,
// Odeint's fehlberg78 at 1e-16.
//
// Two times of each run: without samples, and with 100 samples a second. Those of ours have all
// columns; those of the peers the states alone.
#include <dlfcn.h>
#include <stdlib.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "emit_c/emit_c.h"
#include "peers/error.h"
#include "peers/machines.h"
#include "peers/odeint.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim::benchmark {
namespace {

constexpr double kEnd = 60.0;
constexpr double kFirstStep = 1e-3;
constexpr int kCompared = 100;    ///< samples of the error
constexpr int kSampled = 6000;    ///< samples of the second time, 100 a second
constexpr double kTimeOut = 0.2;  ///< s, of one run; a slower method is not tried at less

double timeOf(int sample, int count) {
  return kEnd * sample / count;
}

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct TimeOut : std::exception {};

/// One method on one machine at one tolerance.
struct Method {
  std::string name;
  std::string form;
  /// Sets the tolerance. False: there is no such method here.
  std::function<bool(double tolerance)> prepare;
  /// The whole run with so many samples, whose speeds go into `speeds` unless it is null.
  std::function<void(int samples, std::vector<double>* speeds)> run;
};

/// A peer plays from stop to stop: `play(t0, t1, x, due)` moves x from t0 to t1 and calls due(t, x
/// at t) wherever `next` says that a sample is due.
template <class Machine>
class Player {
 public:
  Player(const Machine& machine, double* deadline)
      : fresh_(machine), machine_(machine), deadline_(deadline) {}
  template <class Interval>
  void run(int samples, std::vector<double>* speeds, const Interval& play) {
    machine_ = fresh_;
    samples_ = samples;
    sample_ = 1;
    speeds_ = speeds;
    double x[Machine::kStates];
    machine_.initial(x);
    double t = 0.0;
    for (const double stop : machine_.stops()) {
      if (stop >= kEnd) break;
      play(t, stop, x);
      machine_.enter(stop);
      t = stop;
    }
    play(t, kEnd, x);
  }
  /// Returns the time of the next sample; infinity behind the last.
  double next() const { return sample_ <= samples_ ? timeOf(sample_, samples_) : HUGE_VAL; }
  void take(const double* x) {
    double w[Machine::kShafts];
    const double t = next();
    ++sample_;
    machine_.speeds(t, x, w);
    if (speeds_ != nullptr) speeds_->insert(speeds_->end(), w, w + Machine::kShafts);
    sink_ = w[0];
  }
  template <class R>
  void rates(const R& t, const R* x, R* dxdt) const {
    if ((++calls_ & 4095U) == 0 && now() > *deadline_) throw TimeOut();
    machine_.rates(t, x, dxdt);
  }
  /// df/dx by columns, and df/dt, by dual numbers.
  void jacobian(double t, const double* x, double* entries, double* dfdt) const {
    const auto rates = [this](const auto& time, const auto* y, auto* dydt) {
      machine_.rates(time, y, dydt);
    };
    differentiate<Machine::kStates>(rates, t, x, entries, dfdt);
  }

 private:
  const Machine fresh_;
  Machine machine_;
  double* deadline_;
  mutable unsigned calls_ = 0;
  int samples_ = 0;
  int sample_ = 1;
  std::vector<double>* speeds_ = nullptr;
  volatile double sink_ = 0.0;
};

/// A stepper with dense output, from t0 to t1.
template <class Machine, class State, class Stepper, class System>
void playDense(Player<Machine>& player, Stepper stepper, const System& system, State x, double t0,
               double t1, double* out) {
  stepper.initialize(x, t0, std::min(kFirstStep, t1 - t0));
  double t = t0;
  while (t < t1) {
    stepper.do_step(system);
    t = stepper.current_time();
    while (player.next() <= std::min(t, t1)) {
      stepper.calc_state(player.next(), x);
      player.take(&x[0]);
    }
  }
  stepper.calc_state(t1, x);
  std::copy(x.begin(), x.end(), out);
}

template <class Machine>
void addOdeint(const Machine& machine, double* deadline, std::vector<Method>* methods) {
  using State = std::array<double, Machine::kStates>;
  auto player = std::make_shared<Player<Machine>>(machine, deadline);
  auto tolerance = std::make_shared<double>(0.0);
  const auto system = [player](const State& x, State& dxdt, double t) {
    player->rates(t, x.data(), dxdt.data());
  };
  const auto read = [](const double* x) {
    State state;
    std::copy(x, x + Machine::kStates, state.begin());
    return state;
  };
  const auto add = [&](const char* name, auto play) {
    methods->push_back({std::string("odeint ") + name, "by hand",
                        [tolerance](double value) {
                          *tolerance = value;
                          return true;
                        },
                        [player, play](int samples, std::vector<double>* speeds) {
                          player->run(samples, speeds, play);
                        }});
  };
  add("dopri5", [=](double t0, double t1, double* x) {
    using Stepper = odeint::runge_kutta_dopri5<State>;
    playDense(*player, odeint::make_dense_output<Stepper>(*tolerance, *tolerance), system, read(x),
              t0, t1, x);
  });
  // It has no dense output: it steps from sample to sample.
  add("fehlberg78", [=](double t0, double t1, double* x) {
    State state = read(x);
    while (t0 < t1) {
      const double t = std::min(t1, player->next());
      if (t > t0) {
        odeint::integrate_adaptive(
            odeint::make_controlled<odeint::runge_kutta_fehlberg78<State>>(*tolerance, *tolerance),
            system, state, t0, t, std::min(t - t0, 0.01));
      }
      if (t == player->next()) player->take(state.data());
      t0 = t;
    }
    std::copy(state.begin(), state.end(), x);
  });
  // Time is a state: Odeint's treatment of df/dt loses an order.
  add("rosenbrock4", [=](double t0, double t1, double* x) {
    using Vector = ublas::vector<double>;
    using Matrix = ublas::matrix<double>;
    constexpr std::size_t N = Machine::kStates;
    Vector state(N + 1);
    std::copy(x, x + N, state.begin());
    state[N] = t0;
    const auto rates = [&](const Vector& y, Vector& dydt, double /*t*/) {
      player->rates(y[N], &y[0], &dydt[0]);
      dydt[N] = 1.0;
    };
    const auto jacobian = [&](const Vector& y, Matrix& entries, const double& /*t*/, Vector& dfdt) {
      double columns[N * (N + 1)];
      player->jacobian(y[N], &y[0], columns, columns + N * N);
      entries.clear();
      for (std::size_t i = 0; i < N; ++i) {
        for (std::size_t j = 0; j <= N; ++j) entries(i, j) = columns[i + N * j];
      }
      dfdt.clear();
    };
    const auto stepper =
        odeint::make_dense_output<odeint::rosenbrock4<double>>(*tolerance, *tolerance);
    double moved[N + 1];
    playDense(*player, stepper, std::make_pair(rates, jacobian), state, t0, t1, moved);
    std::copy(moved, moved + N, x);
  });
}

Simulation makeSimulation(ParameterTree tree, double tolerance, bool compiled) {
  ParameterTree::Dictionary& root = tree.asDictionary();
  root["solver"] = ParameterTree::dictionary(
      {{"relative_tolerance", ParameterTree::real(tolerance)},
       {"absolute_tolerance", ParameterTree::real(tolerance)},
       {"machine_code", ParameterTree::text(compiled ? "always" : "never")}});
  BuiltinComponentFactory factory;
  return Simulation(readScene(tree, factory));
}

struct Command {
  double time;
  int input;
  double value;
};

/// The commands of a start by the indices of their inputs.
std::vector<Command> commandsOf(const Start& start, const Scene& scene) {
  std::vector<Command> commands;
  for (const TimedCommand& command : start.commands) {
    for (std::size_t i = 0; i < scene.inputs.size(); ++i) {
      if (scene.inputs[i].topic != command.topic) continue;
      commands.push_back({command.time, static_cast<int>(i), command.value});
    }
  }
  return commands;
}

/// Plays to the end with so many samples: `advance(time)`, `command(input, value)`, and `read()`,
/// which returns the speeds of the shafts.
template <class Advance, class Act, class Read>
void playOurs(const std::vector<Command>& commands, int samples, std::size_t shafts,
              std::vector<double>* speeds, const Advance& advance, const Act& command,
              const Read& read) {
  std::size_t next = 0;
  const auto go = [&](double time) {
    for (; next < commands.size() && commands[next].time <= time; ++next) {
      advance(commands[next].time);
      command(commands[next].input, commands[next].value);
    }
    advance(time);
  };
  for (int n = 1; n <= samples; ++n) {
    go(timeOf(n, samples));
    const double* const w = read();
    if (speeds != nullptr) speeds->insert(speeds->end(), w, w + shafts);
  }
  go(kEnd);
}

/// Ours, with the scene's file as it stands but for the tolerances.
void addOurs(const Start& start, bool compiled, double* deadline, std::vector<Method>* methods) {
  auto simulation = std::make_shared<std::unique_ptr<Simulation>>();
  const auto prepare = [=](double tolerance) {
    *simulation = std::make_unique<Simulation>(makeSimulation(start.scene, tolerance, compiled));
    return !compiled || (*simulation)->loadMachineCode(true);
  };
  const auto run = [=](int samples, std::vector<double>* speeds) {
    Simulation& motion = **simulation;
    motion.reset();
    playOurs(
        commandsOf(start, motion.scene()), samples, motion.scene().shafts.size(), speeds,
        [&](double time) {
          if (!motion.advanceTo(time).ok() || now() > *deadline) throw TimeOut();
        },
        [&](int input, double value) { motion.command(input, value); },
        [&] { return motion.sample().velocity; });
  };
  methods->push_back({"ours auto", compiled ? "machine code" : "formulas", prepare, run});
}

/// The emitted program of the scene, compiled for this machine and loaded.
class Emitted {
 public:
  explicit Emitted(const Start& start) : start_(start) {}
  ~Emitted() { release(); }
  Emitted(const Emitted&) = delete;
  Emitted& operator=(const Emitted&) = delete;

  bool prepare(double tolerance) {
    release();
    Simulation simulation = makeSimulation(start_.scene, tolerance, false);
    shafts_ = simulation.scene().shafts.size();
    commands_ = commandsOf(start_, simulation.scene());
    folder_ = (std::filesystem::temp_directory_path() / "applications_XXXXXX").string();
    if (::mkdtemp(folder_.data()) == nullptr) return false;
    writeEmittedScene(emitScene(simulation, "it", "it"), folder_);
    std::ofstream(folder_ + "/play.c") << kPlay;
    const std::string line = "cd " + folder_ +
                             " && cc -std=c99 -O3 -march=native -ffp-contract=off -shared -fPIC "
                             "it.c play.c -o it.so -lm";
    if (std::system(line.c_str()) != 0) return false;
    library_ = ::dlopen((folder_ + "/it.so").c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library_ == nullptr) return false;
    find("play_begin", &begin_);
    find("play_advance", &advance_);
    find("play_command", &command_);
    find("play_read", &read_);
    return true;
  }
  void run(int samples, std::vector<double>* speeds) {
    begin_();
    playOurs(
        commands_, samples, shafts_, speeds,
        [&](double time) {
          if (advance_(time) != 0) throw TimeOut();
        },
        [&](int input, double value) { command_(input, value); }, read_);
  }

 private:
  static constexpr const char* kPlay =
      "#include \"it.h\"\n"
      "static it_model model;\n"
      "static it_sample sample;\n"
      "void play_begin(void) { it_init(&model); }\n"
      "int play_advance(double time) { return it_advance_to(&model, time); }\n"
      "void play_command(int input, double value) { it_command(&model, input, value); }\n"
      "const double* play_read(void) { it_read(&model, &sample); return sample.velocity; }\n";

  template <class Function>
  void find(const char* name, Function** function) const {
    *function = reinterpret_cast<Function*>(::dlsym(library_, name));
  }
  void release() {
    if (library_ != nullptr) ::dlclose(library_);
    library_ = nullptr;
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
    folder_.clear();
  }

  const Start& start_;
  std::size_t shafts_ = 0;
  std::vector<Command> commands_;
  std::string folder_;
  void* library_ = nullptr;
  void (*begin_)() = nullptr;
  int (*advance_)(double) = nullptr;
  void (*command_)(int, double) = nullptr;
  const double* (*read_)() = nullptr;
};

void addEmitted(const Start& start, std::vector<Method>* methods) {
  auto emitted = std::make_shared<Emitted>(start);
  methods->push_back(
      {"ours emitted", "C", [emitted](double value) { return emitted->prepare(value); },
       [emitted](int samples, std::vector<double>* speeds) { emitted->run(samples, speeds); }});
}

/// The speeds at the samples of the error, in long double from sample to sample.
template <class Machine>
std::vector<double> makeReference(Machine machine) {
  using State = std::array<long double, Machine::kStates>;
  const auto system = [&](const State& x, State& dxdt, long double t) {
    machine.rates(t, x.data(), dxdt.data());
  };
  std::vector<double> times = machine.stops();
  for (int n = 1; n <= kCompared; ++n) times.push_back(timeOf(n, kCompared));
  std::sort(times.begin(), times.end());
  double start[Machine::kStates];
  machine.initial(start);
  State x;
  std::copy(start, start + Machine::kStates, x.begin());
  std::vector<double> speeds;
  double t = 0.0;
  int sample = 1;
  for (const double time : times) {
    if (time > t) {
      const auto stepper =
          odeint::make_controlled<odeint::runge_kutta_fehlberg78<State, long double>>(1e-16L,
                                                                                      1e-16L);
      odeint::integrate_adaptive(stepper, system, x, static_cast<long double>(t),
                                 static_cast<long double>(time), 1e-4L);
      t = time;
    }
    if (sample <= kCompared && time == timeOf(sample, kCompared)) {
      double w[Machine::kShafts];
      std::copy(x.begin(), x.end(), start);
      machine.speeds(time, start, w);
      speeds.insert(speeds.end(), w, w + Machine::kShafts);
      ++sample;
    }
    const auto& stops = machine.stops();
    if (std::binary_search(stops.begin(), stops.end(), time)) machine.enter(time);
  }
  return speeds;
}

/// Error and times of one method at one tolerance.
struct Row {
  const Method* method;
  double error = std::nan("");
  double seconds[2] = {HUGE_VAL, HUGE_VAL};  ///< without samples, with 100 a second
};

/// A method that stops with so many samples keeps its other row.
void measureOnce(int k, double* deadline, Row* row) {
  *deadline = now() + 10.0 * kTimeOut;
  const double begin = now();
  try {
    row->method->run(k == 0 ? 0 : kSampled, nullptr);
    row->seconds[k] = std::min(row->seconds[k], now() - begin);
  } catch (const std::exception&) {
  }
}

template <class Machine>
void measure(const std::string& name, const Start& start, bool quick) {
  const Machine machine(start);
  const std::vector<double> reference = makeReference(machine);
  double deadline = 0.0;
  std::vector<Method> methods;
  addOurs(start, true, &deadline, &methods);
  addOurs(start, false, &deadline, &methods);
  addEmitted(start, &methods);
  addOdeint(machine, &deadline, &methods);
  std::vector<bool> late(methods.size(), false);
  for (double tolerance = 1e-2; tolerance > 0.9e-12; tolerance *= 0.1) {
    std::vector<Row> rows;
    for (std::size_t n = 0; n < methods.size(); ++n) {
      if (late[n] || !methods[n].prepare(tolerance)) continue;
      Row row{&methods[n]};
      std::vector<double> speeds;
      deadline = now() + kTimeOut;
      try {
        methods[n].run(kCompared, &speeds);
        row.error = speeds.size() == reference.size()
                        ? calcError(speeds.data(), reference.data(), speeds.size())
                        : std::nan("");
      } catch (const std::exception&) {
        late[n] = now() > deadline;
        continue;
      }
      rows.push_back(row);
    }
    // The machine's other work comes and goes: rounds over all methods, the least time counts.
    for (int round = 0; round < (quick ? 3 : 12); ++round) {
      for (Row& row : rows) {
        for (const int k : {0, 1}) measureOnce(k, &deadline, &row);
      }
    }
    for (const Row& row : rows) {
      for (const int k : {0, 1}) {
        if (row.seconds[k] == HUGE_VAL) continue;
        std::printf("%s%s,%s,%s,%.0e,%.3e,%.5f,0,0,ok\n", name.c_str(), k == 0 ? "" : " sampled",
                    row.method->name.c_str(), row.method->form.c_str(), tolerance, row.error,
                    1e3 * row.seconds[k]);
      }
    }
    std::fflush(stdout);
  }
  std::fprintf(stderr, "%s\n", name.c_str());
}

int run(const std::string& folder, const std::string& only, bool quick) {
  std::printf("# compiler: g++ %s, %s\n", __VERSION__, VARIATOR_SIM_BENCHMARK_FLAGS);
  std::printf("scene,method,form,tolerance,error,milliseconds,right_hand_sides,steps,status\n");
  const auto play = [&](const char* name, auto measure_it) {
    if (!only.empty() && only != name) return;
    Start start;
    start.scene = readYamlFile(folder + "/" + name + ".yaml");
    start.commands = readCommandFile(folder + "/" + std::string(name) + ".csv");
    Simulation simulation = makeSimulation(start.scene, 1e-9, false);
    start.sample = simulation.sample();
    measure_it(name, start, quick);
  };
  play("car", measure<Car>);
  play("diesel_locomotive", measure<Locomotive>);
  play("machine_tool", measure<MachineTool>);
  play("ship_power_unit", measure<ShipUnit>);
  play("starting_system", measure<StartingSystem>);
  play("vbelt_vehicle", measure<VBelt>);
  return 0;
}

}  // namespace
}  // namespace variator_sim::benchmark

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::string(argv[argc - 1]) == "--quick";
  if (argc < 2 || argv[1][0] == '-') {
    std::cerr << "Usage: applications FOLDER [SCENE] [--quick]\n\n"
                 "FOLDER holds the scenes, config/applications. Rows go to standard output.\n";
    return 2;
  }
  try {
    return variator_sim::benchmark::run(argv[1], argc - quick > 2 ? argv[2] : "", quick);
  } catch (const std::exception& error) {
    std::cerr << "applications: " << error.what() << '\n';
    return 1;
  }
}
