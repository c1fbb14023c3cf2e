/// The machines of config/applications, written by hand: as few states as the physics allows,
/// inputs in closed form, tables as polynomials, stops at commands and at known switches. It is
/// what a user would type into a program of his own for one machine.
///
/// A machine has
///     kStates, kShafts
///     stops         times at which something is switched; `enter(t)` is called at each
///     rates         x' = f(t, x) between two stops, over double, long double or dual numbers
///     speeds        omega of all shafts from x
/// It starts from the angles, speeds and accelerations of `Start`.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "dual.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/simulation.h"
#include "variator_sim/table.h"

namespace variator_sim::benchmark {

constexpr double kGravity = 9.80665;  // m/s^2, standard

template <class T, int N>
double valueOf(const Dual<T, N>& x) {
  return static_cast<double>(x.value);
}
template <class T>
double valueOf(const T& x) {
  return static_cast<double>(x);
}

/// S(x) = 10 x^3 - 15 x^4 + 6 x^5 between 0 and 1, and its derivative.
template <class R>
R smoothStep(const R& x) {
  if (valueOf(x) <= 0.0) return R(0.0);
  if (valueOf(x) >= 1.0) return R(1.0);
  return x * x * x * (x * (x * 6.0 - 15.0) + 10.0);
}
template <class R>
R smoothStepSlope(const R& x) {
  if (valueOf(x) <= 0.0 || valueOf(x) >= 1.0) return R(0.0);
  return x * x * (x * (x * 30.0 - 60.0) + 30.0);
}

/// Returns how many of the points are not above x.
inline std::size_t cellOf(const std::vector<double>& points, double x) {
  std::size_t cell = 0;
  while (cell < points.size() && x >= points[cell]) ++cell;
  return cell;
}

/// A table of one variable as polynomials in x - x_k.
class Curve {
 public:
  Curve(std::vector<double> x, const std::vector<double>& y,
        Table::Beyond beyond = Table::Beyond::kConstant)
      : x_(std::move(x)) {
    const Table table = Table::through(x_, y, beyond);
    cells_.push_back({y.front(), table.slope(x_.front())});
    for (const double knot : x_) {
      double factorial = 1.0;
      std::array<double, 6> cell{};
      for (int m = 0; m < 6; factorial *= ++m) {
        cell[static_cast<std::size_t>(m)] = table.derivative(m, knot) / factorial;
      }
      cells_.push_back(cell);
    }
  }
  template <class R>
  R operator()(const R& x) const {
    const std::size_t cell = cellOf(x_, valueOf(x));
    const auto& c = cells_[cell];
    const R t = x - x_[cell > 0 ? cell - 1 : 0];
    return ((((t * c[5] + c[4]) * t + c[3]) * t + c[2]) * t + c[1]) * t + c[0];
  }

 private:
  std::vector<double> x_;
  std::vector<std::array<double, 6>> cells_;  ///< one before the first knot, one behind each
};

/// The command behind a first-order lag, u' = (u_c - u)/tau.
class Lag {
 public:
  Lag(double tau, double initial) : tau_(tau), target_(initial), start_(initial) {}
  void command(double t, double value) {
    start_ = (*this)(t);
    target_ = value;
    begin_ = t;
  }
  template <class R>
  R operator()(const R& t) const {
    using std::exp;
    return (start_ - target_) * exp((begin_ - t) / tau_) + target_;
  }
  template <class R>
  R rate(const R& t) const {
    using std::exp;
    return (target_ - start_) / tau_ * exp((begin_ - t) / tau_);
  }

