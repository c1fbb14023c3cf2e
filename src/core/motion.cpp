#include "motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace variator_sim {

Motion::Motion(Scene scene)
    : scene_(std::move(scene)),
      own_system_(makeSystem(scene_)),
      system_(*own_system_),
      S(system_.shafts()),
      integrates_torque_(system_.integratesTorque()),
      drivetrain_(system_.drivetrain()),
      choice_(system_, scene_.solver),
      stepper_(&choice_.stepper()),
      tolerance_{scene_.solver.absolute_tolerance, scene_.solver.relative_tolerance},
      checks_(system_, tolerance_, choice_.isFixed()),
      energy_(system_, scene_, tolerance_),
      control_(1),
      rest_(system_),
      left_at_sleep_end_(system_.size()),
      start_(system_.size()),
      base_(system_),
      front_(system_),
      dxdt_new_(system_.size()) {
  guards_.setGuards(
      drivetrain_.guards(),
      [this](double time, const double* angle, const double* velocity, const double* acceleration) {
        return drivetrain_.view(relative(time), angle, velocity, acceleration);
      });
  if (guards_.hasJumps()) system_.watch(&watch_);
  startOver();
  if (initial_result_ == InitialResult::kInconsistent ||
      initial_result_ == InitialResult::kNotFound || initial_result_ == InitialResult::kNotUnique ||
      initial_result_ == InitialResult::kDoubtful) {
    throwInitialError();
  }
}

std::vector<std::string> Motion::skips() const {
  std::vector<std::string> skips;
  if (!system_.readsAngles()) skips.emplace_back("stages of the angles (nothing reads them)");
  if (drivetrain_.hasConstantRows() && drivetrain_.constraintCount() > 0) {
    skips.emplace_back("factorizations but the first (C and J are constant)");
  }
  if (drivetrain_.inertia().isConstant()) {
    skips.emplace_back("inertial torques and connection (J is constant)");
  }
  if (system_.size() == 2 * S) {
    skips.emplace_back(
        "torque rates in the stages and stepped accelerations (the principle gives them)");
  }
  if (!drivetrain_.readsTime()) {
    skips.emplace_back(scene_.solver.sleep ? "anything at rest until a command (no explicit time)"
                                           : "derivatives by time (no explicit time)");
  }
  if (system_.isSpecialized())
    skips.emplace_back("loops over shafts and constraints (two and one)");
  return skips;
}

const Statistics& Motion::statistics() const {
  statistics_.right_hand_sides = drivetrain_.rightHandSides();
  statistics_.newton_iterations = drivetrain_.newtonIterations();
  statistics_.stepper_switches = choice_.switches();
  return statistics_;
}

const MotionStatus& Motion::advanceTo(double time) {
  if (!(time > time_)) return status_;
  try {
    return advance(time);
  } catch (...) {
    // Plugins do not throw; one that does leaves a motion that can go on from its last step.
    front_ = base_;
    time_ = absolute(front_.time);
    restart();
    throw;
  }
}

double Motion::quietUntil() const {
  if (!status_.ok() || pending_count_ > 0) return time_;
  double reached = absolute(front_.time);
  if (relative(reached) > front_.time) reached = std::nextafter(reached, 0.0);
  return std::max(time_, std::min(reached, nextTimeout()));
}

const Sample& Motion::sample() {
  if (status_.ok()) applyPending();
  if (!sample_valid_) {
    State x = front_.x;
    if (sleeping_) {
      calcRest(present(), x);
    } else if (isInsideStep()) {
      sampleInside(x);
    }
    system_.calcSample(present(), x, &sample_);
    // A law that fails once is asked again; a value that does not exist ends the motion.
    if (!isSampleFinite()) system_.calcSample(present(), x, &sample_);
    sample_.time = time_;
    if (!isSampleFinite() && status_.ok()) {
      stop(StopReason::kNonFiniteValue);
      nameBadValue(present(), x);
      status_.time = time_;
    }
    sample_valid_ = true;
    if (energy_.isTracked()) sample_.energy = energy_.calcEnergy(sample_, calcApplied());
  }
  return sample_;
}

void Motion::trackEnergy(bool on) {
  if (on == energy_.isTracked()) return;
  energy_.track(on);
  sample_valid_ = false;
}

Energy Motion::energy() {
  const Sample& now = sample();
  return energy_.isTracked() ? now.energy : energy_.calcEnergy(now, calcApplied());
}

EnergyDoubt Motion::energyDoubt() const {
  const EnergyDoubt doubt = energy_.doubt();
  // The integrator runs ahead of the present.
  return advanced_ && doubt.since <= time_ ? doubt : EnergyDoubt{};
}

void Motion::calcConstraintRow(int m, double* C) {
  double c0;
  drivetrain_.constraint(m).calcRow(system_.view(front_.time, front_.x), C, &c0);
}

void Motion::moveOriginToPresent() {
  drivetrain_.moveOrigin(present());
  drivetrain_.setOrigin(time_);
  origin_ = time_;
  origin_rest_ = 0.0;
}

