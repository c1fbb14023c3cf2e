/// The steppers by their names in scenes.
#pragma once

#include <memory>

#include "explicit_stepper.h"
#include "radau_stepper.h"
#include "rosenbrock_stepper.h"
#include "stepper.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// `reads_angles`: some derivative depends on an angle; otherwise the stages leave angles out.
template <class Tableau, class System>
std::unique_ptr<Stepper<System>> makeExplicitStepper(Tolerance tolerance, bool reads_angles) {
  if (reads_angles) {
    return std::make_unique<ExplicitStepper<Tableau, System, 0>>(tolerance);
  }
  constexpr std::size_t kAngles = System::kShafts;
  return std::make_unique<ExplicitStepper<Tableau, System, kAngles>>(tolerance);
}

/// The stepper of one kind, which is not kAuto.
template <class System>
std::unique_ptr<Stepper<System>> makeStepper(StepperKind kind, Tolerance tolerance,
                                             bool reads_angles) {
  switch (kind) {
    case StepperKind::kRk4:
      return std::make_unique<Rk4Stepper<System>>(tolerance);
    case StepperKind::kDopri5:
    case StepperKind::kDopri5Fixed:
      return makeExplicitStepper<Dopri5Tableau, System>(tolerance, reads_angles);
    case StepperKind::kFehlberg78:
      return std::make_unique<Fehlberg78Stepper<System>>(tolerance);
    case StepperKind::kRosenbrock4:
    case StepperKind::kRosenbrock4Fixed:
      return std::make_unique<RosenbrockStepper<System>>(tolerance);
    case StepperKind::kRadau5:
    case StepperKind::kRadau5Fixed:
      return std::make_unique<RadauStepper<System>>(tolerance);
    case StepperKind::kDop853:
    case StepperKind::kAuto:
      break;
  }
  return makeExplicitStepper<Dop853Tableau, System>(tolerance, reads_angles);
}

}  // namespace variator_sim
