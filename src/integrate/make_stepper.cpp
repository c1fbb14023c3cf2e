#include <memory>

#include "integrate/stepper.h"

namespace variator_sim {

std::unique_ptr<Stepper> makeStepper(StepperKind kind, const System& system, Tolerance tolerance) {
  switch (kind) {
    case StepperKind::kRk4:
      return makeRk4Stepper(system, tolerance);
    case StepperKind::kDopri5:
    case StepperKind::kDopri5Fixed:
      return makeDopri5Stepper(system, tolerance);
    case StepperKind::kFehlberg78:
      return makeFehlberg78Stepper(system, tolerance);
    case StepperKind::kRosenbrock4:
    case StepperKind::kRosenbrock4Fixed:
      return makeRosenbrock4Stepper(system, tolerance);
    case StepperKind::kRadau5:
    case StepperKind::kRadau5Fixed:
      return makeRadau5Stepper(system, tolerance);
    case StepperKind::kTaylor:
    case StepperKind::kTaylorFixed:
      return makeTaylorStepper(system, tolerance);
    case StepperKind::kDop853:
    case StepperKind::kAuto:
      break;
  }
  return makeDop853Stepper(system, tolerance);
}

}  // namespace variator_sim
