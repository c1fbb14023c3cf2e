// A controller in lockstep: ~step of 1 ms with a command, beside an empty service, block by block.
// Prints, for each round and service, the median and the 99th percentile of a call (s).
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <variator_sim/Step.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "realtime/timed_loop.h"

namespace {

using variator_sim::benchmark::steadyTime;

void print(int round, const char* name, std::vector<double>& times) {
  std::sort(times.begin(), times.end());
  std::printf("%d %s %.9f %.9f\n", round, name, times[times.size() / 2],
              times[times.size() * 99 / 100]);
  std::fflush(stdout);
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
  ros::ServiceClient step_client =
      handle.serviceClient<variator_sim::Step>("/variator/step", /*persistent=*/true);
  ros::ServiceClient trigger_client =
      handle.serviceClient<std_srvs::Trigger>("/trigger/trigger", /*persistent=*/true);
  variator_sim::Step step;
  step.request.duration = 0.001;
  step.request.command_topics = {"drive_torque"};
  step.request.command_values = {0.0};
  std_srvs::Trigger trigger;
  long steps = 0;
  for (int round = -1; round < rounds; ++round) {  // the first one warms up
    std::vector<double> step_times;
    std::vector<double> trigger_times;
    for (int i = 0; i < calls; ++i) {
      step.request.command_values[0] = 20.0 * std::sin(1e-3 * static_cast<double>(steps++));
      const std::int64_t begin = steadyTime();
      if (!step_client.call(step) || !step.response.success) {
        std::fprintf(stderr, "step_probe: ~step failed: %s\n", step.response.message.c_str());
        return 1;
      }
      step_times.push_back(static_cast<double>(steadyTime() - begin) / 1e9);
    }
    for (int i = 0; i < calls; ++i) {
      const std::int64_t begin = steadyTime();
      if (!trigger_client.call(trigger)) {
        std::fprintf(stderr, "step_probe: the trigger failed\n");
        return 1;
      }
      trigger_times.push_back(static_cast<double>(steadyTime() - begin) / 1e9);
    }
    if (round < 0) continue;
    print(round, "step", step_times);
    print(round, "trigger", trigger_times);
  }
  return 0;
}