 private:
  double tau_;
  double target_;
  double start_;
  double begin_ = 0.0;
};

/// The command as it is.
struct Held {
  double value = 0.0;
  void command(double /*t*/, double commanded) { value = commanded; }
};

/// The command behind a second-order lag, (tau d/dt + 1)^2 u = u_c.
class SecondLag {
 public:
  SecondLag(double tau, double initial) : tau_(tau), target_(initial) {}
  void command(double t, double value) {
    const double u = (*this)(t);
    const double du = rate(t);
    target_ = value;
    begin_ = t;
    a_ = u - value;
    b_ = a_ + tau_ * du;
  }
  template <class R>
  R operator()(const R& t) const {
    using std::exp;
    const R x = (t - begin_) / tau_;
    return (x * b_ + a_) * exp(-x) + target_;
  }
  template <class R>
  R rate(const R& t) const {
    using std::exp;
    const R x = (t - begin_) / tau_;
    return (b_ - a_ - x * b_) * exp(-x) / tau_;
  }

 private:
  double tau_;
  double target_;
  double a_ = 0.0;
  double b_ = 0.0;
  double begin_ = 0.0;
};

/// A table of two variables as polynomials in x - x_k and y - y_l.
class Surface {
 public:
  explicit Surface(const Table& table) : x_(table.points(0)), y_(table.points(1)) {
    for (std::size_t k = 0; k <= x_.size(); ++k) {
      for (std::size_t l = 0; l <= y_.size(); ++l) cells_.push_back(makeCell(table, k, l));
    }
  }
  template <class R>
  R operator()(const R& x, const R& y) const {
    const std::size_t k = cellOf(x_, valueOf(x));
    const std::size_t l = cellOf(y_, valueOf(y));
    const Cell& c = cells_[k * (y_.size() + 1) + l];
    const R u = x - x_[k > 0 ? k - 1 : 0];
    const R v = y - y_[l > 0 ? l - 1 : 0];
    R sum(0.0);
    for (std::size_t m = 6; m-- > 0;) {
      sum = sum * u +
            (((((v * c[m][5] + c[m][4]) * v + c[m][3]) * v + c[m][2]) * v + c[m][1]) * v + c[m][0]);
    }
    return sum;
  }

 private:
  using Cell = std::array<std::array<double, 6>, 6>;
  static Cell makeCell(const Table& table, std::size_t k, std::size_t l) {
    // Before the first point: derivatives of order 0 and 1 at it, which are continuous.
    const int orders_x = k == 0 ? 2 : 6;
    const int orders_y = l == 0 ? 2 : 6;
    Cell cell{};
    double factorial_m = 1.0;
    for (int m = 0; m < orders_x; factorial_m *= ++m) {
      double factorial_n = 1.0;
      for (int n = 0; n < orders_y; factorial_n *= ++n) {
        const double value = table.derivative({m, n}, table.points(0)[k > 0 ? k - 1 : 0],
                                              table.points(1)[l > 0 ? l - 1 : 0]);
        cell[static_cast<std::size_t>(m)][static_cast<std::size_t>(n)] =
            value / (factorial_m * factorial_n);
      }
    }
    return cell;
  }
  std::vector<double> x_;
  std::vector<double> y_;
  std::vector<Cell> cells_;  ///< row by row
};

/// The start of a machine.
struct Start {
  ParameterTree scene;                 ///< for the table of two variables
  Sample sample;                       ///< at time 0
  std::vector<TimedCommand> commands;  ///< in the order of time
};

/// The base of all machines: commands that are due, and the times of stops.
class Commanded {
 public:
  Commanded(const Start& start, const std::vector<double>& switches)
      : start_(start.sample), commands_(start.commands), stops_(switches) {
    for (const TimedCommand& command : commands_) stops_.push_back(command.time);
    std::sort(stops_.begin(), stops_.end());
    stops_.erase(std::unique(stops_.begin(), stops_.end()), stops_.end());
  }
  const std::vector<double>& stops() const { return stops_; }

 protected:
  /// Carries out the commands of the time t on one topic, or on whichever.
  template <class Input>
  void carryOut(double t, Input& input, const char* topic = nullptr) const {
    for (const TimedCommand& it : commands_) {
      if (it.time == t && (topic == nullptr || it.topic == topic)) input.command(t, it.value);
    }
  }
  Sample start_;

