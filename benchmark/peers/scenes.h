/// The scenes of benchmark/scenes/, written by hand, as for a program
/// for one machine. Sizes and constants are known to the compiler; nothing is virtual.
///
/// R is the scalar: double for the peers, long double for the references, Dual for Jacobians.
/// A scene has
///     torqueRate        Q'
///     row               C and c0 of C eta + c0 = 0
///     initial           x = (phi, omega, epsilon) at time 0
/// Scenes whose inertia depends on the angle have freeRate() instead of torqueRate(). Scenes that
/// start with accelerations of least reaction have torque() and residual(), psi, too.
#pragma once

#include <cmath>
#include <initializer_list>

#include "dual.h"

namespace variator_sim::benchmark {

/// Parameters of a scene; only stiff ones read them.
struct SceneParameters {
  long double tau = 0.0L;
  bool slips_at_start = false;
};

/// Common base of scenes without events and with a constant inertia.
struct PlainScene {
  static constexpr bool kConstantInertia = true;
  static constexpr int kEvents = 0;
};

/// Two shafts, one constraint.
struct TwoShafts : PlainScene {
  static constexpr int kShafts = 2;
  static constexpr int kConstraints = 1;
};

/// x in long double, as a scene's scalars.
template <class R>
void setState(R* x, std::initializer_list<long double> values) {
  for (const long double value : values) *x++ = R(typename ConstantOf<R>::Type(value));
}

/// epsilon of least reaction for one constraint that is linear in epsilon: J epsilon = Q + C^T l.
template <class Scene, class R>
void findLeastReaction(const Scene& scene, R* x) {
  constexpr int S = Scene::kShafts;
  static_assert(Scene::kConstraints == 1 && Scene::kConstantInertia);
  R* e = x + 2 * S;
  R Q[S] = {};
  scene.torque(R(0), x, x + S, Q);
  for (int i = 0; i < S; ++i) e[i] = Q[i] / Scene::kInertia[i];
  R psi[1];
  R C[1][S] = {};
  R c0[1];
  scene.residual(R(0), x, x + S, e, psi);
  scene.row(R(0), x, x + S, e, C, c0);
  R A = R(0);
  for (int i = 0; i < S; ++i) A += C[0][i] * C[0][i] / Scene::kInertia[i];
  for (int i = 0; i < S; ++i) e[i] -= C[0][i] / Scene::kInertia[i] * psi[0] / A;
}

/// Kloss's motor: peak * slip / (slip^2 + 0.04), slip = (synchronous - omega) / synchronous.
template <class R>
struct KlossMotor {
  using K = typename ConstantOf<R>::Type;
  K peak;
  K synchronous;
  R torque(const R& w) const {
    const R s = (synchronous - w) * (K(1) / synchronous);
    return peak * s / (s * s + K(0.04L));
  }
  R torqueRate(const R& w, const R& e) const {
    const R s = (synchronous - w) * (K(1) / synchronous);
    const R inverse = K(1) / (s * s + K(0.04L));
    return peak * (s * s - K(0.04L)) * (inverse * inverse) * (e * (K(1) / synchronous));
  }
};

/// A motor and a propeller on two shafts.
template <class R>
struct ShipShafts : TwoShafts {
  using K = typename ConstantOf<R>::Type;
  static constexpr K kInertia[2] = {K(0.8L), K(2.0L)};
  static constexpr KlossMotor<R> kMotor = {K(12), K(50)};
  static void torque(const R& /*t*/, const R* /*phi*/, const R* w, R* Q) {
    Q[0] = kMotor.torque(w[0]);
    Q[1] = K(-0.02L) * (w[1] * w[1]);
  }
  static void torqueRate(const R& /*t*/, const R* /*phi*/, const R* w, const R* e, R* rate) {
    rate[0] = kMotor.torqueRate(w[0], e[0]);
    rate[1] = K(-0.04L) * (w[1] * e[1]);
  }
};

template <class R>
struct Ship : ShipShafts<R> {
  using K = typename ConstantOf<R>::Type;
  static constexpr K kEnd = K(20);
  explicit Ship(const SceneParameters& /*parameters*/) {}

