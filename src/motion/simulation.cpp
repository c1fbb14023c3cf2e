#include "variator_sim/simulation.h"

#include <string>
#include <utility>
#include <vector>

#include "motion/error_estimate.h"
#include "motion/motion.h"
#include "motion/stop_message.h"

namespace variator_sim {

namespace {

std::unique_ptr<Motion> makeMotion(Scene scene, const Motion* like) {
  if (scene.shaftCount() < 1 || scene.shaftCount() > kMaxShafts) {
    throw SceneError("shafts", "a drivetrain has 1 to " + std::to_string(kMaxShafts) + " shafts");
  }
  return std::make_unique<Motion>(std::move(scene), Shortcuts{}, like);
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
double Simulation::firstClampedCommand(int input) const {
  return motion_->firstClampedCommand(input);
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

bool Simulation::loadMachineCode(bool compile, bool patiently) {
  if (error_estimate_) error_estimate_->loadMachineCode(compile, patiently);
  return motion_->loadMachineCode(compile, patiently);
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
  return describeStop(*motion_);
}

}  // namespace variator_sim
