/// A user's own constraint in ten lines: its formula, written once.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "variator_sim/automatic_derivatives.h"
#include "variator_sim/constraint.h"

namespace variator_sim {

/// The state as a formula reads it; T is a number that carries derivatives. Entry i belongs to the
/// i-th shaft (or commanded input) of the constraint, not of the scene. What a constraint's order
/// does not know, acceleration in order 1 and jerk up to order 2, is NaN.
template <class T>
struct GenericState {
  T time;                      ///< t, s
  T angle[kMaxShafts];         ///< phi, rad
  T velocity[kMaxShafts];      ///< omega, rad/s
  T acceleration[kMaxShafts];  ///< epsilon, rad/s^2
  T jerk[kMaxShafts];          ///< eta, rad/s^3
  T input[kMaxInputs];         ///< u, its own unit
};

/// Supplies everything a constraint has to answer from one function of the derived class,
///     template <class T>
///     T residual(const variator_sim::GenericState<T>& x) const;
/// which gives f (Order 1), psi (Order 2) or C eta + c0 (Order 3, linear in x.jerk). Derivatives
/// are exact, by forward automatic differentiation; nothing is allocated.
///
///     class Slip : public variator_sim::AutomaticConstraint<Slip> {
///      public:
///       template <class T>
///       T residual(const variator_sim::GenericState<T>& x) const {
///         return tau_ * (x.acceleration[1] - x.acceleration[0]) + x.velocity[1] - x.velocity[0];
///       }
///      private:
///       void doConfigure(variator_sim::ComponentContext& context) override {
///         useShafts(context.readShafts("shafts", 2));
///         tau_ = context.parameters().number("time_constant", variator_sim::Range::positive());
///       }
///       double tau_ = 0.0;  // s
///     };
///
/// `residual` may use + - * /, comparisons, sin cos tan asin acos atan atan2 sinh cosh tanh exp
/// expm1 log log1p sqrt pow abs min max without a namespace, constants of type double, and, for
/// functions of one variable known otherwise, `compose`. Not std::sin etc.
///
/// `Shafts` is how many shafts the formula reads, `Inputs` how many commanded inputs.
///
/// Order 2 is asked for C and c0 together: one evaluation with Shafts + 1 directions, the
/// accelerations and the motion itself. Order 1 needs f'' along the motion, t + d,
/// phi + omega d + epsilon d^2/2, omega + epsilon d: one evaluation with Curve, of which C is the
/// gradient. Derivatives of C and c0 by the state (stiff steppers) are one evaluation of the same
/// numbers within a Dual of 3 Shafts directions.
///
/// To be overridden besides, for speed: doDependence, doHasConstantJacobian,
/// doIsLinearInAcceleration.
template <class Derived, int Order = 2, int Shafts = 2, int Inputs = 0>
class AutomaticConstraint : public Constraint {
  static_assert(Order >= 1 && Order <= 3, "the order of a constraint is 1, 2 or 3");
  static_assert(Shafts >= 1 && Shafts <= kMaxShafts);
  static_assert(Inputs >= 0 && Inputs <= kMaxInputs);

 protected:
  AutomaticConstraint() {
    for (int i = 0; i < Shafts; ++i) shaft_[static_cast<std::size_t>(i)] = i;
    input_.fill(-1);
  }
  /// Which shafts of the scene x.velocity[0], [1], ... are; without it, its first ones.
  void useShafts(const std::vector<int>& shafts) {
    if (shafts.size() != static_cast<std::size_t>(Shafts)) {
      throw std::logic_error("useShafts: as many shafts as the template's argument says");
    }
    std::copy(shafts.begin(), shafts.end(), shaft_.begin());
  }
  /// x.input[slot] is the input `index` of the scene (ComponentContext::addInput); 0 without it.
  void useInput(int slot, int index) { input_.at(static_cast<std::size_t>(slot)) = index; }
  int shaft(int i) const { return shaft_[static_cast<std::size_t>(i)]; }

  int doOrder() const final { return Order; }
  bool doReadsInputs() const final {
    return std::any_of(input_.begin(), input_.end(), [](int index) { return index >= 0; });
  }
  /// To be overridden where psi is linear in the accelerations: jumps are then cheaper.
  bool doIsLinearInAcceleration() const override { return Order == 1; }

  double doCalcResidual(const StateView& state) const final {
    return evaluate<Dual<0>>(state, [](auto&, Part, int) {}).value;
  }

