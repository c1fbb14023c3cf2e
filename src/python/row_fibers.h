/// Runs rows of a sweep on fibers of one thread, so that SIMD lanes make several steps at a time.
///
/// There is one fiber per lane, and each runs rows one after the other. A fiber waits when its
/// motion needs a step that may be made in a lane; when all fibers wait, the lanes make the steps
/// of all. Rows do not depend on each other: their results are the same to the bit.
#pragma once

#include <array>
#include <boost/context/fiber.hpp>
#include <exception>
#include <functional>
#include <memory>

#include "dynamics/series_lanes.h"
#include "variator_sim/steps_together.h"

namespace variator_sim::python {

/// The fibers of one thread.
class RowFibers final : public StepsTogether {
 public:
  /// Sets the lanes. Motions register with Simulation::makeStepsWith and share the lanes' machine
  /// code.
  void setLanes(std::shared_ptr<SeriesLanes> lanes) { lanes_ = std::move(lanes); }
  bool hasLanes() const { return lanes_ != nullptr; }

  /// Calls `body` in each fiber; returns when all have ended. Rethrows an exception of a fiber.
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
