#include "variator_sim/status.h"

#include <iterator>

#include "model/number_text.h"

namespace variator_sim {

const char* toString(StopReason reason) {
  // In the order of the enumeration.
  constexpr const char* kNames[] = {"",
                                    "SingularConstraint",
                                    "StepUnderflow",
                                    "NonFiniteValue",
                                    "StepTooLarge",
                                    "ToleranceTooSmall",
                                    "StepLimit",
                                    "JumpFailed",
                                    "ProjectionFailed",
                                    "Chattering",
                                    "TimeExhausted",
                                    "NoModes",
                                    "IndefiniteInertia"};
  static_assert(std::size(kNames) == static_cast<std::size_t>(StopReason::kIndefiniteInertia) + 1);
  return kNames[static_cast<std::size_t>(reason)];
}

const char* modeName(int mode) {
  constexpr const char* kNames[] = {"backward", "stuck", "forward",  // from -1 on
                                    "free",     "below", "above"};
  return kNames[mode + 1];
}

std::string describe(const EnergyDoubt& doubt) {
  if (!doubt.exists()) return "";
  const std::string share = doubt.throughput > 0.0
                                ? printed("%.3g %% of what the applied torques brought and took",
                                          100.0 * std::abs(doubt.reactions) / doubt.throughput)
                                : "while the applied torques brought and took none";
  return printed(
      "under the principle 'generalized_gauss' the reactions have %s %.3g J by t = %.6g s, %s "
      "(first more than 5 %% at t = %.6g s): where the constraints' Jacobian C varies, R' = C^T "
      "Lambda gives the reaction R a null-space component, which does work; under 'principle: "
      "gauss' R = C^T lambda has none, and a ratio is lossless (doc/theory.md)",
      doubt.reactions < 0.0 ? "taken" : "fed in", std::abs(doubt.reactions), doubt.time,
      share.c_str(), doubt.since);
}

std::vector<std::string> describe(const ErrorDoubt& doubt) {
  std::vector<std::string> sentences;
  const auto add = [&](const char* format, double time, auto... more) {
    sentences.push_back(printed(format, time, more...));
  };
  if (doubt.stopped >= 0.0) {
    add("the motion that errors are estimated by stopped at t = %.6g s (%s): from there on they "
        "are not known (nan)",
        doubt.stopped, toString(doubt.reason));
  }
  if (doubt.grown >= 0.0) {
    add("estimated errors are not to be trusted from t = %.6g s on: there one is above 1e8 "
        "tolerances, or above a tenth of the largest value of its column, and errors no longer "
        "grow in proportion",
        doubt.grown);
  }
  if (doubt.parted >= 0.0) {
    add("estimated errors are not to be trusted from before t = %.6g s on: a law jumps there so "
        "near to where it would not that the motion and the one it is compared with differ in how "
        "often",
        doubt.parted);
  }
  if (2 * doubt.rounding_samples > doubt.samples) {
    add("%.3g %% of the samples, the first one at t = %.6g s, differ by rounding alone from the "
        "motion that errors are estimated by: their estimates are only what rounding usually makes",
        100.0 * static_cast<double>(doubt.rounding_samples) / static_cast<double>(doubt.samples),
        doubt.rounding);
  }
  return sentences;
}

}  // namespace variator_sim
