/// Converts samples, counters and scenes to messages; no other file knows both.
#pragma once

#include <sensor_msgs/JointState.h>
#include <variator_sim/DrivetrainEnergy.h>
#include <variator_sim/DrivetrainState.h>
#include <variator_sim/Event.h>
#include <variator_sim/NamedValues.h>
#include <variator_sim/SceneInfo.h>
#include <variator_sim/SimulationStatus.h>

#include <cstdint>

#include "ros/loop_messages.h"

namespace variator_sim {

class Simulation;
struct Scene;

/// Simulated time, ns >= 0, as a stamp (saturates at the last second that a stamp can hold).
ros::Time toStamp(std::int64_t nanoseconds);

/// Makes a message with its array sizes; `fillState` then allocates nothing. Without `has_errors`
/// the arrays of estimated errors stay empty.
DrivetrainState makeState(const Scene& scene, bool has_errors);
/// Fills in all but the header. `time` is the message's simulated time, s (sample.time counts from
/// the last reset).
void fillState(const Sample& sample, double time, DrivetrainState& message);

/// Fills in all but the header; `time` as in fillState.
void fillEnergy(const Energy& energy, double time, DrivetrainEnergy& message);

/// Makes a message with names and array sizes of a group's quantities.
NamedValues makeQuantities(const Simulation& simulation, QuantityGroup group);
/// Fills in all but the header from one value per name; `time` as in fillState.
void fillQuantities(const double* values, double time, NamedValues& message);

/// Makes a message without the header; `names`: Scene::eventNames.
Event toMessage(const TimedEvent& timed, const std::vector<std::string>& names);

/// Makes a message with joint names and array sizes.
sensor_msgs::JointState makeJointState(const Scene& scene);
/// Fills in position, velocity and effort (the applied torque), not the header.
void fillJointState(const Sample& sample, sensor_msgs::JointState& message);

SceneInfo toSceneInfo(const Simulation& simulation);

/// Fills in the counters that the simulation itself keeps.
void fillStatistics(const Statistics& statistics, SimulationStatus& message);

}  // namespace variator_sim
