#include "stress/bumpy_scene.h"

#include <boost/numeric/odeint/stepper/bulirsch_stoer.hpp>
#include <cstdlib>
#include <stdexcept>

#include "stress/methods.h"

namespace variator_sim::test {
namespace {

std::string written(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.5g", value);
  return std::strtod(buffer, nullptr) == value ? buffer : plainly(value);
}

struct Function {
  const char* name;
  double (*value)(double);
  double (*slope)(double);
};
const Function kFunctions[] = {
    {"sin", std::sin, std::cos},
    {"cos", std::cos, [](double x) { return -std::sin(x); }},
    {"tan", std::tan, [](double x) { return 1.0 + std::tan(x) * std::tan(x); }},
    {"asin", std::asin, [](double x) { return 1.0 / std::sqrt(1.0 - x * x); }},
    {"atan", std::atan, [](double x) { return 1.0 / (1.0 + x * x); }},
    {"exp", std::exp, std::exp},
    {"log", std::log, [](double x) { return 1.0 / x; }},
    {"sqrt", std::sqrt, [](double x) { return 0.5 / std::sqrt(x); }},
    {"tanh", std::tanh, [](double x) { return 1.0 - std::tanh(x) * std::tanh(x); }},
    {"cosh", std::cosh, std::sinh},
    {"abs", [](double x) { return std::abs(x); }, [](double x) { return x < 0.0 ? -1.0 : 1.0; }},
};

template <class Combine>
Formula combine(const Formula& a, char sign, const Formula& b, Combine combined) {
  return {"(" + a.text + sign + b.text + ")",
          [a = a.at, b = b.at, combined](Dual x) { return combined(a(x), b(x)); }};
}

}  // namespace

Formula variable() {
  return {"X", [](Dual x) { return x; }};
}
Formula number(double value) {
  return {"(" + written(value) + ")", [value](Dual) { return Dual{value, 0.0}; }};
}
Formula operator+(const Formula& a, const Formula& b) {
  return combine(a, '+', b, [](Dual x, Dual y) {
    return Dual{x.value + y.value, x.rate + y.rate};
  });
}
Formula operator-(const Formula& a, const Formula& b) {
  return combine(a, '-', b, [](Dual x, Dual y) {
    return Dual{x.value - y.value, x.rate - y.rate};
  });
}
Formula operator*(const Formula& a, const Formula& b) {
  return combine(a, '*', b, [](Dual x, Dual y) {
    return Dual{x.value * y.value, x.rate * y.value + x.value * y.rate};
  });
}
Formula operator/(const Formula& a, const Formula& b) {
  return combine(a, '/', b, [](Dual x, Dual y) {
    const double value = x.value / y.value;
    // Beyond the numbers of y nothing changes.
    return Dual{value, value == 0.0 ? 0.0 : (x.rate - value * y.rate) / y.value};
  });
}
Formula power(const Formula& x, double exponent) {
  return {"(" + x.text + ")^" + written(exponent), [x = x.at, exponent](Dual t) {
            const Dual value = x(t);
            return Dual{std::pow(value.value, exponent),
                        value.rate * exponent * std::pow(value.value, exponent - 1.0)};
          }};
}
Formula call(const char* name, const Formula& x) {
  for (const Function& function : kFunctions) {
    if (std::string(name) != function.name) continue;
    return {name + ("(" + x.text + ")"), [x = x.at, function](Dual t) {
              const Dual value = x(t);
              return Dual{function.value(value.value),
                          value.rate == 0.0 ? 0.0 : value.rate * function.slope(value.value)};
            }};
  }
  throw std::invalid_argument(name);
}

namespace {

// --- the reference -------------------------------------------------------------------------------

/// The commands to one input, in closed form.
class Signal {
 public:
  Signal(const BumpyScene& scene, int input) : zero_order_(input != 0), scene_(scene) {
    for (const TimedCommand& command : scene.commands) {
      if (command.input == input) commands_.push_back(command);
    }
  }
  Dual at(double t) const {
    Dual u;
    for (std::size_t n = 0; n < commands_.size() && commands_[n].time <= t; ++n) {
      const bool is_last = n + 1 == commands_.size() || commands_[n + 1].time > t;
      u = moved(u, commands_[n].value, (is_last ? t : commands_[n + 1].time) - commands_[n].time);
    }
    return u;
  }

