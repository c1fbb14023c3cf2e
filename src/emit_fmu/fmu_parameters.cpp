#include "emit_fmu/fmu_parameters.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <set>

#include "model/number_text.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {

namespace {

constexpr std::size_t kTolerances = 3;  ///< the first numbers: relative, absolute, longest step

template <class Value>
void append(std::vector<Value>* all, const std::vector<Value>& some) {
  all->insert(all->end(), some.begin(), some.end());
}

/// Returns value base^exponent as the FMU computes it.
double raise(double value, double base, int exponent) {
  for (int n = 0; n < exponent; ++n) value *= base;
  for (int n = 0; n > exponent; --n) value /= base;
  return value;
}

/// Returns a number without the rounding of the product that it was divided by.
double snap(double factor, double product, double whole) {
  double short_one = factor;
  readWhole(printed("%.12g", factor), &short_one);
  return std::abs(short_one * product - whole) <= 4e-16 * std::abs(whole) ? short_one : factor;
}

}  // namespace

/// A program's structure and the numbers that its text keeps: all but those that can be set.
struct FmuParameters::Form {
  explicit Form(const MotionProgram& it) : structure(it.structure()) {
    append(&holds, it.hold_of.values);
    append(&holds, it.falls_to_zero.values);
    for (const auto& list : {it.timeout_of, it.initial_input, it.minimum_of, it.maximum_of}) {
      append(&fixed, list.values);
    }
    for (const std::vector<double>& points : it.passages) append(&fixed, points);
    for (const expression::DenseTable& table : it.rows().tables()) {
      for (const std::vector<double>& points : table.points) append(&fixed, points);
      append(&fixed, table.pieces);
    }
    // Factors of 1 and equal numbers change linear combinations only.
    for (const auto part :
         {expression::SeriesProgram::Part::kGiven, expression::SeriesProgram::Part::kTried,
          expression::SeriesProgram::Part::kRest, expression::SeriesProgram::Part::kAtOnce}) {
      for (const auto* statement : it.rows().instructions(part)) {
        if (statement->code == expression::SeriesProgram::Code::kLinear) continue;
        nonlinear.push_back(static_cast<int>(part) * 100 + static_cast<int>(statement->code));
      }
    }
    std::sort(nonlinear.begin(), nonlinear.end());
    append(&nonlinear, {it.K, it.HOLDS, it.TRANSMITS, it.WATCHED, it.IS_CURVED, it.IS_COUPLED,
                        it.INERTIA_VARIES, it.IS_GENERAL, it.HAS_RESIDUAL, it.HAS_NEUTRAL,
                        it.JUMPS_STRAIGHT, it.SIGNS, it.TABLES, it.EVENTS, it.SCENE_ORDER});
    append(&nonlinear, it.is_neutral.values);
  }
  bool isLike(const Form& other) const {
    return nonlinear == other.nonlinear && fixed == other.fixed;
  }
  bool operator==(const Form& other) const {
    return structure == other.structure && holds == other.holds && fixed == other.fixed;
  }

  std::string structure;
  std::vector<int> holds;
  std::vector<int> nonlinear;
  std::vector<double> fixed;
};

/// Programs of the scene with other numbers.
class FmuParameters::Trials {
 public:
  // (Where a scene has parts, paths lead into these.)
  Trials(const Scene& scene, const MakeProgram& make)
      : tree_(scene.with_parts.kind() == ParameterTree::Kind::kNothing ? scene.resolved
                                                                       : scene.with_parts),
        make_(make) {
    setValue(tree_, "verify_derivatives", ParameterTree::boolean(false));
  }
  /// Returns nullptr where the scene's reader refuses a number.
  std::unique_ptr<MotionProgram> make(const std::map<std::string, double>& replaced,
                                      std::map<std::string, double>* numbers = nullptr,
                                      std::map<std::string, Range>* ranges = nullptr) {
    ParameterTree tree = tree_;
    BuiltinComponentFactory factory;
    std::unique_ptr<MotionProgram> made;
    try {
      for (const auto& [path, value] : replaced) setValue(tree, path, ParameterTree::real(value));
      ParameterReader::noteNumbers(numbers, ranges);
      made = make_(readScene(tree, factory));
    } catch (const std::exception&) {
    }
    ParameterReader::noteNumbers(nullptr);
    return made;
  }
  std::map<std::string, double> with(const std::string& path, double value) const {
    std::map<std::string, double> made = values;
    made[path] = value;
    return made;
  }
  std::map<std::string, double> values;  ///< of the text

