/// Commanded inputs u(t): holds turn samples into a function of time with an exact value and an
/// exact rate (theory: "holds"). Pure data and closed forms; nothing here keeps time.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "variator_sim/expression/graph.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// The course of u between two commands.
enum class Hold {
  kZeroOrder,       ///< u = command; u' is an impulse at each command (the jump map)
  kFirstOrderLag,   ///< tau u' = command - u
  kRateLimit,       ///< |u'| = rate until u = command
  kFirstOrderHold,  ///< straight line from u to the command over one period
  kSecondOrderLag   ///< (tau d/dt + 1)^2 u = command, critically damped: u and u' are continuous
};

const char* toString(Hold hold);

/// The action when no command has come for `timeout` seconds of simulated time.
enum class OnTimeout { kHold, kZero };

/// Sets the value of an input. Variables, states and delayed formulas of a scene are inputs that no
/// command reaches: events set the first two, states move by their rates, and a delayed formula has
/// the value that it had some time ago.
enum class InputKind { kCommanded, kVariable, kState, kDelayed };

/// The settings of one input; constant during a run.
struct CommandInputSettings {
  InputKind kind = InputKind::kCommanded;
  std::string topic;       ///< name of the topic the commands arrive on
  std::string topic_path;  ///< path of the topic in the scene, for messages; may be empty
  std::string name;        ///< the input's name in the scene: the topic, unless it has its own
  std::string owner;       ///< name of the torque or constraint that reads it
  Hold hold = Hold::kZeroOrder;
  /// tau of the lags, s; |u'| of kRateLimit, unit of u per s; the period of kFirstOrderHold, s.
  double hold_parameter = 0.0;
  double initial = 0.0;                                       ///< u before the first command
  double minimum = -std::numeric_limits<double>::infinity();  ///< commands are clamped
  double maximum = std::numeric_limits<double>::infinity();
  double timeout = 0.0;  ///< s of simulated time without a command; 0: never
  OnTimeout on_timeout = OnTimeout::kHold;
  expression::Node delayed;  ///< of kDelayed: the formula x of delay(x, T)
  double delay = 0.0;        ///< T, s
};

/// Returns the index of the commanded input of `topic`. Throws std::invalid_argument with the
/// nearest topic and all others.
int findInput(const std::vector<CommandInputSettings>& inputs, const std::string& topic);

/// Adds an input of a scene; returns its index. Throws SceneError at `path` for one too many.
int addTo(std::vector<CommandInputSettings>& inputs, const CommandInputSettings& input,
          const std::string& path);

/// Returns a sentence that `command` lies outside of [minimum, maximum].
std::string describeClamped(const CommandInputSettings& settings, double command);

/// Reads topic, hold, time_constant, rate, period, initial, min, max, timeout, on_timeout.
/// u stays in `allowed`, in its unit. Throws SceneError.
CommandInputSettings readCommandInput(ParameterReader& reader, const std::string& owner,
                                      const Range& allowed = Range::any());

/// u(t) since the last command: one closed form between two events.
class CommandSignal {
 public:
  /// The closed form, as the texts of the runtime have it (signals.h).
  struct Closed {
    enum Form : int { kConstant, kRamp, kExponential, kCritical };  ///< numbered as there
    int form = kConstant;
    double start = 0.0;
    double target = 0.0;
    double slope = 0.0;        ///< of kRamp
    double inverse_tau = 0.0;  ///< of kExponential and kCritical
    double linear = 0.0;       ///< of kCritical: b of u = target + (a + b x) exp(-x)
    double age = 0.0;          ///< s since the command, at the origin of time
    double end = std::numeric_limits<double>::infinity();  ///< the age at which it ends, s
    const double* piece = nullptr;                         ///< of delayed formulas, none of here
  };
  const Closed& closed() const { return it_; }

  /// Sets the constant u = `settings.initial`.
  void reset(const CommandInputSettings& settings);

  /// Takes a command at `time` (already clamped, finite). Returns true when u itself jumps: the
  /// caller must run the jump map (unless nothing has moved yet: then it is the initial value).
  /// First-order ramps and lags that are over within `resolution`, s, are jumps.
  bool command(const CommandInputSettings& settings, double time, double value,
               double resolution = 0.0);
  /// Moves the origin of time `by` seconds later.
  void moveOrigin(double by) { it_.age += by; }

  /// u, u' and u'' at one instant.
  struct Moment {
    double value;
    double rate;         ///< right-hand limit at an event, left-hand limit at `segmentEnd()`
    double second_rate;  ///< between two commands for kSecondOrderLag; 0 otherwise
  };
  /// Returns u and its rates at `time`, at or after the last event. [loop]
  Moment at(double time) const;
  /// Returns the end of the current closed form (a ramp or a lag arrives), or infinity.
  double segmentEnd() const { return it_.end - it_.age; }
  /// Moves past `segmentEnd()`: u stays at its target from there.
  void finishSegment();
  double target() const { return it_.target; }

  /// Saves and restores the closed form to the bit. Throws SceneError for a form that no input with
  /// these settings has.
  ParameterTree toTree() const;
  static CommandSignal fromTree(ParameterReader& reader, const CommandInputSettings& settings);

 private:
  Closed it_;
};

}  // namespace variator_sim