void Motion::moveOrigin(double t) {
  // The sum of two doubles and what it rounds off (Knuth: The Art of Computer
  // Programming, 4.2.2).
  const double added = origin_rest_ + t;
  const double sum = origin_ + added;
  const double part = sum - origin_;
  origin_rest_ = (origin_ - (sum - part)) + (added - part);
  origin_ = sum;
  drivetrain_.moveOrigin(t);
  drivetrain_.setOrigin(origin_);
}

bool Motion::isSampleFinite() const {
  double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
  for (int i = 0; i < S; ++i) {
    poison += 0.0 * (sample_.angle[i] + sample_.velocity[i] + sample_.acceleration[i] +
                     sample_.applied_torque[i] + sample_.reaction_torque[i]);
  }
  return poison == 0.0;
}

const MotionStatus& Motion::advance(double time) {
  applyPending();
  if (!advanced_) energy_.begin(front_, row_before_);
  advanced_ = true;
  // Commands that fail to come in time act on their own; they are events of the motion.
  for (double timeout = nextTimeout(); status_.ok() && timeout <= time; timeout = nextTimeout()) {
    moveTo(timeout);
    if (status_.ok()) applyTimeouts();
    if (timeout < time) applyPending();
  }
  moveTo(time);
  return status_;
}

void Motion::moveTo(double time) {
  if (!status_.ok()) return;
  while (front_.time < relative(time)) {
    if (sleeping_ && relative(time) < sleep_end_) break;
    if (sleeping_ ? !finishSleep() : !countStep() || !step()) {
      time_ = absolute(front_.time);
      sample_valid_ = false;
      status_.time = time_;
      return;
    }
    noteEnergy();
  }
  time_ = time;
  sample_valid_ = false;
}

bool Motion::countStep() {
  if (absolute(front_.time) - step_window_start_ >= 1.0) {
    step_window_start_ = absolute(front_.time);
    steps_in_window_ = 0;
  }
  if (steps_in_window_ < scene_.solver.maximum_steps) {
    ++steps_in_window_;
    return true;
  }
  stop(StopReason::kStepLimit);
  return false;
}

bool Motion::isDenseOutputGood() const {
  if (!stepper_->hasDenseOutput()) return false;
  // Where accelerations follow from the state, an error of it may be large for them.
  return integrates_torque_ || stepper_->checksDenseOutput();
}

void Motion::sampleInside(State& x) {
  const double now = present();
  if (hopped_) {
    x = goAhead(base_, now - base_.time);
    return;
  }
  if (isDenseOutputGood() && stepper_->interpolate(system_, now, base_, front_, x)) {
    State moved(system_.size());
    State slope(system_.size());
    if (stepper_->keepsConstraints()) stepper_->calcSlope(now, base_, front_, slope);
    const double h = front_.time - base_.time;
    const ProjectionResult result =
        stepper_->isImplicit()
            ? projectStiffly(system_, *stepper_, now, h, slope, x, moved, &statistics_.projections)
            : system_.project(now, x, moved, &statistics_.projections);
    if (result == ProjectionResult::kConverged) return;
  }
  StepNode node(system_);
  x = reachPresent(&node) ? node.x : base_.x;
}

void Motion::noteEnergy() {
  if (!integrates_torque_) {
    // Steps of fixed size have had no need of it.
    if (choice_.isFixed()) checks_.noteTorque(front_);
  }
  energy_.noteStep(base_, front_, row_before_,
                   [this](double theta, State& x) { calcInside(theta, x); });
}

void Motion::cutEnergy(const StepNode& present) {
  if (sleeping_) {
    energy_.cutAtRest(front_, present);
  } else {
    energy_.cut(base_, front_, present, [this](double theta, State& x) { calcInside(theta, x); });
  }
}

double Motion::calcApplied() {
  if (!advanced_) energy_.begin(front_, row_before_);
  if (sleeping_) {
    State x(system_.size());
    calcRest(present(), x);
    return energy_.calcAppliedAtRest(front_, x);
  }
  if (!isInsideStep()) return energy_.applied();
  const double part = (present() - base_.time) / (front_.time - base_.time);
  return energy_.calcApplied(base_, front_, part,
                             [this](double theta, State& x) { calcInside(theta, x); });
}

void Motion::calcInside(double theta, State& x) {
  const double h = front_.time - base_.time;
  if (!hopped_) {
    if (stepper_->hasDenseOutput() &&
        stepper_->interpolate(system_, base_.time + theta * h, base_, front_, x)) {
      return;
    }
    // A step that was good is so for a part of it.
    State unused(system_.size());
    if (std::isfinite(choice_.innerOf(*stepper_).step(system_, base_, theta * h, x, unused))) {
      return;
    }
  }
  for (int n = 0; n < x.size(); ++n) {
    x[n] = base_.x[n] + theta * (front_.x[n] - base_.x[n]);
  }
}

}  // namespace variator_sim
