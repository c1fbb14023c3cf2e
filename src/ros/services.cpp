#include "ros/services.h"

#include <dynamic_reconfigure/server.h>
#include <std_srvs/Trigger.h>
#include <variator_sim/GetState.h>
#include <variator_sim/VariatorSimConfig.h>

#include <boost/function.hpp>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "ros/checked_lists.h"
#include "ros/message_conversion.h"
#include "ros/nanoseconds.h"
#include "ros/stepping_loop.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

constexpr double kLongestStep = 1e6;  // s
/// Far from the ends of 64-bit nanoseconds.
constexpr double kLatest = 1e9;  // s

/// Return why a request is rejected, or "". They check all of it before any change.
std::string read(const Step::Request& message, const Scene& scene, LoopRequest& request) {
  const std::string duration = "duration is " + formatReal(message.duration) + " s; ";
  if (!(message.duration > 0.0 && message.duration <= kLongestStep)) {
    return duration + "it must be above 0 and at most 1e6 s";
  }
  request.duration = std::llround(message.duration * kNanosecondsPerSecond);
  if (request.duration == 0) return duration + "simulated time is kept in whole nanoseconds";
  return readCommands(scene.inputs, message.command_topics, message.command_values,
                      request.commands);
}

void checkTime(double time) {
  if (!(time <= kLatest)) {
    throw SceneError("time", formatNumber(time) + " s; allowed: from 0 to 1e9 s");
  }
  const double nearest = toSeconds(toCount(time * kNanosecondsPerSecond));
  if (nearest == time) return;
  throw SceneError("time",
                   formatNumber(time) +
                       " s; allowed: whole nanoseconds, as the node keeps time; the nearest is " +
                       formatNumber(nearest) + " s");
}

/// Returns the state of a message as one tree: its text, with the values of its arrays. Throws
/// SceneError.
ParameterTree stateOf(const SetState::Request& message, const Scene& scene) {
  ParameterTree state = ParameterTree::dictionary();
  if (!message.text.empty()) state = readYamlText(message.text, "text");
  const std::pair<std::string, const std::vector<double>&> arrays[] = {
      {"angle", message.angle},
      {"velocity", message.velocity},
      {"acceleration", message.acceleration}};
  for (const auto& [name, values] : arrays) {
    if (values.empty()) continue;
    if (values.size() != scene.shafts.size()) {
      throw SceneError("", name + " has " + std::to_string(values.size()) +
                               " values; allowed: none, or one per shaft: " +
                               std::to_string(scene.shafts.size()));
    }
    state.asDictionary().erase("history");  // of the text's own values
    for (std::size_t i = 0; i < values.size(); ++i) {
      setValue(state, "shafts/" + scene.shafts[i] + "/" + name, ParameterTree::real(values[i]));
    }
  }
  if (!state.asDictionary().empty()) return state;
  throw SceneError("", "nothing is to be set: text, angle, velocity, acceleration are empty");
}

/// Returns "", or why the state is not set.
std::string setState(Simulation& simulation, const ParameterTree& state, bool project) {
  MotionState present;
  if (!simulation.saveState(&present)) return simulation.describeStatus();
  try {
    const MotionState wanted = readMotionState(state, simulation.scene(), present);
    checkTime(wanted.time);
    return simulation.setState(wanted, project);
  } catch (const SceneError& error) {
    return error.what();
  }
}

std::string read(const SetState::Request& message, const Scene& scene, LoopRequest& request) {
  try {
    request.visit = [state = stateOf(message, scene), project = message.project != 0](
                        Simulation& simulation) { return setState(simulation, state, project); };
  } catch (const SceneError& error) {
    return error.what();
  }
  return "";
}

/// Fills in success, message and state of an answer.
template <class Response>
void fill(const LoopAnswer& answer, const Scene& scene, bool has_errors, Response& response) {
  response.success = answer.result == RequestResult::kDone;
  response.message = answer.describeFault();
  const bool has_state = answer.result != RequestResult::kShutDown &&
                         answer.result != RequestResult::kNotPaused &&
                         answer.result != RequestResult::kTimeExhausted;
  if (!has_state) return;
  const TimedSample& timed = answer.sample;
  response.state = toState(timed.sample, toSeconds(timed.time), scene, has_errors);
  // The stamp is simulated time, so that the whole answer is the same on every run.
  response.state.header.stamp = toStamp(timed.time);
}

