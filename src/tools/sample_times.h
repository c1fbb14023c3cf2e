/// The instants at which an offline run is sampled.
#pragma once

#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace variator_sim {

/// A walk over ascending instants; it never holds a rate's instants in memory.
class SampleTimes {
 public:
  /// `begin`, then k / rate for all whole k between `begin` and `end`, then `end` itself.
  static SampleTimes atRate(double rate, double begin, double end) {
    SampleTimes times;
    times.rate_ = rate;
    times.end_ = end;
    times.index_ = static_cast<std::uint64_t>(begin * rate);
    while (static_cast<double>(times.index_) / rate <= begin) ++times.index_;
    times.current_ = begin;
    return times;
  }
  /// Uses the given instants, which must be ascending.
  static SampleTimes at(std::vector<double> instants) {
    SampleTimes times;
    times.instants_ = std::move(instants);
    times.takeInstant();
    return times;
  }

  /// Ends the run sooner, at `end`; later instants are not sampled. A rate samples the end.
  void endAt(double end) {
    end_ = end;
    if (current_ <= end) return;
    current_ = rate_ > 0.0 ? end : kNever;
    instants_.clear();
  }

  /// Next instant to sample; infinity after the last.
  double current() const { return current_; }
  void next() {
    if (rate_ == 0.0) {
      takeInstant();
    } else if (current_ >= end_) {
      current_ = kNever;
    } else {
      takeMultiple();
    }
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  SampleTimes() = default;

  void takeInstant() { current_ = index_ < instants_.size() ? instants_[index_++] : kNever; }

  // A division: k / 100 is the double nearest to the decimal that a user would write, k * 0.01 is
  // not.
  void takeMultiple() {
    const double instant = static_cast<double>(index_++) / rate_;
    current_ = instant < end_ ? instant : end_;
  }

  double rate_ = 0.0;
  double end_ = 0.0;
  std::vector<double> instants_;
  std::uint64_t index_ = 0;
  double current_ = kNever;
};

}  // namespace variator_sim
