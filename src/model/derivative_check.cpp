#include "model/derivative_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "laws/derived.h"
#include "model/central_difference.h"
#include "model/check_point.h"
#include "model/stated_derivative.h"
#include "model/symmetric_matrix.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

using StateFunction = std::function<double(const StateView&)>;  ///< what a state decides

/// What does not fit.
struct Mismatch {
  std::string what;
  std::string claim;   ///< what is stated of it, and what its values say
  std::string remedy;  ///< what to correct
};

Mismatch wrongDerivative(const std::string& derivative, double stated, double found) {
  return {derivative,
          "is stated as " + describe(stated) + ", but its values say " + describe(found),
          "the derivative"};
}

struct Quantity {
  std::string name;
  double value;
};
using Quantities = std::vector<Quantity>;  ///< what a state decides
using StateQuantities = std::function<Quantities(const StateView&)>;

/// Every comparison of one component at one point; the first mismatch.
class DerivativeComparison {
 public:
  DerivativeComparison(const Scene& scene, const CheckPoint& point)
      : scene_(scene), point_(point) {}

  const std::optional<Mismatch>& mismatch() const { return mismatch_; }
  void checkTorque(const Torque& torque) {
    const CheckPoint motion = motionOf(point_);
    const auto Q_at = [&](const StateView& x) {
      std::array<double, kMaxShafts> Q{};
      torque.addTorque(x, Q.data());
      return Q;
    };
    double rate[kMaxShafts] = {};
    torque.addTorqueRate(point_.view(), rate);
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      along(motion, rate[i], "dQ/dt of shaft " + inQuotes(scene_.shafts[at(i)]),
            kRounding * unitTorque(i), [&](const StateView& x) { return Q_at(x)[at(i)]; });
    }
    checkRateDerivatives(torque);
    checkShafts(torque, ofShafts("Q", Q_at(point_.view()).data()));
    checkDependence(torque.torqueDependence(), "torqueDependence",
                    [&](const StateView& x) { return ofShafts("Q", Q_at(x).data()); });
    checkDependence(torque.rateDependence(), "rateDependence", [&](const StateView& x) {
      double Q_rate[kMaxShafts] = {};
      torque.addTorqueRate(x, Q_rate);
      return ofShafts("dQ/dt", Q_rate);
    });
  }

  void checkConstraint(const Constraint& constraint) {
    const int order = constraint.order();
    if (order < 3) {
      checkPartials(constraint);
      checkForms(constraint);
    }
    checkJacobianRates(constraint);
    checkRowDerivatives(constraint);
    const auto row = [&](const StateView& x) { return rowOf(constraint, x); };
    checkDependence(constraint.dependence(), "dependence", [&](const StateView& x) {
      Quantities all = row(x);
      double unused[kMaxShafts];
      if (order == 1) {
        all.push_back({"f", constraint.calcResidual(x)});
        all.push_back({"f'", constraint.calcResidualAndJacobian(x, unused)});
      } else if (order == 2) {
        all.push_back({"psi", constraint.calcResidual(x)});
      }
      return all;
    });
    if (constraint.hasConstantJacobian()) checkConstantJacobian(row);
  }

 private:
  // Rounding in what is stated, relative to
  static constexpr double kRounding = 1e-10;     ///< what it was made of
  static constexpr double kCancellation = 1e-9;  ///< what it is elsewhere

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  /// `stated` against the derivative of `function` along `direction`.
  void along(const CheckPoint& direction, double stated, const std::string& name, double slack,
             const StateFunction& function) {
    // A direction as long as the speeds are is left in a step as much shorter.
    const double scale = 1.0 / std::max(1.0, largestEntry(direction));
    compare(direction, scale, stated, name, slack, function);
  }

  /// As above; `scale` is a step that matters.
  void compare(const CheckPoint& direction, double scale, double stated, const std::string& name,
               double slack, const StateFunction& function) {
    if (mismatch_) return;
    const auto of_step = [&](double h) { return function(moved(point_, direction, h).view()); };
    const std::optional<double> found = findDisagreement(of_step, stated, scale, slack);
    if (!found) return;
    const double gap = std::abs(*found - stated);
    if (gap <= kCancellation * naturalSize(direction, scale, function)) return;
    mismatch_ = wrongDerivative(name, stated, *found);
  }

  /// How large the derivative of `function` along `direction` is where it is large. Where a tanh
  /// saturates, 1 - tanh^2 is a few units of rounding: what is made of it is small against this,
  /// and means nothing. So it is looked for with all of the state, its place or its motion scaled
  /// from almost nothing to twice what it is.
  double naturalSize(const CheckPoint& direction, double scale,
                     const StateFunction& function) const {
    constexpr int kStates = 30;
    const double h = 1e-4 * scale;
    double largest = 0.0;
    for (int n = 0; n < 3 * kStates; ++n) {
      const int state = n / 3;
      const double factor = 2.0 * (state + 1) / kStates;
      const CheckPoint there = scaled(point_, n % 3 == 1 ? 1.0 : factor, n % 3 == 2 ? 1.0 : factor);
      const double difference = (function(moved(there, direction, h).view()) -
                                 function(moved(there, direction, -h).view())) /
                                (2.0 * h);
      if (std::isfinite(difference)) largest = std::max(largest, std::abs(difference));
    }
    return largest;
  }

  /// Two evaluations of the same thing.
  void same(double stated, double value, double scale, const std::string& name) {
    if (mismatch_ || !std::isfinite(stated) || !std::isfinite(value)) return;
    if (std::abs(stated - value) > 1e-7 * std::max({scale, std::abs(stated), std::abs(value)})) {
      mismatch_ = wrongDerivative(name, stated, value);
    }
  }

  void checkPartials(const Constraint& constraint) {
    const std::string d = constraint.order() == 1 ? "d f/d " : "d psi/d ";
    const auto residual = [&](const StateView& x) { return constraint.calcResidual(x); };
    ConstraintPartials partials;
    constraint.calcPartials(point_.view(), partials);
    CheckPoint direction;
    double largest = std::abs(partials.time);
    for (int i = 0; i < kMaxShafts; ++i) {
      largest = std::max({largest, std::abs(partials.angle[i]), std::abs(partials.velocity[i]),
                          std::abs(partials.acceleration[i])});
    }
    const auto one = [&](double& entry, double size, double stated, const std::string& name) {
      // a step in proportion to the variable
      entry = 1.0;
      compare(direction, std::max(1.0, std::abs(size)), stated, d + name, kRounding * largest,
              residual);
      entry = 0.0;
    };
    one(direction.time, point_.time, partials.time, "t");
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      const std::string n = std::to_string(i + 1);
      one(direction.angle[at(i)], point_.angle[at(i)], partials.angle[i], "phi" + n);
      one(direction.velocity[at(i)], point_.velocity[at(i)], partials.velocity[i], "w" + n);
      if (constraint.order() == 2) {
        one(direction.acceleration[at(i)], point_.acceleration[at(i)], partials.acceleration[i],
            "e" + n);
      }
    }
    double Cu[kMaxInputs] = {};
    constraint.calcInputJacobian(point_.view(), scene_.inputCount(), Cu);
    for (int i = 0; i < scene_.inputCount(); ++i) {
      const std::string topic = "the input " + inQuotes(scene_.inputs[at(i)].topic);
      const double size = point_.input[at(i)];
      one(direction.input[at(i)], size, partials.input[i], topic);
      one(direction.input[at(i)], size, Cu[i], topic + " (calcInputJacobian)");
    }
  }

  void checkForms(const Constraint& constraint) {
    const int s = scene_.shaftCount();
    const StateView x = point_.view();
    const CheckPoint motion = motionOf(point_);
    ConstraintPartials partials;
    constraint.calcPartials(x, partials);
    double C[kMaxShafts] = {};
    double row[kMaxShafts] = {};
    double c0 = 0.0;
    const double second = constraint.calcResidualAndJacobian(x, C);
    constraint.calcRow(x, row, &c0);
    const double* exact = constraint.order() == 1 ? partials.velocity : partials.acceleration;
    double largest = 0.0;
    for (int i = 0; i < s; ++i) largest = std::max(largest, std::abs(exact[i]));
    const double size = largest * std::max(1.0, largestEntry(motion));
    const auto sameC = [&](const double* stated, const char* form) {
      for (int i = 0; i < s; ++i) {
        same(stated[i], exact[i], largest, "C" + std::to_string(i + 1) + " of " + form);
      }
    };
    sameC(C, "calcResidualAndJacobian");
    sameC(row, "calcRow");
    if (constraint.order() == 1) {
      double C1[kMaxShafts] = {};
      const double f = constraint.calcVelocityResidualAndJacobian(x, C1);
      sameC(C1, "calcVelocityResidualAndJacobian");
      same(f, constraint.calcResidual(x), 1e-3 * size, "f of calcVelocityResidualAndJacobian");
      along(motion, second, "f'", kRounding * size,
            [&](const StateView& y) { return constraint.calcResidual(y); });
    } else {
      same(second, constraint.calcResidual(x), 1e-3 * size, "psi of calcResidualAndJacobian");
    }
    along(motion, c0, "c0", kRounding * size, [&](const StateView& y) {
      double unused[kMaxShafts];
      return constraint.calcResidualAndJacobian(y, unused);
    });
  }

  /// dC/depsilon and dC/dt. The defaults are differences themselves, good to some 1e-9.
  void checkJacobianRates(const Constraint& constraint) {
    const int s = scene_.shaftCount();
    const CheckPoint motion = motionOf(point_);
    double D[kMaxShafts] = {};
    double H[kMaxShafts * kMaxShafts] = {};
    double rate_hessian[kMaxShafts * kMaxShafts] = {};
    constraint.calcHessian(point_.view(), H);
    constraint.calcJacobianRate(point_.view(), D, rate_hessian);
    double C0[kMaxShafts] = {};
    double c0_here = 0.0;
    constraint.calcRow(point_.view(), C0, &c0_here);
    double largest = 0.0;
    for (int i = 0; i < s; ++i) largest = std::max(largest, std::abs(C0[i]));
    const double slack = 1e-6 * largest;
    const double motion_slack = slack * std::max(1.0, largestEntry(motion));
    for (int i = 0; i < s; ++i) {
      const std::string name = "d C" + std::to_string(i + 1) + "/d";
      const auto entry = [&](const StateView& x) {
        double C[kMaxShafts];
        double c0;
        constraint.calcRow(x, C, &c0);
        return C[i];
      };
      for (int j = 0; j < s; ++j) {
        CheckPoint direction;
        direction.acceleration[at(j)] = 1.0;
        const std::string by = name + " e" + std::to_string(j + 1);
        // What is called linear is a promise that the jumps rely on.
        along(direction, H[i * s + j],
              by + (constraint.isLinearInAcceleration() ? " (isLinearInAcceleration)" : ""), slack,
              entry);
        along(direction, rate_hessian[i * s + j], by + " (calcJacobianRate)", slack, entry);
      }
      along(motion, D[i], name + "t (calcJacobianRate)", motion_slack, entry);
    }
  }

  /// One value per shaft.
  Quantities ofShafts(const std::string& name, const double* values) const {
    Quantities all;
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      all.push_back({name + " of shaft " + inQuotes(scene_.shafts[at(i)]), values[i]});
    }
    return all;
  }
  /// C, then c0.
  Quantities rowOf(const Constraint& constraint, const StateView& x) const {
    double C[kMaxShafts] = {};
    double c0 = 0.0;
    constraint.calcRow(x, C, &c0);
    Quantities all;
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      all.push_back({"C" + std::to_string(i + 1), C[i]});
    }
    all.push_back({"c0", c0});
    return all;
  }

  /// Rounding that is small against it moves nothing.
  double unitTorque(int i) const { return calcFreeDiagonal(scene_.inertia, i); }

  /// dQ'/d(phi, omega, epsilon).
  void checkRateDerivatives(const Torque& torque) {
    const int s = scene_.shaftCount();
    double stated[3 * kMaxShafts * kMaxShafts] = {};
    torque.addTorqueRateDerivatives(point_.view(), stated);
    double Q[kMaxShafts] = {};
    torque.addTorque(point_.view(), Q);
    const double motion = std::max(1.0, largestEntry(motionOf(point_)));
    for (int i = 0; i < s; ++i) {
      std::array<double, 3 * kMaxShafts> by_state{};
      for (int q = 0; q < 3 * s; ++q) by_state[at(q)] = stated[q * s + i];
      checkByState(by_state, "d Q'/d ",
                   " of shaft " + inQuotes(scene_.shafts[at(i)]) + " (addTorqueRateDerivatives)",
                   std::max(std::abs(Q[i]), unitTorque(i)) * motion, [&](const StateView& x) {
                     double Q_rate[kMaxShafts] = {};
                     torque.addTorqueRate(x, Q_rate);
                     return Q_rate[i];
                   });
    }
  }

  /// d(C, c0)/d(phi, omega, epsilon).
  void checkRowDerivatives(const Constraint& constraint) {
    const int s = scene_.shaftCount();
    // What is left unwritten differs between the two.
    double dC[2][3 * kMaxShafts * kMaxShafts];
    double dc0[2][3 * kMaxShafts];
    for (int n = 0; n < 2; ++n) {
      std::fill_n(dC[n], 3 * s * s, static_cast<double>(n));
      std::fill_n(dc0[n], 3 * s, static_cast<double>(n));
      constraint.calcRowDerivatives(point_.view(), dC[n], dc0[n]);
    }
    double C_here[kMaxShafts] = {};
    double c0_here = 0.0;
    constraint.calcRow(point_.view(), C_here, &c0_here);
    double largest = 0.0;
    for (int i = 0; i < s; ++i) largest = std::max(largest, std::abs(C_here[i]));
    const double motion = std::max(1.0, largestEntry(motionOf(point_)));
    for (int i = 0; i <= s; ++i) {
      const double size = i < s ? largest : largest * motion * motion;
      const std::string name = i < s ? "C" + std::to_string(i + 1) : "c0";
      std::array<double, 3 * kMaxShafts> by_state{};
      for (int q = 0; q < 3 * s; ++q) {
        const double* first = i < s ? &dC[0][q * s + i] : &dc0[0][q];
        const double* second = i < s ? &dC[1][q * s + i] : &dc0[1][q];
        by_state[at(q)] = *first;
        if (!mismatch_ && isDifferent(*first, *second)) {
          mismatch_ = Mismatch{"d " + name + "/d " + nameOf(q) + " (calcRowDerivatives)",
                               "is not written", "that: all entries are to be"};
        }
      }
      checkByState(by_state, "d " + name + "/d ", " (calcRowDerivatives)", size,
                   [&](const StateView& x) {
                     double C[kMaxShafts] = {};
                     double c0 = 0.0;
                     constraint.calcRow(x, C, &c0);
                     return i < s ? C[i] : c0;
                   });
    }
  }

  /// `stated` derivatives of `function` in the 3s directions of the state; its terms are of about
  /// `size`, though they may cancel.
  void checkByState(const std::array<double, 3 * kMaxShafts>& stated, const std::string& before,
                    const std::string& after, double size, const StateFunction& function) {
    const int s = std::max(1, scene_.shaftCount());
    std::array<double, 3 * kMaxShafts> differences{};
    forEachShift(point_.view(), s,
                 [&](int q, const StateView& above, const StateView& below, double width) {
                   differences[at(q)] = (function(above) - function(below)) / width;
                 });
    double largest = std::max(size, std::abs(function(point_.view())));
    for (const double value : stated) largest = std::max(largest, std::abs(value));
    for (int q = 0; q < 3 * s; ++q) {
      // The default is no statement.
      if (!isDifferent(stated[at(q)], differences[at(q)])) continue;
      CheckPoint direction;
      auto& part = q < s       ? direction.angle
                   : q < 2 * s ? direction.velocity
                               : direction.acceleration;
      part[at(q % s)] = 1.0;
      std::string name = before;
      name += nameOf(q);
      name += after;
      along(direction, stated[at(q)], name, kRounding * largest, function);
    }
  }

  /// phi1, .., w1, .., e1, ..
  std::string nameOf(int q) const {
    const int s = std::max(1, scene_.shaftCount());
    return (q < s ? "phi" : q < 2 * s ? "w" : "e") + std::to_string(q % s + 1);
  }

  static bool isDifferent(double a, double b) {
    return !(a == b || (std::isnan(a) && std::isnan(b)));
  }

  /// Whether what is stated not to matter leaves `quantities` as they are, to the bit.
  void checkDependence(Dependence stated, const std::string& method,
                       const StateQuantities& quantities) {
    if (mismatch_ || (stated.time && stated.angle)) return;
    const Quantities here = quantities(point_.view());
    const auto compare = [&](const CheckPoint& other, const char* variable) {
      const Quantities there = quantities(other.view());
      for (std::size_t i = 0; i < here.size() && !mismatch_; ++i) {
        if (!isDifferent(here[i].value, there[i].value)) continue;
        mismatch_ = Mismatch{here[i].name,
                             std::string("is stated not to depend on the ") + variable + " (" +
                                 method + "), but it is " + describe(there[i].value) + " at {" +
                                 describe(scene_, other) + "} and " + describe(here[i].value),
                             "the statement"};
      }
    };
    // From the scale of tables over time to that of teeth; no whole turns.
    for (const double shift : {0.73, 3.7, 29.0, 410.0, 0.1, 1e-3}) {
      if (!stated.time) {
        CheckPoint later = point_;
        later.time += shift;
        compare(later, "time");
      }
      if (!stated.angle) {
        CheckPoint turned = point_;
        // Each by another amount: differences of angles change too.
        for (int i = 0; i < scene_.shaftCount(); ++i)
          turned.angle[at(i)] += shift * (1.0 + 0.37 * i);
        compare(turned, "angles");
      }
    }
  }

  void checkShafts(const Torque& torque, Quantities Q) {
    for (const int i : torque.shafts()) Q[at(i)].value = 0.0;
    for (const Quantity& other : Q) {
      if (other.value == 0.0 || mismatch_) continue;
      mismatch_ =
          Mismatch{other.name, "is stated to be 0 (shafts), but it is " + describe(other.value),
                   "the statement"};
    }
  }

  /// C, of the `row`, at this state and at others, near and far.
  void checkConstantJacobian(const StateQuantities& row) {
    const Quantities here = row(point_.view());
    double largest = 0.0;
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      largest = std::max(largest, std::abs(here[at(i)].value));
    }
    Random random;
    for (const double by : {0.3, 3.0, 30.0, 1e-3}) {
      const CheckPoint other = shaken(scene_, point_, by, random);
      const Quantities there = row(other.view());
      for (int i = 0; i < scene_.shaftCount() && !mismatch_; ++i) {
        const double a = here[at(i)].value;
        const double b = there[at(i)].value;
        // What rounds differently is constant all the same.
        if (!std::isfinite(a - b) || std::abs(a - b) <= 1e-12 * largest) continue;
        mismatch_ =
            Mismatch{here[at(i)].name,
                     "is stated to be constant (hasConstantJacobian), but it is " + describe(b) +
                         " at {" + describe(scene_, other) + "} and " + describe(a),
                     "the statement"};
      }
    }
  }

  const Scene& scene_;
  const CheckPoint& point_;
  std::optional<Mismatch> mismatch_;
};