  double doCalcVelocityResidualAndJacobian(const StateView& state, double* C) const final {
    using T = Dual<Shafts>;
    const T f = evaluate<T>(state, [](T& x, Part part, int i) {
      if (part == Part::kVelocity) x.derivative[at(i)] = 1.0;
    });
    scatter(f.derivative, C);
    return f.value;
  }

  double doCalcResidualAndJacobian(const StateView& state, double* C) const final {
    if constexpr (Order == 1) {
      using T = Dual<Shafts + 1>;
      const T f = evaluate<T>(state, [&](T& x, Part part, int i) {
        x.derivative[Shafts] = rateOf(state, part, i);
        if (part == Part::kVelocity) x.derivative[at(i)] = 1.0;
      });
      scatter(f.derivative, C);
      return f.derivative[Shafts];
    } else {
      using T = Dual<Shafts>;
      const T psi = evaluate<T>(state, [](T& x, Part part, int i) {
        if (part == kHighest) x.derivative[at(i)] = 1.0;
      });
      scatter(psi.derivative, C);
      return psi.value;
    }
  }

  void doCalcRow(const StateView& state, double* C, double* c0) const final {
    if constexpr (Order == 1) {
      using T = Curve<Shafts>;
      const T f = evaluate<T>(state, [&](T& x, Part part, int i) {
        x.first = rateOf(state, part, i);
        x.second = secondRateOf(state, part, i);
        if (part == Part::kVelocity) x.gradient[at(i)] = 1.0;
      });
      scatter(f.gradient, C);
      *c0 = f.second;
    } else if constexpr (Order == 2) {
      using T = Dual<Shafts + 1>;
      const T psi = evaluate<T>(state, [&](T& x, Part part, int i) {
        if (part == Part::kAcceleration) {
          x.derivative[at(i)] = 1.0;
        } else {
          x.derivative[Shafts] = rateOf(state, part, i);
        }
      });
      scatter(psi.derivative, C);
      *c0 = psi.derivative[Shafts];
    } else {
      *c0 = doCalcResidualAndJacobian(state, C);  // at zero jerk
    }
  }

  void doCalcPartials(const StateView& state, ConstraintPartials& partials) const final {
    using T = Dual<1 + 3 * Shafts + Inputs>;
    const T psi = evaluate<T>(state, [](T& x, Part part, int i) {
      switch (part) {
        case Part::kTime:
          x.derivative[0] = 1.0;
          break;
        case Part::kAngle:
          x.derivative[at(1 + i)] = 1.0;
          break;
        case Part::kVelocity:
          x.derivative[at(1 + Shafts + i)] = 1.0;
          break;
        case Part::kAcceleration:
          if (Order > 1) x.derivative[at(1 + 2 * Shafts + i)] = 1.0;
          break;
        case Part::kJerk:
          break;
        case Part::kInput:
          if (Inputs > 0) x.derivative[at(1 + 3 * Shafts + i)] = 1.0;
          break;
      }
    });
    partials.time = psi.derivative[0];
    for (int i = 0; i < Shafts; ++i) {
      partials.angle[shaft(i)] = psi.derivative[at(1 + i)];
      partials.velocity[shaft(i)] = psi.derivative[at(1 + Shafts + i)];
      if (Order > 1) partials.acceleration[shaft(i)] = psi.derivative[at(1 + 2 * Shafts + i)];
    }
    for (int i = 0; i < Inputs; ++i) {
      const int index = input_[at(i)];
      if (index >= 0) partials.input[index] += psi.derivative[at(1 + 3 * Shafts + i)];
    }
  }

  void doCalcInputJacobian(const StateView& state, int input_count, double* Cu) const final {
    std::fill_n(Cu, input_count, 0.0);
    // In order 3 a jump of an input makes the jerk jump, not the accelerations.
    if constexpr (Inputs > 0 && Order < 3) {
      using T = Dual<Inputs>;
      const T psi = evaluate<T>(state, [](T& x, Part part, int i) {
        if (part == Part::kInput) x.derivative[at(i)] = 1.0;
      });
      for (int i = 0; i < Inputs; ++i) {
        if (input_[at(i)] >= 0) Cu[input_[at(i)]] += psi.derivative[at(i)];
      }
    }
  }

