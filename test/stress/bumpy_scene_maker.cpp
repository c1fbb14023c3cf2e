// Which scenes are made: shapes of features, where they stand, what they depend on, and what else
// happens at their feet.

#include "stress/bumpy_scene.h"
#include "stress/methods.h"
#include "stress/random.h"

namespace variator_sim::test {
namespace {

/// To few digits, so that texts stay short.
double rounded(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.5g", value);
  return std::strtod(buffer, nullptr);
}

/// max(0, x).
Formula positive(const Formula& x) {
  return {"max(0," + x.text + ")", [x = x.at](Dual t) {
            const Dual value = x(t);
            return value.value > 0.0 ? value : Dual{};
          }};
}

/// if(x < 1, y, 0).
Formula whereBelow1(const Formula& x, const Formula& y) {
  return {"if(" + x.text + "<1," + y.text + ",0)",
          [x = x.at, y = y.at](Dual t) { return x(t).value < 1.0 ? y(t) : Dual{}; }};
}

class Generator {
 public:
  explicit Generator(std::uint64_t seed) : random_(seed) {}
  BumpyScene make();

 private:
  double logarithmic(double low, double high) {
    return low * std::pow(high / low, random_.between(0.0, 1.0));
  }
  int even(int most) {
    return 2 * std::max(1, static_cast<int>(logarithmic(1.0, 0.5 * most + 0.99)));
  }

  Term makeTerm(Argument argument, double from, double length, double narrowest);
  void addPeriodic(Term* term, double from, double length);
  void addLocal(Term* term, double from, double length, double narrowest);
  /// A function of a bump that is as flat.
  Formula wrapped(const Formula& g);

