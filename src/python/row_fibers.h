/// Rows of a sweep in turn, in one thread, so that their steps are made several at a time.
///
/// Each of the fibers, as many as there are lanes, runs rows, one after the other. Where a row's
/// motion wants a step that may be made together with others, its fiber waits; when all of them
/// wait, the lanes make the steps of all. No row knows of the others, and none gets another bit by
/// them.
#pragma once

#include <array>
#include <boost/context/fiber.hpp>
#include <exception>
#include <functional>
#include <memory>

#include "dynamics/series_lanes.h"
#include "variator_sim/steps_together.h"

namespace variator_sim::python {

/// Of one thread.
class RowFibers final : public StepsTogether {
 public:
  /// Motions have to be told of this (Simulation::makeStepsWith) for their steps to be made
  /// together, and share the machine code that the lanes belong to.
  void setLanes(std::shared_ptr<SeriesLanes> lanes) { lanes_ = std::move(lanes); }
  bool hasLanes() const { return lanes_ != nullptr; }

  /// Calls `body` in each fiber; returns when all have ended. What one of them throws is thrown.
  void run(const std::function<void()>& body);

  bool make(MotionSeries& series) override;
  void fetch(MotionSeries& series, int begin, int end) override;

 private:
  using Fiber = boost::context::fiber;
  static constexpr int kCount = SeriesLanes::kLanes;

  struct Lane {
    Fiber fiber;                     ///< while it waits
    Fiber caller;                    ///< while it runs
    MotionSeries* series = nullptr;  ///< of the step that it waits for
    std::exception_ptr error;
  };

  std::shared_ptr<SeriesLanes> lanes_;
  std::array<Lane, kCount> fibers_;
  int running_ = 0;
};

}  // namespace variator_sim::python