 private:
  std::vector<TimedCommand> commands_;
  std::vector<double> stops_;
};

/// Q = r T - F,  r = 1 - (1 - u) S((w - w_i + b)/(2 b)),  F = F_0 tanh(w) + F_1 w
struct Diesel {
  Curve full_load;
  double F_0, F_1, w_i, b;
  template <class R>
  R torque(const R& u, const R& w) const {
    using std::tanh;
    const R r = 1.0 - (1.0 - u) * smoothStep((w - (w_i - b)) / (2.0 * b));
    return r * full_load(w) - (F_0 * tanh(w) + F_1 * w);
  }
};

/// x = (w1, w2, phi3): engine, gearbox, wheels; J1 e1 = Q1, and by w3 = i w2 and R2 = -i R3
///     (J2 + i^2 J3) e2 = Q2 + i (Q3 - J3 i' w2).
class Car : public Commanded {
 public:
  static constexpr int kStates = 3;
  static constexpr int kShafts = 3;
  explicit Car(const Start& start) : Commanded(start, {}), engine_(readMap(start.scene)) {}
  void enter(double t) {
    carryOut(t, throttle_, "throttle");
    carryOut(t, clutch_, "clutch");
    carryOut(t, pedal_, "brake");
    carryOut(t, ratio_, "ratio");
  }
  void initial(double* x) const {
    x[0] = start_.velocity[0];
    x[1] = start_.velocity[1];
    x[2] = start_.angle[2];
  }
  template <class R>
  void rates(const R& t, const R* x, R* dxdt) const {
    using std::sqrt;
    using std::tanh;
    const R i = ratio_(t);
    const R w3 = i * x[1];
    const R slip = clutch_(t) * tanh((x[0] - x[1]) / 2.0);
    const R g = hill_(x[2] * 0.3);
    const R weight = 1200.0 * kGravity / sqrt(1.0 + g * g);
    const R v = 0.3 * w3;
    const R road = (0.012 * weight + (0.5 * 0.65 * 1.2) * (v * v)) * tanh(v / 0.1) + weight * g;
    const R Q3 = -2600.0 * pedal_(t) * tanh(w3 / 0.2) - 0.3 * road;
    dxdt[0] = (engine_(x[0], throttle_(t)) - slip) / 0.18;
    dxdt[1] = (slip + i * (Q3 - 112.0 * (ratio_.rate(t) * x[1]))) / (0.03 + 112.0 * (i * i));
    dxdt[2] = w3;
  }
  void speeds(double t, const double* x, double* w) const {
    w[0] = x[0];
    w[1] = x[1];
    w[2] = ratio_(t) * x[1];
  }

 private:
  static Table readMap(const ParameterTree& scene) {
    ParameterReader root(scene, "");
    ParameterReader reader = root.section("engine_map");
    return Table::read(reader, {{"x"}, {"y"}, {"values"}}, Table::Beyond::kLinear);
  }
  Surface engine_;
  Curve hill_{{-100, 650, 720, 870, 940}, {0, 0, 0.08, 0.08, 0}};
  Lag throttle_{0.15, 0.0};
  Lag pedal_{0.15, 0.0};
  Lag clutch_{0.4, 0.0};
  SecondLag ratio_{0.4, 0.07};
};

/// x = (w1, w2). With i = w2/w1 the regulator is e2 = i e1 + r w1, and by R1 = -i R2
///     (J1 + i^2 J2) e1 = Q1 + i (Q2 - J2 r w1).
class Locomotive : public Commanded {
 public:
  static constexpr int kStates = 2;
  static constexpr int kShafts = 2;
  explicit Locomotive(const Start& start) : Commanded(start, {36.0, 42.0}) {}
  void enter(double t) { carryOut(t, rack_); }
  void initial(double* x) const {
    x[0] = start_.velocity[0];
    x[1] = start_.velocity[1];
  }
  template <class R>
  void rates(const R& t, const R* x, R* dxdt) const {
    using std::sqrt;
    using std::tanh;
    constexpr double J2 = 1.1466e+5;
    const R g = grade_(t);
    const R v = 0.525 * x[1];
    const R force = (6000.0 + 18.0 * (v * v)) * tanh(v / 0.1) + 120.0 * v +
                    400e3 * kGravity * g / sqrt(1.0 + g * g);
    const R i = x[1] / x[0];
    const R rise = 0.0065 * tanh((x[0] - 74.0) / 2.5) * x[0];
    dxdt[0] =
        (diesel_.torque(rack_(t), x[0]) - i * (0.525 * force + J2 * rise)) / (250.0 + J2 * (i * i));
    dxdt[1] = i * dxdt[0] + rise;
  }
  void speeds(double /*t*/, const double* x, double* w) const { std::copy(x, x + 2, w); }