  static void initial(R* x) {
    setState(x, {0.0L, 0.0L, 5.0L, 2.0L, 8.7766140234030305241L, 6.0165615693436304098L});
  }
  static void residual(const R& t, const R* /*phi*/, const R* w, const R* e, R* psi) {
    using std::sin;
    const R u = K(0.6L) + K(0.2L) * sin(K(0.7L) * t);
    const R g = K(1) + K(0.05L) * (e[0] * e[0] + e[1] * e[1]);
    psi[0] = K(0.2L) * (e[1] - u * e[0]) * g + w[1] - u * w[0];
  }
  static void row(const R& t, const R* /*phi*/, const R* w, const R* e, R (*C)[2], R* c0) {
    using std::cos;
    using std::sin;
    const R angle = K(0.7L) * t;
    const R u = K(0.6L) + K(0.2L) * sin(angle);
    const R du = K(0.14L) * cos(angle);
    const R slip = e[1] - u * e[0];
    const R g = K(0.2L) + K(0.01L) * (e[0] * e[0] + e[1] * e[1]);
    const R bend = K(0.02L) * slip;
    C[0][0] = bend * e[0] - u * g;
    C[0][1] = bend * e[1] + g;
    c0[0] = slip - du * (g * e[0] + w[0]);
  }
};

template <class R>
struct SmoothLinear : TwoShafts {
  using K = typename ConstantOf<R>::Type;
  static constexpr K kInertia[2] = {K(0.6L), K(1.5L)};
  static constexpr K kEnd = K(20);
  explicit SmoothLinear(const SceneParameters& /*parameters*/) {}

  static void initial(R* x) {
    setState(x, {0.0L, 0.0L, 10.0L, 7.0L, 0.0L, 0.0L});
    findLeastReaction(SmoothLinear({}), x);
  }
  static void torque(const R& t, const R* /*phi*/, const R* w, R* Q) {
    using std::sin;
    Q[0] = K(20) + K(5) * sin(K(1.3L) * t) - K(0.8L) * w[0];
    Q[1] = K(-0.5L) * w[1];
  }
  static void torqueRate(const R& t, const R* /*phi*/, const R* /*w*/, const R* e, R* rate) {
    using std::cos;
    rate[0] = K(6.5L) * cos(K(1.3L) * t) - K(0.8L) * e[0];
    rate[1] = K(-0.5L) * e[1];
  }
  static void residual(const R& /*t*/, const R* /*phi*/, const R* w, const R* e, R* psi) {
    psi[0] = K(0.5L) * e[1] - K(0.35L) * e[0] + w[1] - K(0.7L) * w[0];
  }
  static void row(const R& /*t*/, const R* /*phi*/, const R* /*w*/, const R* e, R (*C)[2], R* c0) {
    C[0][0] = R(K(-0.35L));
    C[0][1] = R(K(0.5L));
    c0[0] = e[1] - K(0.7L) * e[0];
  }
};

template <class R>
struct AccelerationCircle : TwoShafts {
  using K = typename ConstantOf<R>::Type;
  static constexpr K kInertia[2] = {K(1.5L), K(1.5L)};
  static constexpr K kEnd = K(5);
  explicit AccelerationCircle(const SceneParameters& /*parameters*/) {}

  static void initial(R* x) { setState(x, {0.0L, 0.0L, 0.0L, 0.0L, 1.2L, 1.6L}); }
  static void torqueRate(const R& /*t*/, const R* /*phi*/, const R* /*w*/, const R* /*e*/,
                         R* rate) {
    rate[0] = R(K(3));
    rate[1] = R(K(0));
  }
  static void row(const R& /*t*/, const R* /*phi*/, const R* /*w*/, const R* e, R (*C)[2], R* c0) {
    C[0][0] = K(2) * e[0];
    C[0][1] = K(2) * e[1];
    c0[0] = R(K(0));
  }
};

/// The torque on the drive steps every 0.5 s, as torque_steps.csv says.
template <class R>
struct TorqueSteps : TwoShafts {
  using K = typename ConstantOf<R>::Type;
  static constexpr K kInertia[2] = {K(0.5L), K(1.2L)};
  static constexpr K kEnd = K(10);
  static constexpr int kEvents = 19;
  K command = K(4);
  explicit TorqueSteps(const SceneParameters& /*parameters*/) {}

