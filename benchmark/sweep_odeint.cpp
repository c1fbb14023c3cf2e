/// A sweep as one writes it by hand: the ship of benchmark/scenes for many inertias of its drive,
/// by Boost.Odeint, one run a thread by OpenMP. benchmark/sweep.py compares `sweep` with it.
///
/// usage: sweep_odeint RUNS TOLERANCE THREADS
/// Prints, for each run, the speed of the load after 20 s.

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "peers/odeint.h"
#include "peers/scenes.h"
#include "peers/system.h"

namespace {

using namespace variator_sim::benchmark;
using State = std::array<double, 6>;

class Run {
 public:
  explicit Run(double drive_inertia)
      : inverse_{1.0 / drive_inertia, 1.0 / Ship<double>::kInertia[1]} {}

  void operator()(const State& x, State& dxdt, double t) const {
    double rate[2];
    double C[1][2];
    double c0[1];
    for (std::size_t i = 0; i < 4; ++i) dxdt[i] = x[2 + i];
    ship_.row(t, x.data(), x.data() + 2, x.data() + 4, C, c0);
    ship_.torqueRate(t, x.data(), x.data() + 2, x.data() + 4, rate);
    calcJerk<1, 2>(rate, C, c0, inverse_, dxdt.data() + 4);
  }

  /// Accelerations of least reaction, from the free ones by linearised constraints.
  State start() const {
    State x{0.0, 0.0, 5.0, 2.0, 0.0, 0.0};
    double free[2];
    ship_.torque(0.0, x.data(), x.data() + 2, free);
    double* const e = x.data() + 4;
    for (int i = 0; i < 2; ++i) e[i] = free[i] *= inverse_[i];
    for (int iteration = 0; iteration < 200; ++iteration) {
      double psi[1];
      double C[1][2];
      double c0[1];
      ship_.residual(0.0, x.data(), x.data() + 2, e, psi);
      ship_.row(0.0, x.data(), x.data() + 2, e, C, c0);
      double A = 0.0;
      double b = psi[0];
      for (int i = 0; i < 2; ++i) {
        A += C[0][i] * C[0][i] * inverse_[i];
        b += C[0][i] * (free[i] - e[i]);
      }
      double change = 0.0;
      for (int i = 0; i < 2; ++i) {
        const double next = free[i] - C[0][i] * b / A * inverse_[i];
        change += std::abs(next - e[i]);
        e[i] = next;
      }
      if (change < 1e-14) break;
    }
    return x;
  }

 private:
  Ship<double> ship_{SceneParameters{}};
  double inverse_[2];
};

double runOne(double drive_inertia, double tolerance) {
  const Run run(drive_inertia);
  State x = run.start();
  odeint::integrate_adaptive(
      odeint::make_controlled<odeint::runge_kutta_dopri5<State>>(tolerance, tolerance), run, x, 0.0,
      20.0, 1e-3);
  return x[3];
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const int runs = std::atoi(argv[1]);
  const double tolerance = std::atof(argv[2]);
  std::vector<double> speeds(static_cast<std::size_t>(runs));
#pragma omp parallel for schedule(dynamic, 16) num_threads(std::atoi(argv[3]))
  for (int i = 0; i < runs; ++i) {
    const double inertia = 0.4 + 0.8 * i / (runs - 1);
    speeds[static_cast<std::size_t>(i)] = runOne(inertia, tolerance);
  }
  for (const double speed : speeds) std::printf("%.17g\n", speed);
}
