#include "variator_sim/simulation.h"

#include <chrono>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "model/interrupted.h"
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

/// Tells whether missing code is compiled, and whether a busy compiler is waited for.
KernelLibrary::Missing missingCode(const SolverSettings& solver, bool compile, bool patiently) {
  using Missing = KernelLibrary::Missing;
  if (!compile) return Missing::kLeave;
  const bool waits = patiently || solver.machine_code == MachineCode::kAlways;
  return waits ? Missing::kCompilePatiently : Missing::kCompile;
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
  return motion_->status();
}
double Simulation::quietUntil() const {
  return motion_->quietUntil();
}
bool Simulation::isSleeping() const {
  return motion_->integrator.isSleeping();
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

void Simulation::exhaustTime() {
  motion_->integrator.exhaustTime(motion_->time);
}

// --- commands --------------------------------------------------------------------------------

CommandResult Simulation::command(int input, double value) {
  if (motion_->error_estimate) motion_->error_estimate->companion().command(input, value);
  Statistics& statistics = motion_->integrator.statistics();
  if (!std::isfinite(value)) {
    ++statistics.commands_refused;
    return CommandResult::kRefused;
  }
  const bool is_clamped = motion_->commands.add(input, value, motion_->time);
  motion_->forgetSample();
  ++statistics.commands_accepted;
  if (!is_clamped) return CommandResult::kAccepted;
  ++statistics.commands_clamped;
  return CommandResult::kClamped;
}
double Simulation::firstClampedCommand(int input) const {
  return motion_->commands.firstClamped(input);
}
double Simulation::nextTimeout() const {
  return motion_->commands.nextTimeout();
}

// --- state at the current time, after its commands -------------------------------------------

const Sample& Simulation::sample() {
  motion_->settle();
  Sample& sample = motion_->sample();
  if (motion_->error_estimate) motion_->error_estimate->judge(*motion_, &sample);
  return sample;
}

OperatingPoint Simulation::operatingPoint() {
  motion_->settle();
  const StateView state = motion_->view();
  const Scene& scene = motion_->scene;
  OperatingPoint point;
  point.time = motion_->time;
  point.angle.assign(state.angle, state.angle + scene.shaftCount());
  point.velocity.assign(state.velocity, state.velocity + scene.shaftCount());
  point.acceleration.assign(state.acceleration, state.acceleration + scene.shaftCount());
  point.input.assign(state.input, state.input + scene.inputCount());
  point.input_rate.assign(state.input_rate, state.input_rate + scene.inputCount());
  for (int i = 0; i < scene.inputCount(); ++i) {
    point.command.push_back(motion_->drivetrain.signal(i).target());
  }
  return point;
}

const std::vector<std::string>& Simulation::quantityNames(QuantityGroup group) const {
  return motion_->quantities.names(group);
}
void Simulation::calcQuantities(QuantityGroup group, double* values) {
  motion_->settle();
  motion_->quantities.calc(group, motion_->view(), values);
}

void Simulation::trackEnergy(bool on) {
  if (on == motion_->energy_meter.isTracked()) return;
  motion_->energy_meter.track(on);
  motion_->forgetSample();
}
Energy Simulation::energy() {
  motion_->settle();
  const Sample& now = motion_->sample();
  if (motion_->energy_meter.isTracked()) return now.energy;
  return motion_->energy_meter.calcEnergy(now, motion_->presentTime());
}
EnergyDoubt Simulation::energyDoubt() const {
  return motion_->energy_meter.doubt(motion_->time);
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
  Statistics& statistics = motion_->integrator.statistics();
  statistics.right_hand_sides = motion_->drivetrain.rightHandSides();
  statistics.newton_iterations = motion_->drivetrain.newtonIterations();
  statistics.stepper_switches = motion_->integrator.choice().switches();
  return statistics;
}

std::string Simulation::describeStatus() const {
  return describeStop(*motion_);
}
const char* Simulation::stepperName() const {
  return motion_->integrator.choice().stepper().name();
}
std::string Simulation::describeStepper() const {
  return motion_->integrator.choice().describe();
}

std::vector<std::string> Simulation::skips() const {
  const Drivetrain& drivetrain = motion_->drivetrain;
  const System& system = motion_->system;
  std::vector<std::string> skips;
  if (!system.readsAngles()) skips.emplace_back("derivatives by the angles (nothing reads them)");
  if (drivetrain.inertia().isConstant()) {
    skips.emplace_back("inertial torques and connection (J is constant)");
  }
  if (!system.integratesTorque()) {
    skips.emplace_back(
        "torque rates in the stages and stepped accelerations (the principle gives them)");
  }
  if (!drivetrain.readsTime()) {
    skips.emplace_back(motion_->scene.solver.sleep
                           ? "anything at rest until a command (no explicit time)"
                           : "derivatives by time (no explicit time)");
  }
  if (system.isSpecialized()) {
    skips.emplace_back("loops over shafts and constraints (two and one)");
  }
  return skips;
}

// --- machine code ----------------------------------------------------------------------------

bool Simulation::loadMachineCode(bool compile, bool patiently) {
  Motion& motion = *motion_;
  const SolverSettings& solver = motion.scene.solver;
  if (motion.error_estimate) {
    motion.error_estimate->companion().loadMachineCode(compile, patiently);
  }
  if (motion.has_machine_code) return true;
  if (solver.machine_code == MachineCode::kNever) {
    motion.machine_code = "the interpreter: 'solver/machine_code' is 'never'";
    return false;
  }
  const auto begin = std::chrono::steady_clock::now();
  bool compiled = false;
  std::string reason;
  try {
    reason = motion.drivetrain.loadMachineCode(motion.series(), motion.integrator.machineCode(),
                                               missingCode(solver, compile, patiently), &compiled);
  } catch (const Interrupted&) {  // while the C of the formulas was written
    reason = "it was interrupted";
  }
  motion.has_machine_code = reason.empty();
  if (!motion.has_machine_code) {
    motion.machine_code = "the interpreter: " + reason;
  } else if (compiled) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    std::ostringstream text;
    text.precision(2);
    text << "machine code, compiled in " << seconds.count() << " s";
    motion.machine_code = text.str();
  } else {
    motion.machine_code = "machine code, from the cache";
  }
  return motion.has_machine_code;
}

bool Simulation::shareMachineCode(const Simulation& other) {
  return motion_->shareMachineCode(*other.motion_);
}

std::shared_ptr<SeriesLanes> Simulation::loadLanes(bool compile) {
  MotionSeries* const series = motion_->system.series();
  if (!motion_->has_machine_code || series == nullptr) return nullptr;
  return motion_->drivetrain.loadLanes(*series, missingCode(motion_->scene.solver, compile, false));
}
void Simulation::makeStepsWith(StepsTogether* together) {
  MotionSeries* const series = motion_->system.series();
  if (series != nullptr) series->makeStepsWith(together);
}

const std::string& Simulation::machineCode() const {
  return motion_->machine_code;
}
bool Simulation::hasMachineCode() const {
  return motion_->has_machine_code;
}

}  // namespace variator_sim