  static void initial(R* x) {
    setState(x, {0.0L, 0.0L, 10.0L, 8.0L, 0.0L, 0.0L});
    findLeastReaction(TorqueSteps({}), x);
  }
  static K eventTime(int event) { return K(0.5L) * K(event); }
  static K commandOf(int event) { return K(4 + 3 * ((2 * event) % 5)); }
  void reset() { command = commandOf(0); }
  /// The jump: d_epsilon = J^-1 (dQ + C^T Lambda), C d_epsilon = 0.
  void applyEvent(int event, R* x) {
    const K free = (commandOf(event) - command) / kInertia[0];
    command = commandOf(event);
    const K A = kC[0] * kC[0] / kInertia[0] + kC[1] * kC[1] / kInertia[1];
    const K Lambda = -kC[0] * free / A;
    x[4] += free + kC[0] / kInertia[0] * Lambda;
    x[5] += kC[1] / kInertia[1] * Lambda;
  }
  void torque(const R& /*t*/, const R* /*phi*/, const R* w, R* Q) const {
    Q[0] = command - K(0.5L) * w[0];
    Q[1] = K(-0.3L) * w[1] - K(0.01L) * (w[1] * w[1]);
  }
  static void torqueRate(const R& /*t*/, const R* /*phi*/, const R* w, const R* e, R* rate) {
    rate[0] = K(-0.5L) * e[0];
    rate[1] = (K(-0.3L) - K(0.02L) * w[1]) * e[1];
  }
  static void residual(const R& /*t*/, const R* /*phi*/, const R* w, const R* e, R* psi) {
    psi[0] = kC[1] * e[1] + kC[0] * e[0] + w[1] - K(0.8L) * w[0];
  }
  static void row(const R& /*t*/, const R* /*phi*/, const R* /*w*/, const R* e, R (*C)[2], R* c0) {
    C[0][0] = R(kC[0]);
    C[0][1] = R(kC[1]);
    c0[0] = e[1] - K(0.8L) * e[0];
  }

 private:
  static constexpr K kC[2] = {K(-0.4L), K(0.5L)};
};

template <class R>
struct StiffSlip : ShipShafts<R> {
  using K = typename ConstantOf<R>::Type;
  static constexpr K kEnd = K(3);
  SceneParameters parameters;
  K tau;
  explicit StiffSlip(const SceneParameters& given) : parameters(given), tau(K(given.tau)) {}

