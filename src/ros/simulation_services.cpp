// The services of a node but for those of states.
#include <boost/function.hpp>
#include <cmath>

#include "ros/simulation_server.h"

namespace variator_sim {
namespace {

constexpr double kLongestStep = 1e6;  // s

}  // namespace

void SimulationServer::advertiseServices() {
  ros::NodeHandle pause_handle(private_handle_);
  pause_handle.setCallbackQueue(&pause_queue_);
  const auto trigger = [this](ros::NodeHandle& handle, const char* name, RequestKind kind) {
    using Callback =
        boost::function<bool(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&)>;
    const Callback answer = [this, kind](std_srvs::Trigger::Request&,
                                         std_srvs::Trigger::Response& response) {
      answerTrigger(kind, response);
      return true;
    };
    services_.push_back(handle.advertiseService(name, answer));
  };
  trigger(pause_handle, "pause", RequestKind::kPause);
  trigger(private_handle_, "resume", RequestKind::kResume);
  trigger(private_handle_, "reset", RequestKind::kReset);
  trigger(private_handle_, "reset_time", RequestKind::kResetTime);
  const boost::function<bool(Step::Request&, Step::Response&)> step =
      [this](Step::Request& request, Step::Response& response) {
        answerStep(request, response);
        return true;
      };
  services_.push_back(private_handle_.advertiseService("step", step));
  state_services_.advertise(private_handle_);
}

void SimulationServer::answerTrigger(RequestKind kind, std_srvs::Trigger::Response& response) {
  LoopRequest request;
  request.kind = kind;
  const LoopAnswer answer = loop_.submit(request);
  response.success = answer.result == RequestResult::kDone;
  response.message = answer.describeFault();
}

std::string SimulationServer::readStepRequest(const Step::Request& message,
                                              LoopRequest& request) const {
  request.kind = RequestKind::kStep;
  const auto number = [](double value) { return ParameterTree::real(value).toText(); };
  if (!std::isfinite(message.duration) || message.duration <= 0.0 ||
      message.duration > kLongestStep) {
    return "duration is " + number(message.duration) + " s; it must be above 0 and at most 1e6 s";
  }
  request.duration = std::llround(message.duration * 1e9);
  if (request.duration == 0) {
    return "duration is " + number(message.duration) +
           " s; simulated time is kept in whole nanoseconds";
  }
  CommandGroup group;
  std::string fault = readCommands(topics_, message.command_topics, message.command_values, group);
  request.command_count = group.count;
  request.commands = group.commands;
  return fault;
}

void SimulationServer::answerStep(const Step::Request& message, Step::Response& response) {
  LoopRequest request;
  response.success = false;
  response.message = readStepRequest(message, request);
  if (!response.message.empty()) return;
  const LoopAnswer answer = loop_.submit(request);
  response.success = answer.result == RequestResult::kDone;
  response.message = answer.describeFault();
  const bool has_moved = response.success || answer.result == RequestResult::kStopped ||
                         answer.result == RequestResult::kInterrupted;
  if (!has_moved) return;
  // The stamp is simulated time, so that the whole answer is the same on every run.
  step_message_.header.stamp = toStamp(answer.sample.time);
  fillState(answer.sample.sample, toSeconds(answer.sample.time), step_message_);
  response.state = step_message_;
}

}  // namespace variator_sim
