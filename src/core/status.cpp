#include "variator_sim/status.h"

namespace variator_sim {

const char* toString(StopReason reason) {
  switch (reason) {
    case StopReason::kNone:
      return "";
    case StopReason::kSingularConstraint:
      return "SingularConstraint";
    case StopReason::kStepUnderflow:
      return "StepUnderflow";
    case StopReason::kNonFiniteValue:
      return "NonFiniteValue";
    case StopReason::kStepTooLarge:
      return "StepTooLarge";
    case StopReason::kToleranceTooSmall:
      return "ToleranceTooSmall";
    case StopReason::kStepLimit:
      return "StepLimit";
    case StopReason::kJumpFailed:
      return "JumpFailed";
    case StopReason::kProjectionFailed:
      return "ProjectionFailed";
    case StopReason::kChattering:
      return "Chattering";
  }
  return "";
}

}  // namespace variator_sim
