/// Changes of modes, and events of the scene, until they are taken.
#pragma once

#include <algorithm>
#include <vector>

#include "motion/exchange.h"
#include "variator_sim/status.h"

namespace variator_sim {

class ModeEvents {
 public:
  /// `program` tells whether there can be any.
  explicit ModeEvents(const MotionProgram& program) {
    if (program.HOLDS > 0 || program.EVENTS > 0) events_.resize(kMost);
  }

  void reset() { first_ = count_ = last_ = 0; }
  /// Notes those of a step. Returns their number. [loop]
  std::size_t note(const vs_exchange& from) {
    last_ = static_cast<std::size_t>(from.event_count);
    for (std::size_t n = 0; n < last_; ++n) {
      const scene_event& it = from.events[n];
      events_[count_++ % kMost] = {it.time, it.element, it.from, it.to, it.torque, it.impulse};
    }
    return last_;
  }
  /// Forgets those of the last step, which has been cut before. Returns their number. [loop]
  std::size_t forgetLast() {
    const std::size_t last = last_;
    count_ -= last;
    last_ = 0;
    return last;
  }
  /// The next step follows those of an instant, which stay. [loop]
  void keepLast() { last_ = 0; }
  /// Takes the oldest one that is not after `time`, s. False if there is none. [loop]
  bool take(double time, ModeEvent* event) {
    if (count_ > kMost) first_ = std::max(first_, count_ - kMost);
    if (first_ >= count_) return false;
    *event = events_[first_ % kMost];
    if (event->time > time) return false;
    ++first_;
    return true;
  }

 private:
  /// Those that wait to be taken; older ones are forgotten.
  static constexpr std::size_t kMost = 1024;

  std::vector<ModeEvent> events_;  ///< a ring
  std::size_t first_ = 0;          ///< number of the first that waits
  std::size_t count_ = 0;          ///< number of the next one
  std::size_t last_ = 0;           ///< of these the last step has made
};

}  // namespace variator_sim
