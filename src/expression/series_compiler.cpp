#include "expression/series_compiler.h"

#include <cmath>
#include <iterator>
#include <stdexcept>

#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {

void SeriesCompiler::compile(const std::vector<Node>& trial, const std::vector<Node>& others,
                             const std::vector<int>& slots) {
  for (const int slot : slots) {
    const bool is_acceleration = sourceOf(slot) == Source::kAcceleration;
    // Multipliers, in the slots of jerks and of elements that hold, are found with the
    // accelerations.
    const bool is_multiplier = sourceOf(slot) == Source::kJerk ||
                               (sourceOf(slot) == Source::kHeld &&
                                indexOf(slot) < heldSlot(HeldValue::kMultiplier, kMaxHolds));
    const bool is_accelerated = is_acceleration || is_multiplier;
    const int degree = slot == slotOf(Source::kTime) ? 1 : SeriesProgram::kNoDegree;
    row_of_slot_[slot] = addRow(degree, is_accelerated);
    made_.variables_.push_back(row_of_slot_[slot]);
    if (is_acceleration) made_.accelerations_.push_back(row_of_slot_[slot]);
  }
  std::vector<Node> outputs = trial;
  outputs.insert(outputs.end(), others.begin(), others.end());
  forms_.resize(static_cast<std::size_t>(graph_.size()));
  for (const int i : graph_.listReachable(outputs)) {
    forms_[static_cast<std::size_t>(i)] = makeForm(graph_.entry({i}));
  }
  for (const Node output : outputs) {
    made_.outputs_.push_back(rowOf(forms_[static_cast<std::size_t>(output.index)]));
  }
  made_.listResolved();
  findPlaces();
  const std::vector<bool> needed = made_.findNeeded(
      {made_.outputs_.begin(), made_.outputs_.begin() + static_cast<std::ptrdiff_t>(trial.size())});
  for (std::size_t i = 0; i < needed.size(); ++i) made_.instructions_[i].is_tried = needed[i];
}

int SeriesCompiler::addRow(int degree, bool is_accelerated) {
  made_.degree_.push_back(degree);
  made_.accelerated_.push_back(is_accelerated ? 1 : 0);
  made_.has_pole_.push_back(false);
  return static_cast<int>(made_.degree_.size()) - 1;
}

int SeriesCompiler::append(Instruction it, int degree) {
  const std::vector<int> read = made_.rowsReadBy(it);
  const bool is_accelerated =
      std::any_of(read.begin(), read.end(), [&](int row) { return made_.isAccelerated(row); });
  it.result = addRow(degree, is_accelerated);
  made_.has_pole_.back() = mayHavePole(it);
  made_.instructions_.push_back(it);
  return it.result;
}

bool SeriesCompiler::mayHavePole(const Instruction& it) const {
  if (it.code == Code::kDivide || it.code == Code::kPower || it.code == Code::kTan ||
      it.code == Code::kLog) {
    return true;
  }
  const std::vector<int> read = made_.rowsReadBy(it);
  return std::any_of(read.begin(), read.end(),
                     [&](int row) { return made_.has_pole_[static_cast<std::size_t>(row)]; });
}

int SeriesCompiler::constantRow(double value) {
  if (std::isnan(value)) throw std::invalid_argument("a constant that is no number");
  const auto [found, is_new] = row_of_constant_.try_emplace(value, -1);
  if (is_new) {
    found->second = addRow(0, false);
    made_.constants_.emplace_back(found->second, value);
  }
  return found->second;
}

int SeriesCompiler::rowOf(Form& form) {
  if (form.terms.empty()) return constantRow(form.constant);
  if (form.terms.size() == 1 && form.constant == 0.0 && form.terms[0].factor == 1.0) {
    return form.terms[0].row;
  }
  Instruction it = instruction(Code::kLinear, {});
  it.constant = form.constant;
  it.aux[0] = static_cast<int>(made_.terms_.size());
  it.aux[1] = static_cast<int>(form.terms.size());
  int highest = 0;
  for (const Term& term : form.terms) {
    made_.terms_.push_back(term);
    highest = std::max(highest, degree(term.row));
  }
  const int row = append(it, highest);
  form = Form{0.0, {{row, 1.0}}};
  return row;
}

SeriesCompiler::Form SeriesCompiler::combine(const Form& a, double ka, const Form& b, double kb) {
  Form sum;
  sum.constant = ka * a.constant + kb * b.constant;
  for (const Term& term : a.terms) sum.terms.push_back({term.row, ka * term.factor});
  for (const Term& term : b.terms) {
    const auto same = std::find_if(sum.terms.begin(), sum.terms.end(),
                                   [&](const Term& it) { return it.row == term.row; });
    if (same == sum.terms.end()) {
      sum.terms.push_back({term.row, kb * term.factor});
    } else {
      same->factor += kb * term.factor;
    }
  }
  return sum;
}

