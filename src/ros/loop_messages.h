/// Messages between the stepping loop and the other threads.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "ros/lateness.h"
#include "ros/pacer.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/quantity_group.h"
#include "variator_sim/sample.h"
#include "variator_sim/status.h"

namespace variator_sim {

class Simulation;

/// Numbered as in SimulationStatus.msg.
enum class RunState : std::uint8_t { kRunning, kPaused, kSleeping, kStopped };

/// The topics of a motion: groups of quantities, by their values, and these.
enum Topic : std::size_t { kEnergy = kQuantityGroups.size(), kEvents, kStates, kJoints, kClock };
/// A set of them.
using Topics = std::bitset<kClock + 1>;

/// A command on its way to an input of the scene.
struct InputCommand {
  static constexpr int kRefused = -1;  ///< replaces a command that was rejected on its way
  int input = 0;
  double value = 0.0;
};

/// Finds the inputs of all commands of one instant, by their topics, before any takes effect.
/// Returns why they are rejected, or "".
std::string readCommands(const std::vector<CommandInputSettings>& inputs,
                         const std::vector<std::string>& topics, const std::vector<double>& values,
                         std::vector<InputCommand>& commands);

/// A sample with its times.
struct TimedSample {
  Sample sample;
  std::int64_t time = 0;        ///< simulated ns since the start or the last reset of time
  std::int64_t clock_time = 0;  ///< when it was taken, ns on the pacing clock; on a followed clock,
                                ///< which moves by steps, when its tick was due
  Topics topics;  ///< that were wanted then: the values of the groups come with it, one after the
                  ///< other; energies are those of a motion that integrates them
};

/// A change of a mode, or an event of the scene, with its times as in TimedSample.
struct TimedEvent {
  ModeEvent event;
  std::int64_t time = 0;
  std::int64_t clock_time = 0;
};

/// State and counters of the loop.
struct LoopSnapshot {
  RunState state = RunState::kRunning;
  bool state_changed = false;  ///< to be published at once
  StopReason reason = StopReason::kNone;
  std::array<char, 1024> stop_message{};  ///< why the motion stopped, a C string
  bool is_preparing = false;              ///< machine code is being compiled, and time stands
  bool waiting_for_clock = false;         ///< a followed clock has shown no time yet
  std::int64_t time = 0;                  ///< simulated ns, as in TimedSample
  double real_time_factor = 0.0;          ///< measured
  double wanted_factor = 0.0;             ///< 0: unpaced, or a clock is followed
  Pacer::Counters pacing;
  Lateness lateness;
  Statistics statistics;
  std::uint64_t commands_dropped = 0;  ///< filled in by the thread that reports, as the next one
  std::uint64_t samples_dropped = 0;
  EnergyDoubt energy_doubt;
  std::array<double, kMaxConstraints> residual{};  ///< when last sampled: about ten times a second
};

/// kSample asks for a sample where simulated time stands, so that none comes by itself.
enum class RequestKind {
  kPause,
  kResume,
  kReset,
  kResetTime,
  kStep,
  kSample,
  kGetState,
  kSetState
};
enum class RequestResult {
  kDone,
  kNotPaused,      ///< kStep only
  kStopped,        ///< the motion has stopped: the answer's message says why
  kRefused,        ///< kSetState: the answer's message says why; kSample: time goes on
  kInterrupted,    ///< kStep only: a pause has ended it on its way
  kTimeExhausted,  ///< simulated time would leave 64-bit nanoseconds
  kShutDown        ///< the loop has ended
};

struct LoopRequest {
  RequestKind kind = RequestKind::kPause;
  std::int64_t duration = 0;             ///< of kStep, ns > 0
  std::vector<InputCommand> commands{};  ///< of kStep
  /// The stepping thread calls it for kGetState and kSetState, which may keep it longer than the
  /// caller waits. It returns "", or why not: then the motion is unchanged. It may allocate.
  std::function<std::string(Simulation&)> visit{};
};

struct LoopAnswer {
  RequestResult result = RequestResult::kDone;
  TimedSample sample{};   ///< of kStep, also when it ended on the way, and of states
  std::string message{};  ///< of kStopped and kRefused
  /// Explains to the caller of a service why the result is not kDone.
  std::string describeFault() const;
};

}  // namespace variator_sim
