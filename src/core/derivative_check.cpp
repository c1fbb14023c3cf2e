#include "derivative_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "central_difference.h"
#include "symmetric_matrix.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// One state that owns its arrays.
struct Point {
  double time = 0.0;
  std::array<double, kMaxShafts> angle{};
  std::array<double, kMaxShafts> velocity{};
  std::array<double, kMaxShafts> acceleration{};
  std::array<double, kMaxInputs> input{};
  std::array<double, kMaxInputs> input_rate{};
  std::array<double, kMaxInputs> input_second_rate{};

  StateView view() const {
    return {time,         angle.data(),      velocity.data(),         acceleration.data(),
            input.data(), input_rate.data(), input_second_rate.data()};
  }
};

/// The point plus h times a direction.
Point moved(const Point& from, const Point& direction, double h) {
  Point to = from;
  to.time += h * direction.time;
  const auto add = [h](auto& values, const auto& rates) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += h * rates[i];
  };
  add(to.angle, direction.angle);
  add(to.velocity, direction.velocity);
  add(to.acceleration, direction.acceleration);
  add(to.input, direction.input);
  add(to.input_rate, direction.input_rate);
  return to;
}

/// Time and angles times one factor, velocities and accelerations times another.
Point scaled(const Point& point, double of_place, double of_motion) {
  Point to = point;
  to.time *= of_place;
  for (double& value : to.angle) value *= of_place;
  for (double& value : to.velocity) value *= of_motion;
  for (double& value : to.acceleration) value *= of_motion;
  return to;
}

/// d/dt along the motion with the accelerations held.
Point motionOf(const Point& point) {
  Point rate;
  rate.time = 1.0;
  rate.angle = point.velocity;
  rate.velocity = point.acceleration;
  rate.input = point.input_rate;
  rate.input_rate = point.input_second_rate;
  return rate;
}

double largestEntry(const Point& direction) {
  double largest = std::abs(direction.time);
  const auto see = [&largest](const auto& values) {
    for (const double value : values) largest = std::max(largest, std::abs(value));
  };
  see(direction.angle);
  see(direction.velocity);
  see(direction.acceleration);
  see(direction.input);
  see(direction.input_rate);
  return largest;
}

/// The derivative of `function` (of a step h) at 0 by differences of order 4, when it is not
/// `stated` beyond doubt; nothing otherwise. `scale` is a step that matters, `slack` what rounding
/// may have left in `stated`.
template <class Function>
std::optional<double> findDisagreement(Function function, double stated, double scale,
                                       double slack) {
  const double here = function(0.0);
  if (!std::isfinite(stated) || !std::isfinite(here)) return std::nullopt;
  constexpr int kSteps = 12;
  constexpr double kTolerance = 1e-5;
  struct Difference {
    double central;
    double margin;  // of rounding in the values
    double kink;    // right-hand less left-hand derivative
    double kink_margin;
  };
  std::vector<Difference> differences;
  double h = 0.02 * scale;
  for (int n = 0; n < kSteps; ++n, h *= 0.25) {
    const std::array<double, 4> f{function(-2.0 * h), function(-h), function(h), function(2.0 * h)};
    // Numbers below the least normal one are rounded as it is.
    double largest = std::max(std::abs(here), std::numeric_limits<double>::min());
    for (const double value : f) largest = std::max(largest, std::abs(value));
    if (!std::isfinite(largest)) continue;
    Difference d{};
    d.central = (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * h);
    d.margin = 8.0 * kEpsilon * largest / h;
    // one-sided differences of order 2
    const double right = (-3.0 * here + 4.0 * f[2] - f[3]) / (2.0 * h);
    const double left = (3.0 * here - 4.0 * f[1] + f[0]) / (2.0 * h);
    d.kink = right - left;
    d.kink_margin = d.margin;
    const double size = std::max(std::abs(stated), std::abs(d.central));
    if (std::abs(d.central - stated) <= kTolerance * size + slack) return std::nullopt;
    differences.push_back(d);
  }
  // The two consecutive steps that agree best.
  double best = std::numeric_limits<double>::infinity();
  std::size_t at = 0;
  for (std::size_t n = 0; n + 1 < differences.size(); ++n) {
    const double doubt = std::abs(differences[n].central - differences[n + 1].central) +
                         differences[n].margin + differences[n + 1].margin;
    if (doubt < best) {
      best = doubt;
      at = n + 1;
    }
  }
  if (!std::isfinite(best)) return std::nullopt;
  const double value = differences[at].central;
  const double gap = std::abs(value - stated);
  const double size = std::max(std::abs(stated), std::abs(value));
  if (gap <= kTolerance * size + slack + 100.0 * best) return std::nullopt;
  // Differences across something much narrower than the steps do not settle.
  if (best > 1e-3 * std::abs(value) && best > 1e-9 * std::abs(stated)) return std::nullopt;
  // A kink here or within reach of every step: the sides do not tend to each other.
  double sides = std::numeric_limits<double>::infinity();
  for (const Difference& d : differences) {
    sides = std::min(sides, std::abs(d.kink) + d.kink_margin);
  }
  if (sides > 0.1 * gap) return std::nullopt;
  return value;
}

