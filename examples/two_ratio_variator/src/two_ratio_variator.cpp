/// A constraint of one's own: C, c0 and all other derivatives follow from the formula.
#include <variator_sim/constraint.h>

#include <pluginlib/class_list_macros.hpp>

namespace two_ratio_variator {

/// psi = tau (epsilon_b - i epsilon_a) + omega_b - i omega_a, rad/s, with the ratio i going
/// smoothly from i_1 to i_2 as omega_a passes omega_0: i = i_1 + (i_2 - i_1) (1 + tanh((omega_a -
/// omega_0)/w))/2
class TwoRatioVariator : public variator_sim::Constraint {
  void build(variator_sim::LawContext& scene) override {
    const auto s = scene.shafts("shafts", 2);
    const auto low = scene.quantity("low"), high = scene.quantity("high");  // 1
    const auto speed = scene.quantity("speed");                             // rad/s
    const double width = scene.number("width", variator_sim::Range::positive("rad/s"));
    const double tau = scene.number("time_constant", variator_sim::Range::positive("s"));
    const auto i = low + 0.5 * (high - low) * (1.0 + tanh((s[0].velocity - speed) / width));
    const auto slip = s[1].velocity - i * s[0].velocity;
    scene.constrain(tau * (s[1].acceleration - i * s[0].acceleration) + slip);
    scene.output("ratio", i);
  }
};

}  // namespace two_ratio_variator

PLUGINLIB_EXPORT_CLASS(two_ratio_variator::TwoRatioVariator, variator_sim::Constraint)
