#include "variator_sim/status.h"

#include <cmath>
#include <cstdio>

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

std::string describe(const EnergyDoubt& doubt) {
  if (!doubt.exists()) return "";
  const double percent =
      doubt.throughput > 0.0 ? 100.0 * std::abs(doubt.reactions) / doubt.throughput : 0.0;
  char share[64] = "while the applied torques brought and took none";
  if (doubt.throughput > 0.0) {
    std::snprintf(share, sizeof(share), "%.3g %% of what the applied torques brought and took",
                  percent);
  }
  char text[512];
  std::snprintf(
      text, sizeof(text),
      "under the principle 'generalized_gauss' the reactions have %s %.3g J, %s (more than 5 %% "
      "since t = %.6g s): while C turns they remember what they were, and feed or drain the "
      "machine; a lossless ratio without memory is 'principle: gauss' (doc/principles.md)",
      doubt.reactions < 0.0 ? "taken" : "fed in", std::abs(doubt.reactions), share, doubt.since);
  return text;
}

}  // namespace variator_sim
