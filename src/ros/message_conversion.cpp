#include "ros/message_conversion.h"

#include <algorithm>
#include <limits>

#include "variator_sim/io/yaml_text.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

void copy(const double* from, std::vector<double>& to) {
  std::copy(from, from + to.size(), to.begin());
}

}  // namespace

ros::Time toStamp(std::int64_t nanoseconds) {
  constexpr std::int64_t kSecond = 1000000000;
  const std::int64_t seconds = nanoseconds / kSecond;
  if (seconds > std::numeric_limits<std::uint32_t>::max()) return ros::TIME_MAX;
  return ros::Time(static_cast<std::uint32_t>(seconds),
                   static_cast<std::uint32_t>(nanoseconds % kSecond));
}

DrivetrainState makeState(const Scene& scene, bool has_errors) {
  DrivetrainState message;
  const std::size_t shafts = scene.shafts.size();
  for (std::vector<double>* values :
       {&message.angle, &message.velocity, &message.acceleration, &message.applied_torque,
        &message.reaction_torque, &message.reaction_torque_rate,
        &message.reaction_torque_covariant_rate}) {
    values->assign(shafts, 0.0);
  }
  message.residual.assign(scene.constraints.size(), 0.0);
  message.multiplier.assign(scene.constraints.size(), 0.0);
  for (std::vector<double>* errors :
       {&message.angle_error, &message.velocity_error, &message.acceleration_error}) {
    errors->assign(has_errors ? shafts : 0, 0.0);
  }
  return message;
}

void fillState(const Sample& sample, double time, DrivetrainState& message) {
  message.time = time;
  copy(sample.angle, message.angle);
  copy(sample.velocity, message.velocity);
  copy(sample.acceleration, message.acceleration);
  copy(sample.applied_torque, message.applied_torque);
  copy(sample.reaction_torque, message.reaction_torque);
  copy(sample.reaction_torque_rate, message.reaction_torque_rate);
  copy(sample.reaction_torque_covariant_rate, message.reaction_torque_covariant_rate);
  copy(sample.residual, message.residual);
  copy(sample.multiplier, message.multiplier);
  copy(sample.angle_error, message.angle_error);
  copy(sample.velocity_error, message.velocity_error);
  copy(sample.acceleration_error, message.acceleration_error);
}

void fillEnergy(const Energy& energy, double time, DrivetrainEnergy& message) {
  message.time = time;
  message.kinetic = energy.kinetic;
  message.applied = energy.applied;
  message.reactions = energy.reactions;
  message.applied_power = energy.applied_power;
  message.reaction_power = energy.reaction_power;
}

NamedValues makeQuantities(const Simulation& simulation, QuantityGroup group) {
  NamedValues message;
  message.name = simulation.quantityNames(group);
  message.value.assign(message.name.size(), 0.0);
  return message;
}

void fillQuantities(const double* values, double time, NamedValues& message) {
  message.time = time;
  copy(values, message.value);
}

Event toMessage(const TimedEvent& timed, const std::vector<std::string>& names) {
  const ModeEvent& event = timed.event;
  Event message;
  message.time = static_cast<double>(timed.time) / 1e9;
  message.element = names[static_cast<std::size_t>(event.element)];
  message.before = modeName(event.from);
  message.after = modeName(event.to);
  message.torque = event.torque;
  message.impulse = event.impulse;
  return message;
}

sensor_msgs::JointState makeJointState(const Scene& scene) {
  sensor_msgs::JointState message;
  message.name = scene.shafts;
  message.position.assign(scene.shafts.size(), 0.0);
  message.velocity.assign(scene.shafts.size(), 0.0);
  message.effort.assign(scene.shafts.size(), 0.0);
  return message;
}

void fillJointState(const Sample& sample, sensor_msgs::JointState& message) {
  copy(sample.angle, message.position);
  copy(sample.velocity, message.velocity);
  copy(sample.applied_torque, message.effort);
}

SceneInfo toSceneInfo(const Simulation& simulation) {
  const Scene& scene = simulation.scene();
  SceneInfo message;
  message.shafts = scene.shafts;
  for (const TorquePtr& torque : scene.torques) message.torques.push_back(torque->name());
  for (const ConstraintPtr& constraint : scene.constraints) {
    message.constraints.push_back(constraint->name());
  }
  for (const CommandInputSettings& input : scene.inputs) {
    if (input.kind == InputKind::kCommanded) message.inputs.push_back(input.topic);
  }
  message.principle = toString(scene.principle);
  message.stepper = simulation.describeStepper();
  message.skips = simulation.skips();
  message.parameters = toYaml(scene.resolved);
  return message;
}

void fillStatistics(const Statistics& statistics, SimulationStatus& message) {
  message.steps = statistics.steps;
  message.rejected_steps = statistics.rejected_steps;
  message.right_hand_sides = statistics.right_hand_sides;
  message.projections = statistics.projections;
  message.newton_iterations = statistics.newton_iterations;
  message.largest_rounding = statistics.largest_rounding;
  message.jumps = statistics.jumps;
  message.commands_accepted = statistics.commands_accepted;
  message.commands_clamped = statistics.commands_clamped;
  message.commands_refused = statistics.commands_refused;
  message.command_timeouts = statistics.command_timeouts;
}

}  // namespace variator_sim
