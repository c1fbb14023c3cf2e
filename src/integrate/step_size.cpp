#include "integrate/step_size.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

bool StepSize::letStepperChoose() {
  const double limit = std::min(step_.settings.maximum_step, endOfReach() - start_.time);
  const double length = step_.stepper->chooseStep(system_, start_, limit);
  is_chosen_ = length > 0.0;
  if (is_chosen_) step_.next_length = length;
  return is_chosen_;
}

double StepSize::chooseFirst() {
  const auto size = [&](const State& v) {
    double largest = 0.0;
    for (int i = 0; i < v.size(); ++i) {
      largest = std::max(largest, std::abs(v[i]) / tolerance_.of(end_.x[i]));
    }
    return largest;
  };
  const double d0 = size(end_.x);
  const double d1 = size(end_.dxdt);
  double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
  h0 = std::min(h0, step_.settings.maximum_step);
  State x1(system_.size());
  State change(system_.size());
  for (int i = 0; i < x1.size(); ++i) x1[i] = end_.x[i] + h0 * end_.dxdt[i];
  system_.noteBase(end_.time, end_.x, end_.dxdt);
  system_(x1, change, end_.time + h0);
  for (int i = 0; i < x1.size(); ++i) change[i] -= end_.dxdt[i];
  const double d2 = size(change) / h0;
  const double largest = std::max(d1, d2);
  // A step of the implicit schemes, whose order is high, is judged anyway, and a second step costs
  // more than one that is rejected early. (What it errs along psi stays where stages do not keep
  // it.)
  const bool may_be_rejected = step_.stepper->isImplicit() && system_.keepsConstraintsInStages();
  const double aim = may_be_rejected ? 10.0 : 0.01;
  double h1 = largest <= 1e-15 ? std::max(1e-6, h0 * 1e-3)
                               : std::pow(aim / largest, 1.0 / step_.stepper->errorOrder());
  if (!std::isfinite(h1)) h1 = 1e-3 * h0;  // the Euler step left the domain
  // Without an absolute tolerance nothing that starts from 0 is ever slow enough: let it try.
  h1 = std::max(h1, 1e-6 * h0);
  return std::min({100.0 * h0, h1, step_.settings.maximum_step});
}

double StepSize::endOfReach() const {
  const double now = step_.absolute(start_.time);
  const double instant = drivetrain_.nextInstant(now + 2.0 * shortestStep(now));
  const double segment_end = std::min(drivetrain_.inputSegmentEnd(), step_.relative(instant));
  const double expected = rhythm_.next();
  const double rounding = shortestStep(expected);  // not more than this lies between equals
  const bool is_ahead = expected - now > rounding;
  return is_ahead && step_.relative(expected) <= segment_end + rounding ? step_.relative(expected)
                                                                        : segment_end;
}

double StepSize::growth(double norm, double estimate) {
  // A step made with more ease than this does not shorten the next one for that alone.
  constexpr double kEasy = 0.75;
  // A stepper that knows the next step beforehand needs no guess of it.
  if (is_chosen_) return 1.0;
  const double ease = step_.stepper->ease();
  // A check may keep the step from growing, but not make it shorter than the estimate alone would.
  const double least = estimate < norm ? std::min(1.0, ease * control_.growthBy(estimate)) : 0.0;
  const double growth = control_.growth(norm);
  const double factor = std::max(least, ease * growth);
  // The part of the estimate that Newton's iteration leaves does not fall with the step, either.
  return ease > kEasy ? std::max(factor, std::min(1.0, growth)) : factor;
}

}  // namespace variator_sim