  /// With a slip: of least reaction. Without: on the slow motion, to second order in tau. With
  /// w2 = u w1 + tau rho, e2 = u e1 - rho the slow motion is
  ///     rho = -u' w1 + tau (u'' w1 + u' e1) + ...;
  /// e1 is the one of the ideal gear w2 = u w1 under the classical principle.
  /// The double numbers that our scene and the peers start with.
  void initial(R* x) const {
    if (parameters.slips_at_start) {
      setState(x, {0.0L, 0.0L, 5.0L, 2.0L, 0.0L, 0.0L});
      findLeastReaction(*this, x);
      return;
    }
    const long double long_tau = parameters.tau;
    const long double u = 0.6L;
    const long double du = 0.14L;  // u'' = 0 at time 0
    const long double w1 = 5.0L;
    const long double motor = KlossMotor<long double>{12.0L, 50.0L}.torque(w1);
    const long double load = -0.02L * 9.0L;
    const long double e1 = (motor + u * load - u * 2.0L * du * w1) / (0.8L + u * u * 2.0L);
    const long double rho = -du * w1 + long_tau * du * e1;
    const auto w2 = static_cast<double>(u * w1 + long_tau * rho);
    const auto rounded_e1 = static_cast<double>(e1);
    const auto e2 = static_cast<double>(u * rounded_e1 - (w2 - u * w1) / long_tau);
    x[0] = x[1] = R(K(0));
    x[2] = R(K(w1));
    x[3] = R(K(w2));
    x[4] = R(K(rounded_e1));
    x[5] = R(K(e2));
  }
  void residual(const R& t, const R* /*phi*/, const R* w, const R* e, R* psi) const {
    using std::sin;
    const R u = K(0.6L) + K(0.2L) * sin(K(0.7L) * t);
    psi[0] = tau * (e[1] - u * e[0]) + w[1] - u * w[0];
  }
  void row(const R& t, const R* /*phi*/, const R* w, const R* e, R (*C)[2], R* c0) const {
    using std::cos;
    using std::sin;
    const R angle = K(0.7L) * t;
    const R u = K(0.6L) + K(0.2L) * sin(angle);
    const R du = K(0.14L) * cos(angle);
    C[0][0] = -(tau * u);
    C[0][1] = R(tau);
    c0[0] = e[1] - u * e[0] - du * (w[0] + tau * e[0]);
  }
  /// df/dx of x' = (omega, epsilon, eta), entry (i, j) at jacobian[i + 6 j], and df/dt. By hand:
  /// C is written as tau (-u, 1), Lambda tau as L, and A / tau^2 as B.
  void jacobian(double t, const double* x, double* jacobian, double* dfdt) const {
    const double* w = x + 2;
    const double* e = x + 4;
    const double s = (50.0 - w[0]) / 50.0;
    const double d = 1.0 / (s * s + 0.04);
    const double slope = 12.0 * (0.04 - s * s) * d * d;
    const double curvature = -24.0 * s * (0.12 - s * s) * d * d * d;
    const double Q1 = -slope * e[0] / 50.0;
    const double Q2 = -0.04 * w[1] * e[1];
    const double sine = std::sin(0.7 * t);
    const double u = 0.6 + 0.2 * sine;
    const double du = 0.14 * std::cos(0.7 * t);
    const double ddu = -0.098 * sine;
    const double inverse_tau = 1.0 / static_cast<double>(tau);
    const double B = 1.0 / (u * u / 0.8 + 0.5);
    const double c0 = (e[1] - u * e[0] - du * w[0]) * inverse_tau - du * e[0];
    const double L = -(c0 - u * Q1 / 0.8 + Q2 / 2.0) * B;
    // derivatives of Q1', Q2', c0 / tau with respect to w1, w2, e1, e2
    const double dQ1[4] = {curvature * e[0] / 2500.0, 0.0, -slope / 50.0, 0.0};
    const double dQ2[4] = {0.0, -0.04 * e[1], 0.0, -0.04 * w[1]};
    const double dc0[4] = {-du * inverse_tau, 0.0, -u * inverse_tau - du, inverse_tau};
    for (int i = 0; i < 36; ++i) jacobian[i] = 0.0;
    for (int i = 0; i < 4; ++i) jacobian[i + 6 * (i + 2)] = 1.0;
    for (int j = 0; j < 4; ++j) {
      const double dL = -(dc0[j] - u * dQ1[j] / 0.8 + dQ2[j] / 2.0) * B;
      jacobian[4 + 6 * (j + 2)] = (dQ1[j] - u * dL) / 0.8;
      jacobian[5 + 6 * (j + 2)] = (dQ2[j] + dL) / 2.0;
    }
    const double dc0dt = -(du * e[0] + ddu * w[0]) * inverse_tau - ddu * e[0];
    const double dLdt = -(dc0dt - du * Q1 / 0.8) * B - L * B * 2.0 * u * du / 0.8;
    for (int i = 0; i < 4; ++i) dfdt[i] = 0.0;
    dfdt[4] = -(du * L + u * dLdt) / 0.8;
    dfdt[5] = dLdt / 2.0;
  }
};

template <class R>
struct FourShafts : PlainScene {
  using K = typename ConstantOf<R>::Type;
  static constexpr int kShafts = 4;
  static constexpr int kConstraints = 2;
  static constexpr K kInertia[4] = {K(1.0L), K(0.5L), K(0.8L), K(2.5L)};
  static constexpr K kEnd = K(10);
  static constexpr KlossMotor<R> kMotor = {K(20), K(60)};
  explicit FourShafts(const SceneParameters& /*parameters*/) {}

