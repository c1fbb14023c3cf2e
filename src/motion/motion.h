/// The motion of a scene by an integrator, which runs freely ahead of the current time.
#pragma once

#include <memory>
#include <string>

#include "dynamics/system.h"
#include "integrate/integrator.h"
#include "motion/energy.h"
#include "motion/motion_base.h"
#include "motion/state_finder.h"

namespace variator_sim {

/// All but its construction are [loop].
struct Motion final : MotionBase {
  /// `like`: has programs and machine code that may fit, or nullptr.
  explicit Motion(Scene its_scene, const Shortcuts& shortcuts = {}, const Motion* like = nullptr);
  /// For the core and its tests.
  static std::unique_ptr<MotionBase>& of(Simulation& simulation) { return simulation.motion_; }

  const MotionStatus& status() const override { return integrator.status(); }
  Statistics& statistics() override;
  void reset() override;
  bool isSleeping() const override { return false; }
  double frontTime() const override {
    return integrator.origin().absolute(integrator.stepEnd().time);
  }
  StateView view() override;
  const CommandSignal& signal(int input) const override { return drivetrain.signal(input); }
  bool saveState(MotionState* state) override;
  std::string setState(const MotionState& state, bool project) override;
  void trackEnergy(bool on) override { energy_meter.track(on); }
  bool isEnergyTracked() const override { return energy_meter.isTracked(); }
  Energy calcEnergy() override { return energy_meter.calcEnergy(sample(), presentTime()); }
  EnergyDoubt energyDoubt() const override { return energy_meter.doubt(time); }
  void exhaustTime() override { integrator.exhaustTime(time); }
  std::string describeStop() override;
  const char* stepperName() const override { return integrator.choice().stepper().name(); }
  std::string describeStepper() const override { return integrator.choice().describe(); }
  std::vector<std::string> skips() const override;
  std::string loadCode(KernelLibrary::Missing /*missing*/, bool* /*compiled*/) override {
    return "steps by '" + std::string(stepperName()) + "' are interpreted";
  }
  bool shareMachineCode(const MotionBase& /*other*/) override { return false; }
  /// Returns the current time as nodes count it.
  double presentTime() const { return integrator.origin().relative(time); }

  /// Continues from `state`, with the values x and the accelerations `epsilon`, without any history
  /// of this motion.
  const MotionStatus& beginFrom(const MotionState& state, const State& x, const double* epsilon);
  /// Writes the node at the current time: the step end, or the step made again up to there. False
  /// when the motion stopped.
  bool cutStep(StepNode* node);

  StateFinder finder;
  System& system;          ///< the finder's
  Drivetrain& drivetrain;  ///< the system's
  Integrator integrator;
  EnergyMeter energy_meter;

 private:
  double signalTime() const override { return presentTime(); }
  bool isStart() const override { return integrator.isStart(); }
  void leaveStart() override { integrator.leaveStart(); }
  bool isMadeUpTo(double end) const override;
  bool step(double end) override;
  double lastInside() const override;
  void changeInputs() override;
  void changeInitialInputs() override;
  void takeSample(Sample* sample) override;
  void recover() override;

  /// Computes the state at time 0 with the inputs as they are.
  void start();

  State first_;  // at time 0, with the inputs as the scene has them
  bool knows_first_ = false;
  double sampled_at_ = 0.0;  // as nodes count it: the current time, or just behind an event there
};

}  // namespace variator_sim
