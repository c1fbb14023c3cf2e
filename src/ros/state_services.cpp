#include "ros/state_services.h"

#include <boost/function.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "ros/message_conversion.h"
#include "ros/nanoseconds.h"
#include "ros/state_exchange.h"
#include "ros/stepping_loop.h"
#include "variator_sim/io/yaml_text.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim {

StateServices::StateServices(const Simulation& simulation, SteppingLoop& loop)
    : scene_(simulation.scene()), loop_(loop) {
  prepareState(scene_, !simulation.describeErrorEstimate().empty(), state_message_);
}

void StateServices::advertise(ros::NodeHandle& private_handle) {
  const boost::function<bool(GetState::Request&, GetState::Response&)> get =
      [this](GetState::Request&, GetState::Response& response) {
        answer(response);
        return true;
      };
  get_ = private_handle.advertiseService("get_state", get);
  const boost::function<bool(SetState::Request&, SetState::Response&)> set =
      [this](SetState::Request& request, SetState::Response& response) {
        answer(request, response);
        return true;
      };
  set_ = private_handle.advertiseService("set_state", set);
}

void StateServices::answer(GetState::Response& response) {
  LoopRequest request;
  request.kind = RequestKind::kGetState;
  request.exchange = std::make_shared<StateExchange>();
  fill(loop_.submit(request), response);
  if (response.success) response.text = toYaml(toTree(request.exchange->state, scene_));
}

std::string StateServices::read(const SetState::Request& message, StateExchange& exchange) const {
  const std::size_t shafts = scene_.shafts.size();
  bool is_any_given = !message.text.empty();
  const auto take = [&](const char* name, const std::vector<double>& values,
                        std::vector<double>& to) -> std::string {
    if (values.empty()) return "";
    is_any_given = true;
    if (values.size() != shafts) {
      return std::string(name) + " has " + std::to_string(values.size()) +
             " values; allowed: none, or one per shaft: " + std::to_string(shafts);
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

void StateServices::answer(const SetState::Request& message, SetState::Response& response) {
  LoopRequest request;
  request.kind = RequestKind::kSetState;
  request.exchange = std::make_shared<StateExchange>();
  response.message = read(message, *request.exchange);
  response.success = false;
  if (response.message.empty()) fill(loop_.submit(request), response);
}

template <class Response>
void StateServices::fill(const LoopAnswer& answer, Response& response) {
  response.success = answer.result == RequestResult::kDone;
  response.message = answer.describeFault();
  if (answer.result == RequestResult::kShutDown) return;
  state_message_.header.stamp = toStamp(answer.sample.time);
  fillState(answer.sample.sample, toSeconds(answer.sample.time), state_message_);
  response.state = state_message_;
}

}  // namespace variator_sim
