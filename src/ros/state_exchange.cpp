#include "ros/state_exchange.h"

#include <algorithm>
#include <cmath>

#include "ros/nanoseconds.h"
#include "ros/stepping_loop.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

/// Far from the ends of 64-bit nanoseconds.
constexpr double kLatest = 1e9;  // s

void checkTime(double time) {
  if (!(time <= kLatest)) {
    throw SceneError("time", formatNumber(time) + " s; allowed: from 0 to 1e9 s");
  }
  const double nearest = toSeconds(toCount(time * kNanosecondsPerSecond));
  if (nearest == time) return;
  throw SceneError("time",
                   formatNumber(time) +
                       " s; allowed: whole nanoseconds, as the node keeps time; the nearest "
                       "is " +
                       formatNumber(nearest) + " s");
}

}  // namespace

std::string changeState(Simulation& simulation, const StateExchange& exchange) {
  MotionState present;
  if (!simulation.saveState(&present)) return simulation.describeStatus();
  try {
    MotionState wanted = readMotionState(exchange.change, simulation.scene(), present);
    const auto take = [&](const std::vector<double>& values, double* to) {
      if (values.empty()) return false;
      std::copy(values.begin(), values.end(), to);
      wanted.history.exists = false;
      return true;
    };
    take(exchange.angle, wanted.angle);
    take(exchange.velocity, wanted.velocity);
    if (take(exchange.acceleration, wanted.acceleration)) wanted.is_acceleration_given = true;
    checkTime(wanted.time);
    return simulation.setState(wanted, exchange.project);
  } catch (const SceneError& error) {
    return error.what();
  }
}

void SteppingLoop::serveState() {
  applyCommands();
  quiet_until_ = 0;
  if (simulation_.status().ok() && request_.kind == RequestKind::kGetState) {
    simulation_.saveState(&request_.exchange->state);
  } else if (simulation_.status().ok()) {
    const std::int64_t shown = sampleTime();
    answer_.message = changeState(simulation_, *request_.exchange);
    if (!answer_.message.empty()) answer_.result = RequestResult::kRefused;
    // Time of samples never goes back.
    present_ = std::llround(simulation_.time() * kNanosecondsPerSecond);
    offset_ = shown - present_;
    anchor();
  }
  answer_.sample = takeSample();
  if (request_.kind == RequestKind::kSetState && samples_wanted_.load(std::memory_order_relaxed)) {
    handOver(answer_.sample);
  }
}

}  // namespace variator_sim
