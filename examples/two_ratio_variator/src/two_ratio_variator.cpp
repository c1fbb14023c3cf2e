/// A constraint of one's own: everything but the formula comes from AutomaticConstraint.
#include <variator_sim/constraints/automatic_constraint.h>

#include <pluginlib/class_list_macros.hpp>

namespace two_ratio_variator {

/// psi = tau (epsilon_b - i epsilon_a) + omega_b - i omega_a, rad/s, with the ratio i going
/// smoothly from i_1 to i_2 as omega_a passes omega_0: i = i_1 + (i_2 - i_1) (1 + tanh((omega_a -
/// omega_0)/w))/2
class TwoRatioVariator : public variator_sim::AutomaticConstraint<TwoRatioVariator> {
 public:
  template <class T>
  T residual(const variator_sim::GenericState<T>& x) const {
    const T i = low_ + 0.5 * (high_ - low_) * (1.0 + tanh((x.velocity[0] - speed_) / width_));
    return tau_ * (x.acceleration[1] - i * x.acceleration[0]) + x.velocity[1] - i * x.velocity[0];
  }

 private:
  void doConfigure(variator_sim::ComponentContext& context) override {
    useShafts(context.readShafts("shafts", 2));
    low_ = context.parameters().number("low");
    high_ = context.parameters().number("high");
    speed_ = context.parameters().number("speed");                                         // rad/s
    width_ = context.parameters().number("width", variator_sim::Range::positive());        // rad/s
    tau_ = context.parameters().number("time_constant", variator_sim::Range::positive());  // s
  }
  bool doIsLinearInAcceleration() const override { return true; }

  double low_ = 1.0, high_ = 1.0, speed_ = 0.0, width_ = 1.0, tau_ = 1.0;
};

}  // namespace two_ratio_variator

PLUGINLIB_EXPORT_CLASS(two_ratio_variator::TwoRatioVariator, variator_sim::Constraint)
