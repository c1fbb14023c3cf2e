#include "motion/stop_message.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "motion/culprit.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

/// Rate that no motion of a machine exceeds, 1/s.
constexpr double kEverFaster = 1e6;

/// Returns a way to smooth a law with modes by `function`.
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
  StopMessage(const Scene& scene, const MotionStatus& status, const StateView& state,
              const Inertia& inertia, std::string function)
      : scene_(scene),
        status_(status),
        state_(state),
        function_(std::move(function)),
        culprits_(scene_, inertia, state_),
        culprit_{status_.torque, status_.constraint} {}

  std::string write();
  /// The element that the text names.
  Element culprit() const { return named_; }

 private:
  std::string explain();
  std::string explainUnderflow();
  std::string explainLostTolerance();
  std::string explainStepLimit();
  std::string describeRunaway() const;
  std::string describeRow() const;

  const Scene& scene_;
  const MotionStatus& status_;
  const StateView state_;
  const std::string function_;  // of the guard, as formulas write it
  const Culprits culprits_;
  Element culprit_;  // from the status, or found
  Element named_;    // in the text
};

std::string StopMessage::explain() {
  switch (status_.reason) {
    case StopReason::kStepUnderflow:
      return "the step fell below the resolution of time: " + explainUnderflow();
    case StopReason::kToleranceTooSmall:
      return explainLostTolerance();
    case StopReason::kStepLimit:
      return explainStepLimit();
    case StopReason::kChattering:
      return "a law jumps, or bends, where the motion turns back at once, so none of its branches "
             "goes on: " +
             smoothLawFor(function_);
    default:
      return explainReason(status_.reason);
  }
}