  void doCalcHessian(const StateView& state, double* H) const final {
    std::fill_n(H, shaftCount() * shaftCount(), 0.0);
    if constexpr (Order > 1) {
      using T = Dual<Shafts, Dual<Shafts>>;
      scatterHessian(evaluate<T>(state, [](T& x, Part part, int i) { seedSecond(x, part, i); }), H);
    }
  }

  void doCalcJacobianRate(const StateView& state, double* D, double* H) const final {
    std::fill_n(H, shaftCount() * shaftCount(), 0.0);
    // the last of the outer directions is the motion with epsilon held
    using T = Dual<Shafts + 1, Dual<Shafts>>;
    const T psi = evaluate<T>(state, [&](T& x, Part part, int i) {
      seedSecond(x, part, i);
      if (part != Part::kAcceleration) x.derivative[Shafts].value = rateOf(state, part, i);
    });
    scatter(psi.derivative[Shafts].derivative, D);
    if constexpr (Order > 1) scatterHessian(psi, H);
  }

  /// Outer directions: phi, omega, epsilon of the formula's shafts. Inner ones as in doCalcRow, so
  /// that what the motion makes of the state depends on the state: phi' = omega, omega' = epsilon.
  void doCalcRowDerivatives(const StateView& state, double* dC, double* dc0) const final {
    if constexpr (Order == 1) {
      using T = Dual<3 * Shafts, Curve<Shafts>>;
      const T f = evaluate<T>(state, [&](T& x, Part part, int i) {
        x.value.first = rateOf(state, part, i);
        x.value.second = secondRateOf(state, part, i);
        if (part == Part::kAngle) {
          x.derivative[at(i)].value = 1.0;
          x.derivative[at(Shafts + i)].first = 1.0;
          x.derivative[at(2 * Shafts + i)].second = 1.0;
        } else if (part == Part::kVelocity) {
          x.value.gradient[at(i)] = 1.0;
          x.derivative[at(Shafts + i)].value = 1.0;
          x.derivative[at(2 * Shafts + i)].first = 1.0;
        }
      });
      for (const Curve<Shafts>& by_one : f.derivative) {
        if (std::isfinite(by_one.second)) continue;
        // `compose` without a third derivative, or a state at which there is none
        Constraint::doCalcRowDerivatives(state, dC, dc0);
        return;
      }
      scatterRowDerivatives(
          f, [](const Curve<Shafts>& by_one) { return by_one.gradient; },
          [](const Curve<Shafts>& by_one) { return by_one.second; }, dC, dc0);
    } else if constexpr (Order == 2) {
      using T = Dual<3 * Shafts, Dual<Shafts + 1>>;
      const T psi = evaluate<T>(state, [&](T& x, Part part, int i) {
        if (part == Part::kAcceleration) {
          x.value.derivative[at(i)] = 1.0;
        } else {
          x.value.derivative[Shafts] = rateOf(state, part, i);
        }
        seedState(x, part, i);
        if (part == Part::kAngle) x.derivative[at(Shafts + i)].derivative[Shafts] = 1.0;
        if (part == Part::kVelocity) x.derivative[at(2 * Shafts + i)].derivative[Shafts] = 1.0;
      });
      scatterRowDerivatives(
          psi, [](const Dual<Shafts + 1>& by_one) { return by_one.derivative; },
          [](const Dual<Shafts + 1>& by_one) { return by_one.derivative[Shafts]; }, dC, dc0);
    } else {
      using T = Dual<3 * Shafts, Dual<Shafts>>;
      const T row = evaluate<T>(state, [](T& x, Part part, int i) {
        if (part == Part::kJerk) x.value.derivative[at(i)] = 1.0;
        seedState(x, part, i);
      });
      scatterRowDerivatives(
          row, [](const Dual<Shafts>& by_one) { return by_one.derivative; },
          [](const Dual<Shafts>& by_one) { return by_one.value; }, dC, dc0);
    }
  }

 private:
  enum class Part { kTime, kAngle, kVelocity, kAcceleration, kJerk, kInput };
  /// What the highest derivatives of the formula are, by which it gives C.
  static constexpr Part kHighest = Order == 1   ? Part::kVelocity
                                   : Order == 2 ? Part::kAcceleration
                                                : Part::kJerk;
  static constexpr std::size_t at(int i) { return static_cast<std::size_t>(i); }

