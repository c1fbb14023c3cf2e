/// Common parts of the stress tests: the judgement of a run, and the report for the table of
/// scripts/stress.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "variator_sim/simulation.h"

namespace variator_sim::test {

/// True in the long form (environment variable VARIATOR_SIM_STRESS is "long"), which scripts/stress
/// runs.
bool isLongForm();
/// `brief` in scripts/test, `lengthy` in scripts/stress.
template <class T>
T sizeOf(T brief, T lengthy) {
  return isLongForm() ? lengthy : brief;
}

/// The seeds of scenes made at random: the one that is the last argument of the program, or
/// `sizeOf(brief, lengthy)` from VARIATOR_SIM_STRESS_SEED (`from`) on; VARIATOR_SIM_STRESS_COUNT
/// changes how many.
std::vector<std::uint64_t> givenSeeds(int brief, int lengthy, std::uint64_t from = 1);

/// How often a motion may have accumulated the error that a step is allowed: "within the error
/// asked for" is within so many tolerances.
constexpr double kAllowed = 100.0;

/// A command at a time, s.
struct TimedCommand {
  double time = 0.0;
  int input = 0;
  double value = 0.0;
};

/// One motion, sampled: all that a verdict needs.
struct Run {
  std::vector<Sample> samples;  ///< at the instants asked for, up to the stop
  StopReason reason = StopReason::kNone;
  std::string message;  ///< why it stopped
  double end = 0.0;     ///< time reached, s
  Statistics statistics;
};

/// Plays `scene` with `commands` (sorted by time), sampled at `times` (sorted). A scene whose start
/// is refused gives no samples, kProjectionFailed, and the message of the refusal.
Run play(const Scene& scene, const std::vector<double>& times,
         const std::vector<TimedCommand>& commands = {});

/// The same of a simulation at time 0.
Run play(Simulation& simulation, const std::vector<double>& times,
         const std::vector<TimedCommand>& commands = {});

/// n instants evenly from end / n to end.
std::vector<double> evenly(double end, int n);

/// Which columns of a sample are compared.
enum class Columns { kVelocity, kVelocityAndAcceleration, kAll };

/// The largest difference of two runs in units of
///     absolute + relative * largest magnitude of the column up to that instant,
/// over the samples that both have. NaN where a value of either is.
double calcDifference(const Run& run, const Run& reference, int shafts, double relative,
                      double absolute, Columns columns = Columns::kVelocityAndAcceleration);

/// One line of the report: a sweep over one hazard. It counts what runs came to, fails the test
/// when one is silently wrong, and leaves its line in the file named by VARIATOR_SIM_STRESS_REPORT,
/// if any, when it goes.
class Hazard {
 public:
  /// `hazard`: e.g. "stiffness"; `sweep`: what is varied; `range`: from where to where.
  Hazard(std::string hazard, std::string sweep, std::string range);
  ~Hazard();
  Hazard(const Hazard&) = delete;
  Hazard& operator=(const Hazard&) = delete;

  /// A run whose error is `error` tolerances where `allowed` are. Unless it is at most that, the
  /// run is silently wrong.
  void judge(double error, const std::string& label, double allowed = kAllowed);
  /// A run that stopped by name.
  void stopped(StopReason reason, const std::string& label);
  /// A run that the program refused to begin, or warned of: counted among the stops as `name`.
  void named(const std::string& name, const std::string& label);
  /// `run` against `reference`: stopped by name, or judged. The samples before a stop are judged
  /// too.
  void compare(const Run& run, const Run& reference, const Scene& scene, const std::string& label,
               double allowed = kAllowed, Columns columns = Columns::kVelocityAndAcceleration);

  int runs() const { return runs_; }
  int stops() const;

 private:
  void fail(double error, double allowed, const std::string& label);

  std::string hazard_;
  std::string sweep_;
  std::string range_;
  int runs_ = 0;
  int wrong_ = 0;
  double worst_ = 0.0;  // error / allowed
  double worst_error_ = 0.0;
  std::string worst_label_;
  std::map<std::string, int> stops_;
};

/// A number as short as it can be for a label.
std::string text(double value);

}  // namespace variator_sim::test
