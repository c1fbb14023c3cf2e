#include "variator_sim/simulation.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "motion/motion.h"
#include "motion/stop_message.h"
#include "variator_sim/errors.h"

namespace variator_sim {

namespace {

std::unique_ptr<Motion> makeMotion(Scene scene, const Motion* like) {
  if (scene.shaftCount() < 1 || scene.shaftCount() > kMaxShafts) {
    throw SceneError("shafts", "a drivetrain has 1 to " + std::to_string(kMaxShafts) + " shafts");
  }
  return std::make_unique<Motion>(std::move(scene), like);
}

}  // namespace

Simulation::Simulation(Scene scene) : motion_(makeMotion(std::move(scene), nullptr)) {}
Simulation::Simulation(Scene scene, const Simulation& like)
    : motion_(makeMotion(std::move(scene), like.motion_.get())) {}
Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

const Scene& Simulation::scene() const {
  return motion_->scene;
}
double Simulation::time() const {
  return motion_->time;
}
const MotionStatus& Simulation::status() const {
  return motion_->status;
}
double Simulation::quietUntil() const {
  return motion_->quietUntil();
}
bool Simulation::isSleeping() const {
  return motion_->program.isStill() && motion_->scene.solver.sleep;
}

const MotionStatus& Simulation::advanceTo(double time) {
  const MotionStatus& status = motion_->advanceTo(time);
  if (motion_->error_estimate) motion_->error_estimate->companion().advanceTo(motion_->time);
  return status;
}

void Simulation::reset() {
  motion_->reset();
  if (!motion_->error_estimate) return;
  motion_->error_estimate->companion().reset();
  motion_->error_estimate->forget();
}

bool Simulation::takeModeEvent(ModeEvent* event) {
  return motion_->events.take(motion_->time, event);
}
void Simulation::keepModeEvents() {
  motion_->events.keepAll();
}
std::uint64_t Simulation::lostModeEvents() const {
  return motion_->events.lostCount();
}

void Simulation::exhaustTime() {
  motion_->stop(StopReason::kTimeExhausted, motion_->time);
}

// --- commands --------------------------------------------------------------------------------

CommandResult Simulation::command(int input, double value) {
  if (motion_->error_estimate) motion_->error_estimate->companion().command(input, value);
  Statistics& statistics = motion_->statistics;
  if (!std::isfinite(value)) {
    ++statistics.commands_refused;
    return CommandResult::kRefused;
  }
  const bool is_clamped = motion_->inputs.command(input, value, motion_->time);
  motion_->forgetSample();
  ++statistics.commands_accepted;
  if (!is_clamped) return CommandResult::kAccepted;
  ++statistics.commands_clamped;
  return CommandResult::kClamped;
}
double Simulation::firstClampedCommand(int input) const {
  return motion_->inputs.firstClamped(input);
}
double Simulation::nextTimeout() const {
  return motion_->inputs.nextTimeout();
}

// --- state at the current time, after its commands -------------------------------------------

const Sample& Simulation::sample() {
  motion_->settle();
  Sample& sample = motion_->sample();
  if (motion_->error_estimate) motion_->error_estimate->judge(*motion_, &sample);
  return sample;
}

OperatingPoint Simulation::operatingPoint() {
  return motion_->operatingPoint();
}

const std::vector<std::string>& Simulation::quantityNames(QuantityGroup group) const {
  return motion_->quantities.names(group);
}
void Simulation::calcQuantities(QuantityGroup group, double* values) {
  motion_->settle();
  const StateView state = motion_->view();
  motion_->quantities.calc(group, state, motion_->sample(), values);
}

void Simulation::trackEnergy(bool on) {
  if (on == motion_->is_energy_tracked) return;
  motion_->is_energy_tracked = on;
  motion_->forgetSample();
}
Energy Simulation::energy() {
  motion_->settle();
  return motion_->calcEnergy();
}
EnergyDoubt Simulation::energyDoubt() const {
  return motion_->energy.doubt(motion_->time);
}

bool Simulation::peekState(MotionState* state) {
  return motion_->peekState(state);
}
bool Simulation::saveState(MotionState* state) {
  return motion_->saveState(state);
}
std::string Simulation::setState(const MotionState& state, bool project) {
  std::string fault = motion_->setState(state, project);
  if (fault.empty() && motion_->error_estimate) {
    motion_->error_estimate->companion().setState(state, project);
    motion_->error_estimate->forget();
  }
  return fault;
}

void Simulation::estimateErrors(bool on) {
  motion_->error_estimate = on ? std::make_unique<ErrorEstimate>(motion_->scene) : nullptr;
  motion_->forgetSample();
}
ErrorDoubt Simulation::errorDoubt() const {
  return motion_->error_estimate ? motion_->error_estimate->doubt() : ErrorDoubt{};
}
std::string Simulation::describeErrorEstimate() const {
  return motion_->error_estimate ? motion_->error_estimate->describe() : "";
}

// --- descriptions ----------------------------------------------------------------------------

const Statistics& Simulation::statistics() const {
  return motion_->statistics;
}
std::string Simulation::describeStatus() const {
  return describeStop(*motion_, nullptr);
}
const char* Simulation::stepperName() const {
  return motion_->program.stepperName();
}
std::string Simulation::describeStepper() const {
  return motion_->program.describeStepper(motion_->statistics.stepper_switches);
}
std::vector<std::string> Simulation::skips() const {
  return motion_->program.skips();
}

// --- machine code ----------------------------------------------------------------------------

bool Simulation::loadMachineCode(bool compile, bool patiently) {
  if (motion_->error_estimate)
    motion_->error_estimate->companion().loadMachineCode(compile, patiently);
  return motion_->program.loadCode(compile, patiently);
}

bool Simulation::shareMachineCode(const Simulation& other) {
  return motion_->program.shareCode(other.motion_->program);
}

const std::string& Simulation::machineCode() const {
  return motion_->program.code();
}
bool Simulation::hasMachineCode() const {
  return motion_->program.hasCode();
}

}  // namespace variator_sim
