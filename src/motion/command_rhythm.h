/// When the next command may be expected.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

namespace variator_sim {

/// A controller commands at regular instants, as a rule. A step that ends where the next command
/// comes need not be made again up to there. After two equal intervals a third one is expected. If
/// nothing comes then, the motion has made one step more than it had to.
///
/// Instants are compared in whole nanoseconds, which the node and command files keep: what is
/// expected is the very double that a command then comes at. Other instants have no rhythm.
class CommandRhythm {
 public:
  void reset() { *this = CommandRhythm{}; }

  /// A command has changed the motion at `time`, s. [loop]
  void note(double time) {
    const std::int64_t instant = toInstant(time);
    if (instant == last_) return;
    const std::int64_t interval = instant > last_ && last_ >= 0 ? instant - last_ : 0;
    next_ = interval > 0 && interval == interval_ ? toTime(instant + interval) : kNever;
    interval_ = interval;
    last_ = instant;
  }

  /// s; infinity when none is expected. It may have passed. [loop]
  double next() const { return next_; }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  static constexpr std::int64_t kNone = -1;

  static double toTime(std::int64_t instant) { return static_cast<double>(instant) / 1e9; }
  /// kNone where `time` is not the double nearest to a whole number of ns.
  static std::int64_t toInstant(double time) {
    constexpr double kLast = 4503599.0;  // s: up to 2^52 ns a double holds halves of ns, too
    if (!(time >= 0.0 && time < kLast)) return kNone;
    const std::int64_t instant = std::llround(time * 1e9);
    return toTime(instant) == time ? instant : kNone;
  }

  std::int64_t last_ = kNone;
  std::int64_t interval_ = 0;
  double next_ = kNever;
};

}  // namespace variator_sim
