/// A hand-written scene as a first-order system: x' = f(t, x), its Jacobian, its projection.
#pragma once

#include <cmath>
#include <type_traits>

#include "scenes.h"

namespace variator_sim::benchmark {

/// eta by the symmetric solve, from -g, C and c0. One division per constraint.
template <int K, int S, class R, class Inverse>
inline void calcJerk(const R* rate, const R (*C)[S], const R* c0, const Inverse* inverse, R* eta) {
  static_assert(K == 1 || K == 2, "one or two constraints");
  R free[S];
  for (int i = 0; i < S; ++i) free[i] = rate[i] * inverse[i];
  if constexpr (K == 1) {
    R A = C[0][0] * C[0][0] * inverse[0];
    R b = c0[0] + C[0][0] * free[0];
    for (int i = 1; i < S; ++i) {
      A += C[0][i] * C[0][i] * inverse[i];
      b += C[0][i] * free[i];
    }
    const R Lambda = b / A;
    for (int i = 0; i < S; ++i) eta[i] = free[i] - C[0][i] * Lambda * inverse[i];
  } else {
    R A[2][2];
    R b[2];
    for (int m = 0; m < 2; ++m) {
      b[m] = c0[m];
      for (int i = 0; i < S; ++i) b[m] += C[m][i] * free[i];
      for (int n = m; n < 2; ++n) {
        A[m][n] = R(typename ConstantOf<R>::Type(0));
        for (int i = 0; i < S; ++i) A[m][n] += C[m][i] * C[n][i] * inverse[i];
      }
    }
    using One = typename ConstantOf<R>::Type;
    const R inverse_determinant = One(1) / (A[0][0] * A[1][1] - A[0][1] * A[0][1]);
    const R Lambda0 = (b[0] * A[1][1] - b[1] * A[0][1]) * inverse_determinant;
    const R Lambda1 = (b[1] * A[0][0] - b[0] * A[0][1]) * inverse_determinant;
    for (int i = 0; i < S; ++i) {
      eta[i] = free[i] - (C[0][i] * Lambda0 + C[1][i] * Lambda1) * inverse[i];
    }
  }
}

/// x' = (omega, epsilon, eta).
template <class Scene, class R>
inline void calcDerivative(const Scene& scene, const R& t, const R* x, R* dxdt) {
  constexpr int S = Scene::kShafts;
  constexpr int K = Scene::kConstraints;
  using Number = typename ConstantOf<R>::Type;
  const R* phi = x;
  const R* w = x + S;
  const R* e = x + 2 * S;
  for (int i = 0; i < 2 * S; ++i) dxdt[i] = x[S + i];
  R rate[S];
  R C[K][S];
  R c0[K];
  scene.row(t, phi, w, e, C, c0);
  if constexpr (Scene::kConstantInertia) {
    scene.torqueRate(t, phi, w, e, rate);
    Number inverse[S];
    for (int i = 0; i < S; ++i) inverse[i] = Number(1) / Scene::kInertia[i];
    calcJerk<K, S>(rate, C, c0, inverse, dxdt + 2 * S);
  } else {
    R J[S];
    scene.freeRate(t, phi, w, e, J, rate);
    R inverse[S];
    for (int i = 0; i < S; ++i) inverse[i] = Number(1) / J[i];
    calcJerk<K, S>(rate, C, c0, inverse, dxdt + 2 * S);
  }
}

template <class Scene, class = void>
struct HasHandJacobian : std::false_type {};
template <class Scene>
struct HasHandJacobian<Scene, std::void_t<decltype(&Scene::jacobian)>> : std::true_type {};

/// df/dx, entry (i, j) at jacobian[i + 3 s j], and df/dt: by hand where the scene has it, else by
/// dual numbers, which are exact too. `parameters` made the scene.
template <template <class> class Scene>
inline void calcJacobian(const Scene<double>& scene, const SceneParameters& parameters, double t,
                         const double* x, double* jacobian, double* dfdt, bool by_hand = true) {
  constexpr int N = 3 * Scene<double>::kShafts;
  if constexpr (HasHandJacobian<Scene<double>>::value) {
    if (by_hand) {
      scene.jacobian(t, x, jacobian, dfdt);
      return;
    }
  }
  const Scene<Dual<double, N + 1>> dual_scene(parameters);
  const auto rates = [&](const auto& time, const auto* y, auto* dydt) {
    calcDerivative(dual_scene, time, y, dydt);
  };
  differentiate<N>(rates, t, x, jacobian, dfdt);
}

/// The projector of d onto C d = 0 along J^-1 C^T: d -= J^-1 C^T A^-1 (C d + b).
template <class Scene>
inline void removeNormalPart(const Scene& scene, double t, const double* x, const double* b,
                             double* d) {
  constexpr int S = Scene::kShafts;
  constexpr int K = Scene::kConstraints;
  double C[K][S];
  double c0[K];
  scene.row(t, x, x + S, x + 2 * S, C, c0);
  double J[S];
  for (int i = 0; i < S; ++i) J[i] = Scene::kInertia[i];
  if constexpr (!Scene::kConstantInertia) {
    double rate[S];
    scene.freeRate(t, x, x + S, x + 2 * S, J, rate);
  }
  double inverse[S];
  double rate[S];
  for (int i = 0; i < S; ++i) {
    inverse[i] = 1.0 / J[i];
    rate[i] = J[i] * d[i];
  }
  double moved[S];
  calcJerk<K, S>(rate, C, b, inverse, moved);
  for (int i = 0; i < S; ++i) d[i] = moved[i];
}

/// Moves x onto the constraints as given: omega at order 1, then epsilon. Nothing at order 3.
template <class Scene>
inline bool projectState(const Scene& scene, double t, double* x) {
  constexpr int S = Scene::kShafts;
  constexpr int K = Scene::kConstraints;
  if constexpr (Scene::kOrder == 3) return true;
  double psi[K];
  if constexpr (Scene::kOrder == 1) {
    double step[S] = {};
    scene.velocityResidual(t, x, x + S, psi);
    removeNormalPart(scene, t, x, psi, step);
    for (int i = 0; i < S; ++i) x[S + i] += step[i];
  }
  for (int iteration = 0; iteration < 5; ++iteration) {
    scene.residual(t, x, x + S, x + 2 * S, psi);
    double step[S] = {};
    removeNormalPart(scene, t, x, psi, step);
    double largest = 0.0;
    for (int i = 0; i < S; ++i) {
      x[2 * S + i] += step[i];
      largest = std::fmax(largest, std::abs(step[i]) / (1.0 + std::abs(x[2 * S + i])));
    }
    // Newton's iteration squares the distance: after 1e-8 nothing is left.
    if (Scene::kLinear || largest < 1e-8) return true;
  }
  return false;
}

/// F(t, y, y') of the implicit form: phi' - omega, omega' - epsilon, psi (or the third-order form),
/// N (J epsilon' + g) with N C^T = 0.
template <class Scene, class R>
inline void calcImplicitResidual(const Scene& scene, const R& t, const R* y, const R* dydt, R* F) {
  constexpr int S = Scene::kShafts;
  constexpr int K = Scene::kConstraints;
  using Number = typename ConstantOf<R>::Type;
  const R* phi = y;
  const R* w = y + S;
  const R* e = y + 2 * S;
  for (int i = 0; i < 2 * S; ++i) F[i] = dydt[i] - y[S + i];
  R C[K][S];
  R c0[K];
  scene.row(t, phi, w, e, C, c0);
  if constexpr (Scene::kOrder == 3) {
    for (int m = 0; m < K; ++m) {
      F[2 * S + m] = c0[m];
      for (int i = 0; i < S; ++i) F[2 * S + m] += C[m][i] * dydt[2 * S + i];
    }
  } else {
    scene.residual(t, phi, w, e, F + 2 * S);
  }
  R rate[S];
  R G[S];
  if constexpr (Scene::kConstantInertia) {
    scene.torqueRate(t, phi, w, e, rate);
    for (int i = 0; i < S; ++i) G[i] = Scene::kInertia[i] * dydt[2 * S + i] - rate[i];
  } else {
    R J[S];
    scene.freeRate(t, phi, w, e, J, rate);
    for (int i = 0; i < S; ++i) G[i] = J[i] * dydt[2 * S + i] - rate[i];
  }
  R N[S - K][S];
  Scene::nullSpace(C, N);
  for (int m = 0; m < S - K; ++m) {
    F[2 * S + K + m] = R(Number(0));
    for (int i = 0; i < S; ++i) F[2 * S + K + m] += N[m][i] * G[i];
  }
}

}  // namespace variator_sim::benchmark
