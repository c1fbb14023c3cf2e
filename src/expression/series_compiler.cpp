// Chooses the rows of a SeriesProgram: sums, differences and constant factors of nodes are gathered
// into one linear form, which gets a row only if a nonlinear operation or an output reads it.
// Constant factors are moved out of products of nodes.
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <map>
#include <stdexcept>
#include <utility>

#include "expression/series_program.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {

class SeriesCompiler {
 public:
  SeriesCompiler(const Graph& graph, SeriesProgram& program) : graph_(graph), made_(program) {}

  void compile(const std::vector<Node>& outputs, const std::vector<int>& slots) {
    for (const int slot : slots) {
      const bool is_acceleration = sourceOf(slot) == Source::kAcceleration;
      // Multipliers, in the slots of jerks and of elements that hold, are found with the
      // accelerations.
      const bool is_multiplier = sourceOf(slot) == Source::kJerk ||
                                 (sourceOf(slot) == Source::kHeld &&
                                  indexOf(slot) < heldSlot(HeldValue::kMultiplier, kMaxHolds));
      const int degree = slot == slotOf(Source::kTime) ? 1 : SeriesProgram::kNoDegree;
      row_of_slot_[slot] = addRow(degree, is_acceleration || is_multiplier);
      made_.variables_.push_back(row_of_slot_[slot]);
      if (is_acceleration) made_.accelerations_.push_back(row_of_slot_[slot]);
    }
    forms_.resize(static_cast<std::size_t>(graph_.size()));
    for (const int i : graph_.listReachable(outputs)) {
      forms_[static_cast<std::size_t>(i)] = makeForm(graph_.entry({i}));
    }
    for (const Node output : outputs) {
      made_.outputs_.push_back(made_.row_of_[output.index] = rowOf(output.index));
    }
  }

 private:
  using Code = SeriesProgram::Code;
  using Instruction = SeriesProgram::Instruction;
  using Term = SeriesProgram::Term;
  /// constant + sum factor row
  struct Form {
    double constant = 0.0;
    std::vector<Term> terms;
  };
  /// Forms with more terms get a row, so that their readers do not repeat them.
  static constexpr std::size_t kMostTerms = 6;
  /// The recurrence of other powers divides by x, which may be 0.
  static constexpr double kMostMultiplied = 1000.0;

  // ----------------------------------------------------------------------------------------- rows
  int degree(int row) const { return made_.degree(row); }
  int addRow(int degree, bool is_accelerated) {
    made_.degree_.push_back(degree);
    made_.accelerated_.push_back(is_accelerated ? 1 : 0);
    made_.has_pole_.push_back(false);
    return made_.rows_++;
  }

  static Instruction instruction(Code code, std::initializer_list<int> operands) {
    Instruction it;
    it.code = code;
    std::copy(operands.begin(), operands.end(), it.operands);
    return it;
  }
  /// Appends an instruction; the kind of its result follows from its operands.
  int append(Instruction it, int degree = SeriesProgram::kNoDegree) {
    const std::vector<int> read = made_.rowsReadBy(it);
    const auto any_is = [&read](const auto& is) {
      return std::any_of(read.begin(), read.end(),
                         [&](int row) { return is[static_cast<std::size_t>(row)] != 0; });
    };
    const bool may_have_pole = it.code == Code::kDivide || it.code == Code::kPower ||
                               it.code == Code::kTan || it.code == Code::kLog ||
                               any_is(made_.has_pole_);
    it.result = addRow(degree, any_is(made_.accelerated_));
    made_.has_pole_.back() = may_have_pole;
    made_.instructions_.push_back(it);
    return it.result;
  }
  /// Appends an instruction with a second result, whose row is its aux[0] then.
  int withSecond(const Instruction& it) {
    const int row = append(it);
    made_.instructions_.back().aux[0] = addRow(SeriesProgram::kNoDegree, made_.isAccelerated(row));
    return row;
  }

  int constantRow(double value) {
    if (std::isnan(value)) throw std::invalid_argument("a constant that is no number");
    const auto [found, is_new] = row_of_constant_.try_emplace(value, -1);
    if (is_new) {
      found->second = addRow(0, false);
      made_.constants_.emplace_back(found->second, value);
    }
    return found->second;
  }
  /// Returns the row of a form; `form` becomes that row.
  int rowOf(Form& form) {
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
    form = single(row);
    return row;
  }
  int rowOf(int node) { return rowOf(forms_[static_cast<std::size_t>(node)]); }

