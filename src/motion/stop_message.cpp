#include "motion/stop_message.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "motion/culprit.h"
#include "motion/motion.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

/// Rate that no motion of a machine exceeds, 1/s.
constexpr double kEverFaster = 1e6;
/// The shortest step reaches no further than this multiple of the distance at which a search ahead
/// begins.
constexpr double kReach = 1e5;

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

/// Returns the element that a status names, or null.
const Law* elementOf(const Scene& scene, const MotionStatus& status) {
  if (status.torque >= 0) return scene.torques[static_cast<std::size_t>(status.torque)].get();
  if (status.constraint < 0) return nullptr;
  return scene.constraints[static_cast<std::size_t>(status.constraint)].get();
}

class StopMessage {
 public:
  explicit StopMessage(Motion& motion)
      : motion_(motion),
        scene_(motion.scene),
        program_(motion.program),
        status_(motion.status),
        blamed_(elementOf(scene_, status_)),
        function_(findFunction()),
        state_(motion.view()),
        inertia_(scene_.inertia, scene_.inertia_harmonics),
        culprits_(scene_, inertia_, state_),
        culprit_(blamed_) {
    inertia_.update(state_.angle);
  }

  std::string write();
  /// The element that the text names, or null.
  const Law* culprit() const { return named_; }

 private:
  /// Finds the branch at which the motion has stopped, and its element. Returns its function, as
  /// formulas write it, or "".
  std::string findFunction();
  /// Does so for a law that changes its branch within the shortest step of the front, on either
  /// side.
  std::string findBranch();

  std::string explain();
  std::string explainUnderflow();
  std::string explainLostTolerance();
  std::string explainStepLimit();
  std::string describeCulprit();
  std::string describeRunaway() const;
  std::string describeHugeCommands() const;
  std::string describeLastEvent() const;
  std::string describeRigid() const;
  std::string describePast() const;

  Motion& motion_;
  const Scene& scene_;
  SteppedProgram& program_;
  const MotionStatus& status_;
  const Law* blamed_;  ///< by the status, or whose branch it is
  const std::string function_;
  const StateView state_;
  Inertia inertia_;
  const Culprits culprits_;
  const Law* culprit_;          ///< the one blamed, or found
  const Law* named_ = nullptr;  ///< in the text
};

std::string StopMessage::findFunction() {
  if (status_.reason == StopReason::kStepUnderflow) return findBranch();
  const int passed = program_.it.passed;
  if (status_.reason != StopReason::kChattering || passed < 0 ||
      passed >= program_.text().FIRST_EVENT)
    return "";
  const expression::Branch& branch = program_.text().branches()[static_cast<std::size_t>(passed)];
  blamed_ = findOwner(scene_, branch.argument);
  return branch.function;
}

std::string StopMessage::findBranch() {
  blamed_ = nullptr;
  const std::vector<expression::Branch>& branches = program_.text().branches();
  std::vector<expression::Node> arguments;
  arguments.reserve(branches.size());
  for (const expression::Branch& it : branches) arguments.push_back(it.argument);
  const expression::Tape tape(*scene_.graph, arguments);
  motion_.lookAtFront();
  const double reach = kReach * motion_.leastDistance();
  // A motion that runs away in a finite time never has the state so far ahead.
  if (status_.measure * reach > 1.0) return "";
  std::vector<int> signs[3];
  for (int side = -1; side <= 1; ++side) {
    double values[3 * kMaxShafts];
    motion_.goAhead(side * reach, values);
    const double* const arguments_there =
        tape.evaluate(program_.view(values, program_.front() + side * reach));
    for (std::size_t n = 0; n < branches.size(); ++n) {
      signs[side + 1].push_back((arguments_there[n] > 0.0) - (arguments_there[n] < 0.0));
    }
  }
  for (std::size_t n = 0; n < branches.size(); ++n) {
    if (signs[0][n] == signs[1][n] && signs[1][n] == signs[2][n]) continue;
    blamed_ = findOwner(scene_, branches[n].argument);
    if (blamed_ != nullptr) return branches[n].function;
  }
  return "";
}

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
  const Law* const steepest = culprits_.findSteepest();
  const double most = steepest != nullptr ? culprits_.calcUnattainable(*steepest) : 0.0;
  // (Where refusals tell, the measure is not known: a digit less.)
  const double factor = std::max(status_.measure > 0.0 ? status_.measure / 5.0 : 10.0, most / 25.0);
  std::ostringstream text;
  text << "the accelerations follow so steeply from the state that rounding alone moves them by "
          "more than the tolerance";
  if (steepest != nullptr) {
    text << ", most by " << describe(*steepest);
    const std::string remedy = culprits_.findRemedy(*steepest, factor);
    if (!remedy.empty()) text << ": " << remedy << " would not";
  }
  culprit_ = nullptr;  // already in the text
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
  named_ = culprits_.findFastest(0.0);
  return named_ != nullptr ? text + "; fastest changes " + describe(*named_) : text;
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

