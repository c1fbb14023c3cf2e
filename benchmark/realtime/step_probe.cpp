// A controller in lockstep: ~step of 1 ms with a command, beside services that do nothing, an empty
// one and one with the messages of ~step, block by block.
// Prints, for each round and service, the median and the 99th percentile of a call (s).
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <variator_sim/Step.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "realtime/timed_loop.h"

namespace {

using variator_sim::benchmark::printRow;
using variator_sim::benchmark::steadyTime;

/// The times of so many calls, s; the program ends when one fails.
template <class Call>
std::vector<double> measure(int calls, const char* name, Call call) {
  std::vector<double> times;
  for (int i = 0; i < calls; ++i) {
    const std::int64_t begin = steadyTime();
    if (!call()) {
      std::fprintf(stderr, "step_probe: %s failed\n", name);
      std::exit(1);
    }
    times.push_back(static_cast<double>(steadyTime() - begin) / 1e9);
  }
  return times;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "step_probe");
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 0;
  const int calls = argc > 2 ? std::atoi(argv[2]) : 0;
  if (rounds < 1 || calls < 1) {
    std::fprintf(stderr, "usage: step_probe ROUNDS CALLS_PER_ROUND\n");
    return 2;
  }
  ros::NodeHandle handle;
  ros::service::waitForService("/variator/step");
  ros::service::waitForService("/trigger/trigger");
  ros::service::waitForService("/trigger/step");
  const bool persistent = true;
  auto step_client = handle.serviceClient<variator_sim::Step>("/variator/step", persistent);
  auto idle_client = handle.serviceClient<variator_sim::Step>("/trigger/step", persistent);
  auto trigger_client = handle.serviceClient<std_srvs::Trigger>("/trigger/trigger", persistent);
  variator_sim::Step step;
  step.request.duration = 0.001;
  step.request.command_topics = {"drive_torque"};
  step.request.command_values = {0.0};
  std_srvs::Trigger trigger;
  long steps = 0;
  const auto call_step = [&](ros::ServiceClient& client) {
    step.request.command_values[0] = 20.0 * std::sin(1e-3 * static_cast<double>(steps++));
    return client.call(step) && step.response.success;
  };
  for (int round = -1; round < rounds; ++round) {  // the first one warms up
    std::vector<double> times[] = {
        measure(calls, "~step", [&] { return call_step(step_client); }),
        measure(calls, "the empty service", [&] { return trigger_client.call(trigger); }),
        measure(calls, "the service that does nothing", [&] { return call_step(idle_client); })};
    if (round < 0) continue;
    printRow(round, "step", times[0]);
    printRow(round, "trigger", times[1]);
    printRow(round, "idle", times[2]);
  }
  return 0;
}
