/// The motion of a scene by one system of equations: steps, rejects, projects, jumps, samples.
///
/// The integrator runs freely ahead of the present, by steps of its own choice: `base` to `front`
/// is its last step and the present lies in it. Samples are taken from inside that step and
/// commands cut it, so that nobody's sampling rate, tick or advance changes one bit of the motion.
///
/// Times inside (of nodes, of inputs' closed forms) are counted from the last beginning (start,
/// command, jump), so that what follows is resolved as finely after 1e7 s as after none.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "command_rhythm.h"
#include "drivetrain.h"
#include "energy.h"
#include "guard_search.h"
#include "initial_conditions.h"
#include "principle_system.h"
#include "projection.h"
#include "rest.h"
#include "step_checks.h"
#include "step_control.h"
#include "step_curve.h"
#include "stepper_choice.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// The system of a scene's principle and orders.
std::unique_ptr<PrincipleSystem> makeSystem(const Scene& scene);

/// See Simulation for what each public method promises.
class Motion {
 public:
  explicit Motion(Scene scene)
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
    guards_.setGuards(drivetrain_.guards(),
                      [this](double time, const double* angle, const double* velocity,
                             const double* acceleration) {
                        return drivetrain_.view(relative(time), angle, velocity, acceleration);
                      });
    if (guards_.hasJumps()) system_.watch(&watch_);
    startOver();
    if (initial_result_ == InitialResult::kInconsistent ||
        initial_result_ == InitialResult::kNotFound ||
        initial_result_ == InitialResult::kNotUnique ||
        initial_result_ == InitialResult::kDoubtful) {
      throwInitialError();
    }
  }

  const Scene& scene() const { return scene_; }
  double time() const { return time_; }
  const MotionStatus& status() const { return status_; }
  const char* stepperName() const { return choice_.stepper().name(); }
  std::string describeStepper() const { return choice_.describe(); }
  std::vector<std::string> skips() const {
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
  bool isSleeping() const { return sleeping_; }
  void reset() { startOver(); }

  const Statistics& statistics() const {
    statistics_.right_hand_sides = drivetrain_.rightHandSides();
    statistics_.newton_iterations = drivetrain_.newtonIterations();
    statistics_.stepper_switches = choice_.switches();
    return statistics_;
  }

  const MotionStatus& advanceTo(double time) {
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

  double quietUntil() const {
    if (!status_.ok() || pending_count_ > 0) return time_;
    double reached = absolute(front_.time);
    if (relative(reached) > front_.time) reached = std::nextafter(reached, 0.0);
    return std::max(time_, std::min(reached, nextTimeout()));
  }

  CommandResult command(int input, double value) {
    const CommandInputSettings& settings = scene_.inputs[input];
    if (!std::isfinite(value)) {
      ++statistics_.commands_refused;
      return CommandResult::kRefused;
    }
    const double clamped = std::min(settings.maximum, std::max(settings.minimum, value));
    stage(input, clamped);
    last_command_time_[input] = time_;
    ++statistics_.commands_accepted;
    if (clamped == value) return CommandResult::kAccepted;
    ++statistics_.commands_clamped;
    return CommandResult::kClamped;
  }

  const Sample& sample() {
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

  void trackEnergy(bool on) {
    if (on == energy_.isTracked()) return;
    energy_.track(on);
    sample_valid_ = false;
  }
  Energy energy() {
    const Sample& now = sample();
    return energy_.isTracked() ? now.energy : energy_.calcEnergy(now, calcApplied());
  }
  EnergyDoubt energyDoubt() const {
    const EnergyDoubt doubt = energy_.doubt();
    // The integrator runs ahead of the present.
    return advanced_ && doubt.since <= time_ ? doubt : EnergyDoubt{};
  }

  void calcConstraintRow(int m, double* C) {
    double c0;
    drivetrain_.constraint(m).calcRow(system_.view(front_.time, front_.x), C, &c0);
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  // --- times -----------------------------------------------------------------------------------
  double absolute(double t) const { return origin_ + (origin_rest_ + t); }
  double relative(double time) const { return (time - origin_) - origin_rest_; }
  /// The present as nodes count it.
  double present() const { return relative(time_); }
  /// True when the present lies within the last step, and not at its end.
  bool isInsideStep() const { return base_.time < front_.time && present() != front_.time; }
  /// Counts times from the present on, which is 0 then to the bit.
  void moveOriginToPresent() {
    drivetrain_.moveOrigin(present());
    drivetrain_.setOrigin(time_);
    origin_ = time_;
    origin_rest_ = 0.0;
  }
  /// Counts times from `t`, as they are counted now, on.
  void moveOrigin(double t) {
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

  bool isSampleFinite() const {
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int i = 0; i < S; ++i) {
      poison += 0.0 * (sample_.angle[i] + sample_.velocity[i] + sample_.acceleration[i] +
                       sample_.applied_torque[i] + sample_.reaction_torque[i]);
    }
    return poison == 0.0;
  }

  const MotionStatus& advance(double time) {
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

  // --- start -----------------------------------------------------------------------------------
  void startOver() {
    status_ = MotionStatus{};
    statistics_ = Statistics{};
    time_ = 0.0;
    advanced_ = false;
    step_window_start_ = 0.0;
    steps_in_window_ = 0;
    pending_count_ = 0;
    rhythm_.reset();
    std::fill(std::begin(last_command_time_), std::end(last_command_time_), kNever);
    choice_.reset(starts_implicitly_);
    drivetrain_.resetInputs();
    std::fill(std::begin(row_reference_), std::end(row_reference_), 0.0);
    checks_.reset();
    origin_ = origin_rest_ = 0.0;
    drivetrain_.setOrigin(0.0);
    crossing_ = Crossing{};
    last_crossing_ = LastCrossing{};
    if (knows_start_) {
      // The accelerations of least reaction are the same every time; commands come later.
      front_ = StepNode(system_);
      front_.x = start_;
      initial_result_ = InitialResult::kConsistent;
      sample_valid_ = false;
      restart();
      return;
    }
    start();
    // (Where accelerations are no part of the state, a start also leaves guesses of them.)
    knows_start_ =
        integrates_torque_ && initial_result_ == InitialResult::kConsistent && status_.ok();
    start_ = front_.x;
  }

  /// The state at time 0 with the inputs as they are.
  void start() {
    front_ = StepNode(system_);
    initial_result_ = system_.start(front_.x, nearest_, &velocities_at_fault_);
    sample_valid_ = false;
    base_ = front_;
    switch (initial_result_) {
      case InitialResult::kConsistent:
        choice_.reset();
        restart();
        if (!status_.ok()) break;
        starts_implicitly_ = choice_.isStiffStart(system_, front_, next_step_);
        // Once more, and as every later reset does: what was done to find out is no part of the
        // run.
        drivetrain_.resetCounts();
        choice_.reset(starts_implicitly_);
        restart();
        break;
      case InitialResult::kSingular:
        stop(StopReason::kSingularConstraint);
        status_.constraint = velocities_at_fault_ ? drivetrain_.singularVelocityConstraint()
                                                  : drivetrain_.singularAccelerationConstraint();
        // (Of constraints of order 3 only the solver of all of them knows.)
        if (status_.constraint < 0) status_.constraint = drivetrain_.solver().singularRow();
        break;
      case InitialResult::kNonFinite:
        stop(StopReason::kNonFiniteValue);
        drivetrain_.findNonFinite(system_.view(0.0, front_.x), &status_.torque,
                                  &status_.constraint);
        break;
      case InitialResult::kInconsistent:
      case InitialResult::kNotFound:
      case InitialResult::kNotUnique:
      case InitialResult::kDoubtful:
        stop(StopReason::kProjectionFailed);
        break;
    }
  }

  /// The front is a new beginning (start, command, end of an input's segment): derivative, step.
  void restart() {
    sleeping_ = false;
    hopped_ = false;
    crossing_ = Crossing{};
    rest_.reset();
    choice_.restart();
    stepper_ = &choice_.stepper();
    control_.setOrder(std::max(1, stepper_->errorOrder()));
    moveOrigin(front_.time);
    front_.time = 0.0;
    base_ = front_;
    drivetrain_.refreshInputs(front_.time);
    system_(front_.x, front_.dxdt, front_.time);
    for (double value : front_.dxdt) {
      if (!std::isfinite(value)) {
        explainStop();
        return;
      }
    }
    checks_.noteTorque(front_);
    checks_.noteAccelerations(front_);
    noteRows();
    if (!advanced_) system_.noteReaction(front_);
    base_ = front_;
    if (!guards_.isEmpty()) {
      moveGuards();
      meetEdgeAtStart();
      if (!advanced_ && !leaveCorner()) return;
    }
    control_.reset();
    restart_time_ = front_.time;
    fixed_steps_ = 0;
    if (!choice_.isFixed()) next_step_ = chooseFirstStep();
  }

  /// Of the step before an edge, at least so much is tried behind it.
  static constexpr double kLeastRestart = 1e-8;
  /// A first step from the sizes of x, x' and the change of x' over a small Euler step
  /// (Hairer, Norsett, Wanner: Solving ODE I, II.4).
  double chooseFirstStep() {
    const SolverSettings& solver = scene_.solver;
    const auto size = [&](const State& v) {
      double largest = 0.0;
      for (int i = 0; i < v.size(); ++i) {
        const double allowance =
            solver.absolute_tolerance + solver.relative_tolerance * std::abs(front_.x[i]) + 1e-300;
        largest = std::max(largest, std::abs(v[i]) / allowance);
      }
      return largest;
    };
    const double d0 = size(front_.x);
    const double d1 = size(front_.dxdt);
    double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h0 = std::min(h0, solver.maximum_step);
    State x1(system_.size());
    State change(system_.size());
    for (int i = 0; i < x1.size(); ++i) x1[i] = front_.x[i] + h0 * front_.dxdt[i];
    system_.noteBase(front_.time, front_.x, front_.dxdt);
    system_(x1, change, front_.time + h0);
    for (int i = 0; i < x1.size(); ++i) change[i] -= front_.dxdt[i];
    const double d2 = size(change) / h0;
    const double largest = std::max(d1, d2);
    double h1 = largest <= 1e-15 ? std::max(1e-6, h0 * 1e-3)
                                 : std::pow(0.01 / largest, 1.0 / stepper_->errorOrder());
    if (!std::isfinite(h1)) h1 = 1e-3 * h0;  // the Euler step left the domain
    // Without an absolute tolerance nothing that starts from 0 is ever slow enough: let it try.
    h1 = std::max(h1, 1e-6 * h0);
    return std::min({100.0 * h0, h1, solver.maximum_step});
  }

  // --- free stepping ---------------------------------------------------------------------------
  /// Brings the present to `time`.
  void moveTo(double time) {
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

  /// The limit of steps is one per simulated time and not per advance: how a motion is cut may not
  /// change it.
  bool countStep() {
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

  /// One accepted step from the front. False when the motion stopped.
  bool step() {
    // Two inputs, or an input and a command, may be meant for one instant and be a rounding apart:
    // no step is so short.
    const double reached = front_.time + shortestStep(front_.time);
    if (drivetrain_.inputSegmentEnd() <= reached) {
      double u0[kMaxInputs];
      drivetrain_.evaluateInputs(front_.time);  // a sample may have been taken elsewhere
      copyInputs(u0);
      drivetrain_.finishInputSegments(front_.time, reached);
      if (haveInputsJumped(u0) && !jump(u0)) return false;
      restart();
      if (!status_.ok()) return false;
    }
    base_ = front_;
    system_.noteBase(base_.time, base_.x, base_.dxdt);
    stepper_ = &choice_.stepper();
    const bool is_behind_edge = hopped_;
    const bool is_due = crossing_.isDueAt(base_.time);
    hopped_ = is_due && crossEdge();
    if (hopped_) return true;
    if (!status_.ok()) return false;
    if (is_due) next_step_ = std::min(next_step_, crossing_.otherwise);
    crossing_ = Crossing{};
    // The step before the edge says nothing about this branch. An implicit one that is much too
    // long for a swing or for something that grows damps it without its estimate showing anything.
    if (is_behind_edge && !choice_.isFixed() && stepper_->isImplicit()) {
      const double first = std::max(chooseFirstStep(), kLeastRestart * next_step_);
      next_step_ = std::min(next_step_, first);
    }
    return choice_.isFixed() ? stepFixed() : stepAdaptively();
  }

  bool stepAdaptively() {
    const SolverSettings& solver = scene_.solver;
    const double segment_end = endOfReach();
    bool rejected = false;
    int rejections = 0;
    int looks = 0;
    double h = std::min(next_step_, solver.maximum_step);
    double usual = 0.0;  // the step that would have been made but for an edge
    while (true) {
      // Up to the end of an input's segment at the most, and not leaving a sliver before it.
      const double reach = looks > 0 ? h : 1.01 * h;
      const bool last_of_segment = base_.time + reach >= segment_end;
      const double end = last_of_segment ? segment_end : base_.time + h;
      const double taken = last_of_segment ? segment_end - base_.time : h;
      if (!(taken > shortestStep(base_.time)) || !(taken > 1e-290)) {
        hopped_ = guards_.hasJumps() && crossJumpAhead(kAhead * solver.maximum_step);
        if (!hopped_ && status_.ok()) explainStop();
        return hopped_;
      }
      watch_.begin();
      double norm = stepper_->step(system_, base_, taken, front_.x, dxdt_new_);
      const bool stages_left = watch_.end();
      if (norm <= 1.0)
        norm = worseOf(norm, projectEnd(*stepper_, base_.x, end, taken, norm, front_.x));
      // These decide whether the step is good. They may keep the next one from growing, but not
      // make it shorter: what rounding leaves in them does not fall with the step.
      front_.time = end;
      if (norm <= 1.0) norm = worseOfCheck(norm, checks_.checkTorque(*stepper_, base_, front_));
      if (norm <= 1.0) {
        norm = worseOfCheck(norm, checkAccelerations());
        if (stopWhereToleranceIsLost()) return false;
      }
      if (norm <= 1.0 && !differentiateFront()) norm = std::numeric_limits<double>::quiet_NaN();
      if (!guards_.isEmpty() && std::isfinite(norm) && looks < kMostLooks) {
        // An edge may be the reason for an error that is too large.
        const Look look = norm <= 1.0 ? lookInside(taken, &h) : lookAtEnd(taken, &h);
        if (look == Look::kCrossed) return true;
        if (!status_.ok()) return false;
        if (look == Look::kShorter) {
          usual = std::max(usual, taken);
          ++looks;
          ++statistics_.rejected_steps;
          front_ = base_;
          continue;
        }
        // A torque that jumps was met by the stages and not by the motion: too long a step.
        if (stages_left && norm <= 1.0) norm = kStagesLeft;
      }
      if (norm <= 1.0) {
        ++statistics_.steps;
        double factor = control_.growth(norm);
        if (rejected) factor = std::min(1.0, factor);
        // A step cut short by a segment's end or an edge says nothing about the next one's size.
        next_step_ = last_of_segment ? std::max(h, taken * factor) : taken * factor;
        crossing_.otherwise = next_step_;
        // (What an implicit step thinks of its error when it is much too long is no guide; where
        // the torque is integrated, its change is compared.)
        const bool is_trusted = integrates_torque_ || !stepper_->isImplicit();
        if (usual > taken && is_trusted) next_step_ = std::max(next_step_, usual);
        if (finishStep()) {
          if (!guards_.isEmpty()) moveGuards();
          lookAhead();
          return true;
        }
        if (!status_.ok()) return false;
        norm = std::numeric_limits<double>::quiet_NaN();
      }
      ++statistics_.rejected_steps;
      rejected = true;
      h = taken * control_.shrink(norm);
      front_ = base_;
      crossing_ = Crossing{};
      // Where no step however short succeeds, it may be for a jump just ahead that they all feel
      // (a Jacobian by differences, a stage).
      if (rejections % kHardPressed == kHardPressed - 1 && guards_.hasJumps()) {
        hopped_ = crossJumpAhead(kAhead * solver.maximum_step);
        if (hopped_ || !status_.ok()) return hopped_;
      }
      if (++rejections == kHopeless && choice_.giveUpExplicit()) {
        stepper_ = &choice_.stepper();
        control_.setOrder(stepper_->errorOrder());
        control_.reset();
      }
    }
  }

  /// Where a step from the base has to end at the latest: the end of an input's segment, an instant
  /// at which a law is not smooth, or where a command is expected.
  double endOfReach() const {
    const double now = absolute(base_.time);
    const double instant = drivetrain_.nextInstant(now + 2.0 * shortestStep(now));
    const double segment_end = std::min(drivetrain_.inputSegmentEnd(), relative(instant));
    const double expected = rhythm_.next();
    const double rounding = shortestStep(expected);  // not more than this lies between equals
    const bool is_ahead = expected - now > rounding;
    return is_ahead && relative(expected) <= segment_end + rounding ? relative(expected)
                                                                    : segment_end;
  }

  // --- edges: where a law changes its branch ---------------------------------------------------
  enum class Look {
    kClear,    ///< no edge inside
    kShorter,  ///< the step is to be made again, shorter
    kCrossed   ///< the edge was at the base: the step went across it, and no further
  };

  /// The front is where the next step begins. Accelerations of least reaction that go on in a
  /// corner of psi (least_reaction.h) only seem to leave it, to either side, by rounding.
  void moveGuards() {
    const StateView state = viewOf(front_);
    guards_.moveBase(state);
    if (!system_.isInCorner()) return;
    for (int i = 0; i < guards_.count(); ++i) {
      if (drivetrain_.guardOwner(i).constraint >= 0) guards_.muteOnEdge(i, state, S);
    }
  }

  /// The state of a node whose derivative is known.
  StateView viewOf(const StepNode& node) {
    const double* acceleration =
        integrates_torque_ ? node.x.data() + node.x.size() - S : node.dxdt.data() + S;
    return drivetrain_.view(node.time, node.x.data(), node.x.data() + S, acceleration);
  }
  CurveEnd curveEnd(const StepNode& node) const {
    const double* x = node.x.data();
    const double* last = node.dxdt.data() + node.dxdt.size() - S;
    if (integrates_torque_) return {x, x + S, x + 2 * S, last};
    return {x, x + S, last, nullptr};
  }

  /// Whether any law leaves its branch within the step of length `taken` from the base to the
  /// front, whose derivative is known. kShorter: it has to be made again with the length `next`, to
  /// shortly before the first edge.
  Look lookInside(double taken, double* next) {
    // What both ends tell excludes it most often.
    StateBox box;
    encloseStep(S, curveEnd(base_), curveEnd(front_), taken, &box);
    box.time = {absolute(base_.time), absolute(front_.time)};
    if (guards_.isClear(box)) return keepCrossing();
    traceStep(taken);
    Look look = aimAtEdge(taken, next);
    // The last derivative taken is the front's: its row is looked at.
    State unused(system_.size());
    if (look == Look::kClear) system_(front_.x, unused, front_.time);
    return look;
  }
  /// The same for a step whose error was too large: whether it ended beyond an edge.
  Look lookAtEnd(double taken, double* next) {
    for (double value : front_.x) {
      if (!std::isfinite(value)) return Look::kClear;
    }
    system_(front_.x, front_.dxdt, front_.time);
    if (!guards_.hasAnyLeft(viewOf(front_))) return Look::kClear;
    // The cubic through both ends tells about where.
    curve_.begin(absolute(base_.time), taken, S, integrates_torque_);
    for (int n = 0; n < StepCurve::kNodes; ++n) {
      const double part = StepCurve::node(n);
      const double rest = 1.0 - part;
      State x(system_.size());
      for (int m = 0; m < x.size(); ++m) {
        const double change = front_.x[m] - base_.x[m];
        const double bend =
            rest * (taken * base_.dxdt[m] - change) - part * (taken * front_.dxdt[m] - change);
        x[m] = base_.x[m] + part * (change + rest * bend);
      }
      curve_.setNode(n, x.data());
    }
    curve_.finish();
    const double refused = *next;
    const Look look = aimAtEdge(taken, next, false);
    if (look != Look::kShorter || *next <= 0.9 * taken) return look;
    *next = refused;
    return Look::kClear;
  }

  /// The first edge along the curve: crossed where it is at the base, the step to it otherwise.
  Look aimAtEdge(double taken, double* next, bool may_cross = true) {
    const double shortest = 2.0 * shortestStep(absolute(base_.time));
    const double resolution = std::max(kEdgeResolution, shortest / taken);
    const GuardFinding finding = guards_.find(curve_, resolution);
    if (finding.kind == GuardFinding::Kind::kClear) return keepCrossing();
    crossing_ = Crossing{};
    if (finding.kind == GuardFinding::Kind::kUnknown) {
      *next = taken * std::max(finding.clear, 0.1);
      return Look::kShorter;
    }
    // The step ends a little before the edge, for no stage to lie behind it.
    const double margin = kMargin * taken + shortest;
    crossing_.guard = finding.guard;
    crossing_.side = guards_.side(finding.guard);
    crossing_.length = (finding.beyond - finding.clear) * taken + margin + shortest;
    *next = finding.clear * taken - margin;
    if (*next > margin) {
      crossing_.at = base_.time + *next;
      return Look::kShorter;
    }
    crossing_.at = base_.time;
    crossing_.length += *next;
    hopped_ = may_cross && crossEdge();
    if (hopped_) return Look::kCrossed;
    // It is not there: the curve of so long a step is no good.
    crossing_ = Crossing{};
    *next = 0.25 * taken;
    return Look::kShorter;
  }
  /// An edge that was found by a longer step stays the next one only when this one ends there.
  Look keepCrossing() {
    if (!crossing_.isDueAt(front_.time)) crossing_ = Crossing{};
    return Look::kClear;
  }

  /// The motion inside the step from base to front as polynomials: by the dense output where there
  /// is one, and else by shorter steps from the base.
  void traceStep(double taken) {
    curve_.begin(absolute(base_.time), taken, S, integrates_torque_);
    for (int n = 0; n < StepCurve::kNodes; ++n) {
      const double time = base_.time + StepCurve::node(n) * taken;
      State x(system_.size());
      if (n == 0) {
        x = base_.x;
      } else if (n + 1 == StepCurve::kNodes) {
        x = front_.x;
      } else if (!stepper_->hasDenseOutput() ||
                 !stepper_->interpolate(system_, time, base_, front_, x)) {
        State unused(system_.size());
        choice_.innerOf(*stepper_).step(system_, base_, time - base_.time, x, unused);
      }
      curve_.setNode(n, x.data());
    }
    curve_.finish();
  }

  /// The beginning of a motion on the edge of a jump: which of both branches it takes is to be seen
  /// at once.
  void meetEdgeAtStart() {
    for (int i = 0; i < guards_.count(); ++i) {
      if (guards_.side(i) != Guard::kOnEdge || !guards_.guard(i).jumps()) continue;
      crossing_.guard = i;
      crossing_.side = guards_.side(i);
      crossing_.at = front_.time;
      crossing_.length = 2.0 * shortestStep(std::max(1.0, std::abs(absolute(front_.time))));
      return;
    }
  }

  /// A motion that begins in a corner of psi (a zero of abs(e1), say, where the least reaction
  /// often lies): C is another one on each of its sides, and the motion takes the side on which its
  /// own jerk leads away from the corner. False, and the motion stopped, when neither side or
  /// either does.
  bool leaveCorner() {
    if (integrates_torque_) {
      for (const Constraint* kink : drivetrain_.kinks()) {
        double G[kMaxShafts];
        const StateView state = viewOf(front_);
        const double g = kink->calcResidualAndJacobian(state, G);
        double size = 0.0;
        for (int i = 0; i < S; ++i)
          size += std::abs(G[i]) * (1.0 + std::abs(state.acceleration[i]));
        if (!(std::abs(g) <= kCorner * size)) continue;
        bool is_still = true;
        for (int n = 2 * S; n < front_.dxdt.size(); ++n) {
          is_still = is_still && front_.dxdt[n] == 0.0;
        }
        if (is_still) continue;
        int leading = 0;
        StepNode best = front_;
        for (const double side : {1.0, -1.0}) {
          StepNode beside = front_;
          if (moveAside(*kink, G, side * 10.0 * kCorner * size, beside)) {
            best = beside;
            ++leading;
          }
        }
        if (leading == 1) {
          front_ = best;
          base_ = front_;
          moveGuards();
          continue;
        }
        stop(StopReason::kChattering);
        for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
          for (const ConstraintPtr& own : drivetrain_.constraint(m).kinks()) {
            if (own.get() == kink) status_.constraint = m;
          }
        }
        return false;
      }
    }
    return true;
  }
  /// Moves the accelerations of a node in a corner to where `kink`, whose gradient is G, has about
  /// the value `distance`, along psi = 0. False where the jerk there leads back into the corner.
  bool moveAside(const Constraint& kink, const double* G, double distance, StepNode& node) {
    double direction[kMaxShafts];
    drivetrain_.inertia().solve(G, direction);
    double slope = 0.0;
    for (int i = 0; i < S; ++i) slope += G[i] * direction[i];
    if (!(slope > 0.0)) return false;
    double* acceleration = node.x.data() + node.x.size() - S;
    for (int i = 0; i < S; ++i) acceleration[i] += distance / slope * direction[i];
    State moved(system_.size());
    if (system_.project(node.time, node.x, moved, &statistics_.projections) !=
        ProjectionResult::kConverged) {
      return false;
    }
    system_(node.x, node.dxdt, node.time);
    double row[kMaxShafts];
    double rate;
    const StateView state = viewOf(node);
    if (!(kink.calcResidual(state) * distance > 0.0)) return false;
    kink.calcRow(state, row, &rate);
    for (int i = 0; i < S; ++i) rate += row[i] * node.dxdt[node.dxdt.size() - S + i];
    return rate * distance > 0.0;
  }

  /// x at a short time after a node, by what is known there: Taylor's series.
  State goAhead(const StepNode& from, double length) const {
    State x = from.x;
    for (int n = 0; n < x.size(); ++n) {
      double change = from.dxdt[n];
      if (n + S < x.size()) change += 0.5 * length * from.dxdt[n + S];
      if (n + 2 * S < x.size()) change += length * length / 6.0 * from.dxdt[n + 2 * S];
      x[n] += length * change;
    }
    return x;
  }

  /// A step over the edge that lies just ahead of the base, to as little beyond it as can be told:
  /// so short that a series from the base will do, and that no stepper makes stages on both sides.
  /// A torque that bends or jumps there moves the accelerations by the jump map. False, and nothing
  /// done, when the edge is not there, or when the motion stopped.
  bool crossEdge() {
    constexpr int kAttempts = 2;
    constexpr int kMostAttempts = 25;
    constexpr int kHalvings = 60;
    constexpr double kDepth = 1e-5;
    constexpr double kShyOfIt = 0.999;
    const int guard = crossing_.guard;
    // The step before may have ended a little beyond it, by the error of its dense output.
    if (guards_.side(guard) != crossing_.side) return false;
    int branch = Guard::kOnEdge;
    // Accelerations that the principle gives are known at a state, not along a series. They may go
    // on in the corner that an edge is for them (least_reaction.h).
    const int owner = drivetrain_.guardOwner(guard).constraint;
    const bool follows =
        !integrates_torque_ && owner >= 0 && drivetrain_.constraint(owner).order() == 2;
    const auto isBeyond = [&](double length) {
      front_.time = base_.time + length;
      front_.x = goAhead(base_, length);
      if (follows) {
        system_(front_.x, front_.dxdt, front_.time);
        if (system_.isInCorner()) return true;
      } else if (!integrates_torque_) {
        front_.dxdt = base_.dxdt;
      }
      branch = guards_.guard(guard).branch(viewOf(front_));
      return branch != Guard::kOnEdge && branch != guards_.side(guard);
    };
    double beyond = crossing_.length;
    int attempt = 0;
    while (!isBeyond(beyond) && ++attempt < (follows ? kMostAttempts : kAttempts) &&
           (!follows || isSeriesGood(beyond))) {
      beyond *= 4.0;
    }
    if (!isBeyond(beyond) || base_.time + beyond >= drivetrain_.inputSegmentEnd()) {
      front_ = base_;
      return false;
    }
    double before = 0.0;
    for (int halving = 0; halving < kHalvings; ++halving) {
      const double middle = 0.5 * (before + beyond);
      if (!(middle > before && middle < beyond)) break;
      (isBeyond(middle) ? beyond : before) = middle;
    }
    if (before > 0.0 && !isSeriesGood(kShyOfIt * before)) {
      front_ = base_;
      return false;
    }
    const double depth = kDepth * beyond + 2.0 * shortestStep(absolute(base_.time));
    const double reached = isBeyond(beyond + depth) ? beyond + depth : beyond;
    // A kink bends the accelerations. Where they jump, the least reaction that they followed has
    // ended there, and the next one is another motion's: as at a fold of a smooth psi.
    if (follows && haveAccelerationsJumped(isBeyond, before, reached)) {
      front_ = base_;
      stop(StopReason::kProjectionFailed);
      return false;
    }
    isBeyond(reached);
    return enterBranch(reached - beyond) && noteCrossing(guard, branch, depth);
  }

  /// Whether the accelerations at two lengths next to each other are not the same. `go` brings the
  /// front there, with its derivative.
  template <class Go>
  bool haveAccelerationsJumped(const Go& go, double before, double beyond) {
    constexpr double kJump = 1e-5;
    go(before);
    const State first = front_.dxdt;
    go(beyond);
    for (int n = first.size() - S; n < first.size(); ++n) {
      const double size = 1.0 + std::abs(first[n]);
      if (!(std::abs(front_.dxdt[n] - first[n]) <= kJump * size)) return true;
    }
    return false;
  }

  /// Whether the series from the base is good up to `length` from there, still on its branch: the
  /// rate of the velocities there is what it says, within the tolerance that they make of it.
  bool isSeriesGood(double length) {
    const double time = base_.time + length;
    const State x = goAhead(base_, length);
    double before[kMaxShafts];
    double after[kMaxShafts];
    if (integrates_torque_) {
      drivetrain_.calcTorque(system_.view(base_.time, base_.x), before);
      drivetrain_.calcTorque(system_.view(time, x), after);
      for (int i = 0; i < S; ++i) before[i] += length * base_.torque_rate[i];
      for (int i = 0; i < S; ++i)
        after[i] = (after[i] - before[i]) / drivetrain_.inertia().entry(i, i);
    } else {
      State dxdt(system_.size());
      system_(x, dxdt, time);
      for (int i = 0; i < S; ++i) after[i] = 0.5 * (dxdt[S + i] - base_.dxdt[S + i]);
    }
    double largest = 0.0;
    for (int i = 0; i < S; ++i) {
      largest = worseOf(largest, length * std::abs(after[i]) / tolerance_.of(x[S + i]));
    }
    return largest <= 1.0;
  }

  /// The jump that the series from the base meets within `reach`, if any.
  bool crossJumpAhead(double reach) {
    StepNode ahead = base_;
    ahead.time += reach;
    ahead.x = goAhead(base_, reach);
    for (int i = 0; i < guards_.count(); ++i) {
      if (!guards_.guard(i).jumps() || !guards_.hasLeft(i, viewOf(ahead))) continue;
      crossing_.guard = i;
      crossing_.side = guards_.side(i);
      crossing_.at = base_.time;
      crossing_.length = reach;
      if (crossEdge()) return true;
      if (!status_.ok()) return false;
    }
    crossing_ = Crossing{};
    front_ = base_;
    return false;
  }

  /// The front, where x is about to be that of the other side of an edge, `late` s behind it:
  /// projection, jumps, derivative.
  bool enterBranch(double late) {
    // What may jump there: a torque or the constraint itself, by `sign`, and the accelerations that
    // f' = 0 asks for, by a kink of f.
    bool jumps = false;
    bool kinks_velocity_row = false;
    int jumping_row = -1;
    const StateView there = viewOf(front_);
    for (int i = 0; i < guards_.count(); ++i) {
      const int branch = guards_.guard(i).branch(there);
      if (branch == Guard::kOnEdge || branch == guards_.side(i)) continue;
      const int row = drivetrain_.guardOwner(i).constraint;
      const bool jumps_here = guards_.guard(i).jumps();
      if (row < 0) {
        jumps = jumps || jumps_here;
      } else {
        const int order = drivetrain_.constraint(row).order();
        kinks_velocity_row = kinks_velocity_row || order == 1;
        if (jumps_here && order < 3) jumping_row = row;
      }
    }
    if (kinks_velocity_row && !system_.crossKink(base_, front_)) return refuseEdge();
    State moved(system_.size());
    const ProjectionResult projected =
        system_.project(front_.time, front_.x, moved, &statistics_.projections);
    if (projected != ProjectionResult::kConverged) return refuseEdge();
    if (kinks_velocity_row && integrates_torque_) {
      for (int n = 2 * S; n < moved.size(); ++n) moved[n] = 0.0;
    }
    const double displaced = calcErrorNorm(moved, base_.x, front_.x, tolerance_);
    if (jumping_row >= 0 && !(displaced <= 1.0)) {
      front_ = base_;
      stop(StopReason::kJumpFailed);
      status_.constraint = jumping_row;
      return false;
    }
    if (!jumpOverEdge(late)) return false;
    checks_.noteTorque(front_);
    system_.restoreReaction(front_, kAnyway);
    system_(front_.x, front_.dxdt, front_.time);
    for (double value : front_.dxdt) {
      if (!std::isfinite(value)) return refuseEdge();
    }
    if (kinks_velocity_row || jumps) choice_.restart();
    noteRowsAnew();
    if (!finishStep()) return refuseEdge();
    checks_.noteTorque(front_);
    moveGuards();
    ++statistics_.steps;
    ++statistics_.kinks;
    crossing_ = Crossing{};
    return true;
  }
  bool refuseEdge() {
    front_ = base_;
    return false;
  }

  /// The jump map by what the torque at the front is more than its rate at the base tells.
  bool jumpOverEdge(double late) {
    if (integrates_torque_) {
      const double length = front_.time - base_.time;
      double before[kMaxShafts];
      double torque_jump[kMaxShafts];
      bool is_any = false;
      drivetrain_.calcTorque(system_.view(base_.time, base_.x), before);
      drivetrain_.calcTorque(system_.view(front_.time, front_.x), torque_jump);
      for (int i = 0; i < S; ++i) {
        torque_jump[i] -= before[i] + length * base_.torque_rate[i];
        is_any = is_any || std::abs(torque_jump[i]) > 1e-15 * std::abs(before[i]);
      }
      if (!is_any) return true;
      State x = front_.x;
      const MotionStatus result =
          system_.jumpTorque(front_.time, x, torque_jump, &statistics_.projections);
      if (!result.ok()) {
        front_ = base_;
        status_ = result;
        status_.time = absolute(front_.time);
        return false;
      }
      // It jumped at the edge itself, and the velocities have changed since.
      for (int i = 0; i < S; ++i) {
        const double change = x[2 * S + i] - front_.x[2 * S + i];
        x[S + i] += late * change;
        x[i] += 0.5 * late * late * change;
      }
      front_.x = x;
      State moved(system_.size());
      if (system_.project(front_.time, front_.x, moved, &statistics_.projections) !=
          ProjectionResult::kConverged) {
        return refuseEdge();
      }
    }
    return true;
  }

  /// After `guard` was left for `branch` by a step: false, and the motion stopped, when
  /// the motion turns back at once. What jumps tells so at once; a kink may be touched.
  /// `depth`, s: so far beyond the edge did the step go.
  bool noteCrossing(int guard, int branch, double depth) {
    const bool jumps = guards_.guard(guard).jumps();
    const double now = absolute(front_.time);
    const bool at_once = guard == last_crossing_.guard &&
                         now - last_crossing_.time <= kAtOnce * (depth + last_crossing_.depth);
    last_crossing_ = {guard, now, depth, at_once ? last_crossing_.count + 1 : 0};
    if (!jumps && !integrates_torque_ && last_crossing_.count >= kMostTouches) {
      // Accelerations of least reaction may go on in the corner itself (least_reaction.h).
      guards_.mute(guard);
      return true;
    }
    bool turns_back = last_crossing_.count >= (jumps ? 1 : kMostTouches);
    if (jumps && !turns_back) {
      StepNode ahead = front_;
      ahead.time += 4.0 * depth;
      ahead.x = goAhead(front_, 4.0 * depth);
      const int next = guards_.guard(guard).branch(viewOf(ahead));
      turns_back = next != branch && next != Guard::kOnEdge;
    }
    if (!turns_back) return true;
    front_ = base_;
    stop(StopReason::kChattering);
    status_.torque = drivetrain_.guardOwner(guard).torque;
    status_.constraint = drivetrain_.guardOwner(guard).constraint;
    return false;
  }

  bool stepFixed() {
    // Multiples of the step, not sums of it: no rounding piles up.
    // (A step across an edge may have gone a little beyond the next one.)
    double grid = base_.time;
    while (!(grid > base_.time)) {
      grid = restart_time_ + static_cast<double>(++fixed_steps_) * scene_.solver.step;
    }
    --fixed_steps_;
    double end = std::min(grid, endOfReach());
    for (int looks = 0;; ++looks) {
      if (!(end > base_.time)) {
        stop(StopReason::kStepUnderflow);
        return false;
      }
      const double taken = end - base_.time;
      const double norm = stepper_->step(system_, base_, taken, front_.x, dxdt_new_);
      const double moved = projectEnd(*stepper_, base_.x, end, taken, norm, front_.x);
      if (!std::isfinite(norm) || !std::isfinite(moved)) {
        front_ = base_;
        explainStop();
        return false;
      }
      front_.time = end;
      const double unaccounted =
          worseOf(checks_.checkTorque(*stepper_, base_, front_), checkAccelerations());
      const bool differentiated = differentiateFront();
      if (differentiated && !guards_.isEmpty() && looks < kMostLooks) {
        double shorter = taken;
        const Look look = lookInside(taken, &shorter);
        if (look == Look::kCrossed) return true;
        if (!status_.ok()) return false;
        if (look == Look::kShorter) {
          end = base_.time + shorter;
          front_ = base_;
          continue;
        }
      }
      if (end == grid) ++fixed_steps_;
      ++statistics_.steps;
      if (!differentiated || !finishStep()) {
        if (status_.ok()) {
          front_ = base_;
          explainStop();
        }
        return false;
      }
      if (!guards_.isEmpty()) moveGuards();
      const double estimate = worseOf(
          worseOf(norm, moved), worseOf(unaccounted, stepper_->estimateFromEnd(base_, front_)));
      statistics_.largest_error_estimate = std::max(statistics_.largest_error_estimate, estimate);
      // The tolerance is no bound for steps of fixed size; but a step whose error is a part of the
      // state itself describes nothing any more.
      const double part = estimate * scene_.solver.relative_tolerance;
      if (part <= kCrudest) return true;  // not when NaN
      front_ = base_;
      stop(StopReason::kStepTooLarge);
      status_.measure = part;
      return false;
    }
  }

  /// Projects x, to which `stepper` has gone from x_old by h and which stands at `end`, if the
  /// stepper has not done so; the size of the move in units of the tolerance (an error measure that
  /// is independent of the stepper's), or NaN when it failed.
  ///
  /// What rounding alone makes of it counts for nothing: shorter steps do not help. It is looked at
  /// where the move is more than a step's own error `estimate`.
  double projectEnd(const Stepper& stepper, const State& x_old, double end, double h,
                    double estimate, State& x) {
    if (!stepper.projects()) {
      for (double value : x) {
        if (!std::isfinite(value)) return std::numeric_limits<double>::quiet_NaN();
      }
    }
    if (drivetrain_.constraintCount() == 0) return 0.0;
    StepProjection own(system_.size());
    if (stepper.isImplicit()) {
      own.result = projectStiffly(system_, stepper, end, h, x, own);
    } else if (!stepper.projects()) {
      own.result = system_.project(end, x, own.moved, &own.iterations);
    }
    const StepProjection& projection = stepper.projects() ? stepper.projection() : own;
    statistics_.projections += projection.iterations;
    if (projection.result != ProjectionResult::kConverged) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    // Stages that hold psi = 0 themselves leave rounding to the projection, no error.
    if (stepper.keepsConstraints() && system_.keepsConstraintsInStages()) return 0.0;
    const double norm = calcErrorNorm(projection.moved, x_old, x, tolerance_);
    if (norm <= kSteady || norm <= estimate) return norm;
    return discountRounding(end, x_old, x, projection.moved);
  }

  /// The size of a move onto the constraints without what rounding makes of it; where that is more
  /// than the tolerance it is told.
  double discountRounding(double end, const State& x_old, const State& x, const State& moved) {
    double velocity[kMaxShafts];
    double acceleration[kMaxShafts];
    drivetrain_.calcProjectionRounding(system_.view(end, x), velocity, acceleration);
    State left = moved;
    double rounding = 0.0;
    const auto discount = [&](int n, double size) {
      left[n] = std::max(0.0, moved[n] - size);
      rounding = std::max(rounding, size / tolerance_.of(x[n]));
    };
    for (int i = 0; i < S; ++i) {
      discount(S + i, velocity[i]);
      if (integrates_torque_) discount(x.size() - S + i, acceleration[i]);
    }
    const double norm = calcErrorNorm(left, x_old, x, tolerance_);
    if (norm <= 1.0 && rounding > 1.0) {
      statistics_.largest_rounding = std::max(statistics_.largest_rounding, rounding);
    }
    return norm;
  }

  /// x' at the new front. False when it is not finite.
  bool differentiateFront() {
    const bool moved = system_.restoreReaction(front_, kLittle);
    if (stepper_->projects() && !moved) {
      front_.dxdt = dxdt_new_;
    } else {
      system_(front_.x, front_.dxdt, front_.time);
    }
    for (double value : front_.dxdt) {
      if (!std::isfinite(value)) return false;
    }
    return true;
  }

  /// The checks of Q' and C at the new front, whose derivative was the last one taken. False when
  /// the front is no good: then either the motion has stopped or the step is to be repeated
  /// shorter.
  bool finishStep() {
    checks_.noteTorqueRate(front_);
    checks_.noteAccelerations(front_);
    if (!checks_.isTorqueFollowed(*stepper_, base_, front_)) return false;
    return noteRows();
  }

  /// After an accepted step of adaptive size: another stepper for the next one? at rest?
  void lookAhead() {
    if (stepper_->isImplicit()) ++statistics_.implicit_steps;
    if (!drivetrain_.readsTime() && scene_.solver.sleep) {
      // Angles that nothing reads go on at constant speed.
      double rate = 0.0;
      double change = 0.0;
      for (int n = system_.readsAngles() ? 0 : S; n < front_.x.size(); ++n) {
        const double allowed = tolerance_.of(front_.x[n]);
        rate = std::max(rate, std::abs(front_.dxdt[n]) / allowed);
        change = std::max(change, std::abs(front_.x[n] - base_.x[n]) / allowed);
      }
      if ((rate == 0.0 || rest_.noteStep(change)) && fallAsleep()) {
        ++statistics_.sleeps;
        return;
      }
      if (choice_.settle(front_, rate * (front_.time - base_.time))) {
        control_.setOrder(choice_.stepper().errorOrder());
        control_.reset();
        return;
      }
    }
    if (!choice_.isAutomatic()) return;
    const double limit =
        std::min(scene_.solver.maximum_step, drivetrain_.inputSegmentEnd() - front_.time);
    if (choice_.reconsider(system_, front_, limit, &next_step_)) {
      control_.setOrder(choice_.stepper().errorOrder());
      control_.reset();
    }
  }

  /// The larger one of `norm` and a check; of one that is passed only so much counts that steps
  /// stay about as long as they are.
  static double worseOfCheck(double norm, double check) {
    return worseOf(norm, check <= 1.0 ? std::min(check, kSteady) : check);
  }

  double checkAccelerations() {
    // Just before a jump of the torque what lies beside the end may lie behind it.
    if (crossing_.isDueAt(front_.time) && guards_.guard(crossing_.guard).jumps()) return 0.0;
    const State* dxdt = stepper_->projects() ? &dxdt_new_ : nullptr;
    return checks_.checkAccelerations(*stepper_, base_, front_.time, front_.x, dxdt);
  }
  /// True, and the motion stopped at the base, when the accelerations that follow from the state
  /// are not known to the tolerance any more.
  bool stopWhereToleranceIsLost() {
    const double measure = checks_.unattainable();
    if (measure > 1.0) {
      statistics_.largest_rounding = std::max(statistics_.largest_rounding, measure);
    }
    if (!checks_.isToleranceLost()) return false;
    front_ = base_;
    explainStop(StopReason::kToleranceTooSmall);
    if (status_.reason == StopReason::kToleranceTooSmall) status_.measure = measure;
    return true;
  }

  /// From the front on nothing is stepped until the end of the term (rest.h). False when that is
  /// too short to be worth its search.
  bool fallAsleep() {
    const double term =
        rest_.calcTerm(front_.time, front_.x, front_.dxdt, tolerance_, left_at_sleep_end_);
    sleeping_ = term >= kLeastSleep * scene_.solver.maximum_step;
    sleep_end_ = front_.time + term;
    return sleeping_;
  }
  /// The front goes to the end of the term; the motion sleeps on from there, or is stepped again.
  /// False when it stopped.
  bool finishSleep() {
    StepNode end = front_;
    end.time = sleep_end_;
    calcRest(sleep_end_, end.x);
    cutEnergy(end);
    front_.time = end.time;
    front_.x = end.x;
    State x = end.x;
    for (int n = 0; n < x.size(); ++n) x[n] += left_at_sleep_end_[n];
    State moved(system_.size());
    const ProjectionResult projected =
        system_.project(front_.time, x, moved, &statistics_.projections);
    if (projected == ProjectionResult::kConverged) front_.x = x;
    restart();
    if (status_.ok()) fallAsleep();
    return status_.ok();
  }
  /// x at `time` of a motion at rest: the front's, angles gone on at constant speed.
  void calcRest(double time, State& x) const {
    x = front_.x;
    if (system_.readsAngles()) return;
    for (int n = 0; n < S; ++n) x[n] += (time - front_.time) * front_.x[S + n];
  }

  /// Compares the rows of C with the longest that each has been. False, and the motion stopped,
  /// when one has vanished.
  bool noteRows() {
    system_.noteColumns();
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      const double length_squared = system_.rowLengthSquared(m);
      row_reference_[m] = std::max(row_reference_[m], length_squared);
      if (length_squared <= kVanished * kVanished * row_reference_[m]) {
        stop(StopReason::kSingularConstraint);
        status_.constraint = m;
        status_.measure = std::sqrt(length_squared / row_reference_[m]);
        return false;
      }
    }
    return drivetrain_.hasConstantRows() || !haveRowsTurned();
  }

  /// True when a row of C has turned by more than 90 degrees (in the metric J^-1) since the base:
  /// no step that follows C does that, but one that passes over a zero of C does, and on the other
  /// side the motion is not determined. Keeps the rows of the front otherwise.
  bool haveRowsTurned() {
    double turned[kMaxShafts];
    const bool is_start = base_.time == front_.time || std::exchange(has_new_rows_, false);
    for (int m = 0; m < drivetrain_.constraintCount() && !is_start; ++m) {
      drivetrain_.inertia().solve(system_.row(m), turned);
      double product = 0.0;
      for (int i = 0; i < S; ++i) product += row_before_[m][i] * turned[i];
      if (!(product > 0.0)) return true;
    }
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      std::copy_n(system_.row(m), S, row_before_[m]);
    }
    return false;
  }

  /// The rows of C at the next front are not compared with those before.
  void noteRowsAnew() { has_new_rows_ = true; }

  /// Stops at the front, where no step however short succeeds, and finds out why; `otherwise` is
  /// the reason where nothing more is found.
  void explainStop(StopReason otherwise = StopReason::kStepUnderflow) {
    stop(otherwise);
    if (nameBadValue(front_.time, front_.x)) return;
    const StateView state = system_.view(front_.time, front_.x);
    double c0[kMaxRows] = {};
    if (!drivetrain_.calcRows(state, c0)) {
      status_.reason = StopReason::kSingularConstraint;
      status_.constraint = drivetrain_.solver().singularRow();
      status_.measure = drivetrain_.solver().singularMeasure();
      return;
    }
    // The step underflows before the rank is lost outright: eta grows without bound near there.
    const double pivot = drivetrain_.solver().calcSmallestPivot(&status_.constraint);
    if (pivot < 1e-9) {
      status_.reason = StopReason::kSingularConstraint;
      status_.measure = pivot;
      return;
    }
    status_.constraint = -1;
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      // Where C goes to zero like sqrt(t* - t) the step underflows first, at C ~ 1e-8.
      const double left =
          std::sqrt(drivetrain_.solver().rowLengthSquared(m) / std::max(row_reference_[m], 1e-300));
      if (left < 1e-5) {
        status_.reason = StopReason::kSingularConstraint;
        status_.constraint = m;
        status_.measure = left;
        return;
      }
    }
    // Just ahead of the front: does a component leave its domain there?
    double h = 1e-14 * std::max(1.0, std::abs(front_.time));
    for (int decade = 0; decade < 12; ++decade, h *= 10.0) {
      State ahead(system_.size());
      for (int i = 0; i < ahead.size(); ++i) {
        ahead[i] = front_.x[i] + h * front_.dxdt[i];
        if (!std::isfinite(ahead[i])) return;
      }
      if (nameBadValue(front_.time + h, ahead)) return;
    }
  }

  /// Names a value that is not finite at (t, x) in the status: a torque, a constraint, or, under
  /// the classical principle, accelerations that do not exist. False when there is none.
  bool nameBadValue(double t, const State& x) {
    static constexpr double kZeros[kMaxShafts] = {};
    StateView state = system_.view(t, x);
    bool solved = true;
    for (int i = 0; i < S; ++i) solved = solved && std::isfinite(state.acceleration[i]);
    if (!solved) state.acceleration = kZeros;
    if (drivetrain_.findNonFinite(state, &status_.torque, &status_.constraint)) {
      status_.reason = StopReason::kNonFiniteValue;
      return true;
    }
    if (!solved) status_.reason = StopReason::kProjectionFailed;
    return !solved;
  }

  void stop(StopReason reason) {
    status_.reason = reason;
    status_.time = absolute(front_.time);
  }

  // --- inside the last step --------------------------------------------------------------------
  bool isDenseOutputGood() const {
    if (!stepper_->hasDenseOutput()) return false;
    // Where accelerations follow from the state, an error of it may be large for them.
    return integrates_torque_ || stepper_->checksDenseOutput();
  }
  /// x at the present, by dense output where the stepper has it.
  void sampleInside(State& x) {
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
          stepper_->isImplicit() ? projectStiffly(system_, *stepper_, now, h, slope, x, moved,
                                                  &statistics_.projections)
                                 : system_.project(now, x, moved, &statistics_.projections);
      if (result == ProjectionResult::kConverged) return;
    }
    StepNode node(system_);
    x = reachPresent(&node) ? node.x : base_.x;
  }

  /// Steps from the base to the present, which lies inside the last step, to the full order and
  /// with the full error control: what the motion continues from after a command.
  /// False, and the motion stopped at the base, in the odd case that no step however short
  /// succeeds.
  bool reachPresent(StepNode* node) {
    const double now = present();
    if (sleeping_) {
      node->time = now;
      calcRest(now, node->x);
      return true;
    }
    Stepper& stepper = choice_.innerOf(*stepper_);
    *node = base_;
    if (hopped_) {
      node->time = now;
      node->x = goAhead(base_, now - base_.time);
      return true;
    }
    double h = now - base_.time;
    int steps = 0;
    while (now - node->time > shortestStep(now)) {
      if (++steps > scene_.solver.maximum_steps) {
        stop(StopReason::kStepLimit);
        status_.time = time_ = absolute(node->time);
        return false;
      }
      const bool last = node->time + h >= now;
      const double end = last ? now : node->time + h;
      const StepNode start = *node;
      if (!(end > start.time)) {
        base_ = front_ = start;
        explainStop();
        time_ = absolute(start.time);
        return false;
      }
      double norm = stepper.step(system_, start, end - start.time, node->x, node->dxdt);
      if (norm <= 1.0 || (choice_.isFixed() && std::isfinite(norm))) {
        const double moved = projectEnd(stepper, start.x, end, end - start.time, norm, node->x);
        norm = worseOf(norm, moved);
      }
      if (norm <= 1.0) {
        const State* dxdt = stepper.projects() ? &node->dxdt : nullptr;
        norm = worseOf(norm, checks_.checkAccelerations(stepper, start, end, node->x, dxdt));
      }
      if (norm <= 1.0 || (choice_.isFixed() && std::isfinite(norm))) {
        node->time = end;
        if (!last && !stepper.projects()) system_(node->x, node->dxdt, end);
        h *= 2.0;
      } else {
        *node = start;
        h = 0.5 * (end - start.time);  // rare: a shorter step is nearly always better
      }
    }
    node->time = now;
    return true;
  }

  // --- energy ----------------------------------------------------------------------------------
  /// The step from the base to the front was accepted.
  void noteEnergy() {
    if (!integrates_torque_) {
      // Steps of fixed size have had no need of it.
      if (choice_.isFixed()) checks_.noteTorque(front_);
    }
    energy_.noteStep(base_, front_, row_before_,
                     [this](double theta, State& x) { calcInside(theta, x); });
  }
  /// The motion goes on from `present`, inside the last step or at rest.
  void cutEnergy(const StepNode& present) {
    if (sleeping_) {
      energy_.cutAtRest(front_, present);
    } else {
      energy_.cut(base_, front_, present, [this](double theta, State& x) { calcInside(theta, x); });
    }
  }
  /// The applied energy at the present, J.
  double calcApplied() {
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
  /// x at base + theta (front - base): within about the tolerance, not projected, and without a
  /// word in the motion's status.
  void calcInside(double theta, State& x) {
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

  // --- commands --------------------------------------------------------------------------------
  /// Of several commands to one input the last one counts.
  void stage(int input, double value) {
    sample_valid_ = false;
    for (int p = 0; p < pending_count_; ++p) {
      if (pending_[p].input != input) continue;
      pending_[p].value = value;
      return;
    }
    pending_[pending_count_++] = {input, value};
  }

  double nextTimeout() const {
    double next = kNever;
    for (int i = 0; i < drivetrain_.inputCount(); ++i) {
      const double timeout = scene_.inputs[i].timeout;
      if (timeout > 0.0 && last_command_time_[i] != kNever) {
        next = std::min(next, last_command_time_[i] + timeout);
      }
    }
    return next;
  }

  /// The inputs whose command is overdue at the present.
  void applyTimeouts() {
    for (int i = 0; i < drivetrain_.inputCount(); ++i) {
      const CommandInputSettings& settings = scene_.inputs[i];
      if (settings.timeout <= 0.0 || last_command_time_[i] == kNever) continue;
      // (Two that are meant for one instant may be a rounding apart.)
      if (last_command_time_[i] + settings.timeout > time_ + shortestStep(time_)) continue;
      last_command_time_[i] = kNever;
      ++statistics_.command_timeouts;
      if (settings.on_timeout == OnTimeout::kZero) {
        stage(i, std::min(settings.maximum, std::max(settings.minimum, 0.0)));
      }
    }
  }

  /// All pending commands take effect at the present, together: inputs that jump move on the
  /// straight line between their old and new values, so that no order means anything.
  void applyPending() {
    if (pending_count_ == 0 || !status_.ok()) return;
    const int count = std::exchange(pending_count_, 0);
    if (!advanced_) {
      applyInitialCommands(count);
      return;
    }
    bool changed = false;
    for (int p = 0; p < count; ++p) {
      changed = changed || drivetrain_.signal(pending_[p].input).target() != pending_[p].value;
    }
    if (!changed) return;  // the motion goes on as if nothing had come
    rhythm_.note(time_);

    StepNode reached = front_;
    if (sleeping_ || isInsideStep()) {
      if (!reachPresent(&reached)) return;
      cutEnergy(reached);
    }
    front_ = reached;
    moveOriginToPresent();
    front_.time = 0.0;
    drivetrain_.refreshInputs(front_.time);
    base_ = front_;
    sample_valid_ = false;
    double u0[kMaxInputs];
    copyInputs(u0);
    drivetrain_.saveSignals();
    bool jumps = false;
    for (int p = 0; p < count; ++p) {
      const int input = pending_[p].input;
      CommandSignal& signal = drivetrain_.signal(input);
      if (signal.target() == pending_[p].value) continue;
      jumps = signal.command(scene_.inputs[input], front_.time, pending_[p].value,
                             shortestStep(time_)) ||
              jumps;
    }
    if (jumps && !jump(u0)) {
      front_ = base_;  // the last good state: before these commands
      drivetrain_.restoreSignals(front_.time);
      return;
    }
    restart();
  }

  void copyInputs(double* u) const {
    std::copy(drivetrain_.inputs(), drivetrain_.inputs() + drivetrain_.inputCount(), u);
  }
  /// Whether an input is not what it was, beyond rounding.
  bool haveInputsJumped(const double* u0) const {
    constexpr double kRounding = 1e-14;
    for (int i = 0; i < drivetrain_.inputCount(); ++i) {
      const double u1 = drivetrain_.inputs()[i];
      if (std::abs(u1 - u0[i]) > kRounding * (std::abs(u1) + std::abs(u0[i]))) return true;
    }
    return false;
  }

  /// The jump map at the front, from the inputs u0 to those that the signals now have. False when
  /// the motion stopped.
  bool jump(const double* u0) {
    ++statistics_.jumps;
    drivetrain_.refreshInputs(front_.time);
    double u1[kMaxInputs];
    copyInputs(u1);
    const MotionStatus result =
        system_.jump(front_.time, front_.x, u0, u1, &statistics_.projections);
    if (result.ok()) return true;
    status_ = result;
    status_.time = absolute(front_.time);
    return false;
  }

  /// Commands before the first instant: a zero-order one is the initial value, no jump, so the
  /// accelerations of least reaction are those with it; the others set targets.
  void applyInitialCommands(int count) {
    for (int p = 0; p < count; ++p) {
      const int input = pending_[p].input;
      drivetrain_.signal(input).command(scene_.inputs[input], 0.0, pending_[p].value);
    }
    drivetrain_.refreshInputs(0.0);
    start();
  }

  // --- messages --------------------------------------------------------------------------------
  void writeResiduals(std::ostream& text, const StateView& state) const {
    const std::vector<int>& rows =
        velocities_at_fault_ ? drivetrain_.velocityRows() : drivetrain_.accelerationRows();
    const char* separator = "";
    for (int m : rows) {
      double C[kMaxShafts];
      const Constraint& constraint = drivetrain_.constraint(m);
      text << separator << " residual of '" << constraint.name() << "' = "
           << formatNumber(velocities_at_fault_ ? constraint.calcResidual(state)
                                                : constraint.calcResidualAndJacobian(state, C));
      separator = ",";
    }
  }

  [[noreturn]] void throwInitialError() {
    const InitialConditions& initial = scene_.initial;
    const std::string what = velocities_at_fault_ ? "velocities" : "accelerations";
    const std::string key = velocities_at_fault_ ? "initial/velocity" : "initial/acceleration";
    const std::vector<double>& given =
        velocities_at_fault_ ? initial.velocity : initial.acceleration;
    std::ostringstream text;
    const auto write = [&](const double* values) {
      text << "[";
      for (int i = 0; i < S; ++i) text << (i ? ", " : "") << formatNumber(values[i]);
      text << "]";
    };
    const StateView state = system_.view(0.0, front_.x);
    if (initial_result_ == InitialResult::kNotUnique ||
        initial_result_ == InitialResult::kDoubtful) {
      const auto& search = system_.search();
      text << (initial_result_ == InitialResult::kNotUnique
                   ? "more than one has the least reaction, and they lead to different motions: "
                   : "which one has the least reaction is not certain, the constraints have too "
                     "many like these: ");
      for (int n = 0; n < search.candidateCount(); ++n) {
        text << (n > 0 ? ", " : "");
        write(search.candidate(n).epsilon);
        text << " with 1/2 R^T J^-1 R = " << formatNumber(search.candidate(n).reaction);
      }
      throw SceneError(key, text.str() + "; give 'initial/acceleration'");
    }
    if (initial_result_ != InitialResult::kInconsistent) {
      text << "no " << what << " that satisfy the constraints were found ";
      text << (given.empty() ? "from the free accelerations; give 'initial/acceleration' (there:"
                             : "near those given (there:");
      writeResiduals(text, state);
      text << ")";
      throw SceneError(key, text.str());
    }
    write(given.data());
    StateView there = state;
    (velocities_at_fault_ ? there.velocity : there.acceleration) = given.data();
    if (scene_.principle == Principle::kGauss && !velocities_at_fault_) {
      text << " is not what the principle 'gauss' gives:";
    } else {
      text << " does not satisfy the constraints:";
    }
    writeResiduals(text, there);
    text << "; the nearest consistent " << what << " are ";
    write(nearest_);
    text << " (write these, or set 'initial/project: true' to start there)";
    throw SceneError(key, text.str());
  }

  /// Error of one fixed step, relative to the state (and to absolute / relative tolerance where
  /// that is larger), above which the motion stops.
  static constexpr double kCrudest = 0.1;
  /// So many rejections of one step make `auto` try implicitly.
  static constexpr int kHopeless = 6;
  /// An error norm that makes StepControl take a step no shorter, at every order.
  static constexpr double kSteady = 0.1;
  /// An edge is found to within this part of the step, and the step made again ends by this part
  /// before it.
  static constexpr double kEdgeResolution = 1e-14;
  static constexpr double kMargin = 1e-7;
  /// Trial steps that look for an edge from one base.
  static constexpr int kMostLooks = 100;
  /// An edge is crossed back at once when that takes so many times what going beyond it took.
  static constexpr double kAtOnce = 100.0;
  /// After so many refusals of a step a jump is looked for, at most so far (of the longest step).
  static constexpr int kHardPressed = 4;
  static constexpr double kAhead = 1e-4;
  /// Tolerances by which accelerations may be moved to restore what no constraint can change of the
  /// reaction: little by little, for what a step leaves is less than its tolerance, and a torque
  /// that answers steeply to the velocities is not to make their errors those of the accelerations;
  /// and where the torque has just changed its branch, as it must be.
  static constexpr double kLittle = 0.1;
  static constexpr double kAnyway = std::numeric_limits<double>::infinity();
  /// What stands for the error of a step with stages on both sides of a jump.
  static constexpr double kStagesLeft = 100.0;
  /// Relative to the accelerations: so near to a corner a start lies in it.
  static constexpr double kCorner = 1e-11;
  /// A kink that is crossed so often at once is not merely touched.
  static constexpr int kMostTouches = 10;
  /// The motion sleeps for so many of its longest steps at least.
  static constexpr double kLeastSleep = 20.0;
  /// Steps from `time` are longer than this. [loop]
  static double shortestStep(double time) { return kResolution * std::abs(time); }
  /// Relative to the time reached: shorter steps no longer change the time reliably.
  static constexpr double kResolution = 4.0 * std::numeric_limits<double>::epsilon();
  /// A row of C shorter than this part of the longest it has been counts as zero.
  static constexpr double kVanished = 1e-10;

  Scene scene_;
  std::unique_ptr<PrincipleSystem> own_system_;
  PrincipleSystem& system_;
  const int S;  // shafts
  const bool integrates_torque_;
  Drivetrain& drivetrain_;  // the system's
  StepperChoice choice_;
  Stepper* stepper_;  // that made the last step
  Tolerance tolerance_;
  StepChecks checks_;
  EnergyMeter energy_;
  StepControl control_;
  Rest rest_;
  GuardSearch guards_;
  JumpWatch watch_{guards_};
  StepCurve curve_;
  CommandRhythm rhythm_;
  bool hopped_ = false;  // the last step was one over an edge
  bool sleeping_ = false;
  double sleep_end_ = 0.0;
  State left_at_sleep_end_;  // the deviation c there
  bool knows_start_ = false;
  State start_;  // at time 0, with the inputs as the scene has them
  bool starts_implicitly_ = false;

  MotionStatus status_;
  mutable Statistics statistics_;
  InitialResult initial_result_ = InitialResult::kConsistent;
  bool velocities_at_fault_ = false;
  double nearest_[kMaxShafts] = {};

  double time_ = 0.0;         // the present
  double origin_ = 0.0;       // what times of nodes are counted from
  double origin_rest_ = 0.0;  // what a double rounds off that
  StepNode base_;             // where the last step began
  StepNode front_;            // where it ended
  State dxdt_new_;            // the stepper's own derivative at the front, before the projection
  double next_step_ = 0.0;
  double step_window_start_ = 0.0;
  int steps_in_window_ = 0;
  double restart_time_ = 0.0;  // fixed steps count from here
  std::uint64_t fixed_steps_ = 0;
  double row_reference_[kMaxRows] = {};
  double row_before_[kMaxRows][kMaxShafts] = {};  // C at the last front

  /// The edge that comes next.
  struct Crossing {
    int guard = -1;
    int side = 0;         // that it leaves
    double at = 0.0;      // where the step before it ends
    double length = 0.0;  // of the step across, s
    // the next step where it is not there after all, s
    double otherwise = std::numeric_limits<double>::infinity();
    bool isDueAt(double time) const { return guard >= 0 && at == time; }
  };
  Crossing crossing_;
  /// The last edge that was crossed.
  struct LastCrossing {
    int guard = -1;
    double time = 0.0;
    double depth = 0.0;
    int count = 0;  // of crossings of it before, each at once after the other
  };
  LastCrossing last_crossing_;
  bool has_new_rows_ = false;

  struct Pending {
    int input;
    double value;
  };
  Pending pending_[kMaxInputs];
  int pending_count_ = 0;
  double last_command_time_[kMaxInputs];
  bool advanced_ = false;

  Sample sample_;
  bool sample_valid_ = false;
};

}  // namespace variator_sim
