/// The numbers that a motion and its program tell each other, with their arrays.
#pragma once

#include "motion_program/motion_steps.h"
#include "variator_sim/types.h"

namespace variator_sim {

struct Exchange : vs_exchange {
  static constexpr int kMostRows = kMaxConstraints + kMaxHolds;

  Exchange() : vs_exchange{} {
    state = states_;
    multiplier = multipliers_;
    reaction = reactions_;
    longest = longests_;
    input = inputs_;
    hold = holds_;
    armed = armeds_;
  }
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

 private:
  double states_[3 * kMaxShafts] = {};
  double multipliers_[kMostRows] = {};
  double reactions_[kMaxShafts] = {};
  double longests_[kMostRows] = {};
  vs_exchanged_signal inputs_[kMaxInputs] = {};
  vs_exchanged_hold holds_[kMaxHolds] = {};
  int armeds_[kMaxEvents] = {};
};

}  // namespace variator_sim
