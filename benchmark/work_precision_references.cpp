#include "work_precision_references.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "peers/error.h"
#include "peers/odeint.h"
#include "peers/system.h"

namespace variator_sim::benchmark {
namespace {

using Real = long double;
using States = std::vector<Real>;

/// From event to event with integrate(t0, t1, x).
template <template <class> class SceneOf, class Integrate>
States play(const SceneCase& scene_case, Integrate integrate) {
  using Scene = SceneOf<Real>;
  constexpr std::size_t kState = 3 * Scene::kShafts;
  Scene scene(scene_case.parameters);
  std::array<Real, kState> x{};
  scene.initial(x.data());
  Real t = 0.0L;
  if constexpr (Scene::kEvents > 0) {
    scene.reset();
    for (int event = 1; event <= Scene::kEvents; ++event) {
      integrate(scene, t, Scene::eventTime(event), x);
      t = Scene::eventTime(event);
      scene.applyEvent(event, x.data());
    }
  }
  integrate(scene, t, Scene::kEnd, x);
  return States(x.begin(), x.end());
}

/// By the stepper of `make(the state)`, explicit.
template <template <class> class SceneOf, class Make>
States integrate(const SceneCase& scene_case, Real first_step, Make make) {
  return play<SceneOf>(scene_case, [&](const auto& scene, Real t0, Real t1, auto& x) {
    using State = std::decay_t<decltype(x)>;
    const auto system = [&scene](const State& y, State& dydt, Real t) {
      calcDerivative(scene, t, y.data(), dydt.data());
    };
    odeint::integrate_adaptive(make(x), system, x, t0, t1, first_step);
  });
}

/// Fehlberg's method of order 8.
template <template <class> class SceneOf>
States integrateExplicitly(const SceneCase& scene_case, Real tolerance) {
  return integrate<SceneOf>(scene_case, 1e-5L, [tolerance](const auto& x) {
    using State = std::decay_t<decltype(x)>;
    return odeint::make_controlled<odeint::runge_kutta_fehlberg78<State, Real>>(tolerance,
                                                                                tolerance);
  });
}

/// Gragg's extrapolation with Bulirsch and Stoer's control.
template <template <class> class SceneOf>
States integrateByExtrapolation(const SceneCase& scene_case, Real tolerance) {
  return integrate<SceneOf>(scene_case, 1e-2L, [tolerance](const auto& x) {
    return odeint::bulirsch_stoer<std::decay_t<decltype(x)>, Real>(tolerance, tolerance);
  });
}

/// The stiff scene in variables in which its slow motion is smooth however small tau is, and in
/// which no difference of large numbers is divided by tau:
///     y = (phi1, phi2, w1, z, rho),   w2 = u w1 + tau rho,   e1 = z + q rho,   e2 = u e1 - rho,
///     q = u J2 / D,   D = J1 + u^2 J2.
/// psi is zero identically; psi' = 0 is rho' = -(rho + u' w1) / tau; the null-space form
/// J1 eta1 + u J2 eta2 = Q1' + u Q2' gives z'.
template <class R>
struct SlowVariables {
  using K = typename ConstantOf<R>::Type;
  K tau;