 private:
  ParameterTree tree_;
  const MakeProgram& make_;
};

std::vector<double> FmuParameters::numbersOf(const MotionProgram& program) {
  std::vector<double> made = {program.RELATIVE_TOLERANCE, program.ABSOLUTE_TOLERANCE,
                              program.MAXIMUM_STEP, program.DECAY};
  append(&made, program.rows().numbers());
  for (const auto& list : {program.coupling, program.constant_value, program.restitution,
                           program.closes_below, program.parameter_of}) {
    append(&made, list.values);
  }
  for (const expression::SeriesOperation& it : program.resolved.values) made.push_back(it.f);
  for (const expression::SeriesOperation& it : program.resolved.values) made.push_back(it.g);
  return made;
}

FmuParameters::FmuParameters(const Scene& scene, const MakeProgram& make) {
  program_ = make(scene);
  Trials trials(scene, make);
  std::map<std::string, double> numbers;
  std::map<std::string, Range> ranges;
  const std::unique_ptr<MotionProgram> same = trials.make({}, &numbers, &ranges);
  addTolerances(scene.solver);
  // (Scenes with elements of other packages cannot be read again here.)
  if (same == nullptr || !Form(*same).isLike(Form(*program_))) return;
  const Form form(*same);
  double part = 0.0;
  std::set<std::string> derived;  // defaults that follow from other numbers
  for (const auto& [path, number] : numbers) {
    const bool is_other = path.find('[') != std::string::npos || path.rfind("solver/", 0) == 0 ||
                          path.rfind("initial/", 0) == 0 ||
                          (program_->IS_COUPLED != 0 && path.find("/inertia") != std::string::npos);
    if (is_other) continue;
    part = std::fmod(part + 0.6180339887498949, 1.0);
    for (const double sign : {1.0, -1.0}) {
      const double change = 0.01 + 0.01 * part;
      const double value = number == 0.0 ? 0.3 + change : number * (1.0 + sign * change);
      if (!ranges[path].contains(value)) continue;
      std::map<std::string, double> beside;
      const std::unique_ptr<MotionProgram> other = trials.make({{path, value}}, &beside);
      for (const auto& [name, then] : beside) {
        const auto before = numbers.find(name);
        const bool is_same = before != numbers.end() && before->second == then;
        if (name != path && !is_same) derived.insert(name);
      }
      if (other == nullptr || !Form(*other).isLike(form)) continue;
      trials.values[path] = value;
      list_.push_back({path, number, ranges[path], false});
      break;
    }
  }
  for (const std::string& path : derived) {
    trials.values.erase(path);
    list_.erase(std::remove_if(list_.begin(), list_.end(),
                               [&](const Parameter& it) { return it.path == path; }),
                list_.end());
  }
  while (!findPowers(trials)) {
  }
}

void FmuParameters::addTolerances(const SolverSettings& solver) {
  list_ = {
      {"solver/relative_tolerance", solver.relative_tolerance, Range::between(1e-14, 0.1), false},
      {"solver/absolute_tolerance", solver.absolute_tolerance, Range::notNegative(), false},
      {"solver/maximum_step", solver.maximum_step, Range::positive("s"), false}};
  for (const int n : {0, 1, 2}) dependents_.push_back({n, 1.0, {{n, 1}}});
}

