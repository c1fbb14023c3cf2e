/// A chain of shafts and the programs by hand that benchmark/sizes.cpp is measured beside.
#pragma once

#include <cmath>
#include <vector>

namespace variator_sim::benchmark {

using State = std::vector<double>;

constexpr double kEnd = 20.0;  ///< s

struct Chain {
  int shafts;
  double stiffness;  ///< N m/rad
  double damping;    ///< N m s/rad

  static double inertia(int i) { return 1.0 + 0.1 * std::sin(i); }
  static bool isDriven(int i) {
    return i % 4 == 2;
  }  ///< by the shaft before it, through a variator
  static double ratio(int i, double t) { return 1.0 + 0.2 * std::sin(0.5 * t + i); }
  static double ratioRate(int i, double t) { return 0.1 * std::cos(0.5 * t + i); }
};

/// The speeds of all shafts at the end; NaN where the solver fails or is not installed.
State playDopri5(const Chain& chain, double tolerance);
State playFehlberg78(const Chain& chain, double tolerance);
State playCvode(const Chain& chain, double tolerance);

}  // namespace variator_sim::benchmark
