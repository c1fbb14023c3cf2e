// Repeatability: the same scene and the same commands at the same times give the same bytes,
// however a run is sampled, cut, asked, moved, reset, interleaved with others or put beside them in
// another thread. Sleeping alone may change a motion, within its bound.
#include <thread>

#include "stress/known_motion.h"
#include "stress/random.h"

namespace variator_sim::test {
namespace {

/// A scene and what is sent to it.
struct Play {
  std::string name;
  Scene scene;
  std::vector<TimedCommand> commands;  ///< sorted by time
  double end = 2.0;
};

/// Each has something of its own that could remember: warm starts of Newton's iterations, factors
/// kept, changes of stepper, polynomials of dense output, holds, jumps, sleep, a stop.
std::vector<Play> plays() {
  const auto motorized = [](const std::string& hold, const std::string& constraint,
                            const std::string& principle) {
    return sceneFromText(
        "a 0.8, b 2.0", {"m on a from u, " + hold, "p on b: -0.02*w2*abs(w2)-0.1*w2", constraint},
        "principle: " + principle + "\ninitial: {velocity: [5, 3], project: true}");
  };
  const std::string nonlinear =
      "v: 0.2*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2))+w2-(0.6+0.2*sin(0.7*t))*w1";
  const std::string steady = "v: 0.2*(e2-0.6*e1)*(1+0.05*e2^2)+w2-0.6*w1";
  const std::string slip = "v = SlipRatio, shafts: [a, b], time_constant: 0.1, ratio: 0.5";
  const std::string third = "v of order 3: 0.04*(j2-0.5*j1)+0.4*(e2-0.5*e1)+w2-(0.5+0.1*sin(t))*w1";
  const std::vector<TimedCommand> steps = {
      {0.0, 0, 2.0}, {0.25, 0, 7.0}, {0.3, 0, -1.0}, {1.0, 0, -1.0}, {1.1, 0, 4.0}};
  std::vector<Play> list;
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    const std::string end = std::string(", ") + principle;
    list.push_back({"jumps" + end, motorized("hold: zero_order", nonlinear, principle), steps});
    list.push_back(
        {"jumps, no time" + end, motorized("hold: zero_order", steady, principle), steps});
    // Steps end where the next one is expected; some come, some do not.
    list.push_back({"regular jumps" + end,
                    motorized("hold: zero_order", nonlinear, principle),
                    {{0.1, 0, 2.0},
                     {0.2, 0, 7.0},
                     {0.3, 0, -1.0},
                     {0.4, 0, 1.0},
                     {0.6, 0, 4.0},
                     {0.8, 0, 4.0},
                     {1.0, 0, 3.0},
                     {1.2, 0, 2.0},
                     {1.4, 0, 5.0}}});
    list.push_back({"lag" + end,
                    motorized("hold: first_order_lag, time_constant: 0.01", slip, principle),
                    steps});
    list.push_back({"rate limit, order 3" + end,
                    motorized("hold: rate_limit, rate: 40", third, principle), steps});
    list.push_back({"straight lines" + end,
                    motorized("hold: first_order_hold, period: 0.07", nonlinear, principle),
                    steps});
    list.push_back(
        {"timeouts" + end,
         motorized("hold: zero_order, timeout: 0.33, on_timeout: zero", steady, principle), steps});
    list.push_back({"sleep" + end,
                    motorized("hold: zero_order", slip, principle),
                    {{0.0, 0, 2.0}, {400.0, 0, 3.0}, {900.0, 0, -2.0}},
                    1000.0});
    KnownMotion stiff;
    stiff.principle = principle[1] == 'a' ? Principle::kGauss : Principle::kGeneralizedGauss;
    stiff.time_constant = 1e-5;
    list.push_back({"stiff" + end, withTolerance(stiff.scene(), 1e-6), {}});
    KnownMotion turning = stiff;
    turning.time_constant = 0.1;
    turning.harmonic = 0.3;
    turning.order = 1;
    list.push_back({"J(phi), order 1" + end, turning.scene(), {}});
    list.push_back(
        {"three shafts, two constraints" + end,
         sceneFromText("a 0.5, b 1.5, c 2",
                       {"m on a from u, hold: second_order_lag, time_constant: 0.05",
                        "k = ElasticCoupling, shafts: [b, c], stiffness: 300, damping: 1",
                        "q on c: 2*sin(t)-0.4*w3", "v of order 1: w2-(0.5+0.1*sin(t))*w1",
                        "w: 0.3*(e3-0.8*e2)+w3-0.8*w2+0.01*w1*w3"},
                       "inertia_coupling: [[a, b, 0.1]]\nprinciple: " + std::string(principle) +
                           "\ninitial: {velocity: [2, 1, 0.8], project: true}"),
         steps});
    // the rows of C become dependent when t = 1.37
    list.push_back({"stops" + end,
                    motorized("hold: zero_order", "v: (1.37-t)*(e2-0.5*e1)+w2-0.5*w1", principle),
                    steps});
  }
  return list;
}

const std::vector<StepperKind>& allSteppers() {
  static const std::vector<StepperKind> kinds = {
      StepperKind::kAuto, StepperKind::kDopri5, StepperKind::kFehlberg78, StepperKind::kRadau,
      StepperKind::kRk4,  StepperKind::kTaylor, StepperKind::kTaylorFixed};
  return kinds;
}

/// The compared data of a run: samples at instants that every run visits, and how it ended.
struct Record {
  std::vector<Sample> samples;
  MotionStatus status;
  std::uint64_t steps = 0;
};

/// Drives a simulation through a play, with `between(simulation, from, to)` called for every
/// stretch between two commands or records, before its end is reached.
class Player {
 public:
  using Between = std::function<void(Simulation&, double, double)>;

