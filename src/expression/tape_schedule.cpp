#include "tape_schedule.h"

#include <algorithm>
#include <cstddef>
#include <queue>
#include <utility>

#include "instruction_set.h"

namespace variator_sim::expression {

namespace {

std::size_t at(int index) {
  return static_cast<std::size_t>(index);
}

// Approximate latencies, in cycles, until another instruction can use the result. All results go
// through memory.
constexpr int kThroughMemory = 8;
int latencyOf(Arithmetic operation) {
  return operation == kOver ? 13 : 3;
}

int latencyOf(int code) {
  if (code < kTriadBase) {
    return kThroughMemory + latencyOf(static_cast<Arithmetic>(code - kPairBase));
  }
  if (code < kQuadBase) {
    const int form = (code - kTriadBase) % kForms;
    const int o1 = (code - kTriadBase) / kForms;
    const bool divides = form == kThenOver || form == kOverThen;
    return kThroughMemory + latencyOf(static_cast<Arithmetic>(o1)) +
           latencyOf(divides ? kOver : kPlus);
  }
  if (code < kArithmeticCount) {
    const int operations = code - kQuadBase;
    const auto o1 = static_cast<Arithmetic>(operations / 16);
    const auto o2 = static_cast<Arithmetic>(operations / 4 % 4);
    const auto o3 = static_cast<Arithmetic>(operations % 4);
    return kThroughMemory + std::max(latencyOf(o1), latencyOf(o3)) + latencyOf(o2);
  }
  switch (code) {
    case kCodeNegate:
    case kCodeAbs:
    case kCodeSign:
    case kCodeMin:
    case kCodeMax:
    case kCodeSelect:
    case kCodeWhereFinite:
      return kThroughMemory + 3;
    case kCodeSqrt:
      return kThroughMemory + 20;
    default:
      // This is less than a call takes: most calls read the time alone, which is known before the
      // state, and would delay steps that wait for the state.
      return kThroughMemory + 15;
  }
}

class Scheduler {
 public:
  explicit Scheduler(const std::vector<Step>& steps) : steps_(steps) {
    findReaders();
    findPriorities();
  }

  std::vector<int> run() {
    ready_.resize(kCodeCount);
    for (int i = 0; i < count(); ++i) {
      if (steps_[at(i)].code >= 0 && waits_for_[at(i)] == 0) makeReady(i);
    }
    while (!codes_.empty()) {
      const auto [priority, code] = codes_.top();
      codes_.pop();
      // Its steps may have been scheduled with earlier ones.
      if (ready_[at(code)].empty() || ready_[at(code)].top().first != priority) continue;
      takeRun(code);
    }
    return std::move(order_);
  }

 private:
  using Ranked = std::pair<int, int>;  // priority and its owner

  int count() const { return static_cast<int>(steps_.size()); }

  void findReaders() {
    std::vector<int> step_of(steps_.size(), -1);  // step that computes each node
    for (int i = 0; i < count(); ++i) {
      if (steps_[at(i)].code < 0) continue;
      for (const int result : steps_[at(i)].results) {
        if (result >= 0) step_of[at(result)] = i;
      }
    }
    readers_.resize(steps_.size());
    waits_for_.assign(steps_.size(), 0);
    for (int i = 0; i < count(); ++i) {
      const Step& step = steps_[at(i)];
      if (step.code < 0) continue;
      for (int k = 0; k < step.operand_count; ++k) {
        const int before = step_of[at(step.operands[k])];
        if (before < 0) continue;
        readers_[at(before)].push_back(i);
        ++waits_for_[at(i)];
      }
    }
  }

  /// Finds the longest chain from each step. Readers come after their operands.
  void findPriorities() {
    priority_.assign(steps_.size(), 0);
    for (int i = count() - 1; i >= 0; --i) {
      if (steps_[at(i)].code < 0) continue;
      int behind = 0;
      for (const int reader : readers_[at(i)]) behind = std::max(behind, priority_[at(reader)]);
      priority_[at(i)] = behind + latencyOf(steps_[at(i)].code);
    }
  }

  void makeReady(int i) {
    const int code = steps_[at(i)].code;
    // Among equal priorities the first step wins.
    ready_[at(code)].emplace(priority_[at(i)], -i);
    codes_.emplace(priority_[at(i)], code);
  }

  /// Schedules the most urgent steps of one code.
  void takeRun(int code) {
    auto& ready = ready_[at(code)];
    for (int n = 0; n < kLongestRun && !ready.empty(); ++n) {
      const int i = -ready.top().second;
      ready.pop();
      order_.push_back(i);
      for (const int reader : readers_[at(i)]) {
        if (--waits_for_[at(reader)] == 0) makeReady(reader);
      }
    }
    if (!ready.empty()) codes_.emplace(ready.top().first, code);
  }

  const std::vector<Step>& steps_;
  std::vector<std::vector<int>> readers_;
  std::vector<int> waits_for_;
  std::vector<int> priority_;
  std::vector<std::priority_queue<Ranked>> ready_;  ///< by code
  std::priority_queue<Ranked> codes_;               ///< by their most urgent step, once or more
  std::vector<int> order_;
};

}  // namespace

std::vector<int> schedule(const std::vector<Step>& steps) {
  return Scheduler(steps).run();
}

}  // namespace variator_sim::expression
