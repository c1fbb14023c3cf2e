#include "motion/motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "motion/stop_message.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

Motion::Motion(Scene its_scene, const Shortcuts& shortcuts, const Motion* like)
    : MotionBase(std::move(its_scene)),
      finder(scene, shortcuts, like != nullptr ? &like->finder : nullptr),
      system(finder.system()),
      drivetrain(system.drivetrain()),
      integrator(system, scene),
      energy_meter(integrator, system),
      first_(system.size()) {
  reset();
  finder.requireConsistency();
}

// --- start -----------------------------------------------------------------------------------

void Motion::reset() {
  time = 0.0;
  forgetSample();
  commands.reset();
  drivetrain.resetInputs();
  integrator.reset();
  if (knows_first_) {
    // The accelerations of least reaction are the same every time; commands come later.
    integrator.beginAt(first_);
    energy_meter.begin();
    return;
  }
  start();
  // (If accelerations are no part of the state, a start also leaves guesses of them.)
  knows_first_ = system.integratesTorque() && status().ok();
  first_ = integrator.stepEnd().x;
}

void Motion::start() {
  forgetSample();
  if (finder.findFirst()) {
    integrator.beginFirstAt(finder.x());
  } else {
    integrator.beginNowhere(finder.x(), finder.explainStart());
  }
  energy_meter.begin();
}

// --- the current time ------------------------------------------------------------------------

void Motion::recover() {
  integrator.stepBack();
  time = frontTime();
  integrator.restart();
}

bool Motion::isMadeUpTo(double end) const {
  return integrator.stepEnd().time >= integrator.origin().relative(end);
}

bool Motion::step(double /*end*/) {
  if (!integrator.step()) return false;
  energy_meter.noteStep();
  return integrator.finishEnd();
}

double Motion::lastInside() const {
  const double reached = frontTime();
  return integrator.origin().relative(reached) > integrator.stepEnd().time
             ? std::nextafter(reached, 0.0)
             : reached;
}

// --- commands --------------------------------------------------------------------------------

bool Motion::cutStep(StepNode* node) {
  *node = integrator.stepEnd();
  if (!integrator.inside().contains(presentTime())) return true;
  if (!integrator.inside().reach(presentTime(), node)) {
    time = status().time;
    return false;
  }
  energy_meter.cut(*node);
  return true;
}

void Motion::changeInputs() {
  integrator.noteCommand(time);
  StepNode reached(system);
  if (!cutStep(&reached)) return;
  integrator.cutAt(time, reached);
  forgetSample();
  double u0[kMaxInputs];
  std::copy_n(drivetrain.inputs(), drivetrain.inputCount(), u0);
  drivetrain.saveSignals();
  bool jumps = false;
  for (int i = 0; i < drivetrain.inputCount(); ++i) {
    CommandSignal& signal = drivetrain.signal(i);
    if (!commands.hasCommand(i) || signal.target() == commands.value(i)) continue;
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    jumps = signal.command(input, 0.0, commands.value(i), resolutionOf(time)) || jumps;
  }
  if (jumps && !integrator.jump(u0)) {
    integrator.stepBack();  // the last accepted state: before these commands
    drivetrain.restoreSignals(0.0);
    return;
  }
  integrator.restart();
}

void Motion::changeInitialInputs() {
  for (int i = 0; i < drivetrain.inputCount(); ++i) {
    if (!commands.hasCommand(i)) continue;
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    drivetrain.signal(i).command(input, 0.0, commands.value(i));
  }
  drivetrain.refreshInputs(0.0);
  start();
}

// --- samples ---------------------------------------------------------------------------------

void Motion::takeSample(Sample* sample) {
  sampled_at_ = presentTime();
  State x(system.size());
  if (!integrator.inside().calcState(&sampled_at_, x)) {
    time = status().time;
    sampled_at_ = presentTime();
  }
  const auto is_finite = [&] {
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int i = 0; i < system.shafts(); ++i) {
      poison += 0.0 * (sample->angle[i] + sample->velocity[i] + sample->acceleration[i] +
                       sample->applied_torque[i] + sample->reaction_torque[i]);
    }
    return poison == 0.0;
  };
  system.calcSample(sampled_at_, x, sample);
  // A failed evaluation is repeated once; a value that does not exist ends the motion.
  if (!is_finite()) system.calcSample(sampled_at_, x, sample);
  if (!is_finite() && status().ok()) integrator.stopAtBadValue(time, sampled_at_, x);
}

StateView Motion::view() {
  const Sample& now = sample();
  return drivetrain.view(sampled_at_, now.angle, now.velocity, now.acceleration);
}

// --- descriptions and machine code -------------------------------------------------------------

Statistics& Motion::statistics() {
  Statistics& statistics = integrator.statistics();
  statistics.right_hand_sides = drivetrain.rightHandSides();
  statistics.newton_iterations = drivetrain.newtonIterations();
  statistics.stepper_switches = integrator.choice().switches();
  return statistics;
}

std::string Motion::describeStop() {
  if (status().ok()) return "";
  const int guard = status().guard;
  const StateView state = view();
  return variator_sim::describeStop(
      scene, status(), state, drivetrain.inertia(),
      guard < 0 ? "" : drivetrain.guards()[static_cast<std::size_t>(guard)]->function());
}

std::vector<std::string> Motion::skips() const {
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
    skips.emplace_back("derivatives by time (no explicit time)");
  }
  if (system.isSpecialized()) {
    skips.emplace_back("loops over shafts and constraints (two and one)");
  }
  return skips;
}

}  // namespace variator_sim
