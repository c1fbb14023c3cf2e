#include <memory>

#include "integrate/stepper.h"

namespace variator_sim {
namespace {

/// The smaller the error is to be the more stages of a Radau method repay themselves.
int chooseStages(double relative_tolerance) {
  if (relative_tolerance > 3e-3) return 3;
  return relative_tolerance > 3e-8 ? 5 : 7;
}

}  // namespace

std::unique_ptr<Stepper> makeStepper(StepperKind kind, const System& system, Tolerance tolerance) {
  switch (kind) {
    case StepperKind::kRk4:
      return makeRk4Stepper(system, tolerance);
    case StepperKind::kFehlberg78:
      return makeFehlberg78Stepper(system, tolerance);
    case StepperKind::kRadau:
      return makeRadauStepper(system, tolerance, chooseStages(tolerance.relative));
    case StepperKind::kTaylor:
    case StepperKind::kTaylorFixed:
      return makeTaylorStepper(system, tolerance);
    case StepperKind::kDopri5:
    case StepperKind::kAuto:
      break;
  }
  return makeDopri5Stepper(system, tolerance);
}

}  // namespace variator_sim
