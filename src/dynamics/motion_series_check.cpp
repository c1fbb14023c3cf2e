// Compares the machine code of a motion's series with the interpreter.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "dynamics/motion_series.h"

namespace variator_sim {

namespace {

/// Number of states, some near 0, at which code has to agree with the interpreter.
constexpr int kStates = 6;
constexpr double kFar = 1e300;  // s

bool isSame(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), areSameBits);
}

}  // namespace

bool MotionSeries::agreesWithInterpreter() {
  keepSamples();
  const SampleTable table = table_;
  const bool is_same = givesSameNumbers();
  table_ = table;
  return is_same;
}

bool MotionSeries::givesSameNumbers() {
  for (int n = 0; n < kStates; ++n) {
    const std::vector<double> computed = expandAt(n);
    std::vector<OrderCode> codes;
    codes.swap(codes_);
    const BeginCode begin_code = std::exchange(begin_code_, nullptr);
    const StepCodes step_codes = std::exchange(step_codes_, StepCodes{});
    const bool is_same = isSame(expandAt(n), computed);
    codes_.swap(codes);
    begin_code_ = begin_code;
    step_codes_ = step_codes;
    if (!is_same) return false;
  }
  return true;
}

void MotionSeries::interpret() {
  codes_.clear();
  begin_code_ = nullptr;
  step_codes_ = {};
  library_ = nullptr;
}

void MotionSeries::setAside(int state, double* x) const {
  for (int i = 0; i < 3 * S; ++i) {
    x[i] = (state % 2 == 0 ? 20.0 : 0.5) * std::abs(std::sin(1.0 + 7.3 * state + 3.1 * i));
  }
}

void MotionSeries::stepAside(int state, double limit, const std::function<void()>& code) {
  keepSamples();
  struct Aside final : StepsTogether {
    explicit Aside(const std::function<void()>& its_code) : code(its_code) {}
    bool make(MotionSeries& /*series*/) override {
      code();
      return true;
    }
    void fetch(MotionSeries& /*series*/, int /*from*/, int /*to*/) override {}
    const std::function<void()>& code;
  } aside(code);
  StepsTogether* const usual = std::exchange(together_, code ? &aside : nullptr);
  double x[3 * kMaxShafts];
  setAside(state, x);
  forgetNext();
  const double relative = scene_.solver.relative_tolerance;
  const double t = 0.37 * state;
  const double length = 0.01 * (1 + state);
  const Reach reach{kFar, t + limit, limit, 1 + state % 3, state % 2 == 0};
  stride(t, x, {false, length, length, relative, relative, 0.5, reach});
  fetched_ = kMostSampled;
  forgetNext();
  together_ = usual;
}

std::vector<double> MotionSeries::expandAt(int state) {
  double x[3 * kMaxShafts];
  setAside(state, x);
  std::vector<double> coefficients;
  const int order = last_order_;
  if (!begin(0.37 * state, x, 0.0625, order)) return coefficients;
  while (this->order() < order && extendTo(this->order() + 1)) {
    for (int i = 0; i < S; ++i) {
      coefficients.push_back(acceleration(i)[this->order()]);
      coefficients.push_back(torque(i)[this->order()]);
    }
  }
  if (makes_whole_steps_ && this->order() == order) {
    stepAside(state, state % 3 == 2 ? 0.001 : 1.0);
    if (step_.refused == 0.0) {
      coefficients.insert(coefficients.end(), step_.x_new, step_.x_new + 3 * S);
      coefficients.insert(coefficients.end(), step_.eta, step_.eta + S);
      coefficients.push_back(step_.taken);
      coefficients.push_back(step_.error);
      Sample sample;
      std::uint64_t unused = 0;
      if (calcSample(stamp_, step_.end, step_.time + 0.3 * step_.taken, &unused, &sample)) {
        coefficients.insert(coefficients.end(), sample.acceleration, sample.acceleration + S);
        coefficients.insert(coefficients.end(), sample.reaction_torque_rate,
                            sample.reaction_torque_rate + S);
      }
    }
  }
  return coefficients;
}

}  // namespace variator_sim
