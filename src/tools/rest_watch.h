/// Whether a motion has become steady.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "variator_sim/simulation.h"

namespace variator_sim {

/// A motion is steady where every shaft has
///     |epsilon| <= kSteady (|omega| + 1 rad/s) / s,
/// and each state z of the scene that something reads |z'| <= kSteady (|z| + 1) / s between looks,
/// and at rest when neither a command nor a timeout is to come and it sleeps, or has been steady
/// for kStaying. Looked at every kInterval, which changes no bit of it.
class RestWatch {
 public:
  static constexpr double kSteady = 1e-6;
  static constexpr double kStaying = 1.0;    // s
  static constexpr double kInterval = 0.05;  // s

  void begin() { next_ = 0.0; }
  double nextLook() const { return next_; }
  bool isReached() const { return is_reached_; }
  /// The first look since which it has been steady, s.
  double since() const { return since_; }

  /// True when the motion is at rest.
  bool look(Simulation& simulation, bool is_last_command) {
    const double now = simulation.time();
    next_ = now + kInterval;
    if (!isSteady(simulation)) {
      since_ = kNever;
      return false;
    }
    since_ = std::min(since_, now);
    is_reached_ = is_last_command && simulation.nextTimeout() == kNever &&
                  (simulation.isSleeping() || now - since_ >= kStaying);
    if (is_reached_) next_ = kNever;
    return is_reached_;
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  bool isSteady(Simulation& simulation) {
    states_.resize(simulation.scene().states.size(), kNever);
    const std::vector<double> before = states_;
    simulation.calcQuantities(QuantityGroup::kStates, states_.data());
    const Sample& sample = simulation.sample();
    if (!simulation.status().ok()) return false;
    for (int i = 0; i < simulation.scene().shaftCount(); ++i) {
      const double allowed = kSteady * (std::abs(sample.velocity[i]) + 1.0);
      if (!(std::abs(sample.acceleration[i]) <= allowed)) return false;
    }
    for (std::size_t i = 0; i < states_.size(); ++i) {
      const double allowed = kSteady * kInterval * (std::abs(states_[i]) + 1.0);
      const bool is_steady = std::abs(states_[i] - before[i]) <= allowed;
      if (simulation.scene().states[i].is_read && !is_steady) return false;
    }
    return true;
  }

  std::vector<double> states_;  ///< at the last look
  double next_ = kNever;
  double since_ = kNever;
  bool is_reached_ = false;
};

}  // namespace variator_sim
