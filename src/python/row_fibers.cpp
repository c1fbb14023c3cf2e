#include "python/row_fibers.h"

#include <algorithm>
#include <boost/context/protected_fixedsize_stack.hpp>
#include <utility>

namespace variator_sim::python {

void RowFibers::run(const std::function<void()>& body) {
  // Bytes; reading a scene with nested formulas needs so much.
  constexpr std::size_t kStack = 4 << 20;
  for (Lane& lane : fibers_) {
    lane.fiber = Fiber(std::allocator_arg, boost::context::protected_fixedsize_stack(kStack),
                       [&lane, &body](Fiber&& caller) {
                         lane.caller = std::move(caller);
                         try {
                           body();
                         } catch (...) {
                           lane.error = std::current_exception();
                         }
                         return std::move(lane.caller);
                       });
  }
  const auto isAlive = [](const Lane& lane) { return static_cast<bool>(lane.fiber); };
  while (std::any_of(fibers_.begin(), fibers_.end(), isAlive)) {
    for (running_ = 0; running_ < kCount; ++running_) {
      Lane& lane = fibers_[static_cast<std::size_t>(running_)];
      if (isAlive(lane) && lane.series == nullptr) lane.fiber = std::move(lane.fiber).resume();
    }
    // All live fibers wait now.
    std::array<MotionSeries*, kCount> wanted{};
    bool any = false;
    for (std::size_t i = 0; i < fibers_.size(); ++i) {
      wanted[i] = fibers_[i].series;
      any = any || wanted[i] != nullptr;
    }
    if (!any) continue;
    const std::array<bool, kCount> have_ended = lanes_->make(wanted);
    for (std::size_t i = 0; i < fibers_.size(); ++i) {
      if (have_ended[i]) fibers_[i].series = nullptr;
    }
  }
  for (Lane& lane : fibers_) {
    if (lane.error) std::rethrow_exception(std::exchange(lane.error, nullptr));
  }
}

bool RowFibers::make(MotionSeries& series) {
  if (lanes_ == nullptr || !lanes_->fits(series)) return false;
  Lane& lane = fibers_[static_cast<std::size_t>(running_)];
  lane.series = &series;
  lane.caller = std::move(lane.caller).resume();
  return true;
}

void RowFibers::fetch(MotionSeries& series, int begin, int end) {
  lanes_->fetch(series, running_, begin, end);
}

}  // namespace variator_sim::python
