#include "ros/message_conversion.h"

#include <algorithm>

#include "ros/nanoseconds.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

ros::Time toStamp(std::int64_t nanoseconds) {
  const auto time = static_cast<std::uint64_t>(nanoseconds);
  return ros::Time().fromNSec(std::min(time, ros::TIME_MAX.toNSec()));
}

DrivetrainState toState(const Sample& sample, double time, const Scene& scene, bool has_errors) {
  DrivetrainState message;
  message.time = time;
  const auto copy = [](const double* from, std::size_t count, std::vector<double>& to) {
    to.assign(from, from + count);
  };
  const std::size_t shafts = scene.shafts.size();
  copy(sample.angle, shafts, message.angle);
  copy(sample.velocity, shafts, message.velocity);
  copy(sample.acceleration, shafts, message.acceleration);
  copy(sample.applied_torque, shafts, message.applied_torque);
  copy(sample.reaction_torque, shafts, message.reaction_torque);
  copy(sample.reaction_torque_rate, shafts, message.reaction_torque_rate);
  copy(sample.reaction_torque_covariant_rate, shafts, message.reaction_torque_covariant_rate);
  copy(sample.residual, scene.constraints.size(), message.residual);
  copy(sample.multiplier, scene.constraints.size(), message.multiplier);
  const std::size_t errors = has_errors ? shafts : 0;
  copy(sample.angle_error, errors, message.angle_error);
  copy(sample.velocity_error, errors, message.velocity_error);
  copy(sample.acceleration_error, errors, message.acceleration_error);
  return message;
}

sensor_msgs::JointState toJointState(const Sample& sample, const Scene& scene) {
  sensor_msgs::JointState message;
  message.name = scene.shafts;
  const std::size_t shafts = scene.shafts.size();
  message.position.assign(sample.angle, sample.angle + shafts);
  message.velocity.assign(sample.velocity, sample.velocity + shafts);
  message.effort.assign(sample.applied_torque, sample.applied_torque + shafts);
  return message;
}

DrivetrainEnergy toMessage(const Energy& energy, double time) {
  DrivetrainEnergy message;
  message.time = time;
  message.kinetic = energy.kinetic;
  message.applied = energy.applied;
  message.reactions = energy.reactions;
  message.applied_power = energy.applied_power;
  message.reaction_power = energy.reaction_power;
  return message;
}

NamedValues toMessage(const double* values, double time, const std::vector<std::string>& names) {
  NamedValues message;
  message.time = time;
  message.name = names;
  message.value.assign(values, values + names.size());
  return message;
}

Event toMessage(const TimedEvent& timed, const std::vector<std::string>& names) {
  const ModeEvent& event = timed.event;
  Event message;
  message.time = toSeconds(timed.time);
  message.element = names[static_cast<std::size_t>(event.element)];
  message.before = modeName(event.from);
  message.after = modeName(event.to);
  message.torque = event.torque;
  message.impulse = event.impulse;
  return message;
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

SimulationStatus toMessage(const LoopSnapshot& snapshot) {
  SimulationStatus message;
  message.state = static_cast<std::uint8_t>(snapshot.state);
  message.stop_reason = toString(snapshot.reason);
  if (snapshot.is_preparing) {
    message.message = "preparing: the formulas are being compiled; the motion begins afterwards";
  }
  if (snapshot.state == RunState::kStopped) message.message = snapshot.stop_message.data();
  message.time = toSeconds(snapshot.time);
  message.real_time_factor = snapshot.real_time_factor;
  message.ticks = snapshot.pacing.ticks;
  message.overruns = snapshot.pacing.overruns;
  message.lateness_p50 = toSeconds(snapshot.lateness.p50);
  message.lateness_p99 = toSeconds(snapshot.lateness.p99);
  message.lateness_max = toSeconds(snapshot.lateness.max);
  message.lost_wall_time = toSeconds(snapshot.pacing.lost_time);
  const Statistics& statistics = snapshot.statistics;
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
  message.commands_dropped = snapshot.commands_dropped;
  message.samples_dropped = snapshot.samples_dropped;
  return message;
}

}  // namespace variator_sim