double SeriesCompiler::takeFactor(Form& form, int* row) {
  if (form.terms.size() == 1 && form.constant == 0.0) {
    *row = form.terms[0].row;
    return form.terms[0].factor;
  }
  *row = rowOf(form);
  return 1.0;
}

SeriesCompiler::Form SeriesCompiler::makeForm(const Graph::Entry& entry) {
  const auto form = [&](int k) -> Form& {
    return forms_[static_cast<std::size_t>(entry.operands[k])];
  };
  Form made;
  switch (entry.operation) {
    case Operation::kConstant:
      made.constant = entry.value;
      return made;
    case Operation::kVariable: {
      const auto found = row_of_slot_.find(entry.slot);
      if (found == row_of_slot_.end()) throw std::invalid_argument("a variable without a series");
      return single(found->second);
    }
    case Operation::kNegate:
      return scaled(form(0), -1.0);
    case Operation::kAdd:
      made = combine(form(0), 1.0, form(1), 1.0);
      break;
    case Operation::kSubtract:
      made = combine(form(0), 1.0, form(1), -1.0);
      break;
    case Operation::kMultiply:
      return multiply(form(0), form(1));
    case Operation::kDivide:
      return divide(form(0), form(1));
    case Operation::kPower:
      return power(entry);
    default:
      return function(entry);
  }
  if (made.terms.size() > kMostTerms) return single(rowOf(made));
  return made;
}

SeriesCompiler::Form SeriesCompiler::multiply(Form& a, Form& b) {
  if (a.terms.empty()) return scaled(b, a.constant);
  if (b.terms.empty()) return scaled(a, b.constant);
  int x = -1;
  int y = -1;
  const double factor = takeFactor(a, &x) * takeFactor(b, &y);
  return single(product(x, y), factor);
}

int SeriesCompiler::product(int x, int y) {
  if (x > y) std::swap(x, y);
  int& row = product_of_.try_emplace({x, y}, -1).first->second;
  if (row >= 0) return row;
  const Instruction it =
      x == y ? instruction(Code::kSquare, {x}) : instruction(Code::kMultiply, {x, y});
  const int highest = std::min(degree(x) + degree(y), SeriesProgram::kNoDegree);
  row = append(it, highest);
  return row;
}

SeriesCompiler::Form SeriesCompiler::divide(Form& a, Form& b) {
  if (b.terms.empty()) {
    return scaled(a, 1.0 / b.constant);
  }
  int y = -1;
  double factor = 1.0 / takeFactor(b, &y);
  int x = -1;
  if (a.terms.empty()) {
    factor *= a.constant;
    x = constantRow(1.0);
  } else {
    factor *= takeFactor(a, &x);
  }
  int& row = quotient_of_.try_emplace({x, y}, -1).first->second;
  if (row < 0) row = append(instruction(Code::kDivide, {x, y}), SeriesProgram::kNoDegree);
  return single(row, factor);
}

int SeriesCompiler::multipliedPower(int x, int n) {
  if (n == 1) return x;
  if (n % 2 == 1) return product(multipliedPower(x, n - 1), x);
  const int root = multipliedPower(x, n / 2);
  return product(root, root);
}

SeriesCompiler::Form SeriesCompiler::power(const Graph::Entry& entry) {
  Form& base = forms_[static_cast<std::size_t>(entry.operands[0])];
  Form& exponent = forms_[static_cast<std::size_t>(entry.operands[1])];
  if (exponent.terms.empty()) {
    const double k = exponent.constant;
    if (k == std::trunc(k) && k != 0.0 && std::abs(k) <= kMostMultiplied) {
      Form raised = single(multipliedPower(rowOf(base), static_cast<int>(std::abs(k))));
      Form one;
      one.constant = 1.0;
      return k > 0.0 ? raised : divide(one, raised);
    }
    const int x = rowOf(base);
    Instruction it = instruction(Code::kPower, {x, rate(x)});
    it.constant = k;
    return single(append(it, SeriesProgram::kNoDegree));
  }
  // a^b = exp(b log a)
  Form logarithm;
  if (base.terms.empty()) {
    logarithm.constant = std::log(base.constant);
  } else {
    logarithm = single(primitive(Code::kLog, rowOf(base), -1));
  }
  Form product = multiply(exponent, logarithm);
  return single(exponential(rowOf(product)));
}

void SeriesCompiler::findPlaces() {
  for (Instruction& it : made_.instructions_) {
    // A rate is written one order after its operand.
    it.ends = degree(it.result) + (it.code == Code::kRate ? 1 : 0);
    it.last = it.operands[1] < 0 ? 0 : degree(it.operands[1]);
  }
}

SeriesProgram::SeriesProgram(const Graph& graph, const std::vector<Node>& trial,
                             const std::vector<Node>& others, const std::vector<int>& slots) {
  SeriesCompiler(graph, *this).compile(trial, others, slots);
}

}  // namespace variator_sim::expression