/// Uniform in [-1, 1], the same numbers on every run and machine.
class Random {
 public:
  double operator()() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 11U) * 0x1p-52 - 1.0;
  }

 private:
  std::uint64_t state_ = 20240229;
};

double shaken(double value, double by, Random& random) {
  return value + by * std::max(1.0, std::abs(value)) * random();
}

/// `point` with every part moved by up to `by`, relative to its size and at least 1.
Point shaken(const Scene& scene, const Point& point, double by, Random& random) {
  Point p = point;
  p.time = std::abs(shaken(p.time, by, random));
  for (std::size_t i = 0; i < scene.shafts.size(); ++i) {
    p.angle[i] = shaken(p.angle[i], by, random);
    p.velocity[i] = shaken(p.velocity[i], by, random);
    p.acceleration[i] = shaken(p.acceleration[i], by, random);
  }
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) {
    const CommandInputSettings& settings = scene.inputs[i];
    p.input[i] = std::clamp(shaken(p.input[i], by, random), settings.minimum, settings.maximum);
    p.input_rate[i] = shaken(p.input_rate[i], by, random);
    if (settings.hold == Hold::kSecondOrderLag) {
      p.input_second_rate[i] = shaken(p.input_second_rate[i], by, random);
    }
  }
  return p;
}

Point startOf(const Scene& scene) {
  Point p;
  std::copy(scene.initial.angle.begin(), scene.initial.angle.end(), p.angle.begin());
  std::copy(scene.initial.velocity.begin(), scene.initial.velocity.end(), p.velocity.begin());
  std::copy(scene.initial.acceleration.begin(), scene.initial.acceleration.end(),
            p.acceleration.begin());
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) p.input[i] = scene.inputs[i].initial;
  return p;
}

std::string number(double value) {
  return ParameterTree::real(value).toText();
}

std::string describe(const Scene& scene, const Point& p) {
  const auto list = [](const auto& values, int count) {
    std::string text = "[";
    for (int i = 0; i < count; ++i) {
      text += (i == 0 ? "" : ", ") + number(values[static_cast<std::size_t>(i)]);
    }
    return text + "]";
  };
  const int s = scene.shaftCount();
  std::string text = "t = " + number(p.time) + ", angle = " + list(p.angle, s) +
                     ", velocity = " + list(p.velocity, s) +
                     ", acceleration = " + list(p.acceleration, s);
  if (scene.inputCount() > 0) {
    text += ", input = " + list(p.input, scene.inputCount()) +
            ", input rate = " + list(p.input_rate, scene.inputCount());
  }
  return text;
}

/// What does not fit.
struct Mismatch {
  std::string what;
  std::string claim;   ///< what is stated of it, and what its values say
  std::string remedy;  ///< what to correct
};

Mismatch wrongDerivative(const std::string& derivative, double stated, double found) {
  return {derivative, "is stated as " + number(stated) + ", but its values say " + number(found),
          "the derivative"};
}

/// Something that a state decides.
struct Quantity {
  std::string name;
  double value;
};
using Quantities = std::vector<Quantity>;

/// Every comparison of one component at one point; the first mismatch.
class Comparison {
 public:
  Comparison(const Scene& scene, const Point& point) : scene_(scene), point_(point) {}

  const std::optional<Mismatch>& mismatch() const { return mismatch_; }

  void checkTorque(const Torque& torque) {
    const Point motion = motionOf(point_);
    double rate[kMaxShafts] = {};
    torque.addTorqueRate(point_.view(), rate);
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      along(motion, rate[i], "dQ/dt of shaft '" + scene_.shafts[at(i)] + "'",
            kRounding * unitTorque(i), [&](const StateView& x) {
              double Q[kMaxShafts] = {};
              torque.addTorque(x, Q);
              return Q[i];
            });
    }
    checkRateDerivatives(torque);
    checkDependence(torque.torqueDependence(), "torqueDependence", [&](const StateView& x) {
      double Q[kMaxShafts] = {};
      torque.addTorque(x, Q);
      return ofShafts("Q", Q);
    });
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
  /// Rounding in what is stated, relative to what it was made of.
  static constexpr double kRounding = 1e-10;
  /// The same, relative to what it is elsewhere.
  static constexpr double kCancellation = 1e-9;

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  /// `stated` against the derivative of `function` along `direction`.
  template <class Function>
  void along(const Point& direction, double stated, const std::string& name, double slack,
             Function function) {
    // A direction as long as the speeds are is left in a step as much shorter.
    const double scale = 1.0 / std::max(1.0, largestEntry(direction));
    compare(direction, scale, stated, name, slack, function);
  }

