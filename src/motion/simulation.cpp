#include "variator_sim/simulation.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "motion/error_estimate.h"
#include "motion/motion.h"

namespace variator_sim {

namespace {

std::unique_ptr<Motion> makeMotion(Scene scene, const Motion* like) {
  if (scene.shaftCount() < 1 || scene.shaftCount() > kMaxShafts) {
    throw SceneError("shafts", "a drivetrain has 1 to " + std::to_string(kMaxShafts) + " shafts");
  }
  return std::make_unique<Motion>(std::move(scene), Shortcuts{}, like);
}

void writeVector(std::ostream& out, const double* values, int count) {
  out << "[";
  for (int i = 0; i < count; ++i) out << (i ? ", " : "") << formatNumber(values[i]);
  out << "]";
}

const char* explain(StopReason reason) {
  switch (reason) {
    case StopReason::kNone:
      return "";
    case StopReason::kSingularConstraint:
      return "the derivatives of the constraints by the accelerations have lost rank, so the "
             "principle no longer determines the jerk";
    case StopReason::kStepUnderflow:
      return "the step fell below the resolution of time: the motion changes ever faster here";
    case StopReason::kNonFiniteValue:
      return "a value is NaN or infinite here or just ahead";
    case StopReason::kStepTooLarge:
      return "the estimated error of one fixed step is a large part of the state: 'solver/step' is "
             "too large for this motion";
    case StopReason::kToleranceTooSmall:
      return "the accelerations follow so steeply from the state that rounding alone moves them by "
             "more than the tolerance: a larger 'solver/relative_tolerance' or, where the scene "
             "allows it, 'principle: generalized_gauss', which integrates them";
    case StopReason::kStepLimit:
      return "more steps than 'solver/maximum_steps' within one simulated second";
    case StopReason::kJumpFailed:
      return "the jump leads to no state on the constraints";
    case StopReason::kChattering:
      return "a law jumps, or bends, where the motion turns back at once, so none of its branches "
             "goes on: a smooth law helps (tanh(w/0.01) for sign(w), sqrt(x^2+1e-6) for abs(x), "
             "variator_sim/Friction for dry friction)";
    case StopReason::kTimeExhausted:
      return "simulated time has come to the end of what messages can hold, 136 years: ~reset_time "
             "begins it anew";
    case StopReason::kProjectionFailed:
      return "no accelerations that satisfy the constraints were found";
  }
  return "";
}

/// Of a step that underflowed at speeds which no machine has: who drives there.
std::string describeRunaway(Motion& motion) {
  constexpr double kNoMachine = 1e6;  // rad/s
  const Sample& sample = motion.sample();
  double fastest = 0.0;
  for (int i = 0; i < motion.scene().shaftCount(); ++i) {
    fastest = std::max(fastest, std::abs(sample.velocity[i]));
  }
  if (fastest < kNoMachine) return "";
  const std::vector<std::string>& names = motion.quantities().names(QuantityGroup::kElements);
  std::vector<double> values(names.size());
  motion.calcQuantities(QuantityGroup::kElements, values.data());
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

}  // namespace

Simulation::Simulation(Scene scene) : motion_(makeMotion(std::move(scene), nullptr)) {}
Simulation::Simulation(Scene scene, const Simulation& like)
    : motion_(makeMotion(std::move(scene), like.motion_.get())) {}
Simulation::~Simulation() = default;
std::shared_ptr<SeriesLanes> Simulation::loadLanes(bool compile) {
  return motion_->loadLanes(compile);
}
void Simulation::makeStepsWith(StepsTogether* together) {
  motion_->makeStepsWith(together);
}
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

const Scene& Simulation::scene() const {
  return motion_->scene();
}
double Simulation::time() const {
  return motion_->time();
}
const MotionStatus& Simulation::advanceTo(double time) {
  const MotionStatus& status = motion_->advanceTo(time);
  if (error_estimate_) error_estimate_->follow();
  return status;
}
void Simulation::interruptBy(const Interruption& interruption) {
  motion_->interruptBy(interruption);
  if (error_estimate_) error_estimate_->interruptBy(interruption);
}
CommandResult Simulation::command(int input, double value) {
  if (error_estimate_) error_estimate_->command(input, value);
  return motion_->command(input, value);
}
const Sample& Simulation::sample() {
  return error_estimate_ ? error_estimate_->sample() : motion_->sample();
}
void Simulation::estimateErrors(bool on) {
  error_estimate_ = on ? std::make_unique<ErrorEstimate>(*motion_) : nullptr;
}
ErrorDoubt Simulation::errorDoubt() const {
  return error_estimate_ ? error_estimate_->doubt() : ErrorDoubt{};
}
std::string Simulation::describeErrorEstimate() const {
  return error_estimate_ ? error_estimate_->describe() : "";
}
OperatingPoint Simulation::operatingPoint() {
  return motion_->operatingPoint();
}
const std::vector<std::string>& Simulation::quantityNames(QuantityGroup group) const {
  return motion_->quantities().names(group);
}
void Simulation::calcQuantities(QuantityGroup group, double* values) {
  motion_->calcQuantities(group, values);
}
void Simulation::trackEnergy(bool on) {
  motion_->trackEnergy(on);
}
Energy Simulation::energy() {
  return motion_->energy();
}
EnergyDoubt Simulation::energyDoubt() const {
  return motion_->energyDoubt();
}
const MotionStatus& Simulation::status() const {
  return motion_->status();
}
const Statistics& Simulation::statistics() const {
  return motion_->statistics();
}
void Simulation::reset() {
  motion_->reset();
  if (error_estimate_) error_estimate_->reset();
}
const char* Simulation::stepperName() const {
  return motion_->stepperName();
}
std::string Simulation::describeStepper() const {
  return motion_->describeStepper();
}
std::vector<std::string> Simulation::skips() const {
  return motion_->skips();
}
void Simulation::exhaustTime() {
  motion_->exhaustTime();
}
void Simulation::refuseCommand() {
  motion_->refuseCommand();
}
double Simulation::nextTimeout() const {
  return motion_->nextTimeout();
}
bool Simulation::peekState(MotionState* state) {
  return motion_->peekState(state);
}
bool Simulation::saveState(MotionState* state) {
  return motion_->saveState(state);
}
std::string Simulation::setState(const MotionState& state, bool project) {
  std::string fault = motion_->setState(state, project);
  if (fault.empty() && error_estimate_) error_estimate_->setState(state, project);
  return fault;
}
double Simulation::quietUntil() const {
  return motion_->quietUntil();
}

bool Simulation::loadMachineCode(bool compile) {
  if (error_estimate_) error_estimate_->loadMachineCode(compile);
  return motion_->loadMachineCode(compile);
}
bool Simulation::shareMachineCode(const Simulation& other) {
  return motion_->shareMachineCode(*other.motion_);
}
const std::string& Simulation::machineCode() const {
  return motion_->machineCode();
}
bool Simulation::hasMachineCode() const {
  return motion_->hasMachineCode();
}

bool Simulation::isSleeping() const {
  return motion_->isSleeping();
}

std::string Simulation::describeStatus() const {
  const MotionStatus& status = motion_->status();
  if (status.ok()) return "";
  const Scene& scene = motion_->scene();
  std::ostringstream text;
  text << toString(status.reason) << " at t = " << formatNumber(status.time)
       << " s: " << explain(status.reason);
  const StepperKind stepper = scene.solver.stepper;
  if (status.reason == StopReason::kStepUnderflow &&
      (stepper == StepperKind::kTaylor || stepper == StepperKind::kTaylorFixed)) {
    text << ", or has no power series here (w^1.5 at w = 0), where 'solver/stepper: auto' goes on";
  }
  if (status.reason == StopReason::kStepUnderflow) text << describeRunaway(*motion_);
  if (status.torque >= 0) {
    text << "; torque '" << scene.torques[static_cast<std::size_t>(status.torque)]->name() << "'";
  }
  if (status.constraint >= 0) {
    text << "; constraint '"
         << scene.constraints[static_cast<std::size_t>(status.constraint)]->name() << "'";
    double C[kMaxShafts] = {};
    motion_->calcConstraintRow(status.constraint, C);
    text << ", its C = ";
    writeVector(text, C, scene.shaftCount());
  }
  if (status.reason == StopReason::kSingularConstraint) {
    text << " (" << status.measure << " of its scale)";
  }
  if (status.reason == StopReason::kStepTooLarge) {
    text << " (the error is " << status.measure << " of it, 'solver/step' "
         << formatNumber(scene.solver.step) << " s)";
  }
  if (status.reason == StopReason::kToleranceTooSmall) {
    text << " (4 roundings of the state make " << status.measure << " tolerances)";
  }
  const Sample& sample = motion_->sample();
  text << "; last good state: angle = ";
  writeVector(text, sample.angle, scene.shaftCount());
  text << " rad, velocity = ";
  writeVector(text, sample.velocity, scene.shaftCount());
  text << " rad/s, acceleration = ";
  writeVector(text, sample.acceleration, scene.shaftCount());
  text << " rad/s^2" << scene.extreme_numbers;
  return text.str();
}

}  // namespace variator_sim