 private:
  Diesel diesel_{
      {{0, 25, 45, 60, 78.5, 88}, {0, 7000, 11800, 12800, 12500, 0}}, 500.0, 10.0, 31.4, 5.0};
  Curve grade_{{0, 36, 42, 60}, {0, 0, 0.004, 0.004}};
  Lag rack_{0.5, 0.1};
};

/// x = w1; w2 = i(t) w1, (J1 + i^2 J2) e1 = Q1 + i (Q2 - J2 i' w1).
class MachineTool : public Commanded {
 public:
  static constexpr int kStates = 1;
  static constexpr int kShafts = 2;
  explicit MachineTool(const Start& start)
      : Commanded(start, {6.0, 15.0, 15.4, 42.0, 42.4, 55.0}) {}
  void enter(double t) {
    const double present = voltage_ + slope_ * (t - begin_);
    carryOut(t, target_);
    slope_ = std::abs(target_.value - present) < 1e-9
                 ? 0.0
                 : std::copysign(80.0, target_.value - present);
    voltage_ = slope_ == 0.0 ? target_.value : present;
    begin_ = t;
  }
  void initial(double* x) const { x[0] = start_.velocity[0]; }
  template <class R>
  void rates(const R& t, const R* x, R* dxdt) const {
    using std::tanh;
    const R p = (t - 15.0) / 27.0;
    const R i = 0.205 / (1.0 - 0.25 * smoothStep(p));
    const R di = i * i * (0.25 / 27.0 / 0.205) * smoothStepSlope(p);
    const R w2 = i * x[0];
    const R engaged = smoothStep((t - 15.0) / 0.4) - smoothStep((t - 42.0) / 0.4);
    const R Q1 = (2.4 / 0.8) * (voltage_ + slope_ * (t - begin_) - 2.4 * x[0]);
    const R Q2 = -193.0 * engaged * tanh(w2 / 0.5) - (3.0 * tanh(w2 / 0.2) + 0.15 * w2);
    dxdt[0] = (Q1 + i * (Q2 - 1.5 * (di * x[0]))) / (0.25 + 1.5 * (i * i));
  }
  void speeds(double t, const double* x, double* w) const {
    w[0] = x[0];
    w[1] = x[0] * 0.205 / (1.0 - 0.25 * smoothStep((t - 15.0) / 27.0));
  }

