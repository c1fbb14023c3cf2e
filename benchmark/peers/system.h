/// A hand-written scene as a first-order system: x' = f(t, x), and its Jacobian.
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

}  // namespace variator_sim::benchmark