std::string StopMessage::explainUnderflow() {
  if (!function_.empty()) {
    return "a law changes its branch right here, and no step gets across: " +
           smoothLawFor(function_);
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
  // Stays well below the bound of 50 (step_checks.h): for the current measure, and for the largest
  // one where the law is steepest.
  const Element steepest = culprits_.findSteepest();
  const double most = steepest.exists() ? culprits_.calcUnattainable(scene_, steepest) : 0.0;
  // (Where refusals tell, the measure is not known: a digit less.)
  const double factor = std::max(status_.measure > 0.0 ? status_.measure / 5.0 : 10.0, most / 25.0);
  std::ostringstream text;
  text << "the accelerations follow so steeply from the state that rounding alone moves them by "
          "more than the tolerance";
  if (steepest.exists()) {
    text << ", most by " << describe(scene_, steepest);
    const std::string remedy = culprits_.findRemedy(steepest, factor);
    if (!remedy.empty()) text << ": " << remedy << " would not";
  }
  culprit_ = {};  // already in the text
  named_ = steepest;
  const SolverSettings& solver = scene_.solver;
  const double relative = std::min(0.1, toOneDigit(factor * solver.relative_tolerance, true));
  text << "; otherwise " << assign("solver/relative_tolerance", relative);
  if (solver.absolute_tolerance > 0.0) {
    const double absolute = toOneDigit(factor * solver.absolute_tolerance, true);
    text << " with " << assign("solver/absolute_tolerance", absolute);
  }
  if (scene_.principle == Principle::kGauss) {
    text << " or 'principle: generalized_gauss', which integrates the accelerations"
         << (scene_.constraints.empty()
                 ? " (without a constraint both principles give the same motion)"
                 : " (another motion where C turns)");
  }
  if (status_.measure > 0.0)
    text << " (4 roundings of the state make " << status_.measure << " tolerances)";
  return text.str();
}

std::string StopMessage::explainStepLimit() {
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
  named_ = fastest;
  return fastest.exists() ? text + "; fastest changes " + describe(scene_, fastest) : text;
}

/// Returns the driver of shafts that underflowed at speeds which no machine has.
std::string StopMessage::describeRunaway() const {
  constexpr double kNoMachine = 1e6;  // rad/s
  double fastest = 0.0;
  for (int i = 0; i < scene_.shaftCount(); ++i) {
    fastest = std::max(fastest, std::abs(state_.velocity[i]));
  }
  if (fastest < kNoMachine) return "";
  const TorquePtr* driver = nullptr;
  double greatest = 0.0;
  for (const TorquePtr& torque : scene_.torques) {
    double Q[kMaxShafts] = {};
    torque->addTorque(state_, Q);
    double power = 0.0;
    for (int i = 0; i < scene_.shaftCount(); ++i) power += Q[i] * state_.velocity[i];
    if (power <= greatest) continue;
    greatest = power;
    driver = &torque;
  }
  if (driver == nullptr) return "";
  return "; the shafts run away, driven by torque '" + (*driver)->name() +
         "': is its sign right? (positive accelerates, a load is negative)";
}

std::string StopMessage::describeRow() const {
  double C[kMaxShafts] = {};
  double c0;
  scene_.constraints[static_cast<std::size_t>(status_.constraint)]->calcRow(state_, C, &c0);
  return ", its C = " + formatNumbers(C, scene_.shaftCount());
}

std::string StopMessage::write() {
  std::ostringstream text;
  text << toString(status_.reason) << " at t = " << formatNumber(status_.time)
       << " s: " << explain();
  const int S = scene_.shaftCount();
  const bool lacks_value =
      status_.reason == StopReason::kNonFiniteValue || status_.reason == StopReason::kStepUnderflow;
  if (lacks_value && !culprit_.exists()) culprit_ = findThrower(scene_);
  if (culprit_.exists()) {
    text << "; " << describe(scene_, culprit_);
    named_ = culprit_;
  }
  if (lacks_value && culprit_.exists()) {
    const std::string thrown = describeThrown(scene_, culprit_);
    const bool is_bad = status_.reason == StopReason::kNonFiniteValue;
    const std::string part =
        is_bad && thrown.empty() ? findNonFinitePart(scene_, culprit_, state_) : "";
    if (!thrown.empty()) text << ", whose function threw: " << thrown;
    if (!part.empty()) text << ", its " << part;
  }
  if (status_.constraint >= 0) text << describeRow();
  if (status_.reason == StopReason::kSingularConstraint && status_.constraint >= 0) {
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

/// Returns " residual of 'variator' = 0.1, ..", of each constraint that a start has to satisfy.
std::string listResiduals(const Scene& scene, const Misfit& misfit, const StateView& state) {
  std::string text;
  for (const ConstraintPtr& constraint : scene.constraints) {
    if (constraint->order() > (misfit.of_velocities ? 1 : 2)) continue;
    double C[kMaxShafts];
    text += (text.empty() ? " residual of '" : ", residual of '") + constraint->name() + "' = " +
            formatNumber(misfit.of_velocities ? constraint->calcResidual(state)
                                              : constraint->calcResidualAndJacobian(state, C));
  }
  return text;
}

std::string levelOf(const Misfit& misfit) {
  return misfit.of_velocities ? "velocities" : "accelerations";
}

bool isUncertain(const Misfit& misfit) {
  return misfit.kind == Misfit::Kind::kNotUnique || misfit.kind == Misfit::Kind::kDoubtful;
}

/// Says that no consistent values were found at `near`, the place of the search.
std::string tellNotFound(const Misfit& misfit, const std::string& near,
                         const std::string& residuals) {
  return "no " + levelOf(misfit) + " that satisfy the constraints were found " + near +
         (residuals.empty() ? "" : " (there:" + residuals + ")");
}

/// Returns the residuals, and the values that Newton's projection finds, with `remedy`, their use.
std::string tellNear(const Scene& scene, const Misfit& misfit, const std::string& residuals,
                     const std::string& remedy) {
  return residuals + (residuals.empty() ? "" : ";") + " consistent " + levelOf(misfit) +
         " near them are " + formatNumbers(misfit.nearest, scene.shaftCount()) + " (" + remedy +
         ")";
}

/// Returns the candidates that have the same reaction, or may have.
std::string listCandidates(const Scene& scene, const Misfit& misfit,
                           const LeastReactionSearch& search) {
  std::string text =
      misfit.kind == Misfit::Kind::kNotUnique
          ? "more than one has the least reaction, and they lead to different motions: "
          : "which one has the least reaction is not certain, the constraints have too many like "
            "these: ";
  for (int n = 0; n < search.candidateCount(); ++n) {
    const auto& candidate = search.candidate(n);
    text += (n > 0 ? ", " : "") + formatNumbers(candidate.epsilon, scene.shaftCount()) +
            " with 1/2 R^T J^-1 R = " + formatNumber(candidate.reaction);
  }
  return text + "; give 'initial/acceleration'";
}

}  // namespace

const char* explainReason(StopReason reason) {
  switch (reason) {
    case StopReason::kSingularConstraint:
      return "the derivatives of the constraints by the accelerations have lost rank, so the "
             "principle no longer determines the jerk";
    case StopReason::kNonFiniteValue:
      return "a value is NaN or infinite here or just ahead";
    case StopReason::kStepTooLarge:
      return "the estimated error of one fixed step is a large part of the state: 'solver/step' is "
             "too large for this motion";
    case StopReason::kJumpFailed:
      return "the jump leads to no state on the constraints";
    case StopReason::kTimeExhausted:
      return "simulated time has come to the end of what messages can hold, 136 years: ~reset_time "
             "begins it anew";
    case StopReason::kNoModes:
      return "no modes of the elements that hold go on: rigid ones contradict each other, or "
             "limits that depend on the motion leave none";
    case StopReason::kIndefiniteInertia:
      return "the inertia matrix, which formulas give, is not positive definite here or just ahead";
    case StopReason::kProjectionFailed:
      return "no accelerations that satisfy the constraints were found";
    default:
      return "";
  }
}

std::string describeStop(const Scene& scene, const MotionStatus& status, const StateView& state,
                         const Inertia& inertia, const std::string& function, Element* culprit) {
  StopMessage message(scene, status, state, inertia, function);
  std::string text = message.write();
  if (culprit != nullptr) *culprit = message.culprit();
  return text;
}

std::string describeMisfit(const Scene& scene, const Misfit& misfit, const StateView& state) {
  if (isUncertain(misfit)) {
    return "which accelerations have the least reaction is not certain; give them";
  }
  const std::string values =
      formatNumbers(misfit.of_velocities ? state.velocity : state.acceleration, scene.shaftCount());
  const std::string residuals = listResiduals(scene, misfit, state);
  if (misfit.kind == Misfit::Kind::kNotFound) {
    return tellNotFound(misfit, "near " + values, residuals);
  }
  return "the " + levelOf(misfit) + " " + values +
         " do not satisfy the constraints or the principle:" +
         tellNear(scene, misfit, residuals, "set these, or have them projected");
}

void throwInitialError(const Scene& scene, const Misfit& misfit, const StateView& state,
                       const LeastReactionSearch* search) {
  const bool of_velocities = misfit.of_velocities;
  const std::string residuals = listResiduals(scene, misfit, state);
  std::string text;
  if (isUncertain(misfit)) {
    text = listCandidates(scene, misfit, *search);
  } else if (misfit.kind == Misfit::Kind::kNotFound) {
    const bool is_given = of_velocities || !scene.initial.acceleration.empty();
    const std::string values = formatNumbers(state.acceleration, scene.shaftCount());
    text = tellNotFound(
        misfit,
        is_given ? "near those given" : "from " + values + " rad/s^2; give 'initial/acceleration'",
        residuals);
  } else {
    const bool by_principle = scene.principle == Principle::kGauss && !of_velocities;
    text = formatNumbers(of_velocities ? state.velocity : state.acceleration, scene.shaftCount()) +
           (by_principle ? " is not what the principle 'gauss' gives:"
                         : " does not satisfy the constraints:") +
           tellNear(scene, misfit, residuals,
                    "write these, or set 'initial/project: true' to start there");
  }
  throw SceneError(of_velocities ? "initial/velocity" : "initial/acceleration",
                   text + scene.extreme_numbers);
}

}  // namespace variator_sim