  struct Ratio {
    R u, du;
  };
  static Ratio ratio(const R& t) {
    using std::cos;
    using std::sin;
    return {K(0.6L) + K(0.2L) * sin(K(0.7L) * t), K(0.14L) * cos(K(0.7L) * t)};
  }
  void derivative(const R& t, const R* y, R* dydt) const {
    const auto [u, du] = ratio(t);
    const R D = K(0.8L) + K(2) * (u * u);
    const R q = K(2) * u / D;
    const R dq = K(2) * du * (K(0.8L) - K(2) * (u * u)) / (D * D);
    const R& w1 = y[2];
    const R& rho = y[4];
    const R w2 = u * w1 + tau * rho;
    const R e1 = y[3] + q * rho;
    const R e2 = u * e1 - rho;
    const R Q1 = KlossMotor<R>{K(12), K(50)}.torqueRate(w1, e1);
    const R Q2 = K(-0.04L) * (w2 * e2);
    dydt[0] = w1;
    dydt[1] = w2;
    dydt[2] = e1;
    dydt[3] = (Q1 + u * Q2 - K(2) * (u * (du * e1))) / D - dq * rho;
    dydt[4] = -(rho + du * w1) * (K(1) / tau);
  }
};

/// Collocation at the S points of Radau (right end included), of order 2 S - 1.
template <int S>
class Radau {
 public:
  Radau() {
    // The points are the roots of P_S(x) - P_(S-1)(x), x = 2 c - 1: bisection between its signs.
    const auto f = [](Real c) { return legendre(S, 2 * c - 1) - legendre(S - 1, 2 * c - 1); };
    int found = 0;
    constexpr int kScan = 4000;
    for (int i = 0; i < kScan && found < S - 1; ++i) {
      Real low = Real(i) / kScan;
      Real high = (Real(i) + 1) / kScan;
      if (f(low) * f(high) > 0) continue;
      for (int k = 0; k < 80; ++k) {
        const Real middle = (low + high) / 2;
        (f(low) * f(middle) <= 0 ? high : low) = middle;
      }
      c_[found++] = (low + high) / 2;
    }
    c_[S - 1] = 1;
    // a_ij is the integral of the Lagrange polynomial l_j from 0 to c_i.
    for (int j = 0; j < S; ++j) {
      Real p[S] = {1};
      int degree = 0;
      for (int m = 0; m < S; ++m) {
        if (m == j) continue;
        const Real scale = 1 / (c_[j] - c_[m]);
        ++degree;
        for (int d = degree; d >= 0; --d) {
          p[d] = ((d > 0 ? p[d - 1] : 0) - (d < degree ? c_[m] * p[d] : 0)) * scale;
        }
      }
      for (int i = 0; i < S; ++i) {
        Real sum = 0;
        for (int d = S - 1; d >= 0; --d) sum = sum * c_[i] + p[d] / (d + 1);
        a_[i][j] = sum * c_[i];
      }
    }
  }

  /// The stiff scene in its slow variables, in `steps` equal steps.
  States integrate(const SceneCase& scene_case, int steps) const {
    constexpr int N = 5;
    constexpr int M = S * N;
    using Number = Dual<Real, N>;
    using Matrix = Eigen::Matrix<Real, M, M>;
    using Column = Eigen::Matrix<Real, M, 1>;
    const Real tau = scene_case.parameters.tau;
    const SlowVariables<Number> dual = {tau};
    Real y[N];
    toSlow(scene_case, y);
    const Real h = StiffSlip<Real>::kEnd / steps;
    Real Y[S][N];
    for (int step = 0; step < steps; ++step) {
      const Real t = h * step;
      for (auto& stage : Y) std::copy(y, y + N, stage);
      for (int iteration = 0; iteration < 12; ++iteration) {
        // residual Y_i - y - h sum a_ij f(Y_j) and its exact derivative
        Matrix A = Matrix::Identity();
        Column residual;
        for (int i = 0; i < M; ++i) residual(i) = y[i % N] - Y[i / N][i % N];
        for (int j = 0; j < S; ++j) {
          Number x[N];
          Number f[N];
          for (int n = 0; n < N; ++n) x[n] = Number::variable(Y[j][n], n);
          dual.derivative(Number(t + c_[j] * h), x, f);
          for (int i = 0; i < S; ++i) {
            for (int n = 0; n < N; ++n) {
              residual(i * N + n) += h * a_[i][j] * f[n].value;
              for (int k = 0; k < N; ++k) {
                A(i * N + n, j * N + k) -=
                    h * a_[i][j] * f[n].derivative[static_cast<std::size_t>(k)];
              }
            }
          }
        }
        const Column change = A.lu().solve(residual);
        Real largest = 0;
        for (int i = 0; i < M; ++i) {
          Real& value = Y[i / N][i % N];
          value += change(i);
          largest = std::max(largest, std::abs(change(i)) / (1 + std::abs(value)));
        }
        if (largest < 1e-18L) break;
      }
      std::copy(Y[S - 1], Y[S - 1] + N, y);
    }
    return fromSlow(tau, StiffSlip<Real>::kEnd, y);
  }