  /// The formula at `state`; `seed(x, part, i)` sets the derivatives of the i-th entry of a part.
  template <class T, class Seed>
  T evaluate(const StateView& state, Seed seed) const {
    GenericState<T> x;
    x.time = T(state.time);
    seed(x.time, Part::kTime, 0);
    for (int i = 0; i < Shafts; ++i) {
      const int n = shaft(i);
      x.angle[i] = T(state.angle[n]);
      seed(x.angle[i], Part::kAngle, i);
      x.velocity[i] = T(state.velocity[n]);
      seed(x.velocity[i], Part::kVelocity, i);
      if constexpr (Order > 1) {
        x.acceleration[i] = T(state.acceleration[n]);
        seed(x.acceleration[i], Part::kAcceleration, i);
      } else {
        x.acceleration[i] = T(std::numeric_limits<double>::quiet_NaN());
      }
      if constexpr (Order > 2) {
        x.jerk[i] = T(0.0);
        seed(x.jerk[i], Part::kJerk, i);
      } else {
        x.jerk[i] = T(std::numeric_limits<double>::quiet_NaN());
      }
    }
    for (int i = 0; i < Inputs; ++i) {
      x.input[i] = T(input_[at(i)] < 0 ? 0.0 : state.input[input_[at(i)]]);
      seed(x.input[i], Part::kInput, i);
    }
    return static_cast<const Derived&>(*this).residual(x);
  }

  /// d/dt along the motion; 0 for the highest part known, whose rate is not.
  double rateOf(const StateView& state, Part part, int i) const {
    switch (part) {
      case Part::kTime:
        return 1.0;
      case Part::kAngle:
        return state.velocity[shaft(i)];
      case Part::kVelocity:
        return state.acceleration[shaft(i)];
      case Part::kInput:
        return Inputs == 0 || input_[at(i)] < 0 ? 0.0 : state.input_rate[input_[at(i)]];
      default:
        return 0.0;
    }
  }
  double secondRateOf(const StateView& state, Part part, int i) const {
    switch (part) {
      case Part::kAngle:
        return state.acceleration[shaft(i)];
      case Part::kInput:
        return Inputs == 0 || input_[at(i)] < 0 ? 0.0 : state.input_second_rate[input_[at(i)]];
      default:
        return 0.0;
    }
  }

  /// Inner directions: what gives C. Outer: epsilon.
  template <class T>
  static void seedSecond(T& x, Part part, int i) {
    if (part == kHighest) x.value.derivative[at(i)] = 1.0;
    if (part == Part::kAcceleration) x.derivative[at(i)].value = 1.0;
  }

  /// Outer directions: phi, omega, epsilon.
  template <class T>
  static void seedState(T& x, Part part, int i) {
    if (part == Part::kAngle) x.derivative[at(i)].value = 1.0;
    if (part == Part::kVelocity) x.derivative[at(Shafts + i)].value = 1.0;
    if (part == Part::kAcceleration) x.derivative[at(2 * Shafts + i)].value = 1.0;
  }

  template <class Derivatives>
  void scatter(const Derivatives& local, double* C) const {
    std::fill_n(C, shaftCount(), 0.0);
    for (int i = 0; i < Shafts; ++i) C[shaft(i)] = local[at(i)];
  }
  template <class T>
  void scatterHessian(const T& psi, double* H) const {
    for (int i = 0; i < Shafts; ++i) {
      for (int j = 0; j < Shafts; ++j) {
        H[shaft(i) * shaftCount() + shaft(j)] = psi.derivative[at(j)].derivative[at(i)];
      }
    }
  }

  /// `C_of` and `c0_of` take the derivatives of C and c0 by one entry of the state from those of
  /// the formula.
  template <class T, class COf, class C0Of>
  void scatterRowDerivatives(const T& formula, COf C_of, C0Of c0_of, double* dC,
                             double* dc0) const {
    const int s = shaftCount();
    std::fill_n(dC, 3 * s * s, 0.0);
    std::fill_n(dc0, 3 * s, 0.0);
    for (int part = 0; part < 3; ++part) {
      for (int j = 0; j < Shafts; ++j) {
        const auto& by_one = formula.derivative[at(part * Shafts + j)];
        const int q = part * s + shaft(j);
        for (int i = 0; i < Shafts; ++i) dC[q * s + shaft(i)] = C_of(by_one)[at(i)];
        dc0[q] = c0_of(by_one);
      }
    }
  }

  std::array<int, Shafts> shaft_;
  std::array<int, Inputs> input_;
};

}  // namespace variator_sim