template <class Service, class Answer>
ros::ServiceServer serve(ros::NodeHandle& handle, const char* name, Answer answer) {
  const boost::function<bool(typename Service::Request&, typename Service::Response&)> callback =
      [answer](typename Service::Request& request, typename Service::Response& response) {
        answer(request, response);
        return true;
      };
  return handle.advertiseService(name, callback);
}

}  // namespace

std::vector<ros::ServiceServer> advertiseServices(const Scene& scene, bool has_errors,
                                                  SteppingLoop& loop,
                                                  ros::NodeHandle& private_handle,
                                                  ros::NodeHandle& pause_handle) {
  const auto serve_trigger = [&loop](ros::NodeHandle& handle, const char* name, RequestKind kind) {
    return serve<std_srvs::Trigger>(handle, name, [&loop, kind](const auto&, auto& response) {
      const LoopAnswer answer = loop.submit({kind});
      response.success = answer.result == RequestResult::kDone;
      response.message = answer.describeFault();
    });
  };
  const auto answer_to = [&scene, &loop, has_errors](RequestKind kind) {
    return [&scene, &loop, has_errors, kind](const auto& message, auto& response) {
      LoopRequest request{kind};
      response.message = read(message, scene, request);
      if (response.message.empty()) fill(loop.submit(request), scene, has_errors, response);
    };
  };
  return {serve_trigger(pause_handle, "pause", RequestKind::kPause),
          serve_trigger(private_handle, "resume", RequestKind::kResume),
          serve_trigger(private_handle, "reset", RequestKind::kReset),
          serve_trigger(private_handle, "reset_time", RequestKind::kResetTime),
          serve<Step>(private_handle, "step", answer_to(RequestKind::kStep)),
          serve<GetState>(private_handle, "get_state",
                          [&scene, &loop, has_errors](const auto&, auto& response) {
                            LoopRequest request{RequestKind::kGetState};
                            const auto state = std::make_shared<MotionState>();
                            request.visit = [state](Simulation& simulation) {
                              simulation.saveState(state.get());
                              return std::string();
                            };
                            fill(loop.submit(request), scene, has_errors, response);
                            if (response.success) response.text = toYaml(toTree(*state, scene));
                          }),
          serve<SetState>(private_handle, "set_state", answer_to(RequestKind::kSetState))};
}

std::shared_ptr<void> serveSettings(const ros::NodeHandle& handle, const NodeSettings& settings,
                                    bool follows_clock, SteppingLoop& loop) {
  using Config = VariatorSimConfig;
  Config in_force;
  in_force.real_time_factor = settings.real_time_factor;
  in_force.publish_rate = settings.publish_rate;
  const auto change = [&loop, name = handle.getNamespace()](
                          const char* key, const std::string& fault, const char* unit,
                          double Config::*member, double its_in_force, Config& config,
                          void (SteppingLoop::*set)(double)) {
    double& value = config.*member;
    if (value == its_in_force) return;
    if (fault.empty()) {
      (loop.*set)(value);
      return;
    }
    // The generated code has moved values beyond its limits to these.
    const bool is_less = value <= Config::__getMin__().*member;
    const bool is_more = value >= Config::__getMax__().*member;
    ROS_WARN("%s: %s %g%s%s; it stays %g%s", name.c_str(), key, value,
             is_less ? " (or less)" : (is_more ? " (or more)" : ""), fault.c_str(), its_in_force,
             unit);
    value = its_in_force;
  };
  const auto server = std::make_shared<dynamic_reconfigure::Server<Config>>(handle);
  // The server calls back at once with its own reading of the parameters; these values replace it.
  server->setCallback([=, tick_rate = settings.tick_rate, is_first = true](
                          Config& config, std::uint32_t /*level*/) mutable {
    if (std::exchange(is_first, false)) {
      config.real_time_factor = in_force.real_time_factor;
      config.publish_rate = in_force.publish_rate;
      return;
    }
    std::string fault = findFaultOfRealTimeFactor(config.real_time_factor);
    if (fault.empty() && follows_clock) {
      fault = " is left aside: /use_sim_time is true, so /clock sets the pace";
    }
    change("real_time_factor", fault, "", &Config::real_time_factor, in_force.real_time_factor,
           config, &SteppingLoop::setRealTimeFactor);
    change("publish_rate", findFaultOfPublishRate(config.publish_rate, tick_rate), " Hz",
           &Config::publish_rate, in_force.publish_rate, config, &SteppingLoop::setPublishRate);
    in_force = config;
  });
  return server;
}

}  // namespace variator_sim