  Random random_;
  bool is_aligned_ = false;  ///< to periods of whole steps, where vanishing derivatives hide
};

Formula Generator::wrapped(const Formula& g) {
  switch (random_.below(16)) {
    case 0:
      return call("log", number(1.0) + g);
    case 1:
      return call("exp", g) - number(1.0);
    case 2:
      return call("tan", number(0.7) * g);
    case 3:
      return call("sin", number(3.0) * g);
    case 4:
      return call("asin", number(0.97) * g);
    case 5:
      return call("atan", g);
    case 6:
      return call("cosh", g) - number(1.0);
    case 7:
      return number(1.0) - call("cos", number(2.0) * g);
    case 8:
      return g / (number(1.5) - g);
    case 9:
      return call("tanh", number(2.0) * g);
    case 10:
      return call("sqrt", number(1.0) + g) - number(1.0);
    case 11:
      return g * g;
    default:
      return g;
  }
}

void Generator::addPeriodic(Term* term, double from, double length) {
  double k = rounded(kPi / length * logarithmic(0.6, 40.0));
  double phase = rounded(random_.between(-1.0, 1.0)) - k * from;
  if (is_aligned_) {  // vanishes at the start, and after one step of 1 or the whole way
    k = kPi * (1 + random_.below(4)) / (length > 30.0 || random_.happens(0.5) ? length : 1.0);
    phase = -k * from;
  }
  const Formula s = call("sin", number(k) * variable() + number(phase));
  const Formula c = call("cos", number(2.0 * k) * variable() + number(2.0 * phase));
  const double zero = -phase / k;
  const double top = zero + 0.5 * kPi / k;
  int n = even(random_.happens(0.5) ? 12 : 1000);
  double A = rounded(logarithmic(1.0, 300.0));
  switch (random_.below(9)) {
    case 0:
    case 1:
      term->formula = power(s, n);
      break;
    case 2:
      // (The power of 0 itself has no series.)
      term->formula = power(number(0.55) - number(0.45) * c, 0.5 * n + 0.5);
      break;
    case 3: {
      term->formula = s;
      for (n = 1; n < 1 << (1 + random_.below(10)); n *= 2) term->formula = power(term->formula, 2);
      break;
    }
    case 4:
      term->formula = power(number(1.0) - c, 0.5 * n) / number(std::pow(2.0, 0.5 * n));
      break;
    case 5:
      term->formula = call("exp", number(0.0) - power(number(A) * s, 2));
      n = 0;
      break;
    case 6:
      term->formula = call("exp", number(-A * A) * power(s, 2));
      n = 0;
      break;
    case 7:
      n = even(8);
      term->formula = number(1.0) / (number(1.0) + power(number(A) * s, n));
      A *= 0.5 * n;
      n = 0;
      break;
    default:
      term->formula = number(1.0) / call("cosh", number(A) * s);
      n = 0;
      break;
  }
  if (n > 0) {
    term->features.push_back({top, 1.0 / (k * std::sqrt(n)), kPi / k});
  } else {
    term->features.push_back({zero, 1.0 / (k * A), kPi / k});
  }
}

void Generator::addLocal(Term* term, double from, double length, double narrowest) {
  const double h = rounded(length * logarithmic(narrowest, 0.2));
  // Often a few widths behind the start.
  const double c = rounded(from + (random_.happens(0.3) ? h * random_.between(0.0, 12.0)
                                                        : length * random_.between(0.0, 1.0)));
  const Formula S = (variable() - number(c)) / number(h);
  const auto feature = [&](double at, double width) {
    term->features.push_back({c + at * h, width * h, 0.0});
  };
  feature(0.0, 1.0);
  const int n = even(random_.happens(0.7) ? 8 : 100);
  switch (random_.below(12)) {
    case 0:
    case 1:
      term->formula = call("exp", number(0.0) - power(S, 2));
      return;
    case 2:
      term->formula = call("exp", number(0.0) - power(S, 4));
      return;
    case 3:
      term->formula = power(number(1.0) / call("cosh", S), 1 + random_.below(3));
      return;
    case 4:
      for (const double side : {-1.0, 1.0}) feature(side, 2.0 / n);
      term->formula = number(1.0) / (number(1.0) + power(S, n));
      return;
    case 5:
      term->formula = number(0.5) * (call("tanh", S + number(3.0)) - call("tanh", S - number(3.0)));
      return;
    case 6:
      term->formula = number(0.5) * (call("atan", S + number(1.0)) - call("atan", S - number(1.0)));
      return;
    case 7: {  // a triangle of roots of squares
      const double e = rounded(logarithmic(1e-5, 0.1));
      const auto root = [&](double at) {
        feature(at, e);
        return call("sqrt", power(S - number(at), 2) + number(e * e));
      };
      term->formula = number(0.5) * (root(-1.0) + root(1.0)) - root(0.0);
      return;
    }
    case 8:
      term->formula = power(positive(number(1.0) - power(S, 2)), 1 + random_.below(6));
      break;
    case 9:
      term->formula =
          whereBelow1(power(S, 2), power(number(1.0) - power(S, 2), 1 + random_.below(6)));
      break;
    case 10:  // sets in behind an edge
      term->formula = power(positive(call("tanh", S)), 1 + random_.below(6));
      return;
    default:
      term->formula =
          number(0.5) + number(0.5) * call(random_.happens(0.5) ? "tanh" : "sin", call("atan", S));
      return;
  }
  for (const double side : {-1.0, 1.0}) feature(side, 0.1);
}

Term Generator::makeTerm(Argument argument, double from, double length, double narrowest) {
  Term term;
  term.argument = argument;
  const bool is_bounded = argument != Argument::kAngle && argument != Argument::kVelocity;
  if (is_bounded && random_.happens(0.15)) {  // zeros of high order at both ends of the way
    const int n = even(random_.happens(0.5) ? 12 : 400);
    const Formula y = (variable() - number(from)) / number(length);
    term.formula = power(number(4.0) * y * (number(1.0) - y), n);
    term.features.push_back({from + 0.5 * length, 0.5 * length / std::sqrt(n), 0.0});
  } else if (random_.happens(is_aligned_ ? 0.9 : 0.4)) {
    addPeriodic(&term, from, length);
  } else {
    addLocal(&term, from, length, narrowest);
  }
  term.formula = wrapped(term.formula);
  double width = length;
  for (const Feature& feature : term.features) width = std::min(width, feature.width);
  term.scale = rounded(random_.happens(0.6) ? random_.between(0.5, 5.0)
                                            : random_.between(0.1, 1.0) * std::min(length, 1.0) /
                                                  std::max(1e-6, width));
  // (Else a long way becomes ever longer.)
  if (argument == Argument::kAngle) term.scale = rounded(term.scale / std::max(1.0, length / 3.0));
  return term;
}

BumpyScene Generator::make() {
  static constexpr double kEnds[] = {1.0, 3.0, 3.0, 3.0, 10.0, 100.0, 300.0};
  static constexpr double kMaximumSteps[] = {0.1, 0.3, 1.0, 1.0, 1.0, 1.0, 10.0, 100.0};
  static constexpr double kTolerances[] = {1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-9, 1e-10, 1e-11};
  static constexpr const char* kHolds[] = {"first_order_lag", "rate_limit", "first_order_hold",
                                           "second_order_lag"};
  BumpyScene scene;
  scene.end = random_.oneOf(kEnds);
  scene.maximum_step = std::max(random_.oneOf(kMaximumSteps), scene.end > 50.0 ? 1.0 : 0.1);
  scene.tolerance = random_.oneOf(kTolerances);
  scene.stepper = random_.happens(0.3) ? StepperKind::kTaylor : StepperKind::kAuto;
  scene.hold = random_.oneOf(kHolds);
  scene.hold_time = rounded(scene.end * logarithmic(0.005, 0.5));
  is_aligned_ = random_.happens(0.4);
  if (is_aligned_ && scene.end > 50.0) scene.maximum_step = 100.0;
  static constexpr int kOrders[] = {0, 0, 0, 0, 1, 2, 2, 3};
  scene.order = random_.oneOf(kOrders);
  if (random_.happens(0.4)) scene.principle = Principle::kGauss;
  scene.is_law = random_.happens(0.7);
  scene.velocity = is_aligned_ ? 1.0 : rounded(random_.between(0.5, 2.0));
  scene.table_offset = is_aligned_ ? 0.0 : rounded(random_.between(-3.0, 3.0));

  static constexpr Argument kArguments[] = {Argument::kTime,  Argument::kTime,
                                            Argument::kAngle, Argument::kVelocity,
                                            Argument::kInput, Argument::kTable};
  const Argument kind = random_.oneOf(kArguments);
  if (kind == Argument::kVelocity) {
    scene.base = rounded(random_.between(0.2, 2.0));
  } else {
    if (random_.happens(0.3)) scene.base = rounded(random_.between(0.1, 1.0));
    if (random_.happens(0.2)) scene.damping = rounded(random_.between(0.05, 0.3) / scene.end);
    if (random_.happens(0.2)) scene.drift = rounded(random_.between(0.1, 0.3));
    if (kind == Argument::kTime && scene.base == 0.0 && random_.happens(0.4)) scene.velocity = 0.0;
    if (random_.happens(0.3)) scene.load = rounded(random_.between(0.0, 0.3));
    if (random_.happens(0.3)) {  // commands, some of them at feet of bumps
      const int n = 1 + random_.below(11);
      for (int i = 1; i <= n; ++i) {
        const double time =
            is_aligned_ ? scene.end * i / (n + 1) : scene.end * random_.between(0, 1);
        scene.commands.push_back({rounded(time), 1, random_.happens(0.3) ? 0.0 : rounded(0.1 * i)});
      }
    }
  }
  const double top = rounded(random_.between(1.0, 2.0));
  for (int n = 1 + random_.below(2); n > 0; --n) {
    scene.commands.push_back({rounded(scene.end * random_.between(0.0, 0.7)), 0, n * top});
  }
  std::stable_sort(scene.commands.begin(), scene.commands.end(),
                   [](const auto& a, const auto& b) { return a.time < b.time; });

  const auto from = [&](Argument x) {
    return x == Argument::kVelocity ? scene.velocity
           : x == Argument::kTable  ? scene.table_offset
                                    : 0.0;
  };
  const auto length = [&](Argument x) {
    return x == Argument::kAngle
               ? scene.velocity * scene.end + scene.base * scene.end * scene.end / 3
           : x == Argument::kVelocity ? scene.base * scene.end
           : x == Argument::kInput    ? 2.0 * top
                                      : scene.end;
  };
  const auto make = [&](Argument x, double narrowest) {
    return makeTerm(x, from(x), length(x), narrowest);
  };
  const bool has_bump_in_constraint =
      scene.order > 0 && kind != Argument::kVelocity && random_.happens(0.5);
  if (!has_bump_in_constraint) {
    for (int n = 1 + random_.below(2); n > 0; --n) {
      const bool is_narrow = kind == Argument::kVelocity || kind == Argument::kAngle;
      scene.terms.push_back(make(kind, is_narrow ? 1e-5 : 1e-6));
    }
  } else if (scene.order == 3 || (scene.order == 2 && random_.happens(0.5))) {
    scene.bumps.push_back(make(kind == Argument::kAngle ? Argument::kTime : kind, 1e-4));
  } else {
    // A ratio of order 1 is differentiated twice.
    const bool is_first = scene.order == 1;
    if (is_first) scene.hold = "second_order_lag";
    Term term = make(kind, is_first ? 0.03 : 1e-3);
    term.scale = rounded(random_.between(0.1, 0.4));
    scene.ratio_terms.push_back(std::move(term));
  }
  return scene;
}

}  // namespace

BumpyScene makeBumpyScene(std::uint64_t seed) {
  return Generator(seed).make();
}

}  // namespace variator_sim::test