 private:
  double voltage_ = 0.0;
  double slope_ = 0.0;
  Held target_;
  double begin_ = 0.0;
};

/// x = (phi1 - phi2, w1, w2, w3, e2, e3); R1 = 0, so J1 e1 = Q1, and with C = d psi/d epsilon
///     J eta = Q' + C^T L,   C eta + c0 = 0.
class ShipUnit : public Commanded {
 public:
  static constexpr int kStates = 6;
  static constexpr int kShafts = 3;
  explicit ShipUnit(const Start& start) : Commanded(start, {}) {}
  void enter(double t) { carryOut(t, rack_); }
  void initial(double* x) const {
    x[0] = start_.angle[0] - start_.angle[1];
    std::copy(start_.velocity, start_.velocity + 3, x + 1);
    x[4] = start_.acceleration[1];
    x[5] = start_.acceleration[2];
  }
  template <class R>
  void rates(const R& t, const R* x, R* dxdt) const {
    using std::cos;
    using std::sin;
    using std::sqrt;
    constexpr double kTurn = 2.0 * 3.14159265358979323846;
    constexpr double k = 1025.0 * 0.045 * (2.4 * 2.4 * 2.4 * 2.4 * 2.4 / (kTurn * kTurn));
    constexpr double m = 1025.0 * 0.03 * 4.0 * (2.4 * 2.4 * 2.4 * 2.4 / kTurn);
    constexpr double tau = 0.5;
    constexpr double b = 0.02;
    constexpr double i = 0.22;
    constexpr double c = 0.0012;
    const R& w = x[3];
    const R& e2 = x[4];
    const R& e3 = x[5];
    const R e1 = (diesel_.torque(rack_(t), x[1]) - 1e5 * x[0] - 400.0 * (x[1] - x[2])) / 60.0;
    const R dQ2 = 1e5 * (x[1] - x[2]) + 400.0 * (e1 - e2);
    // Q3 = -(k w - m) a(w) - 4.5 w^2 sin(0.8 t),  a = w^2/sqrt(w^2 + w0^2)
    const R inverse = 1.0 / (w * w + 0.25);
    const R a = w * w * sqrt(inverse);
    const R da = w * sqrt(inverse) * (1.0 + 0.25 * inverse);
    const R dQ3 = -(k * a + (k * w - m) * da) * e3 - 9.0 * w * e3 * sin(0.8 * t) -
                  3.6 * (w * w) * cos(0.8 * t);
    const R slip = e3 - i * e2;
    const R g = 1.0 + b * (e2 * e2 + e3 * e3);
    const R C2 = tau * (2.0 * b * (slip * e2) - i * g);
    const R C3 = tau * (2.0 * b * (slip * e3) + g);
    const R c0 = slip + 2.0 * c * (w * e3);
    const R L = -(c0 + C2 * dQ2 / 10.0 + C3 * dQ3 / 400.0) / (C2 * C2 / 10.0 + C3 * C3 / 400.0);
    dxdt[0] = x[1] - x[2];
    dxdt[1] = e1;
    dxdt[2] = e2;
    dxdt[3] = e3;
    dxdt[4] = (dQ2 + C2 * L) / 10.0;
    dxdt[5] = (dQ3 + C3 * L) / 400.0;
  }
  void speeds(double /*t*/, const double* x, double* w) const { std::copy(x + 1, x + 4, w); }

 private:
  Diesel diesel_{
      {{0, 30, 60, 80, 105, 115}, {0, 5000, 9500, 11500, 11200, 0}}, 500.0, 5.0, 42.0, 8.0};
  Lag rack_{0.8, 0.25};
};

/// x = (phi2, w2): the motor's motion is the integral of four pulses of jerk; R2 = 0, J2 e2 = Q2.
class StartingSystem : public Commanded {
 public:
  static constexpr int kStates = 2;
  static constexpr int kShafts = 2;
  explicit StartingSystem(const Start& start)
      : Commanded(start, {2.0, 6.0, 16.0, 20.0, 40.0, 44.0, 54.0, 58.0}) {}
  void enter(double t) { carryOut(t, damper_, "damper_torque"); }
  void initial(double* x) const { x[0] = x[1] = 0.0; }
  template <class R>
  void rates(const R& t, const R* x, R* dxdt) const {
    using std::tanh;
    R phi1(0.0);
    R w1(0.0);
    addPulses(t, &phi1, &w1);
    const R& w = x[1];
    const R air = valueOf(w) < 0.0 ? R(-0.017 * (w * w)) : R(0.017 * (w * w));
    dxdt[0] = w;
    dxdt[1] = (5e4 * (phi1 - x[0]) + 100.0 * (w1 - w) - air - (6.0 * tanh(w / 0.2) + 0.02 * w) -
               damper_(t)) /
              60.0;
  }
  void speeds(double t, const double* x, double* w) const {
    double phi1 = 0.0;
    w[0] = 0.0;
    addPulses(t, &phi1, w);
    w[1] = x[1];
  }