  static void initial(R* x) {
    setState(x, {0.0L, 0.0L, 0.0L, 0.0L, 10.0L, 7.0L, 7.0L, 5.6L, 18.22722053114120627745L,
                 12.75905437179884439422L, -0.4181321623640764628555L, -0.3350661376058696561941L});
  }
  static void torqueRate(const R& /*t*/, const R* phi, const R* w, const R* e, R* rate) {
    const R twist = phi[1] - phi[2];
    const R spring = (K(60) + K(15) * (twist * twist)) * (w[1] - w[2]) + K(4) * (e[1] - e[2]);
    rate[0] = kMotor.torqueRate(w[0], e[0]);
    rate[1] = -spring;
    rate[2] = spring;
    rate[3] = K(-0.08L) * (w[3] * e[3]);
  }
  static void row(const R& t, const R* /*phi*/, const R* w, const R* e, R (*C)[4], R* c0) {
    using std::cos;
    using std::sin;
    const R angle = K(0.5L) * t;
    const R u = K(0.7L) + K(0.15L) * sin(angle);
    const R du = K(0.075L) * cos(angle);
    const R slip = e[1] - u * e[0];
    const R g = K(0.3L) + K(0.006L) * (e[0] * e[0] + e[1] * e[1]);
    const R bend = K(0.012L) * slip;
    C[0][0] = bend * e[0] - u * g;
    C[0][1] = bend * e[1] + g;
    C[0][2] = C[0][3] = R(K(0));
    c0[0] = slip - du * (g * e[0] + w[0]);
    C[1][0] = C[1][1] = R(K(0));
    C[1][2] = K(0.001L) * e[3] - K(0.2L);
    C[1][3] = K(0.001L) * e[2] + K(0.25L);
    c0[1] = e[3] - K(0.8L) * e[2];
  }
};

template <class R>
struct Crank : PlainScene {
  using K = typename ConstantOf<R>::Type;
  static constexpr int kShafts = 3;
  static constexpr int kConstraints = 1;
  static constexpr bool kConstantInertia = false;
  static constexpr K kInertia[3] = {K(1.0L), K(0.2L), K(3.0L)};  ///< of the first shaft the mean
  static constexpr K kEnd = K(2);
  explicit Crank(const SceneParameters& /*parameters*/) {}

  static void initial(R* x) {
    setState(x, {0.0L, 0.0L, 0.0L, 10.0L, 10.0L, 7.0L, 15.833333333333333333L,
                 -0.61495035182037140116L, -0.4317929022600517712L});
  }
  /// The inertias and -g of J eta + g = C^T Lambda [6]:
  ///     -g = Q' - J' omega epsilon - n' + J' omega R / (2 J),   n = J' omega^2 / 2.
  static void freeRate(const R& /*t*/, const R* phi, const R* w, const R* e, R* J, R* rate) {
    using std::cos;
    using std::sin;
    const R s1 = sin(phi[0]);
    const R c1 = cos(phi[0]);
    const R s2 = K(2) * (s1 * c1);
    const R c2 = K(1) - K(2) * (s1 * s1);
    J[0] = K(1) + K(0.15L) * c1 + K(0.05L) * c2 + K(0.02L) * s2;
    J[1] = R(kInertia[1]);
    J[2] = R(kInertia[2]);
    const R dJ = K(0.04L) * c2 - K(0.15L) * s1 - K(0.1L) * s2;
    const R ddJ = -(K(0.15L) * c1) - K(0.2L) * c2 - K(0.08L) * s2;
    const R spring = K(400) * (phi[0] - phi[1]) + K(3) * (w[0] - w[1]);
    const R spring_rate = K(400) * (w[0] - w[1]) + K(3) * (e[0] - e[1]);
    const R n = K(0.5L) * (dJ * (w[0] * w[0]));
    const R Q = K(25) + K(6) * s2 - K(0.4L) * w[0] - spring;
    const R reaction = J[0] * e[0] + n - Q;
    rate[0] = K(12) * (c2 * w[0]) - K(0.4L) * e[0] - spring_rate - K(2) * (dJ * (w[0] * e[0])) -
              K(0.5L) * (ddJ * (w[0] * (w[0] * w[0]))) + K(0.5L) * (dJ * (w[0] * reaction)) / J[0];
    rate[1] = spring_rate;
    rate[2] = K(-0.06L) * (w[2] * e[2]);
  }
  static void row(const R& /*t*/, const R* /*phi*/, const R* /*w*/, const R* e, R (*C)[3], R* c0) {
    C[0][0] = R(K(0));
    C[0][1] = K(0.002L) * e[2] - K(0.28L);
    C[0][2] = K(0.002L) * e[1] + K(0.4L);
    c0[0] = e[2] - K(0.7L) * e[1];
  }
};

template <class R>
struct Order1 : TwoShafts {
  using K = typename ConstantOf<R>::Type;
  static constexpr K kInertia[2] = {K(0.3L), K(1.1L)};
  static constexpr K kEnd = K(20);
  explicit Order1(const SceneParameters& /*parameters*/) {}

