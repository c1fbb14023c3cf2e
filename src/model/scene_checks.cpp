// Checks of a scene that has been read.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "expression/opaque_slope.h"
#include "model/scene_readers.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim {
namespace {

// --- extreme numbers -----------------------------------------------------------------------------

/// Largest number of values in one message.
constexpr std::size_t kMostTold = 4;

bool isExtreme(double value) {
  constexpr double kFar = 1e16;
  const double size = std::abs(value);
  return size > kFar || (size > 0.0 && size < 1.0 / kFar);
}

void collect(const ParameterTree& tree, const std::string& path, std::vector<std::string>& found) {
  if (found.size() == kMostTold) return;
  const bool is_integer = tree.kind() == ParameterTree::Kind::kInteger;
  if (isExtreme(is_integer ? static_cast<double>(tree.asInteger()) : tree.asReal())) {
    found.push_back(shownPath(path) + " = " + tree.toText());
  }
  for (std::size_t n = 0; n < tree.asList().size(); ++n) {
    collect(tree.asList()[n], elementPath(path, n), found);
  }
  for (const auto& [key, value] : tree.asDictionary()) {
    collect(value, entryPath(path, key), found);
  }
}

// --- states to check laws at ---------------------------------------------------------------------

/// One state that owns its arrays.
struct CheckPoint {
  double time = 0.0;
  std::array<double, kMaxShafts> angle{};
  std::array<double, kMaxShafts> velocity{};
  std::array<double, kMaxShafts> acceleration{};
  std::array<double, kMaxInputs + kMaxHolds> input{};  ///< and sides of elements that hold
  std::array<double, kMaxInputs + kMaxHolds> input_rate{};
  std::array<double, kMaxInputs + kMaxHolds> input_second_rate{};