/// Returns the element to blame, what its function threw or its part that is not finite, and its C.
std::string StopMessage::describeCulprit() {
  std::string text;
  const bool is_bad = status_.reason == StopReason::kNonFiniteValue;
  const bool lacks_value = is_bad || status_.reason == StopReason::kStepUnderflow;
  if (lacks_value && culprit_ == nullptr) culprit_ = findThrower(scene_);
  if (culprit_ != nullptr) {
    named_ = culprit_;
    text = "; " + describe(*culprit_);
    const std::string thrown = lacks_value ? describeThrown(*culprit_) : "";
    const std::string part =
        is_bad && thrown.empty() ? findNonFinitePart(scene_, *culprit_, state_) : "";
    if (!thrown.empty()) text += ", whose function threw: " + thrown;
    if (!part.empty()) text += ", its " + part;
  }
  if (const auto* const constraint = dynamic_cast<const Constraint*>(blamed_)) {
    double C[kMaxShafts] = {};
    double c0;
    constraint->calcRow(state_, C, &c0);
    text += ", its C = " + formatNumbers(C, scene_.shaftCount());
  }
  return text;
}

/// Returns the commands that no machine has, of ordinary inputs.
std::string StopMessage::describeHugeCommands() const {
  constexpr double kNoMachine = 1e12;  // in any SI unit
  std::string text;
  for (int i = 0; i < scene_.inputCount(); ++i) {
    const CommandInputSettings& input = scene_.inputs[static_cast<std::size_t>(i)];
    const double command = motion_.inputs.signal(i).target();
    if (input.kind != InputKind::kCommanded || std::abs(command) < kNoMachine) continue;
    text += "; the command " + formatNumber(command) + " on " + inQuotes(input.topic) +
            " is out of all proportion: 'min' and 'max' of the input bound what is taken";
  }
  return text;
}

std::string StopMessage::describeLastEvent() const {
  const int event = program_.it.passed - program_.text().FIRST_EVENT;
  if (status_.reason != StopReason::kChattering || event < 0 || event >= program_.text().EVENTS)
    return "";
  return "; the event " + inQuotes(scene_.events[static_cast<std::size_t>(event)].name) +
         " came last: what it sets must not set it off again at once";
}

std::string StopMessage::describeRigid() const {
  if (status_.reason != StopReason::kNoModes) return "";
  const MotionProgram& text = program_.text();
  std::string rigid;
  for (std::size_t h = 0; h < text.holdNames().size(); ++h) {
    const bool is_rigid = text.closes_below.values[h] > 0.0 || text.has_gap.values[h] != 0 ||
                          text.slides_backward.values[h] == 0;
    if (is_rigid) rigid += (rigid.empty() ? "; rigid are " : ", ") + inQuotes(text.holdNames()[h]);
  }
  return rigid;
}

std::string StopMessage::describePast() const {
  const int full = program_.past().findFull();
  if (full < 0) return "";
  const auto input =
      static_cast<std::size_t>(program_.text().delay_input.values[static_cast<std::size_t>(full)]);
  return "; the past of " + inQuotes(scene_.inputs[input].name) + " has " +
         std::to_string(MotionPast::kMostPieces) +
         " steps, which is all that is kept: a shorter delay, or larger tolerances, have fewer";
}

std::string StopMessage::write() {
  std::ostringstream text;
  text << toString(status_.reason) << " at t = " << formatNumber(status_.time)
       << " s: " << explain() << describeCulprit();
  if (status_.reason == StopReason::kSingularConstraint && status_.constraint >= 0) {
    text << " (" << status_.measure << " of its scale)";
  }
  if (status_.reason == StopReason::kStepTooLarge) {
    text << " (the error is " << status_.measure << " of it, 'solver/step' "
         << formatNumber(scene_.solver.step) << " s)";
  }
  // (The node cuts long messages, such as those with the states of many shafts.)
  const int S = scene_.shaftCount();
  text << describeHugeCommands() << "; last good state: angle = " << formatNumbers(state_.angle, S)
       << " rad, velocity = " << formatNumbers(state_.velocity, S)
       << " rad/s, acceleration = " << formatNumbers(state_.acceleration, S) << " rad/s^2"
       << scene_.extreme_numbers;
  if (status_.reason == StopReason::kProjectionFailed && motion_.doSolutionsMeet())
    text << "; two solutions for the accelerations meet here, and none goes on behind";
  text << describeLastEvent() << describeRigid() << describePast();
  return text.str();
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

std::string describeStop(Motion& motion, const Law** culprit) {
  if (motion.status.ok()) return "";
  StopMessage message(motion);
  std::string text = message.write();
  if (culprit != nullptr) *culprit = message.culprit();
  return text;
}

}  // namespace variator_sim
