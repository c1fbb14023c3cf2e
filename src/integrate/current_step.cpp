#include "integrate/current_step.h"

#include <algorithm>

#include "motion/diagnosis.h"

namespace variator_sim {

CurrentStep::CurrentStep(System& its_system, const Scene& scene)
    : S(its_system.shafts()),
      integrates_torque(its_system.integratesTorque()),
      settings(scene.solver),
      system(its_system),
      drivetrain(system.drivetrain()),
      tolerance{scene.solver.absolute_tolerance, scene.solver.relative_tolerance},
      choice(system, scene.solver),
      stepper(&choice.stepper()),
      checks(system, tolerance, choice.isFixed(), statistics),
      rows(system),
      progress(scene.solver.maximum_steps),
      start(system),
      end(system) {}

StateView CurrentStep::viewOf(const StepNode& node) {
  const double* acceleration =
      integrates_torque ? node.x.data() + node.x.size() - S : node.dxdt.data() + S;
  return drivetrain.view(node.time, node.x.data(), node.x.data() + S, acceleration);
}

State CurrentStep::extrapolate(const StepNode& from, double length) const {
  State x = from.x;
  for (int n = 0; n < x.size(); ++n) {
    double change = from.dxdt[n];
    if (n + S < x.size()) change += 0.5 * length * from.dxdt[n + S];
    if (n + 2 * S < x.size()) change += length * length / 6.0 * from.dxdt[n + 2 * S];
    x[n] += length * change;
  }
  return x;
}

bool CurrentStep::differentiateEnd() {
  // Tolerances by which accelerations are moved to correct the drift of the reaction, where a
  // torque answers steeply to angles or velocities: their errors are not to become those of the
  // accelerations.
  constexpr double kRestoreCap = 0.1;
  system.reaction().correct(end, kRestoreCap);
  system(end.x, end.dxdt, end.time);
  noteDerivative();
  return end.dxdt.isFinite();
}

void CurrentStep::noteDerivative() {
  checks.noteTorqueRate(end);
  rows.look();
  is_in_corner = system.isInCorner();
}

bool CurrentStep::checkEnd() {
  checks.noteAccelerations(end);
  if (!checks.isTorqueFollowed(*stepper, start, end)) return false;
  return noteRows();
}

bool CurrentStep::noteRows() {
  const RowWatch::Verdict verdict = rows.note(start.time == end.time);
  if (verdict == RowWatch::Verdict::kVanished) {
    stop(StopReason::kSingularConstraint);
    status.constraint = rows.vanished();
    status.measure = rows.measure();
  }
  return verdict == RowWatch::Verdict::kGood;
}

void CurrentStep::stop(StopReason reason) {
  status.reason = reason;
  status.time = absolute(end.time);
}

void CurrentStep::stopChattering(int guard) {
  stop(StopReason::kChattering);
  status.guard = guard;
  status.torque = drivetrain.guardOwner(guard).torque;
  status.constraint = drivetrain.guardOwner(guard).constraint;
}

void CurrentStep::explainStop(StopReason otherwise) {
  stop(otherwise);
  diagnoseStop(system, end, rows.references(), &status);
}

}  // namespace variator_sim