  StateView view() const {
    return {time,         angle.data(),      velocity.data(),         acceleration.data(),
            input.data(), input_rate.data(), input_second_rate.data()};
  }
};

/// The same on every run and machine.
using Random = std::minstd_rand;

/// Returns `value` moved by up to `by`, relative to its size and at least 1.
double shaken(double value, double by, Random& random) {
  const double part = static_cast<double>(random()) / static_cast<double>(Random::max());
  return value + by * std::max(1.0, std::abs(value)) * (2.0 * part - 1.0);
}

CheckPoint withSpeeds(const CheckPoint& point, double factor) {
  CheckPoint to = point;
  for (double& value : to.velocity) value *= factor;
  for (double& value : to.acceleration) value *= factor;
  return to;
}

/// Returns `point` with every part moved.
CheckPoint shaken(const Scene& scene, const CheckPoint& point, double by, Random& random) {
  CheckPoint p = point;
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

/// Returns the scene's initial state.
CheckPoint startOf(const Scene& scene) {
  CheckPoint p;
  std::copy(scene.initial.angle.begin(), scene.initial.angle.end(), p.angle.begin());
  std::copy(scene.initial.velocity.begin(), scene.initial.velocity.end(), p.velocity.begin());
  std::copy(scene.initial.acceleration.begin(), scene.initial.acceleration.end(),
            p.acceleration.begin());
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) p.input[i] = scene.inputs[i].initial;
  std::fill(p.input.begin() + kMaxInputs, p.input.end(), 1.0);
  return p;
}

// --- power of reactions --------------------------------------------------------------------------

/// Tells whether the reactions of a constraint of order 1 have power under `gauss`: R = C^T lambda
/// has lambda C omega. For f homogeneous in omega of degree d this is lambda d f = 0 (Euler); else
/// C omega / f differs from state to state. A constraint that is not zero at rest imposes a motion
/// and is meant to have power.
bool takesEnergy(const Constraint& constraint, const Scene& scene) {
  constexpr double kRounding = 1e-9;
  // C, then f
  std::vector<expression::Node> formulas = constraint.row();
  formulas.back() = constraint.function();
  const expression::Tape tape(constraint.graph(), formulas);
  const int S = scene.shaftCount();
  Random random;
  double degree = std::numeric_limits<double>::quiet_NaN();
  for (int n = 0; n < 16; ++n) {
    const double speed = std::pow(10.0, n / 4);
    const CheckPoint point = withSpeeds(shaken(scene, startOf(scene), 1.0, random), speed);
    const double at_rest = constraint.calcResidual(withSpeeds(point, 0.0).view());
    const double* const C = tape.evaluate(point.view());
    const double f = C[S];
    double power = 0.0;
    double size = 0.0;
    for (int i = 0; i < S; ++i) {
      const double part = C[i] * point.velocity[static_cast<std::size_t>(i)];
      power += part;
      size += std::abs(part);
    }
    if (!std::isfinite(f) || !std::isfinite(size) || !std::isfinite(at_rest)) continue;
    if (std::abs(at_rest) > kRounding * size) return false;
    if (std::abs(f) < 1e-3 * size) continue;  // lost in rounding
    if (std::isnan(degree)) degree = power / f;
    if (std::abs(power / f - degree) > kRounding * (1.0 + size / std::abs(f))) return true;
  }
  return false;
}

// --- opaque functions ----------------------------------------------------------------------------

/// Returns the derivative of `function` (of a step h) at 0 by differences if it contradicts
/// `stated` with certainty; nothing otherwise. `scale` is a step that matters, `slack` the rounding
/// in `stated`.
std::optional<double> findDisagreement(const std::function<double(double)>& function, double stated,
                                       double scale, double slack) {
  if (!std::isfinite(stated) || !std::isfinite(function(0.0))) return std::nullopt;
  constexpr int kSteps = 12;
  constexpr double kTolerance = 1e-5;
  // (Two consecutive steps that agree best decide.)
  double doubt = std::numeric_limits<double>::infinity();
  double found = 0.0;
  double before = std::numeric_limits<double>::quiet_NaN();
  double margin_before = 0.0;
  double h = 0.02 * scale;
  for (int n = 0; n < kSteps; ++n, h *= 0.25) {
    // A difference of order 4, and the margin of rounding in the function's values.
    const std::array<double, 4> f{function(-2.0 * h), function(-h), function(h), function(2.0 * h)};
    const double value = (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * h);
    if (!std::isfinite(value)) continue;
    const double size = std::max(std::abs(stated), std::abs(value));
    if (std::abs(value - stated) <= kTolerance * size + slack) return std::nullopt;
    // Numbers below the least normal one are rounded as it is.
    double largest = std::numeric_limits<double>::min();
    for (const double it : f) largest = std::max(largest, std::abs(it));
    const double margin = 8.0 * std::numeric_limits<double>::epsilon() * largest / h;
    const double its = std::abs(value - before) + margin + margin_before;
    if (its < doubt) found = value;
    doubt = its < doubt ? its : doubt;
    before = value;
    margin_before = margin;
  }
  const double size = std::max(std::abs(stated), std::abs(found));
  if (!(std::abs(found - stated) > kTolerance * size + slack + 100.0 * doubt)) return std::nullopt;
  // Differences across something much narrower than the steps do not settle.
  if (doubt > 1e-3 * std::abs(found) && doubt > 1e-9 * std::abs(stated)) return std::nullopt;
  return found;
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

/// Checks a function that the law of `kind` calls with `arguments`.
void verify(const Scene& scene, const OpaqueFunction& function, const expression::Tape& arguments,
            const Law& law, const char* kind) {
  constexpr int kPoints = 4;
  Random random;
  const CheckPoint start = startOf(scene);
  const auto argumentsAt = [&](const CheckPoint& point) {
    Arguments x{};
    arguments.evaluate(point.view(), x.data());
    return x;
  };
  for (int n = 0; n < kPoints; ++n) {
    const CheckPoint point = n == 0 ? start : shaken(scene, start, 0.3, random);
    const Arguments x = argumentsAt(point);
    const std::optional<Mismatch> wrong = findMismatch(function, x);
    if (!wrong) continue;
    const CheckPoint nearby = shaken(scene, point, 1e-3, random);
    if (!findMismatch(function, argumentsAt(nearby))) continue;
    throw SceneError(
        law.name(),
        "d f/d x" + std::to_string(wrong->argument + 1) + " of an opaque function of " + kind +
            " " + inQuotes(law.name()) + " is stated as " + formatNumber(wrong->stated) +
            ", but its values say " + formatNumber(wrong->found) +
            ", at x = " + formatNumbers(x.data(), function.argumentCount()) +
            "; correct the derivative, or load it unchecked with verify_derivatives: false" +
            scene.extreme_numbers);
  }
}

}  // namespace

std::string describeExtremeNumbers(const ParameterTree& scene) {
  if (scene.kind() != ParameterTree::Kind::kDictionary) return "";
  std::vector<std::string> found;
  for (const auto& [key, value] : scene.asDictionary()) {
    // Numbers at the root belong to the node.
    const bool holds = value.kind() == ParameterTree::Kind::kDictionary ||
                       value.kind() == ParameterTree::Kind::kList;
    if (holds) collect(value, key, found);
  }
  std::string text;
  for (const std::string& number : found) {
    text += (text.empty() ? "; numbers that may be to blame: " : ", ") + number;
  }
  return text;
}

void warnOfEnergy(const Constraint& constraint, Scene* scene) {
  if (scene->principle != Principle::kGauss || constraint.order() != 1) return;
  if (!constraint.direction().empty() || !takesEnergy(constraint, *scene)) return;
  scene->warnings.push_back(
      "under the principle 'gauss' the reactions of the constraint " + inQuotes(constraint.name()) +
      " take or give energy (--energy shows how much): it is not proportional to the speeds, so "
      "C = df/dw is not in their ratio; for a ratio that follows a speed and loses nothing take "
      "variator_sim/KinematicRatio, whose 'reaction' is 'lossless' by default "
      "(doc/scene.md)");
}

void verifyDerivatives(const Scene& scene) {
  const expression::Graph& graph = *scene.graph;
  for (const Law* law : scene.laws()) {
    const bool is_torque = dynamic_cast<const Torque*>(law) != nullptr;
    const char* const kind = is_torque ? "torque" : "constraint";
    for (const int n : graph.listReachable(law->formulas())) {
      const expression::Graph::Entry& entry = graph.entry({n});
      if (entry.operation != expression::Operation::kOpaque) continue;
      const OpaqueFunction& function = *graph.opaqueOf(entry);
      if (expression::OpaqueSlope::countIn(function) > 0) continue;
      std::vector<expression::Node> arguments;
      arguments.reserve(static_cast<std::size_t>(function.argumentCount()));
      for (int i = 0; i < function.argumentCount(); ++i) arguments.push_back({entry.operands[i]});
      verify(scene, function, expression::Tape(graph, arguments), *law, kind);
    }
  }
}

}  // namespace variator_sim
