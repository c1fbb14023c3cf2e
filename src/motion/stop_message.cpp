#include "motion/stop_message.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "motion/culprit.h"

namespace variator_sim {

namespace {

/// What no motion of a machine does, 1/s.
constexpr double kEverFaster = 1e6;

std::string assign(const std::string& path, double value) {
  return "'" + path + ": " + formatNumber(value) + "'";
}

/// How a law that branches by `function` is made smooth.
std::string smoothLawFor(const std::string& function) {
  const std::string sign = "tanh(w/0.01) for sign(w)";
  const std::string abs = "sqrt(x^2+1e-6) for abs(x)";
  const std::string friction = "variator_sim/Friction for dry friction";
  if (function == "if") {
    return "both branches of its 'if' lead back over the threshold, and laws have no memory for a "
           "hysteresis: blend them over a width, b + (a - b)*(1 - tanh((x - y)/width))/2 for "
           "if(x < y, a, b)";
  }
  std::string law = sign + ", " + abs + ", " + friction;
  if (function == "sign") law = sign + ", " + friction;
  if (function == "abs") law = abs;
  if (function == "min") law = "(a + b - sqrt((a - b)^2+1e-6))/2 for min(a, b)";
  if (function == "max") law = "(a + b + sqrt((a - b)^2+1e-6))/2 for max(a, b)";
  return "a smooth law helps (" + law + ")";
}

class StopMessage {
 public:
  explicit StopMessage(Motion& motion)
      : motion_(motion),
        scene_(motion.scene()),
        status_(motion.status()),
        state_(motion.present()),
        culprits_(scene_, motion.inertia(), state_),
        culprit_{status_.torque, status_.constraint} {}

  std::string write();

 private:
  std::string explain();
  std::string explainUnderflow();
  std::string explainLostTolerance();
  std::string explainStepLimit() const;
  std::string describeRunaway();
  /// By torques, or constraints where they are not at fault themselves.
  std::string describeCulprit() const {
    return culprit_.exists() ? describe(scene_, culprit_) : "";
  }
  std::string functionOfGuard() const {
    return status_.guard < 0 ? "" : motion_.guard(status_.guard).function();
  }