template <class Component, class Check>
void verify(const Scene& scene, const Component& component, const char* kind, Check check) {
  constexpr int kPoints = 4;
  Random random;
  const CheckPoint start = startOf(scene);
  for (int n = 0; n < kPoints; ++n) {
    const CheckPoint point = n == 0 ? start : shaken(scene, start, 0.3, random);
    DerivativeComparison here(scene, point);
    check(here, component);
    if (!here.mismatch()) continue;
    const CheckPoint nearby = shaken(scene, point, 1e-3, random);
    DerivativeComparison there(scene, nearby);
    check(there, component);
    if (!there.mismatch()) continue;
    const Mismatch& wrong = *here.mismatch();
    throw SceneError(component.name(),
                     wrong.what + " of " + kind + " " + inQuotes(component.name()) + " " +
                         wrong.claim + ", at " + describe(scene, point) + "; correct " +
                         wrong.remedy + ", or load it unchecked with verify_derivatives: false" +
                         scene.extreme_numbers);
  }
}

}  // namespace

void verifyDerivatives(const Scene& scene, Compared compared) {
  for (const TorquePtr& torque : scene.torques) {
    if (compared == Compared::kStated && isDerived(*torque)) continue;
    verify(scene, *torque, "torque",
           [](DerivativeComparison& here, const Torque& t) { here.checkTorque(t); });
  }
  for (const ConstraintPtr& constraint : scene.constraints) {
    if (compared == Compared::kStated && isDerived(*constraint)) continue;
    verify(scene, *constraint, "constraint",
           [](DerivativeComparison& here, const Constraint& c) { here.checkConstraint(c); });
  }
}

}  // namespace variator_sim