 private:
  /// The integrals of sin(pi x)^2, x = (t - t_0)/T, which is 0 before x = 0 and behind x = 1:
  ///     w/T^2 = x^2/4 + (cos(2 pi x) - 1)/(8 pi^2),
  ///     phi/T^3 = x^3/12 + (sin(2 pi x)/(2 pi) - x)/(8 pi^2); behind it a parabola.
  template <class R>
  static void addPulses(const R& t, R* phi, R* w) {
    using std::cos;
    using std::sin;
    constexpr double kTurn = 2.0 * 3.14159265358979323846;
    constexpr double q = 0.5 / (kTurn * kTurn);  // 1/(8 pi^2)
    constexpr double T = 4.0;
    constexpr double kJerk = 5.535714285714286;
    constexpr double kTimes[] = {2.0, 16.0, 40.0, 54.0};
    constexpr double kSigns[] = {1.0, -1.0, -1.0, 1.0};
    for (int pulse = 0; pulse < 4; ++pulse) {
      const R x = (t - kTimes[pulse]) / T;
      if (valueOf(x) <= 0.0) continue;
      const double size = kJerk * kSigns[pulse];
      if (valueOf(x) < 1.0) {
        *w += (size * T * T) * (0.25 * (x * x) + q * (cos(kTurn * x) - 1.0));
        *phi += (size * T * T * T) * (x * x * x / 12.0 + q * (sin(kTurn * x) / kTurn - x));
      } else {
        const R y = x - 1.0;
        *w += (size * T * T) * (0.25 + 0.5 * y);
        *phi += (size * T * T * T) * (1.0 / 12.0 - q + 0.25 * y + 0.25 * (y * y));
      }
    }
  }
  Lag damper_{0.8, 0.0};
};

/// x = w1; w2 = i(w1) w1, g = dw2/dw1: (J1 + g^2 J2) e1 = Q1 + g Q2.
class VBelt : public Commanded {
 public:
  static constexpr int kStates = 1;
  static constexpr int kShafts = 2;
  explicit VBelt(const Start& start) : Commanded(start, {40.0, 43.0}) {}
  void enter(double t) { carryOut(t, throttle_); }
  void initial(double* x) const { x[0] = start_.velocity[0]; }
  template <class R>
  void rates(const R& t, const R* x, R* dxdt) const {
    using std::sqrt;
    using std::tanh;
    const R& w = x[0];
    const R part = 1.0 / (220.0 * 220.0 + w * w);
    const R w2 = w * (0.5 + 0.5 * (w * w * part));
    const R g = 0.5 + 0.5 * (w * w * part) + 220.0 * 220.0 * (w * w) * (part * part);
    const R grade = grade_(t);
    const R weight = 760.0 * kGravity / sqrt(1.0 + grade * grade);
    constexpr double rho = 0.27 / 4.0;
    const R v = rho * w2;
    const R road = (0.014 * weight + (0.5 * 0.7 * 1.2) * (v * v)) * tanh(v / 0.1) + weight * grade;
    const R Q1 = throttle_(t) * engine_(w) - (4.0 * tanh(w / 5.0) + 0.008 * w);
    dxdt[0] = (Q1 - g * (rho * road)) / (0.12 + 3.6 * (g * g));
  }
  void speeds(double /*t*/, const double* x, double* w) const {
    w[0] = x[0];
    w[1] = x[0] * (0.5 + 0.5 * x[0] * x[0] / (220.0 * 220.0 + x[0] * x[0]));
  }

 private:
  Curve engine_{{0, 80, 150, 260, 340, 419, 500}, {0, 44, 56, 64, 62, 58, 0}};
  Curve grade_{{0, 40, 43, 60}, {0, 0, 0.02, 0.02}};
  Lag throttle_{0.2, 0.3};
};

}  // namespace variator_sim::benchmark
