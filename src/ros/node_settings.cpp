#include "ros/node_settings.h"

#include <algorithm>

namespace variator_sim {
namespace {

// Hz. It keeps ticks far from the ends of 64-bit nanoseconds.
constexpr double kSlowestTickRate = 1e-3;
constexpr double kFastestTickRate = 1e5;
constexpr double kSlowestPublishRate = 1e-3;
constexpr double kSmallestRealTimeFactor = 1e-3;
constexpr double kGreatestRealTimeFactor = 1e6;

}  // namespace

std::string findFaultOfRealTimeFactor(double factor) {
  if (factor == 0.0 || (factor >= kSmallestRealTimeFactor && factor <= kGreatestRealTimeFactor)) {
    return "";
  }
  return " is not allowed: 0 (unpaced) or from 0.001 to 1e6";
}

std::string findFaultOfPublishRate(double rate, double tick_rate) {
  if (rate >= kSlowestPublishRate && rate <= tick_rate) return "";
  return " Hz is not allowed: from 0.001 to tick_rate (" + formatReal(tick_rate) +
         " Hz; states are taken at ticks only)";
}

NodeSettings readNodeSettings(const ParameterTree& tree) {
  NodeSettings settings;
  ParameterReader reader(tree, "");
  const auto check = [](const char* key, double value, const std::string& fault) {
    if (!fault.empty()) throw SceneError(key, formatReal(value) + fault);
  };
  settings.tick_rate = reader.number(
      "tick_rate", Range::between(kSlowestTickRate, kFastestTickRate, "Hz"), settings.tick_rate);
  settings.publish_rate = reader.number("publish_rate", Range::any("Hz"),
                                        std::min(settings.publish_rate, settings.tick_rate));
  check("publish_rate", settings.publish_rate,
        findFaultOfPublishRate(settings.publish_rate, settings.tick_rate));
  settings.real_time_factor = reader.number(
      "real_time_factor", Range::between(0.0, kGreatestRealTimeFactor), settings.real_time_factor);
  check("real_time_factor", settings.real_time_factor,
        findFaultOfRealTimeFactor(settings.real_time_factor));
  settings.publish_clock = reader.boolean("publish_clock", settings.publish_clock);
  settings.start_paused = reader.boolean("start_paused", settings.start_paused);
  settings.realtime_priority =
      reader.integer("realtime_priority", 0, 99, settings.realtime_priority);
  settings.lock_memory = reader.boolean("lock_memory", settings.lock_memory);
  settings.estimate_error = reader.boolean("estimate_error", settings.estimate_error);
  reader.text("scene_folder", "");  // read before all others: server_from_parameters.cpp
  return settings;
}

}  // namespace variator_sim