  /// As above; `scale` is a step that matters.
  template <class Function>
  void compare(const Point& direction, double scale, double stated, const std::string& name,
               double slack, Function function) {
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
  template <class Function>
  double naturalSize(const Point& direction, double scale, Function function) const {
    constexpr int kStates = 30;
    const double h = 1e-4 * scale;
    double largest = 0.0;
    for (int n = 0; n < 3 * kStates; ++n) {
      const int state = n / 3;
      const double factor = 2.0 * (state + 1) / kStates;
      const Point there = scaled(point_, n % 3 == 1 ? 1.0 : factor, n % 3 == 2 ? 1.0 : factor);
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
    Point direction;
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
      const std::string topic = "the input '" + scene_.inputs[at(i)].topic + "'";
      const double size = point_.input[at(i)];
      one(direction.input[at(i)], size, partials.input[i], topic);
      one(direction.input[at(i)], size, Cu[i], topic + " (calcInputJacobian)");
    }
  }

  void checkForms(const Constraint& constraint) {
    const int s = scene_.shaftCount();
    const StateView x = point_.view();
    const Point motion = motionOf(point_);
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
    const Point motion = motionOf(point_);
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
        Point direction;
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
      all.push_back({name + " of shaft '" + scene_.shafts[at(i)] + "'", values[i]});
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
                   " of shaft '" + scene_.shafts[at(i)] + "' (addTorqueRateDerivatives)",
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
  template <class Function>
  void checkByState(const std::array<double, 3 * kMaxShafts>& stated, const std::string& before,
                    const std::string& after, double size, Function function) {
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
      Point direction;
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
  template <class Function>
  void checkDependence(Dependence stated, const std::string& method, Function quantities) {
    if (mismatch_ || (stated.time && stated.angle)) return;
    const Quantities here = quantities(point_.view());
    const auto compare = [&](const Point& other, const char* variable) {
      const Quantities there = quantities(other.view());
      for (std::size_t i = 0; i < here.size() && !mismatch_; ++i) {
        if (!isDifferent(here[i].value, there[i].value)) continue;
        mismatch_ = Mismatch{here[i].name,
                             std::string("is stated not to depend on the ") + variable + " (" +
                                 method + "), but it is " + number(there[i].value) + " at {" +
                                 describe(scene_, other) + "} and " + number(here[i].value),
                             "the statement"};
      }
    };
    // From the scale of tables over time to that of teeth; no whole turns.
    for (const double shift : {0.73, 3.7, 29.0, 410.0, 0.1, 1e-3}) {
      if (!stated.time) {
        Point later = point_;
        later.time += shift;
        compare(later, "time");
      }
      if (!stated.angle) {
        Point turned = point_;
        // Each by another amount: differences of angles change too.
        for (int i = 0; i < scene_.shaftCount(); ++i)
          turned.angle[at(i)] += shift * (1.0 + 0.37 * i);
        compare(turned, "angles");
      }
    }
  }

  /// C, of the `row`, at this state and at others, near and far.
  template <class Function>
  void checkConstantJacobian(Function row) {
    const Quantities here = row(point_.view());
    double largest = 0.0;
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      largest = std::max(largest, std::abs(here[at(i)].value));
    }
    Random random;
    for (const double by : {0.3, 3.0, 30.0, 1e-3}) {
      const Point other = shaken(scene_, point_, by, random);
      const Quantities there = row(other.view());
      for (int i = 0; i < scene_.shaftCount() && !mismatch_; ++i) {
        const double a = here[at(i)].value;
        const double b = there[at(i)].value;
        // What rounds differently is constant all the same.
        if (!std::isfinite(a - b) || std::abs(a - b) <= 1e-12 * largest) continue;
        mismatch_ =
            Mismatch{here[at(i)].name,
                     "is stated to be constant (hasConstantJacobian), but it is " + number(b) +
                         " at {" + describe(scene_, other) + "} and " + number(a),
                     "the statement"};
      }
    }
  }

  const Scene& scene_;
  const Point& point_;
  std::optional<Mismatch> mismatch_;
};

template <class Component, class Check>
void verify(const Scene& scene, const Component& component, const char* kind, Check check) {
  constexpr int kPoints = 4;
  Random random;
  const Point start = startOf(scene);
  for (int n = 0; n < kPoints; ++n) {
    const Point point = n == 0 ? start : shaken(scene, start, 0.3, random);
    Comparison here(scene, point);
    check(here, component);
    if (!here.mismatch()) continue;
    const Point nearby = shaken(scene, point, 1e-3, random);
    Comparison there(scene, nearby);
    check(there, component);
    if (!there.mismatch()) continue;
    const Mismatch& mismatch = *here.mismatch();
    throw SceneError(component.name(), mismatch.what + " of " + kind + " '" + component.name() +
                                           "' " + mismatch.claim + ", at " +
                                           describe(scene, point) + "; correct " + mismatch.remedy +
                                           ", or load it unchecked with verify_derivatives: false");
  }
}

}  // namespace

void verifyDerivatives(const Scene& scene) {
  for (const TorquePtr& torque : scene.torques) {
    verify(scene, *torque, "torque",
           [](Comparison& comparison, const Torque& t) { comparison.checkTorque(t); });
  }
  for (const ConstraintPtr& constraint : scene.constraints) {
    verify(scene, *constraint, "constraint",
           [](Comparison& comparison, const Constraint& c) { comparison.checkConstraint(c); });
  }
}

}  // namespace variator_sim