 private:
  Dual moved(Dual u, double target, double s) const {
    const double T = scene_.hold_time;
    const double e = std::exp(-s / T);
    if (zero_order_ || scene_.hold == "zero_order") return {target, 0.0};
    if (scene_.hold == "first_order_lag") {
      return {target + (u.value - target) * e, (target - u.value) * e / T};
    }
    if (scene_.hold == "second_order_lag") {
      const double A = u.value - target;
      const double B = u.rate + A / T;
      return {target + (A + B * s) * e, (B - (A + B * s) / T) * e};
    }
    const double rate = scene_.hold == "rate_limit" ? std::copysign(1.0 / T, target - u.value)
                                                    : (target - u.value) / T;
    if (rate == 0.0 || s >= (target - u.value) / rate) return {target, 0.0};
    return {u.value + rate * s, rate};
  }
  bool zero_order_;
  const BumpyScene& scene_;
  std::vector<TimedCommand> commands_;
};

/// phi_a, w_a, w_b, P = R_a + c R_b, and e_b - c e_a of order 3.
using State = std::array<double, 5>;

/// Derived by hand: R_b = 2 e_b - load, e_b = c e_a + b, so that (1 + 2 c^2) e_a = P + Q_a + c load
/// - 2 c b. Under `gauss` R = C^T lambda, so P = 0; under `generalized_gauss` R_a' = -c R_b', so P'
/// = c' R_b.
class Equations {
 public:
  explicit Equations(const BumpyScene& scene) : scene_(scene), u_(scene, 0), torque_(scene, 1) {}

  Dual argument(Argument argument, double t, const State& y, double e) const {
    switch (argument) {
      case Argument::kAngle:
        return {y[0], y[1]};
      case Argument::kVelocity:
        return {y[1], e};
      case Argument::kInput:
        return u_.at(t);
      case Argument::kTable:
        return {t + scene_.table_offset, 1.0};
      default:
        return {t, 1.0};
    }
  }
  Dual sum(const std::vector<Term>& terms, double t, const State& y) const {
    Dual total;
    for (const Term& term : terms) {
      const Dual x = term.formula.at(argument(term.argument, t, y, 0.0));
      total.value += term.scale * x.value;
      total.rate += term.scale * x.rate;
    }
    return total;
  }
  void operator()(const State& y, State& rate, double t) const {
    const double Q = scene_.base - scene_.damping * y[1] + scene_.drift * std::sin(1.4 * t) +
                     torque_.at(t).value + sum(scene_.terms, t, y).value;
    rate = {y[1], Q, 0.0, 0.0, 0.0};
    if (scene_.order == 0) return;
    Dual c = sum(scene_.ratio_terms, t, y);
    c.value += scene_.ratio;
    const double bumps = sum(scene_.bumps, t, y).value;
    const double w_b = scene_.order == 1 ? c.value * y[1] : y[2];
    const double b = scene_.order == 1   ? c.rate * y[1]
                     : scene_.order == 2 ? (bumps - w_b + c.value * y[1]) / scene_.slip_time
                                         : y[4];
    const double e_a =
        (y[3] + Q + c.value * (scene_.load - 2.0 * b)) / (1.0 + 2.0 * c.value * c.value);
    const double e_b = c.value * e_a + b;
    rate[1] = e_a;
    rate[2] = e_b;
    if (scene_.principle == Principle::kGeneralizedGauss) {
      rate[3] = c.rate * (2.0 * e_b - scene_.load);
    }
    if (scene_.order == 3) rate[4] = bumps - y[4];
  }
  State start(double shift) const {
    State y{shift, scene_.velocity + shift, 0.0, 0.0, 0.0};
    const double c = scene_.ratio + sum(scene_.ratio_terms, 0.0, y).value;
    y[2] = c * y[1];
    // Free accelerations are those of least reaction.
    State rate;
    operator()(y, rate, 0.0);
    if (scene_.order == 3) {
      const double Q = rate[1] * (1.0 + 2.0 * c * c) - c * scene_.load;
      y[4] = 0.5 * scene_.load - c * Q;
    }
    return y;
  }
  /// No longer than a part of the way to the next feature.
  double longestStep(double t, const State& y) const {
    State rate;
    operator()(y, rate, t);
    double longest = scene_.end / 20.0;
    const double moving = 40.0 * scene_.hold_time;
    const bool is_moving = std::any_of(
        scene_.commands.begin(), scene_.commands.end(), [&](const TimedCommand& command) {
          return command.input == 0 && command.time <= t && t < command.time + moving;
        });
    for (const auto* terms : {&scene_.terms, &scene_.ratio_terms, &scene_.bumps}) {
      for (const Term& term : *terms) {
        const Dual x = argument(term.argument, t, y, rate[1]);
        const bool is_input = term.argument == Argument::kInput && is_moving;
        const double bend = term.argument == Argument::kAngle ? std::abs(rate[1])
                            : is_input ? 16.0 / (scene_.hold_time * scene_.hold_time)
                                       : 0.0;
        for (const Feature& feature : term.features) {
          double away = x.value - feature.at;
          if (feature.period > 0.0) away = std::remainder(away, feature.period);
          const double way = std::max(0.5 * feature.width, 0.25 * std::abs(away));
          longest = std::min({longest, way / std::abs(x.rate), std::sqrt(way / bend)});
        }
      }
    }
    return longest;
  }