  // ---------------------------------------------------------------------------------------- forms
  /// Returns ka a + kb b.
  static Form combine(const Form& a, double ka, const Form& b, double kb) {
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
  static Form scaled(const Form& form, double by) { return combine(form, by, Form{}, 0.0); }
  static Form single(int row, double factor = 1.0) { return Form{0.0, {{row, factor}}}; }
  /// Removes and returns the factor of a form of one term; returns 1 for others.
  double takeFactor(Form& form, int* row) {
    if (form.terms.size() == 1 && form.constant == 0.0) {
      *row = form.terms[0].row;
      return form.terms[0].factor;
    }
    *row = rowOf(form);
    return 1.0;
  }

  Form makeForm(const Graph::Entry& entry) {
    const auto form = [&](int k) -> Form& {
      return forms_[static_cast<std::size_t>(entry.operands[k])];
    };
    Form made;
    switch (entry.operation) {
      case Operation::kConstant:
        return {entry.value, {}};
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
        return power(form(0), form(1));
      default:
        return single(function(entry));
    }
    if (made.terms.size() > kMostTerms) return single(rowOf(made));
    return made;
  }

  Form multiply(Form& a, Form& b) {
    if (a.terms.empty()) return scaled(b, a.constant);
    if (b.terms.empty()) return scaled(a, b.constant);
    int x = -1;
    int y = -1;
    const double factor = takeFactor(a, &x) * takeFactor(b, &y);
    return single(product(x, y), factor);
  }
  int product(int x, int y) {
    if (x > y) std::swap(x, y);
    int& row = product_of_.try_emplace({x, y}, -1).first->second;
    if (row >= 0) return row;
    const int highest = std::min(degree(x) + degree(y), SeriesProgram::kNoDegree);
    row = append(x == y ? instruction(Code::kSquare, {x}) : instruction(Code::kMultiply, {x, y}),
                 highest);
    return row;
  }

  Form divide(Form& a, Form& b) {
    if (b.terms.empty()) return scaled(a, 1.0 / b.constant);
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
    if (row < 0) row = append(instruction(Code::kDivide, {x, y}));
    return single(row, factor);
  }

  /// Returns the row of x^n by the same products as powerOf.
  int multipliedPower(int x, int n) {
    if (n == 1) return x;
    if (n % 2 == 1) return product(multipliedPower(x, n - 1), x);
    const int root = multipliedPower(x, n / 2);
    return product(root, root);
  }
  Form power(Form& base, Form& exponent) {
    if (exponent.terms.empty()) {
      const double k = exponent.constant;
      if (k == std::trunc(k) && k != 0.0 && std::abs(k) <= kMostMultiplied) {
        Form raised = single(multipliedPower(rowOf(base), static_cast<int>(std::abs(k))));
        Form one = {1.0, {}};
        return k > 0.0 ? raised : divide(one, raised);
      }
      const int x = rowOf(base);
      Instruction it = instruction(Code::kPower, {x, rate(x)});
      it.constant = k;
      return single(append(it));
    }
    // a^b = exp(b log a)
    Form logarithm = base.terms.empty() ? Form{std::log(base.constant), {}}
                                        : single(primitive(Code::kLog, rowOf(base), -1));
    Form product = multiply(exponent, logarithm);
    return single(exponential(rowOf(product)));
  }

  // ------------------------------------- functions: a row, and the rows that its recurrence needs
  /// Returns D of x: its rate, j x_j at j - 1.
  int rate(int x) {
    int& row = rate_of_.try_emplace(x, -1).first->second;
    if (row >= 0) return row;
    const bool is_polynomial = degree(x) < SeriesProgram::kNoDegree;
    row = append(instruction(Code::kRate, {x}),
                 is_polynomial ? std::max(0, degree(x) - 1) : SeriesProgram::kNoDegree);
    return row;
  }
  int exponential(int x) { return append(instruction(Code::kExp, {x, rate(x)})); }

  /// Returns sine or, with `second`, cosine of one argument.
  int pair(Code code, int x, bool second) {
    auto& rows = pair_of_.try_emplace({code, x}, std::pair<int, int>{-1, -1}).first->second;
    if (rows.first < 0) {
      rows.first = withSecond(instruction(code, {x, rate(x)}));
      rows.second = made_.instructions_.back().aux[0];
    }
    return second ? rows.second : rows.first;
  }

  /// Returns log x, atan x, asin x, acos x or atan2(x, y).
  int primitive(Code code, int x, int y) {
    Instruction it = instruction(code, {x, y});
    it.constant = code == Code::kAcos ? -1.0 : 1.0;
    const auto square = [this](int row) { return single(product(row, row)); };
    Form w;
    if (code == Code::kAtan2) {
      // (x y' ..): the rate of atan2(x, y) is (y x' - x y') / (x^2 + y^2)
      it.operands[2] = append(instruction(Code::kWronskian, {y, x, rate(y), rate(x)}));
      w = combine(square(x), 1.0, square(y), 1.0);
    } else if (code == Code::kLog) {
      w = single(x);
    } else {
      w = combine({1.0, {}}, 1.0, square(x), code == Code::kAtan ? 1.0 : -1.0);
    }
    if (code != Code::kAtan2) it.operands[2] = rate(x);
    it.operands[3] = rowOf(w);
    if (code == Code::kAsin || code == Code::kAcos) {
      it.operands[3] = append(instruction(Code::kSqrt, {it.operands[3]}));
    }
    return withSecond(it);
  }

  int function(const Graph::Entry& entry) {
    const int a = rowOf(entry.operands[0]);
    const Code code = codeOf(entry.operation);
    switch (code) {
      case Code::kSinCos:
        return pair(code, a, entry.operation == Operation::kCos);
      case Code::kSinhCosh:
        return pair(code, a, entry.operation == Operation::kCosh);
      case Code::kTan:
      case Code::kTanh:
        return withSecond(instruction(code, {a, rate(a)}));
      case Code::kExp:
        return exponential(a);
      case Code::kLog:
      case Code::kAtan:
      case Code::kAsin:
      case Code::kAcos:
        return primitive(code, a, -1);
      case Code::kAtan2:
        return primitive(code, a, rowOf(entry.operands[1]));
      case Code::kSqrt:
        return append(instruction(code, {a}));
      default:
        return branch(code, entry, a);
    }
  }
  static Code codeOf(Operation operation) {
    static const std::map<Operation, Code> codes = {
        {Operation::kSin, Code::kSinCos},    {Operation::kCos, Code::kSinCos},
        {Operation::kTan, Code::kTan},       {Operation::kAsin, Code::kAsin},
        {Operation::kAcos, Code::kAcos},     {Operation::kAtan, Code::kAtan},
        {Operation::kAtan2, Code::kAtan2},   {Operation::kSinh, Code::kSinhCosh},
        {Operation::kCosh, Code::kSinhCosh}, {Operation::kTanh, Code::kTanh},
        {Operation::kExp, Code::kExp},       {Operation::kLog, Code::kLog},
        {Operation::kSqrt, Code::kSqrt},     {Operation::kAbs, Code::kAbs},
        {Operation::kSign, Code::kSign},     {Operation::kMin, Code::kMin},
        {Operation::kMax, Code::kMax},       {Operation::kTable, Code::kTable},
        {Operation::kTable2, Code::kTable2}, {Operation::kOpaque, Code::kOpaque},
        {Operation::kSelect, Code::kSelect}, {Operation::kWhereFinite, Code::kWhereFinite}};
    return codes.at(operation);
  }

  /// Returns what is another formula on each side of a point, or a function that keeps its place.
  int branch(Code code, const Graph::Entry& entry, int a) {
    Instruction it = instruction(code, {a});
    int highest = degree(a);
    int count = operandCount(entry.operation);
    if (code == Code::kOpaque) {
      it.function = graph_.opaqueOf(entry);
      count = it.function->argumentCount();
    }
    for (int k = 1; k < count; ++k) {
      it.operands[k] = rowOf(entry.operands[k]);
      highest = std::max(highest, degree(it.operands[k]));
    }
    switch (code) {
      case Code::kTable:
      case Code::kTable2:
        return table(it, *graph_.tableOf(entry), entry.order);
      case Code::kOpaque:
        it.piece = made_.pieces_;
        made_.pieces_ += 1 + OpaqueFunction::kMostArguments;
        return append(it);
      case Code::kSign:
        return append(it, 0);
      case Code::kWhereFinite:
        return append(it, highest);
      default:
        it.mode = made_.modes_++;
        return append(it, highest);
    }
  }
  int table(Instruction it, const Table& table, const int (&order)[2]) {
    const bool has_two = it.code == Code::kTable2;
    const int a = it.operands[0];
    it.table = findTable(cut(table, order));
    it.mode = made_.modes_;
    it.piece = made_.pieces_;
    made_.modes_ += has_two ? 4 : 3;
    made_.pieces_ += has_two ? (Table::kDegree + 1) * (Table::kDegree + 1) : Table::kDegree + 1;
    // (A held value is no constant: the next piece has another one.)
    const bool is_polynomial = !has_two && degree(a) <= 4;
    const int row = append(
        it, is_polynomial ? std::max(1, table.degree() * degree(a)) : SeriesProgram::kNoDegree);
    made_.has_pole_.back() = false;
    return row;
  }
  /// Returns the index of a table, which is added unless the same is there.
  int findTable(DenseTable table) {
    std::vector<DenseTable>& all = made_.tables_;
    const auto same = std::find_if(all.begin(), all.end(), [&](const DenseTable& other) {
      return other.points == table.points && other.pieces == table.pieces;
    });
    const auto index = static_cast<int>(same - all.begin());
    if (same == all.end()) all.push_back(std::move(table));
    return index;
  }

  const Graph& graph_;
  SeriesProgram& made_;
  std::vector<Form> forms_;  ///< of the nodes
  std::map<int, int> row_of_slot_;
  std::map<double, int> row_of_constant_;
  std::map<std::pair<int, int>, int> product_of_;
  std::map<std::pair<int, int>, int> quotient_of_;
  std::map<int, int> rate_of_;
  std::map<std::pair<Code, int>, std::pair<int, int>> pair_of_;
};

SeriesProgram::SeriesProgram(const Graph& graph, const std::vector<Node>& outputs,
                             std::size_t tried, std::size_t series, const std::vector<int>& slots) {
  SeriesCompiler(graph, *this).compile(outputs, slots);
  findPlaces(tried, series);
  listResolved();
}

}  // namespace variator_sim::expression
