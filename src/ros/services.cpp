#include "ros/services.h"

#include <boost/function.hpp>
#include <cmath>
#include <memory>

#include "ros/message_conversion.h"
#include "ros/nanoseconds.h"
#include "ros/stepping_loop.h"
#include "variator_sim/io/yaml_text.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim {
namespace {

constexpr double kLongestStep = 1e6;  // s

LoopRequest makeRequest(RequestKind kind) {
  LoopRequest request;
  request.kind = kind;
  if (kind == RequestKind::kGetState || kind == RequestKind::kSetState) {
    request.exchange = std::make_shared<StateExchange>();
  }
  return request;
}

}  // namespace

Services::Services(const Simulation& simulation, SteppingLoop& loop)
    : scene_(simulation.scene()),
      loop_(loop),
      state_message_(makeState(scene_, !simulation.describeErrorEstimate().empty())) {}

template <class Service, class Answer>
void Services::add(ros::NodeHandle& handle, const char* name, Answer answer) {
  const boost::function<bool(typename Service::Request&, typename Service::Response&)> callback =
      [answer](typename Service::Request& request, typename Service::Response& response) {
        answer(request, response);
        return true;
      };
  servers_.push_back(handle.advertiseService(name, callback));
}

void Services::advertise(ros::NodeHandle& private_handle, ros::NodeHandle& pause_handle) {
  const auto add_trigger = [this](ros::NodeHandle& handle, const char* name, RequestKind kind) {
    add<std_srvs::Trigger>(handle, name, [this, kind](const auto&, auto& response) {
      const LoopAnswer answer = loop_.submit(makeRequest(kind));
      response.success = answer.result == RequestResult::kDone;
      response.message = answer.describeFault();
    });
  };
  add_trigger(pause_handle, "pause", RequestKind::kPause);
  add_trigger(private_handle, "resume", RequestKind::kResume);
  add_trigger(private_handle, "reset", RequestKind::kReset);
  add_trigger(private_handle, "reset_time", RequestKind::kResetTime);
  add<Step>(private_handle, "step", [this](const auto& message, auto& response) {
    LoopRequest request = makeRequest(RequestKind::kStep);
    response.message = read(message, request);
    if (response.message.empty()) fill(loop_.submit(request), response);
  });
  add<GetState>(private_handle, "get_state", [this](const auto&, auto& response) {
    const LoopRequest request = makeRequest(RequestKind::kGetState);
    fill(loop_.submit(request), response);
    if (response.success) response.text = toYaml(toTree(request.exchange->state, scene_));
  });
  add<SetState>(private_handle, "set_state", [this](const auto& message, auto& response) {
    const LoopRequest request = makeRequest(RequestKind::kSetState);
    response.message = read(message, *request.exchange);
    if (response.message.empty()) fill(loop_.submit(request), response);
  });
}

std::string Services::read(const Step::Request& message, LoopRequest& request) const {
  const std::string duration = "duration is " + formatReal(message.duration) + " s; ";
  if (!(message.duration > 0.0 && message.duration <= kLongestStep)) {
    return duration + "it must be above 0 and at most 1e6 s";
  }
  request.duration = std::llround(message.duration * kNanosecondsPerSecond);
  if (request.duration == 0) return duration + "simulated time is kept in whole nanoseconds";
  return readCommands(scene_.inputs, message.command_topics, message.command_values, request.group);
}

std::string Services::read(const SetState::Request& message, StateExchange& exchange) const {
  bool is_any_given = !message.text.empty();
  const auto take = [&](const char* name, const std::vector<double>& values,
                        std::vector<double>& to) -> std::string {
    if (values.empty()) return "";
    is_any_given = true;
    if (values.size() != scene_.shafts.size()) {
      return std::string(name) + " has " + std::to_string(values.size()) +
             " values; allowed: none, or one per shaft: " + std::to_string(scene_.shafts.size());
    }
    for (const double value : values) {
      if (!std::isfinite(value)) return std::string(name) + ": every value must be finite";
    }
    to = values;
    return "";
  };
  for (const std::string& fault :
       {take("angle", message.angle, exchange.angle),
        take("velocity", message.velocity, exchange.velocity),
        take("acceleration", message.acceleration, exchange.acceleration)}) {
    if (!fault.empty()) return fault;
  }
  if (!is_any_given) return "nothing is to be set: text, angle, velocity, acceleration are empty";
  exchange.project = message.project;
  if (message.text.empty()) return "";
  try {
    exchange.change = readYamlText(message.text, "text");
  } catch (const SceneError& error) {
    return error.what();
  }
  return "";
}

template <class Response>
void Services::fill(const LoopAnswer& answer, Response& response) {
  response.success = answer.result == RequestResult::kDone;
  response.message = answer.describeFault();
  const bool has_state = answer.result != RequestResult::kShutDown &&
                         answer.result != RequestResult::kNotPaused &&
                         answer.result != RequestResult::kTimeExhausted;
  if (!has_state) return;
  // The stamp is simulated time, so that the whole answer is the same on every run.
  state_message_.header.stamp = toStamp(answer.sample.time);
  fillState(answer.sample.sample, toSeconds(answer.sample.time), state_message_);
  response.state = state_message_;
}

}  // namespace variator_sim