 private:
  static Real legendre(int degree, Real x) {
    Real before = 1;
    Real now = x;
    if (degree == 0) return 1;
    for (int n = 1; n < degree; ++n) {
      const Real next = ((2 * n + 1) * x * now - n * before) / (n + 1);
      before = now;
      now = next;
    }
    return now;
  }
  static void toSlow(const SceneCase& scene_case, Real* y) {
    Real x[6];
    StiffSlip<Real>(scene_case.parameters).initial(x);
    const Real u = 0.6L;
    y[0] = x[0];
    y[1] = x[1];
    y[2] = x[2];
    y[4] = u * x[4] - x[5];
    y[3] = x[4] - 2 * u / (0.8L + 2 * u * u) * y[4];
  }
  static States fromSlow(Real tau, Real t, const Real* y) {
    const auto [u, du] = SlowVariables<Real>::ratio(t);
    const Real e1 = y[3] + 2 * u / (0.8L + 2 * u * u) * y[4];
    return {y[0], y[1], y[2], u * y[2] + tau * y[4], e1, u * e1 - y[4]};
  }

  Real c_[S] = {};
  Real a_[S][S] = {};
};

}  // namespace

Reference makeReference(const SceneCase& scene) {
  return visitScene(scene, [&](auto tag) {
    using Tag = decltype(tag);
    Reference reference;
    const auto compare = [&](const States& other, const char* what) {
      const double difference =
          calcError(other.data(), reference.state.data(), reference.state.size());
      std::fprintf(stderr, "  %-24s %-40s %.1e\n", scene.name.c_str(), what, difference);
      return difference;
    };
    if constexpr (HasHandJacobian<typename Tag::template Of<double>>::value) {
      const bool slips = scene.parameters.slips_at_start;
      reference.state = Radau<5>().integrate(scene, slips ? 60000 : 3000);
      reference.difference =
          compare(Radau<4>().integrate(scene, slips ? 90000 : 9000), "Radau order 9, 7");
      // Explicit steps have to resolve tau; rounding counts 1e-19 / tau.
      if (scene.tau > 0.5e-4) {
        compare(integrateExplicitly<Tag::template Of>(scene, 1e-17L),
                "Radau order 9, Fehlberg 7(8)");
      }
    } else {
      reference.state = integrateExplicitly<Tag::template Of>(scene, 1e-18L);
      compare(integrateExplicitly<Tag::template Of>(scene, 1e-16L), "Fehlberg 7(8), 1e-18, 1e-16");
      reference.difference = compare(integrateByExtrapolation<Tag::template Of>(scene, 1e-17L),
                                     "Fehlberg 7(8), Bulirsch and Stoer");
    }
    return reference;
  });
}

std::map<std::string, Reference> readReferences(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  std::map<std::string, Reference> references;
  std::string line;
  while (std::getline(file, line)) {
    if (line.empty() || line[0] == '#' || line.rfind("scene,", 0) == 0) continue;
    std::istringstream cells(line);
    std::string cell;
    std::getline(cells, cell, ',');
    Reference& reference = references[cell];
    std::getline(cells, cell, ',');
    reference.difference = std::stod(cell);
    while (std::getline(cells, cell, ',')) reference.state.push_back(std::stold(cell));
  }
  return references;
}

void writeReferences(const std::string& path, const std::vector<SceneCase>& scenes,
                     const std::map<std::string, Reference>& references) {
  std::ofstream file(path);
  file << "# States at the end of the scenes of benchmark/scenes/: angles (rad), velocities "
          "(rad/s),\n"
       << "# accelerations (rad/s^2). Made by work_precision --make-references: the hand-written\n"
       << "# scenes in long double; `difference` is between two methods.\n"
       << "scene,difference,state\n";
  for (const SceneCase& scene : scenes) {
    const auto found = references.find(scene.name);
    if (found == references.end()) continue;
    file << scene.name << ',' << std::setprecision(2) << found->second.difference;
    for (const long double value : found->second.state) {
      file << ',' << std::setprecision(21) << value;
    }
    file << '\n';
  }
}

}  // namespace variator_sim::benchmark