  explicit Player(const Play& play) : play_(play) {
    for (int n = 0; n <= kRecords; ++n) events_.push_back({play.end * n / kRecords, -1});
    for (std::size_t c = 0; c < play.commands.size(); ++c) {
      events_.push_back({play.commands[c].time, static_cast<int>(c)});
    }
    // At the same time: commands, then the record.
    std::stable_sort(events_.begin(), events_.end(), [](const Event& a, const Event& b) {
      return a.time != b.time ? a.time < b.time : a.command > b.command;
    });
  }

  bool isDone() const { return next_ == events_.size(); }

  /// Up to and with the next event.
  void advance(Simulation& simulation, const Between& between) {
    const Event& event = events_[next_++];
    if (between) between(simulation, time_, event.time);
    time_ = event.time;
    simulation.advanceTo(event.time);
    if (event.command >= 0) {
      const TimedCommand& command = play_.commands[static_cast<std::size_t>(event.command)];
      if (simulation.status().ok()) simulation.command(command.input, command.value);
      return;
    }
    record_.samples.push_back(simulation.sample());
    record_.status = simulation.status();
    record_.steps = simulation.statistics().steps;
  }

  const Record& record() const { return record_; }

 private:
  static constexpr int kRecords = 5;
  struct Event {
    double time;
    int command;  // -1: a record
  };
  const Play& play_;
  std::vector<Event> events_;
  std::size_t next_ = 0;
  double time_ = 0.0;
  Record record_;
};

Record playThrough(const Play& play, Simulation& simulation,
                   const Player::Between& between = nullptr) {
  Player player(play);
  while (!player.isDone()) player.advance(simulation, between);
  return player.record();
}
Record playThrough(const Play& play, const Player::Between& between = nullptr) {
  Simulation simulation(play.scene);
  return playThrough(play, simulation, between);
}
/// With an account of energy in its samples.
Record playTracked(const Play& play, const Player::Between& between = nullptr) {
  Simulation simulation(play.scene);
  simulation.trackEnergy(true);
  return playThrough(play, simulation, between);
}
/// The motion alone: without energies and estimated errors.
Record motionOf(Record record) {
  for (Sample& sample : record.samples) {
    sample.energy = {};
    for (double* const errors :
         {sample.angle_error, sample.velocity_error, sample.acceleration_error}) {
      std::fill_n(errors, kMaxShafts, 0.0);
    }
    std::fill_n(sample.state_error, kMaxInputs, 0.0);
  }
  return record;
}

/// How many samples differ in some byte, or that the ends do.
int countDifferences(const Record& a, const Record& b) {
  int count = a.samples.size() == b.samples.size() ? 0 : 1;
  for (std::size_t n = 0; n < std::min(a.samples.size(), b.samples.size()); ++n) {
    count += std::memcmp(&a.samples[n], &b.samples[n], sizeof(Sample)) != 0;
  }
  count += a.status.reason != b.status.reason;
  count += std::memcmp(&a.status.time, &b.status.time, sizeof(double)) != 0;
  count += a.steps != b.steps;
  return count;
}

/// Nothing may differ.
constexpr double kNone = 0.5;

/// All plays by all steppers, at steps and tolerances that keep it short.
void forEachRun(const std::function<void(const Play&, const std::string&)>& use) {
  for (const Play& listed : plays()) {
    for (StepperKind stepper : allSteppers()) {
      if (!takes(listed.scene, stepper)) continue;
      for (double tolerance : {1e-5, 1e-9}) {
        if (isFixedStep(stepper) && tolerance < 1e-5) continue;
        if (!isLongForm() && tolerance < 1e-5 &&
            (listed.end > 100.0 ||
             (stepper != StepperKind::kAuto && stepper != StepperKind::kRadau))) {
          continue;
        }
        Play play = listed;
        play.scene.solver.stepper = stepper;
        play.scene = withTolerance(std::move(play.scene), tolerance);
        play.scene.solver.step = play.end > 100.0 ? 0.2 : 0.007;
        play.scene.solver.maximum_steps = sizeOf(300, 20000);
        use(play, play.name + ", " + describe(stepper, tolerance));
      }
    }
  }
}

TEST(Repeatability, RunAgain) {
  Hazard hazard("repeatability", "the same run again, differences", "all steppers");
  forEachRun([&](const Play& play, const std::string& label) {
    hazard.judge(countDifferences(playThrough(play), playThrough(play)), label, kNone);
  });
}

// Samples, cuts and questions may not change the motion, nor the account of its energy.
TEST(Repeatability, SamplingAndCutting) {
  Hazard sampling("repeatability", "sampled n times between records, differences", "1 .. 1000");
  Hazard cutting("repeatability", "advances cut at random, down to 1e-15 s, differences", "");
  Hazard asking("repeatability", "asked for everything on the way, differences", "");
  forEachRun([&](const Play& play, const std::string& label) {
    const Record plain = playThrough(play);
    const Record reference = playTracked(play);
    asking.judge(countDifferences(motionOf(reference), plain), label + ", energy", kNone);
    for (int rate :
         isLongForm() ? std::vector<int>{1, 2, 3, 17, 100, 1000} : std::vector<int>{1, 23}) {
      const Record sampled = playTracked(play, [&](Simulation& simulation, double from, double to) {
        for (int n = 0; n <= rate; ++n) {
          simulation.advanceTo(from + (to - from) * n / (rate + 1));
          simulation.sample();
          simulation.energy();
        }
      });
      sampling.judge(countDifferences(sampled, reference), label + ", " + std::to_string(rate),
                     kNone);
    }
    for (std::uint64_t seed = 1; seed <= sizeOf<std::uint64_t>(2, 20); ++seed) {
      Random random(seed);
      const auto draw = [&] { return random.between(0.0, 1.0); };
      const Record cut = playTracked(play, [&](Simulation& simulation, double from, double to) {
        for (int n = 0; n < 8; ++n) {
          // somewhere, or just beyond or before where it is: nothing moves backwards
          const double where = draw();
          const double aside = (to - from) * std::pow(10.0, -15.0 * draw());
          simulation.advanceTo(where < 0.6   ? from + (to - from) * draw()
                               : where < 0.8 ? std::min(to, simulation.time() + aside)
                                             : simulation.time() - aside);
          if (draw() < 0.3) simulation.sample();
        }
      });
      cutting.judge(countDifferences(cut, reference), label + ", seed " + std::to_string(seed),
                    kNone);
    }
    Simulation estimating(play.scene);
    estimating.estimateErrors(true);
    const auto ask = [&](Simulation& simulation, double from, double to) {
      simulation.advanceTo(from + 0.37 * (to - from));
      simulation.describeStatus();
      simulation.describeStepper();
      simulation.skips();
      simulation.sample();
      simulation.sample();
      simulation.statistics();
      simulation.isSleeping();
      simulation.scene();
      for (const QuantityGroup group : kQuantityGroups) {
        std::vector<double> values(simulation.quantityNames(group).size());
        simulation.calcQuantities(group, values.data());
      }
    };
    asking.judge(countDifferences(motionOf(playThrough(play, estimating, ask)), plain), label,
                 kNone);
  });
}

// A command that says what is so already is no command.
TEST(Repeatability, RepeatedAndRefusedCommands) {
  Hazard hazard("repeatability", "commands repeated, and NaN, on the way, differences", "");
  forEachRun([&](const Play& play, const std::string& label) {
    if (play.commands.empty() || play.scene.inputs.front().timeout > 0.0) return;
    const Record reference = playThrough(play);
    const Record repeated = playThrough(play, [&](Simulation& simulation, double from, double to) {
      double value = play.scene.inputs.front().initial;
      for (const TimedCommand& command : play.commands) {
        if (command.time < to && command.time <= from) value = command.value;
      }
      for (double part : {0.1, 0.5, 0.83}) {
        simulation.advanceTo(from + part * (to - from));
        if (to > from) simulation.command(0, value);
        simulation.command(0, std::nan(""));
      }
    });
    hazard.judge(countDifferences(repeated, reference), label, kNone);
  });
}

TEST(Repeatability, Reset) {
  Hazard hazard("repeatability", "after a reset, differences", "before, within and after a run");
  forEachRun([&](const Play& play, const std::string& label) {
    const Record reference = playTracked(play);
    Simulation simulation(play.scene);
    simulation.trackEnergy(true);
    simulation.reset();
    hazard.judge(countDifferences(playThrough(play, simulation), reference), label + ", unused",
                 kNone);
    simulation.reset();
    EXPECT_EQ(simulation.time(), 0.0) << label;
    EXPECT_EQ(simulation.statistics().steps, 0u) << label;
    EXPECT_EQ(simulation.statistics().sleeps, 0u) << label;
    EXPECT_FALSE(simulation.isSleeping()) << label;
    hazard.judge(countDifferences(playThrough(play, simulation), reference), label + ", finished",
                 kNone);
    for (double part : isLongForm() ? std::vector<double>{0.03, 0.14, 0.41, 0.77}
                                    : std::vector<double>{0.14, 0.77}) {
      simulation.reset();
      // another run, with other commands
      for (int n = 1; n <= 5; ++n) {
        simulation.advanceTo(part * play.end * n / 5.0);
        if (!play.commands.empty()) simulation.command(0, 1.5 * n - 3.0);
        if (n % 2 == 0) simulation.sample();
      }
      simulation.reset();
      hazard.judge(countDifferences(playThrough(play, simulation), reference),
                   label + ", after " + text(part), kNone);
    }
  });
}

// A Simulation may be moved; what it was moved from is gone.
TEST(Repeatability, Moved) {
  Hazard hazard("repeatability", "moved to another place on the way, differences", "");
  forEachRun([&](const Play& play, const std::string& label) {
    const Record reference = playThrough(play);
    std::vector<Simulation> places;
    places.emplace_back(play.scene);
    Player player(play);
    while (!player.isDone()) {
      player.advance(places.back(), nullptr);
      std::vector<Simulation> other;
      other.push_back(std::move(places.back()));
      places = std::move(other);
    }
    hazard.judge(countDifferences(player.record(), reference), label, kNone);
  });
}

// Simulations of one scene share its components, and those of all scenes share the program.
TEST(Repeatability, Interleaved) {
  Hazard hazard("repeatability", "two simulations in turn, differences", "same scene, another one");
  const std::vector<Play> all = plays();
  std::size_t index = 0;
  forEachRun([&](const Play& play, const std::string& label) {
    const Record reference = playThrough(play);
    Play other = all[++index % all.size()];
    if (!takes(other.scene, play.scene.solver.stepper)) return;
    other.scene.solver = play.scene.solver;
    other.scene.solver.step = other.end > 100.0 ? 0.2 : 0.007;
    const Record other_reference = playThrough(other);
    Simulation first(play.scene);
    Simulation second(play.scene);
    Simulation third(other.scene);
    Player first_player(play);
    Player second_player(play);
    Player third_player(other);
    // the second one lags behind by three events
    for (int n = 0; !second_player.isDone() || !third_player.isDone(); ++n) {
      if (!first_player.isDone()) first_player.advance(first, nullptr);
      if (n >= 3 && !second_player.isDone()) second_player.advance(second, nullptr);
      if (!third_player.isDone()) third_player.advance(third, nullptr);
    }
    hazard.judge(countDifferences(first_player.record(), reference), label, kNone);
    hazard.judge(countDifferences(second_player.record(), reference), label + ", behind", kNone);
    hazard.judge(countDifferences(third_player.record(), other_reference), label + ", beside",
                 kNone);
  });
}

/// The same play with a scene that was read apart.
Play readApart(const Play& play) {
  static const std::vector<Play> others = plays();
  for (const Play& other : others) {
    if (other.name != play.name) continue;
    Play result = other;
    result.scene.solver = play.scene.solver;
    return result;
  }
  ADD_FAILURE() << play.name;
  return play;
}

/// Plays `here` in this thread and `there` in another one, some times; differences from
/// `reference`.
int countDifferencesOfThreads(const Play& here, const Play& there, const Record& reference) {
  const int rounds = sizeOf(2, 20);
  const auto count = [&](const Play& play, int* differences) {
    for (int n = 0; n < rounds; ++n) {
      try {
        *differences +=
            countDifferences(playThrough(play,
                                         [](Simulation& simulation, double from, double to) {
                                           simulation.advanceTo(0.5 * (from + to));
                                           simulation.sample();
                                         }),
                             reference);
      } catch (const SceneError&) {
        ++*differences;  // the scene that was all right alone
      }
    }
  };
  int differences_here = 0;
  int differences_there = 0;
  std::thread thread(count, std::cref(there), &differences_there);
  count(here, &differences_here);
  thread.join();
  return differences_here + differences_there;
}

TEST(Repeatability, TwoThreadsWithScenesOfTheirOwn) {
  Hazard hazard("repeatability", "two threads, scenes read apart, differences", "all steppers");
  forEachRun([&](const Play& play, const std::string& label) {
    hazard.judge(countDifferencesOfThreads(play, readApart(play), playThrough(play)), label, kNone);
  });
}

// A motion at rest that is not stepped is within a tenth of a tolerance of the one that is; either
// run has errors of its own.
TEST(Repeatability, Sleep) {
  Hazard hazard("repeatability", "sleep on and off, in tolerances", "1e-4 .. 1e-10");
  int sleeps = 0;
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    for (int order : {1, 2, 3}) {
      for (double damping : {0.3, 3.0}) {
        const char* const psi[] = {"w2-0.5*w1-0.01*w1*w2", "0.2*(e2-0.5*e1)+w2-0.5*w1-0.01*w1*w2",
                                   "0.04*(j2-0.5*j1)+0.4*(e2-0.5*e1)+w2-0.5*w1"};
        const Scene scene =
            sceneFromText("a 0.8, b 2.0",
                          {"m on a from u, hold: first_order_lag, time_constant: 0.1",
                           "p on b: -0.02*w2*abs(w2)-" + text(damping) + "*w2",
                           "v" + ofOrder(order, psi[order - 1])},
                          std::string("principle: ") + toString(principle) +
                              "\ninitial: {velocity: [2, 1], project: true}");
        const std::vector<TimedCommand> commands = {
            {0.0, 0, 3.0}, {200.0, 0, 4.0}, {200.5, 0, 2.0}, {500.0, 0, 0.0}};
        const std::vector<double> times = evenly(700.0, 70);
        for (StepperKind stepper : steppersOf(scene)) {
          for (double tolerance : isLongForm() ? std::vector<double>{1e-4, 1e-6, 1e-8, 1e-10}
                                               : std::vector<double>{1e-4, 1e-8}) {
            Scene asleep = withSolver(scene, stepper, tolerance);
            Scene awake = asleep;
            awake.solver.sleep = false;
            const test::Run sleeping = play(asleep, times, commands);
            sleeps += static_cast<int>(sleeping.statistics.sleeps);
            hazard.compare(sleeping, play(awake, times, commands), asleep,
                           "order " + std::to_string(order) + ", " + toString(principle) +
                               ", damping " + text(damping) + ", " + describe(stepper, tolerance),
                           kAllowed, Columns::kAll);
          }
        }
      }
    }
  }
  EXPECT_GT(sleeps, hazard.runs()) << "that is less than once a run: nothing is tested here";
}

}  // namespace
}  // namespace variator_sim::test
