/// The interface for the driver: one solver on one scene.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "scene_list.h"
#include "system.h"

namespace variator_sim::benchmark {

constexpr int kMaxState = 12;

/// Processor time of this program: what else the machine does does not count. All methods run in
/// one thread.
struct ProcessorClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<ProcessorClock>;
  static constexpr bool is_steady = true;
  static time_point now() {
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return time_point(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec));
  }
};

template <class Clock>
double secondsSince(std::chrono::time_point<Clock> start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The first step that a program tries: solvers ask their users for one.
inline double chooseFirstStep(const SceneCase& scene) {
  return scene.tau > 0.0 ? std::clamp(0.1 * scene.tau, 1e-9, 1e-3) : 1e-3;
}

/// The result of a run.
struct Outcome {
  std::array<double, kMaxState> state{};
  std::uint64_t right_hand_sides = 0;
  std::uint64_t steps = 0;
  std::string status = "ok";  ///< otherwise why there is no state
};

class Method {
 public:
  Method(std::string name, std::string form) : name_(std::move(name)), form_(std::move(form)) {}
  virtual ~Method() = default;
  Method(const Method&) = delete;
  Method& operator=(const Method&) = delete;

  /// "sundials cvode adams"
  const std::string& name() const { return name_; }
  /// How the scene was given: "formulas", "compiled", "by hand".
  const std::string& form() const { return form_; }

  /// Creates the solver. Not timed. "" or why it cannot.
  virtual std::string prepare(double tolerance) = 0;
  /// From the initial state to the end. Timed. False on failure.
  virtual bool run() = 0;
  /// As run, but gives up after `seconds`. The driver calls it first, untimed.
  virtual bool runGuarded(double seconds) = 0;
  /// Returns the result of the last run. Not timed.
  virtual Outcome outcome() = 0;

 private:
  std::string name_;
  std::string form_;
};

using Methods = std::vector<std::unique_ptr<Method>>;

/// A hand-written scene as peers call it: f(t, x) with a counter and a deadline.
template <template <class> class SceneOf>
class PeerProblem {
 public:
  using Scene = SceneOf<double>;
  static constexpr int kState = 3 * Scene::kShafts;

  explicit PeerProblem(const SceneCase& scene_case)
      : scene_(scene_case.parameters), parameters_(scene_case.parameters) {
    scene_.initial(initial_);
  }

  /// False when the deadline has passed.
  bool operator()(double t, const double* x, double* dxdt) {
    calcDerivative(scene_, t, x, dxdt);
    return count();
  }
  void jacobian(double t, const double* x, double* entries, double* dfdt) const {
    calcJacobian<SceneOf>(scene_, parameters_, t, x, entries, dfdt);
  }
  /// Counts an evaluation; looks at the clock now and then.
  bool count() { return (++calls_ & 4095U) != 0 || ProcessorClock::now() < deadline_; }

  const Scene& scene() const { return scene_; }
  const SceneParameters& parameters() const { return parameters_; }
  const double* initial() const { return initial_; }
  std::uint64_t calls() const { return calls_; }
  void setLimit(double seconds) {
    deadline_ = ProcessorClock::now() + std::chrono::duration_cast<ProcessorClock::duration>(
                                            std::chrono::duration<double>(seconds));
  }
  bool isLate() const { return ProcessorClock::now() >= deadline_; }

  /// From the start to the end with integrate(t0, t1, x), which moves x from t0 to t1 and starts
  /// the solver anew: between two events, or once.
  template <class Integrate>
  bool play(double* x, Integrate integrate) {
    calls_ = 0;
    for (int i = 0; i < kState; ++i) x[i] = initial_[i];
    double t = 0.0;
    if constexpr (Scene::kEvents > 0) {
      scene_.reset();
      for (int event = 1; event <= Scene::kEvents; ++event) {
        const double next = Scene::eventTime(event);
        if (!integrate(t, next, x)) return false;
        t = next;
        scene_.applyEvent(event, x);
      }
    }
    return integrate(t, static_cast<double>(Scene::kEnd), x);
  }

 private:
  Scene scene_;
  SceneParameters parameters_;
  double initial_[kState] = {};
  std::uint64_t calls_ = 0;
  ProcessorClock::time_point deadline_ = ProcessorClock::time_point::max();
};

/// Common base of the peers: the problem, its last state, the time limit.
template <template <class> class SceneOf>
class PeerMethod : public Method {
 public:
  static constexpr int kState = PeerProblem<SceneOf>::kState;

  PeerMethod(std::string name, const SceneCase& scene)
      : Method(std::move(name), "by hand"), problem_(scene) {}

  bool runGuarded(double seconds) final {
    problem_.setLimit(seconds);
    const bool good = run();
    late_ = problem_.isLate();
    problem_.setLimit(1e6);
    return good && !late_;
  }
  Outcome outcome() final {
    Outcome result;
    for (int i = 0; i < kState; ++i) result.state[static_cast<std::size_t>(i)] = x_[i];
    result.right_hand_sides = problem_.calls();
    result.steps = steps_;
    result.status = late_ ? "time-out" : failure_;
    return result;
  }

 protected:
  PeerProblem<SceneOf> problem_;
  double x_[kState] = {};
  std::uint64_t steps_ = 0;
  std::string failure_ = "ok";
  bool late_ = false;
};

// Each appends its methods for the scene; a file that its peer is not installed for is not built.
void addOurMethods(const SceneCase& scene, const std::string& scene_folder, Methods& methods);
void addOdeintMethods(const SceneCase& scene, Methods& methods);
void addSundialsMethods(const SceneCase& scene, Methods& methods);
void addGslMethods(const SceneCase& scene, Methods& methods);

}  // namespace variator_sim::benchmark
