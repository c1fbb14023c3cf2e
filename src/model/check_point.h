/// States at which the laws of a scene are checked.
#pragma once

#include <array>
#include <cstdint>

#include "variator_sim/scene.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// One state that owns its arrays.
struct CheckPoint {
  double time = 0.0;
  std::array<double, kMaxShafts> angle{};
  std::array<double, kMaxShafts> velocity{};
  std::array<double, kMaxShafts> acceleration{};
  std::array<double, kMaxInputs + kMaxHolds> input{};  ///< and sides of elements that hold
  std::array<double, kMaxInputs + kMaxHolds> input_rate{};
  std::array<double, kMaxInputs + kMaxHolds> input_second_rate{};

  StateView view() const {
    return {time,         angle.data(),      velocity.data(),         acceleration.data(),
            input.data(), input_rate.data(), input_second_rate.data()};
  }
};

/// Scales time and angles by one factor, velocities and accelerations by another.
CheckPoint scaled(const CheckPoint& point, double of_place, double of_motion);

/// A source of numbers uniform in [-1, 1], the same on every run and machine.
class Random {
 public:
  double operator()() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 11U) * 0x1p-52 - 1.0;
  }

 private:
  std::uint64_t state_ = 20240229;
};

/// Returns the scene's initial state.
CheckPoint startOf(const Scene& scene);
/// Returns `point` with every part moved by up to `by`, relative to its size and at least 1.
CheckPoint shaken(const Scene& scene, const CheckPoint& point, double by, Random& random);

}  // namespace variator_sim
