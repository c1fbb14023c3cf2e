#include "model/derivative_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/check_point.h"
#include "variator_sim/errors.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

struct Difference {
  double central;
  double margin;  ///< of rounding in the values
  double kink;    ///< right-hand less left-hand derivative
};

/// Returns differences around 0 with the step h, `here` being the value there; nothing if some
/// value is not finite.
std::optional<Difference> calcDifference(const std::function<double(double)>& function, double here,
                                         double h) {
  const std::array<double, 4> f{function(-2.0 * h), function(-h), function(h), function(2.0 * h)};
  // Numbers below the least normal one are rounded as it is.
  double largest = std::max(std::abs(here), std::numeric_limits<double>::min());
  for (const double value : f) largest = std::max(largest, std::abs(value));
  if (!std::isfinite(largest)) return std::nullopt;
  Difference d{};
  d.central = (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * h);
  d.margin = 8.0 * kEpsilon * largest / h;
  // one-sided differences of order 2
  const double right = (-3.0 * here + 4.0 * f[2] - f[3]) / (2.0 * h);
  const double left = (3.0 * here - 4.0 * f[1] + f[0]) / (2.0 * h);
  d.kink = right - left;
  return d;
}

/// Returns the derivative of `function` (of a step h) at 0 by differences of order 4 if it
/// contradicts `stated` with certainty; nothing otherwise. `scale` is a step that matters, `slack`
/// the rounding in `stated`.
std::optional<double> findDisagreement(const std::function<double(double)>& function, double stated,
                                       double scale, double slack) {
  const double here = function(0.0);
  if (!std::isfinite(stated) || !std::isfinite(here)) return std::nullopt;
  constexpr int kSteps = 12;
  constexpr double kTolerance = 1e-5;
  std::vector<Difference> differences;
  double h = 0.02 * scale;
  for (int n = 0; n < kSteps; ++n, h *= 0.25) {
    const std::optional<Difference> d = calcDifference(function, here, h);
    if (!d) continue;
    const double size = std::max(std::abs(stated), std::abs(d->central));
    if (std::abs(d->central - stated) <= kTolerance * size + slack) return std::nullopt;
    differences.push_back(*d);
  }
  // Take the two consecutive steps that agree best.
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
  for (const Difference& d : differences) sides = std::min(sides, std::abs(d.kink) + d.margin);
  if (sides > 0.1 * gap) return std::nullopt;
  return value;
}

using Arguments = std::array<double, OpaqueFunction::kMostArguments>;

struct Mismatch {
  int argument;  ///< from 0
  double stated;
  double found;
};

/// Returns the first derivative of `f` at x that its values contradict.
std::optional<Mismatch> findMismatch(const OpaqueFunction& f, const Arguments& x) {
  constexpr double kRounding = 1e-10;  ///< in a gradient, relative to its largest entry
  Arguments gradient{};
  f.calcGradient(x.data(), gradient.data());
  double largest = 0.0;
  for (const double entry : gradient) largest = std::max(largest, std::abs(entry));
  for (int i = 0; i < f.argumentCount(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    const auto along = [&](double h) {
      Arguments moved = x;
      moved[n] += h;
      return f.value(moved.data());
    };
    const double scale = std::max(1.0, std::abs(x[n]));
    const auto found = findDisagreement(along, gradient[n], scale, kRounding * largest);
    if (found) return Mismatch{i, gradient[n], *found};
  }
  return std::nullopt;
}

/// A call of an opaque function by a law.
struct Call {
  std::shared_ptr<const OpaqueFunction> function;
  expression::Tape arguments;

  Arguments evaluate(const CheckPoint& point) const {
    Arguments x{};
    arguments.evaluate(point.view(), x.data());
    return x;
  }
};

std::vector<Call> listCalls(const expression::Graph& graph,
                            const std::vector<expression::Node>& nodes) {
  std::vector<Call> calls;
  for (const int n : graph.listReachable(nodes)) {
    const expression::Graph::Entry& entry = graph.entry({n});
    if (entry.operation != expression::Operation::kOpaque || entry.order[0] != 0) continue;
    const int count = graph.opaqueOf(entry)->argumentCount();
    std::vector<expression::Node> arguments;
    arguments.reserve(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
      arguments.push_back({entry.operands[i]});
    }
    calls.push_back({graph.opaqueOf(entry), expression::Tape(graph, arguments)});
  }
  return calls;
}

std::string describe(const Arguments& x, int count) {
  std::string text = "x = [";
  for (int i = 0; i < count; ++i) {
    text += (i == 0 ? "" : ", ") + formatNumber(x[static_cast<std::size_t>(i)]);
  }
  return text + "]";
}

void verify(const Scene& scene, const Call& call, const std::string& name, const char* kind) {
  constexpr int kPoints = 4;
  Random random;
  const CheckPoint start = startOf(scene);
  for (int n = 0; n < kPoints; ++n) {
    const CheckPoint point = n == 0 ? start : shaken(scene, start, 0.3, random);
    const Arguments x = call.evaluate(point);
    const std::optional<Mismatch> wrong = findMismatch(*call.function, x);
    if (!wrong) continue;
    const CheckPoint nearby = shaken(scene, point, 1e-3, random);
    if (!findMismatch(*call.function, call.evaluate(nearby))) continue;
    throw SceneError(
        name, "d f/d x" + std::to_string(wrong->argument + 1) + " of an opaque function of " +
                  kind + " " + inQuotes(name) + " is stated as " + formatNumber(wrong->stated) +
                  ", but its values say " + formatNumber(wrong->found) + ", at " +
                  describe(x, call.function->argumentCount()) +
                  "; correct the derivative, or load it unchecked with verify_derivatives: false" +
                  scene.extreme_numbers);
  }
}

}  // namespace

void verifyDerivatives(const Scene& scene) {
  const auto check = [&scene](const Law& law, const char* kind) {
    for (const Call& call : listCalls(law.graph(), law.formulas())) {
      verify(scene, call, law.name(), kind);
    }
  };
  for (const TorquePtr& torque : scene.torques) check(*torque, "torque");
  for (const ConstraintPtr& constraint : scene.constraints) check(*constraint, "constraint");
}

}  // namespace variator_sim