/// Returns the exponents of parameter i in the numbers, none where it is no parameter. Far values
/// and another sign are tried, too: a law may choose its form by them.
std::vector<int> FmuParameters::findExponents(Trials& trials, const Form& form,
                                              const std::vector<double>& whole,
                                              Parameter* parameter) const {
  const double value = trials.values[parameter->path];
  std::vector<int> exponents;
  int found = 0;
  for (const double ratio : {1.25, 0.8, 7.3, 0.13, -1.0}) {
    if (!parameter->range.contains(value * ratio)) continue;
    const std::unique_ptr<MotionProgram> other =
        trials.make(trials.with(parameter->path, value * ratio));
    if (other == nullptr) continue;
    bool follows = Form(*other) == form;
    const std::vector<double> numbers = follows ? numbersOf(*other) : whole;
    for (std::size_t j = 0; j < whole.size() && follows; ++j) {
      const bool is_same =
          numbers[j] == whole[j] || (std::isnan(numbers[j]) && std::isnan(whole[j]));
      const double growth = is_same ? 1.0 : numbers[j] / whole[j];
      if (found == 0) {
        const double e = std::round(std::log(growth) / std::log(ratio));
        exponents.push_back(std::abs(e) <= 4.0 ? static_cast<int>(e) : 0);
      }
      const double expected = raise(1.0, ratio, exponents[j]);
      follows = std::abs(growth - expected) <= 1e-12 * std::abs(expected);
    }
    if (!follows && ratio > 0.0) return {};
    if (!follows) {
      (value > 0.0 ? parameter->range.minimum : parameter->range.maximum) = 0.0;
      parameter->is_never_zero = true;
    }
    ++found;
  }
  return found < 2 ? std::vector<int>{} : exponents;
}

/// Finds the exponents; false where a number of the scene proves to be none of the parameters, and
/// is taken from the list.
bool FmuParameters::findPowers(Trials& trials) {
  dependents_.resize(kTolerances);
  std::unique_ptr<MotionProgram> text = trials.make(trials.values);
  if (text == nullptr) {
    list_.resize(kTolerances);
    return true;
  }
  const Form form(*text);
  const std::vector<double> whole = numbersOf(*text);
  std::vector<std::vector<std::pair<int, int>>> powers(whole.size());
  std::vector<std::string> refused;
  std::vector<Parameter> kept(list_.begin(), list_.begin() + kTolerances);
  for (std::size_t i = kTolerances; i < list_.size(); ++i) {
    Parameter& parameter = list_[i];
    const std::vector<int> exponents = findExponents(trials, form, whole, &parameter);
    bool acts = false;
    for (std::size_t j = 0; j < exponents.size(); ++j) {
      if (exponents[j] == 0) continue;
      acts = true;
      powers[j].emplace_back(static_cast<int>(kept.size()), exponents[j]);
      parameter.is_never_zero = parameter.is_never_zero || exponents[j] < 0;
    }
    if (!acts) {
      refused.push_back(parameter.path);
      continue;
    }
    const std::unique_ptr<MotionProgram> zero =
        parameter.range.contains(0.0) ? trials.make(trials.with(parameter.path, 0.0)) : nullptr;
    if (zero == nullptr || !Form(*zero).isLike(form)) parameter.is_never_zero = true;
    kept.push_back(parameter);
  }
  list_ = std::move(kept);
  for (const std::string& path : refused) trials.values.erase(path);
  if (!refused.empty()) return false;
  for (std::size_t j = 0; j < whole.size(); ++j) {
    if (powers[j].empty()) continue;
    double product = 1.0;
    for (const auto& [i, e] : powers[j]) {
      product = raise(product, trials.values[list_[static_cast<std::size_t>(i)].path], e);
    }
    dependents_.push_back(
        {static_cast<int>(j), snap(whole[j] / product, product, whole[j]), std::move(powers[j])});
  }
  program_ = std::move(text);
  return true;
}

}  // namespace variator_sim