 private:
  const BumpyScene& scene_;
  Signal u_;
  Signal torque_;
};

}  // namespace

std::vector<double> BumpyScene::times() const {
  return evenly(end, 4);
}

double BumpyScene::rounding() const {
  double sum = 0.0;
  for (const Term& term : terms) sum += std::abs(term.scale);
  for (const Term& term : bumps) sum += std::abs(term.scale);
  return kEps * sum * (end + std::abs(table_offset));
}

std::vector<Sample> BumpyScene::reference(double shift, double fineness, int most) const {
  namespace odeint = boost::numeric::odeint;
  const Equations equations(*this);
  // (Fehlberg's pair of orders 7 and 8 would estimate no error of a torque of time alone.)
  const double asked = std::max({1e-12, 1e-3 * tolerance, 4.0 * rounding()});
  odeint::bulirsch_stoer<State> controlled(asked, asked);
  State y = equations.start(shift);
  double t = 0.0;
  double tried = 1e-3 * end;
  const auto go = [&](double to) {
    while (t < to) {
      if (--most < 0 || !std::isfinite(y[1])) return false;
      const double longest = std::min(to - t, fineness * equations.longestStep(t, y));
      const bool is_last = longest == to - t && tried >= longest;
      double h = std::min(tried, longest);
      const double before = tried;
      if (controlled.try_step(std::cref(equations), y, t, h) == odeint::success) {
        if (is_last) t = to;
        tried = std::max(h, before);
        if (h < before && !is_last && before <= longest) tried = h;
      } else {
        tried = h;
        if (t + h == t) {  // rounding of a jump
          t = std::nextafter(t, to);
          tried = 1e-12 * end;
        }
      }
    }
    return true;
  };
  std::vector<Sample> samples;
  auto command = commands.begin();
  for (const double time : times()) {
    for (; command != commands.end() && command->time < time; ++command) {
      if (!go(command->time)) return {};
    }
    if (!go(time)) return {};
    State rate;
    equations(y, rate, t);
    Sample sample;
    sample.time = t;
    sample.angle[0] = y[0];
    sample.velocity[0] = y[1];
    sample.velocity[1] =
        order == 1 ? (ratio + equations.sum(ratio_terms, t, y).value) * y[1] : y[2];
    samples.push_back(sample);
  }
  return samples;
}

// --- as text -------------------------------------------------------------------------------------

namespace {

std::string sumOf(const std::vector<Term>& terms) {
  static const char* const kNames[] = {"t", "phi1", "w1", "u", "line(t)"};
  std::string sum;
  for (const Term& term : terms) {
    std::string text = "+" + written(term.scale) + "*" + term.formula.text;
    const std::string by = kNames[static_cast<int>(term.argument)];
    for (std::size_t at = 0; (at = text.find('X', at)) != std::string::npos; at += by.size()) {
      text.replace(at, 1, by);
    }
    sum += text;
  }
  return sum;
}

}  // namespace

std::string BumpyScene::yaml() const {
  const Equations equations(*this);
  const State y = equations.start(0.0);
  std::string text = order == 0 ? "shafts: [a]\n" : "shafts: [a, b]\nb: {inertia: 2.0}\n";
  text += "a: {inertia: 1.0}\ninputs: [u]\nu: {topic: u, hold: " + hold;
  if (hold == "rate_limit") text += ", rate: " + plainly(1.0 / hold_time);
  if (hold == "first_order_hold") text += ", period: " + plainly(hold_time);
  if (hold.find("lag") != std::string::npos) text += ", time_constant: " + plainly(hold_time);
  text += ", initial: 0.0}\ntables: [line]\nline: {x: [0, " + plainly(0.4 * end) + ", " +
          plainly(end) + "], values: [" + plainly(table_offset) + ", " +
          plainly(table_offset + 0.4 * end) + ", " + plainly(table_offset + end) +
          "], beyond: linear}\n";
  const auto torque = [&](const char* name, const char* shaft, const std::string& formula) {
    text += std::string(name) + ": {type: variator_sim/ExpressionTorque, shaft: " + shaft +
            ", torque: \"" + formula + "\"}\n";
  };
  text += order == 0 ? "torques: [q, m]\n" : "torques: [q, m, l]\n";
  std::string q = written(base);
  if (damping != 0.0) q += "-" + written(damping) + "*w1";
  if (drift != 0.0) q += "+" + written(drift) + "*sin(1.4*t)";
  torque("q", "a", q + sumOf(terms));
  text += "m: {type: variator_sim/CommandedTorque, shaft: a, topic: m}\n";
  if (order > 0) {
    torque("l", "b", written(load));
    const std::string c = "(" + written(ratio) + sumOf(ratio_terms) + ")";
    text += "constraints: [k]\nk: {type: variator_sim/";
    if (is_law && order == 1) {
      text += "KinematicRatio, shafts: [a, b], ratio: \"" + c + "\"}\n";
    } else if (is_law && order == 2 && bumps.empty()) {
      text += "SlipRatio, shafts: [a, b], time_constant: " + written(slip_time) + ", ratio: \"" +
              c + "\"}\n";
    } else {
      const auto slip = [&](const std::string& x) { return x + "2-" + c + "*" + x + "1"; };
      text += "ExpressionConstraint, order: " + std::to_string(order) + ", expression: \"" +
              (order == 1   ? slip("w")
               : order == 2 ? written(slip_time) + "*(" + slip("e") + ")+" + slip("w")
                            : slip("j") + "+" + slip("e")) +
              (bumps.empty() ? "" : "-(0" + sumOf(bumps) + ")") + "\"}\n";
    }
    text += std::string("principle: ") + toString(principle) + "\n";
  }
  text += "initial: {velocity: [" + plainly(y[1]) + (order == 0 ? "" : ", " + plainly(y[2])) +
          "], project: true}\nsolver: {stepper: " + toString(stepper) +
          ", relative_tolerance: " + plainly(tolerance) +
          ", absolute_tolerance: " + plainly(tolerance) +
          ", maximum_step: " + written(maximum_step) + ", maximum_steps: 200000}\n";
  return text;
}

std::string BumpyScene::csv() const {
  std::string text = "time,topic,value\n";
  for (const TimedCommand& command : commands) {
    text += plainly(command.time) + (command.input == 0 ? ",u," : ",m,") + plainly(command.value) +
            "\n";
  }
  return text;
}

}  // namespace variator_sim::test
