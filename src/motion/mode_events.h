/// Changes of modes, and events of the scene, until they are taken.
#pragma once

#include <algorithm>
#include <boost/circular_buffer.hpp>
#include <cstdint>
#include <utility>

#include "motion_program/motion_steps.h"
#include "variator_sim/status.h"

namespace variator_sim {

class ModeEvents {
 public:
  /// `program` tells whether there can be any.
  explicit ModeEvents(const MotionProgram& program)
      : events_(program.HOLDS > 0 || program.EVENTS > 0 ? kMost : 0) {}

  void reset() {
    events_.clear();
    last_ = 0;
  }
  /// From now on all of them wait, for which notes allocate.
  void keepAll() { keeps_all_ = true; }
  /// Number of those that were forgotten before they were taken. [loop]
  std::uint64_t lostCount() const { return lost_; }
  /// Notes those of a step. Returns their number. [loop]
  std::size_t note(const vs_exchange& from) {
    last_ = static_cast<std::size_t>(from.event_count);
    for (std::size_t n = 0; n < last_; ++n) {
      const scene_event& it = from.events[n];
      if (events_.full() && keeps_all_) events_.set_capacity(2 * events_.capacity());
      if (events_.full()) ++lost_;
      events_.push_back({it.time, it.element, it.from, it.to, it.torque, it.impulse});
    }
    return last_;
  }
  /// Forgets those of the last step, which has been cut before. Returns their number. [loop]
  std::size_t forgetLast() {
    events_.erase_end(std::min(last_, events_.size()));
    return std::exchange(last_, 0);
  }
  /// The next step follows those of an instant, which stay. [loop]
  void keepLast() { last_ = 0; }
  /// Takes the oldest one that is not after `time`, s. False if there is none. [loop]
  bool take(double time, ModeEvent* event) {
    if (events_.empty() || events_.front().time > time) return false;
    *event = events_.front();
    events_.pop_front();
    return true;
  }

 private:
  /// Those that wait to be taken; older ones are forgotten unless all are kept.
  static constexpr std::size_t kMost = 1024;

  boost::circular_buffer<ModeEvent> events_;
  std::size_t last_ = 0;  ///< of these the last step has made
  std::uint64_t lost_ = 0;
  bool keeps_all_ = false;
};

}  // namespace variator_sim