  Motion& motion_;
  const Scene& scene_;
  const MotionStatus& status_;
  const StateView state_;
  const Culprits culprits_;
  Element culprit_;
};

std::string StopMessage::explain() {
  switch (status_.reason) {
    case StopReason::kNone:
      return "";
    case StopReason::kSingularConstraint:
      return "the derivatives of the constraints by the accelerations have lost rank, so the "
             "principle no longer determines the jerk";
    case StopReason::kStepUnderflow:
      return "the step fell below the resolution of time: " + explainUnderflow();
    case StopReason::kNonFiniteValue:
      return "a value is NaN or infinite here or just ahead";
    case StopReason::kStepTooLarge:
      return "the estimated error of one fixed step is a large part of the state: 'solver/step' is "
             "too large for this motion";
    case StopReason::kToleranceTooSmall:
      return explainLostTolerance();
    case StopReason::kStepLimit:
      return explainStepLimit();
    case StopReason::kJumpFailed:
      return "the jump leads to no state on the constraints";
    case StopReason::kChattering:
      return "a law jumps, or bends, where the motion turns back at once, so none of its branches "
             "goes on: " +
             smoothLawFor(functionOfGuard());
    case StopReason::kTimeExhausted:
      return "simulated time has come to the end of what messages can hold, 136 years: ~reset_time "
             "begins it anew";
    case StopReason::kProjectionFailed:
      return "no accelerations that satisfy the constraints were found";
  }
  return "";
}

std::string StopMessage::explainUnderflow() {
  if (status_.guard >= 0) {
    return "a law changes its branch right here, and no step gets across: " +
           smoothLawFor(functionOfGuard());
  }
  std::string text = status_.measure > kEverFaster
                         ? "the motion changes ever faster here"
                         : "no step, however short, is within the tolerance here";
  const StepperKind stepper = scene_.solver.stepper;
  if (stepper == StepperKind::kTaylor || stepper == StepperKind::kTaylorFixed) {
    text += ", or has no power series here (w^1.5 at w = 0), where 'solver/stepper: auto' goes on";
  }
  const std::string runaway = describeRunaway();
  if (runaway.empty()) culprit_ = culprits_.findFastest(kEverFaster);
  return text + runaway;
}

std::string StopMessage::explainLostTolerance() {
  // Far enough below the bound of 50 (step_checks.h): what the motion shows now, and what it may
  // come to where the law is steepest.
  culprit_ = culprits_.findSteepest();
  const double most = culprit_.exists() ? culprits_.calcUnattainable(culprit_) : 0.0;
  const double factor = std::max(status_.measure / 5.0, most / 25.0);
  std::ostringstream text;
  text << "the accelerations follow so steeply from the state that rounding alone moves them by "
          "more than the tolerance";
  if (culprit_.exists()) {
    text << ", most by " << describeCulprit();
    const std::optional<Remedy> remedy = culprits_.findRemedy(culprit_, factor);
    if (remedy) {
      text << ": " << assign(remedy->path, remedy->then) << " (it is " << formatNumber(remedy->now)
           << ") would not";
    }
    culprit_ = {};
  }
  const SolverSettings& solver = scene_.solver;
  text << "; otherwise "
       << assign("solver/relative_tolerance",
                 std::min(0.1, toOneDigit(factor * solver.relative_tolerance, true)));
  if (solver.absolute_tolerance > 0.0) {
    text << " with "
         << assign("solver/absolute_tolerance",
                   toOneDigit(factor * solver.absolute_tolerance, true));
  }
  text << " or 'principle: generalized_gauss', which integrates the accelerations";
  text << (scene_.constraints.empty()
               ? " (without a constraint both principles give the same motion)"
               : " (another motion where C turns)");
  text << " (4 roundings of the state make " << status_.measure << " tolerances)";
  return text.str();
}

std::string StopMessage::explainStepLimit() const {
  constexpr double kMost = std::numeric_limits<int>::max();
  std::string text = "more steps than 'solver/maximum_steps' (" +
                     std::to_string(scene_.solver.maximum_steps) + ") within one simulated second";
  const double needed = toOneDigit(1.1 * status_.measure, true);
  if (needed < kMost) {
    text += "; at the pace of these " + assign("solver/maximum_steps", needed) + " would do";
  } else if (status_.measure > 0.0) {
    text += "; at the pace of these no number of steps would do";
  }
  const Element fastest = culprits_.findFastest(0.0);
  return fastest.exists() ? text + "; fastest changes " + describe(scene_, fastest) : text;
}

/// Of a step that underflowed at speeds which no machine has: who drives there.
std::string StopMessage::describeRunaway() {
  constexpr double kNoMachine = 1e6;  // rad/s
  double fastest = 0.0;
  for (int i = 0; i < scene_.shaftCount(); ++i) {
    fastest = std::max(fastest, std::abs(state_.velocity[i]));
  }
  if (fastest < kNoMachine) return "";
  const std::vector<std::string>& names = motion_.quantities().names(QuantityGroup::kElements);
  std::vector<double> values(names.size());
  motion_.calcQuantities(QuantityGroup::kElements, values.data());
  const std::string power = "/power";
  std::string driver;
  double greatest = 0.0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::size_t end = names[i].size() - std::min(names[i].size(), power.size());
    if (names[i].compare(end, power.size(), power) != 0 || values[i] <= greatest) continue;
    greatest = values[i];
    driver = names[i].substr(0, end);
  }
  if (driver.empty()) return "";
  return "; the shafts run away, driven by torque '" + driver +
         "': is its sign right? (positive accelerates, a load is negative)";
}

std::string StopMessage::write() {
  std::ostringstream text;
  text << toString(status_.reason) << " at t = " << formatNumber(status_.time)
       << " s: " << explain();
  const int S = scene_.shaftCount();
  if (culprit_.exists()) text << "; " << describeCulprit();
  if (status_.reason == StopReason::kNonFiniteValue && culprit_.exists()) {
    const std::string part = culprits_.findNonFinitePart(culprit_);
    if (!part.empty()) text << ", its " << part;
  }
  if (status_.constraint >= 0) {
    double C[kMaxShafts] = {};
    motion_.calcConstraintRow(status_.constraint, C);
    text << ", its C = " << formatNumbers(C, S);
  }
  if (status_.reason == StopReason::kSingularConstraint) {
    text << " (" << status_.measure << " of its scale)";
  }
  if (status_.reason == StopReason::kStepTooLarge) {
    text << " (the error is " << status_.measure << " of it, 'solver/step' "
         << formatNumber(scene_.solver.step) << " s)";
  }
  text << "; last good state: angle = " << formatNumbers(state_.angle, S)
       << " rad, velocity = " << formatNumbers(state_.velocity, S)
       << " rad/s, acceleration = " << formatNumbers(state_.acceleration, S) << " rad/s^2"
       << scene_.extreme_numbers;
  return text.str();
}

}  // namespace

std::string describeStop(Motion& motion) {
  return motion.status().ok() ? "" : StopMessage(motion).write();
}

}  // namespace variator_sim
