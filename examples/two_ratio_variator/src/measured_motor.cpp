/// A torque from a function that formulas cannot see into: a map of measurements with an
/// interpolation of one's own.
#include <variator_sim/torque.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

namespace two_ratio_variator {

/// What was measured: speed w_n (rad/s), command u_n (1), torque M_n (N m).
constexpr double kMeasured[][3] = {
    {0, 0.5, 7},  {15, 0.5, 9},  {30, 0.5, 14}, {40, 0.5, 16}, {46, 0.5, 8},  {50, 0.5, 0},
    {0, 1.0, 12}, {15, 1.0, 16}, {30, 1.0, 25}, {40, 1.0, 30}, {46, 1.0, 18}, {50, 1.0, 0},
};

/// The mean of the measured torques, those of nearby speeds and commands counting more:
///     M(w, u) = sum k_n M_n / sum k_n,   k_n = 1/(0.02 + x_n^2 + y_n^2)^3,
///     x_n = (w - w_n)/(20 rad/s),   y_n = u - u_n
/// after Shepard (Proceedings of the ACM National Conference 1968, 517-524), smooth everywhere.
class MotorMap : public variator_sim::OpaqueFunction {
 public:
  MotorMap() : OpaqueFunction(2) {}
  double value(const double* at) const override {
    double unused[2];
    return evaluate(at, unused);
  }
  void calcGradient(const double* at, double* gradient) const override { evaluate(at, gradient); }

 private:
  /// M, and its derivatives sum dk_n (M_n - M) / sum k_n.
  static double evaluate(const double* at, double* gradient) {
    double k_sum = 0.0, kM_sum = 0.0;
    double dk_sum[2] = {}, dkM_sum[2] = {};
    for (const auto& [w_n, u_n, M_n] : kMeasured) {
      const double x = (at[0] - w_n) / 20.0, y = at[1] - u_n;
      const double r = 1.0 / (0.02 + x * x + y * y), k = r * r * r;
      const double dk[2] = {-6.0 * k * r * x / 20.0, -6.0 * k * r * y};
      k_sum += k;
      kM_sum += k * M_n;
      for (int i = 0; i < 2; ++i) {
        dk_sum[i] += dk[i];
        dkM_sum[i] += dk[i] * M_n;
      }
    }
    const double M = kM_sum / k_sum;
    for (int i = 0; i < 2; ++i) gradient[i] = (dkM_sum[i] - dk_sum[i] * M) / k_sum;
    return M;
  }
};

/// Q = M(omega, u) on one shaft, N m. Keys: `shaft`, `command` u (from 0 to 1).
class MeasuredMotor : public variator_sim::Torque {
  void build(variator_sim::LawContext& scene) override {
    const variator_sim::Shaft shaft = scene.shaft("shaft");
    const auto u = scene.quantity("command", variator_sim::Range::between(0.0, 1.0, "1"));
    scene.apply(shaft, scene.function(std::make_shared<MotorMap>(), {shaft.velocity, u}));
  }
};

}  // namespace two_ratio_variator

PLUGINLIB_EXPORT_CLASS(two_ratio_variator::MeasuredMotor, variator_sim::Torque)