  static void initial(R* x) {
    setState(x, {0.0L, 0.0L, 4.0L, 2.0L, 0.0L, 0.0L});
    findLeastReaction(Order1({}), x);
  }
  static void torque(const R& /*t*/, const R* /*phi*/, const R* w, R* Q) {
    Q[0] = K(20) - K(0.5L) * w[0];
    Q[1] = K(-2) - K(0.01L) * (w[1] * w[1]);
  }
  static void torqueRate(const R& /*t*/, const R* /*phi*/, const R* w, const R* e, R* rate) {
    rate[0] = K(-0.5L) * e[0];
    rate[1] = K(-0.02L) * (w[1] * e[1]);
  }
  static void residual(const R& t, const R* /*phi*/, const R* w, const R* e, R* psi) {
    using std::cos;
    using std::sin;
    const R angle = K(0.8L) * t;
    psi[0] = e[1] - (K(0.5L) + K(0.1L) * sin(angle)) * e[0] - K(0.08L) * cos(angle) * w[0];
  }
  static void row(const R& t, const R* /*phi*/, const R* w, const R* e, R (*C)[2], R* c0) {
    using std::cos;
    using std::sin;
    const R angle = K(0.8L) * t;
    const R sine = sin(angle);
    C[0][0] = K(-0.5L) - K(0.1L) * sine;
    C[0][1] = R(K(1));
    c0[0] = K(0.064L) * (sine * w[0]) - K(0.16L) * (cos(angle) * e[0]);
  }
};

template <class R>
struct Order3 : TwoShafts {
  using K = typename ConstantOf<R>::Type;
  static constexpr K kInertia[2] = {K(0.8L), K(2.0L)};
  static constexpr K kEnd = K(20);
  explicit Order3(const SceneParameters& /*parameters*/) {}

  static void initial(R* x) { setState(x, {0.0L, 0.0L, 5.0L, 2.0L, 10.0L, 4.0L}); }
  static void torqueRate(const R& /*t*/, const R* /*phi*/, const R* w, const R* e, R* rate) {
    rate[0] = K(-0.6L) * e[0];
    rate[1] = K(-0.04L) * (w[1] * e[1]);
  }
  static void row(const R& t, const R* /*phi*/, const R* w, const R* e, R (*C)[2], R* c0) {
    using std::sin;
    const R u = K(0.6L) + K(0.1L) * sin(K(0.9L) * t);
    C[0][0] = K(-0.2L) * u;
    C[0][1] = R(K(0.2L));
    c0[0] = e[1] - u * e[0] + K(1.5L) * (w[1] - u * w[0]);
  }
};

}  // namespace variator_sim::benchmark
