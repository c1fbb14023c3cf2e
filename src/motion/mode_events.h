/// Changes of modes, and events of the scene, until they are taken.
#pragma once

#include <cstdint>
#include <utility>
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
  /// From now on all of them wait, for which notes allocate.
  void keepAll() { keeps_all_ = true; }
  /// Number of those that were forgotten before they were taken. [loop]
  std::uint64_t lostCount() const { return lost_; }
  /// Notes those of a step. Returns their number. [loop]
  std::size_t note(const vs_exchange& from) {
    last_ = static_cast<std::size_t>(from.event_count);
    for (std::size_t n = 0; n < last_; ++n) {
      const scene_event& it = from.events[n];
      if (keeps_all_ && count_ - first_ == events_.size()) grow();
      events_[count_++ % events_.size()] = {it.time, it.element, it.from,
                                            it.to,   it.torque,  it.impulse};
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
    if (count_ > first_ + events_.size()) {
      lost_ += count_ - events_.size() - first_;
      first_ = count_ - events_.size();
    }
    if (first_ >= count_) return false;
    *event = events_[first_ % events_.size()];
    if (event->time > time) return false;
    ++first_;
    return true;
  }

 private:
  void grow() {
    std::vector<ModeEvent> all(2 * events_.size());
    for (std::size_t n = first_; n < count_; ++n) all[n % all.size()] = events_[n % events_.size()];
    events_ = std::move(all);
  }

  /// Those that wait to be taken; older ones are forgotten unless all are kept.
  static constexpr std::size_t kMost = 1024;

  std::vector<ModeEvent> events_;  ///< a ring
  std::size_t first_ = 0;          ///< number of the first that waits
  std::size_t count_ = 0;          ///< number of the next one
  std::size_t last_ = 0;           ///< of these the last step has made
  std::uint64_t lost_ = 0;
  bool keeps_all_ = false;
};

}  // namespace variator_sim
