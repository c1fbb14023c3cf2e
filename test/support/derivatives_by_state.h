/// The exact derivatives of C, c0 and Q' by the state against differences of high order.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "variator_sim/constraint.h"
#include "variator_sim/torque.h"

namespace variator_sim::test {

/// d f/d x_q by differences of order eight with the step h; q counts phi, then omega, then epsilon.
template <class Function>
double differenceByState(const StateView& x, int shaft_count, int q, double h, Function f) {
  const auto s = static_cast<std::size_t>(shaft_count);
  std::vector<double> values;
  for (const double* part : {x.angle, x.velocity, x.acceleration}) {
    values.insert(values.end(), part, part + s);
  }
  const auto at = [&](double step) {
    std::vector<double> moved = values;
    moved[static_cast<std::size_t>(q)] += step;
    StateView view = x;
    view.angle = moved.data();
    view.velocity = moved.data() + s;
    view.acceleration = moved.data() + 2 * s;
    return f(view);
  };
  const double c[] = {4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0};
  double sum = 0.0;
  for (int k = 1; k <= 4; ++k) sum += c[k - 1] * (at(k * h) - at(-k * h));
  return sum / h;
}

/// calcRowDerivatives writes all of d(C, c0)/d(phi, omega, epsilon) and only that.
inline void expectRowDerivatives(const Constraint& constraint, const StateView& x, double h = 1e-2,
                                 double tolerance = 1e-10) {
  const int s = constraint.shaftCount();
  const auto size = static_cast<std::size_t>(3 * s);
  std::vector<double> dC(size * static_cast<std::size_t>(s) + 1,
                         std::numeric_limits<double>::quiet_NaN());
  std::vector<double> dc0(size + 1, std::numeric_limits<double>::quiet_NaN());
  constraint.calcRowDerivatives(x, dC.data(), dc0.data());
  EXPECT_TRUE(std::isnan(dC.back()) && std::isnan(dc0.back())) << "written beyond the end";
  for (int q = 0; q < 3 * s; ++q) {
    for (int i = 0; i <= s; ++i) {
      double largest = 1.0;
      const double expected = differenceByState(x, s, q, h, [&](const StateView& view) {
        double C[kMaxShafts];
        double c0 = 0.0;
        constraint.calcRow(view, C, &c0);
        const double value = i < s ? C[i] : c0;
        largest = std::max(largest, std::abs(value));
        return value;
      });
      const double stated =
          i < s ? dC[static_cast<std::size_t>(q * s + i)] : dc0[static_cast<std::size_t>(q)];
      EXPECT_NEAR(stated, expected, tolerance * std::max(largest, std::abs(expected)))
          << (i < s ? "C" + std::to_string(i + 1) : "c0") << " by entry " << q << " of the state";
    }
  }
}

/// addTorqueRateDerivatives adds dQ'/d(phi, omega, epsilon) to what is there.
inline void expectRateDerivatives(const Torque& torque, const StateView& x, double h = 1e-2,
                                  double tolerance = 1e-10) {
  const int s = torque.shaftCount();
  std::vector<double> none(static_cast<std::size_t>(3 * s * s), 0.0);
  std::vector<double> some(none.size(), 0.5);
  torque.addTorqueRateDerivatives(x, none.data());
  torque.addTorqueRateDerivatives(x, some.data());
  for (int q = 0; q < 3 * s; ++q) {
    for (int i = 0; i < s; ++i) {
      double largest = 1.0;
      const double expected = differenceByState(x, s, q, h, [&](const StateView& view) {
        double rate[kMaxShafts] = {};
        torque.addTorqueRate(view, rate);
        largest = std::max(largest, std::abs(rate[i]));
        return rate[i];
      });
      const double stated = none[static_cast<std::size_t>(q * s + i)];
      EXPECT_NEAR(stated, expected, tolerance * std::max(largest, std::abs(expected)))
          << "Q' of shaft " << i << " by entry " << q << " of the state";
      EXPECT_EQ(some[static_cast<std::size_t>(q * s + i)], 0.5 + stated);
    }
  }
}

}  // namespace variator_sim::test
