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
#include <string>
#include <vector>

#include "ros/loop_messages.h"

namespace variator_sim {

class Simulation;
struct Scene;

/// Simulated time, ns >= 0, as a stamp (saturates at the last second that a stamp can hold).
ros::Time toStamp(std::int64_t nanoseconds);

// The messages below lack their stamps. `time` is their simulated time, s (that of a sample counts
// from the last reset).

/// Without `has_errors` the arrays of estimated errors are empty.
DrivetrainState toState(const Sample& sample, double time, const Scene& scene, bool has_errors);
/// Joints have the applied torques as efforts.
sensor_msgs::JointState toJointState(const Sample& sample, const Scene& scene);
DrivetrainEnergy toMessage(const Energy& energy, double time);
/// `values`: one for each name.
NamedValues toMessage(const double* values, double time, const std::vector<std::string>& names);
SimulationStatus toMessage(const LoopSnapshot& snapshot);
/// `names`: Scene::eventNames.
Event toMessage(const TimedEvent& timed, const std::vector<std::string>& names);

SceneInfo toSceneInfo(const Simulation& simulation);

}  // namespace variator_sim
