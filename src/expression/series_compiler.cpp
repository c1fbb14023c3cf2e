// How the rows of a SeriesProgram are chosen: sums, differences and constant factors of nodes are
// gathered into one linear form, which gets a row of its own only where something that is not
// linear, or an output, reads it. A product of nodes with constant factors is that of the nodes.
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "expression/series_program.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {

class SeriesCompiler {
 public:
  SeriesCompiler(const Graph& graph, SeriesProgram& program) : graph_(graph), made_(program) {}

  void compile(const std::vector<Node>& trial, const std::vector<Node>& others,
               const std::vector<int>& slots, int order) {
    made_.capacity_ = (order + 1 + 3) / 4 * 4 + SeriesProgram::kPad;
    made_.width_ = static_cast<std::size_t>(made_.capacity_);
    for (const int slot : slots) {
      const bool is_accelerated = sourceOf(slot) == Source::kAcceleration;
      const int degree = slot == slotOf(Source::kTime) ? 1 : SeriesProgram::kNoDegree;
      row_of_slot_[slot] = addRow(degree, is_accelerated);
      made_.variables_.push_back(row_of_slot_[slot]);
      if (is_accelerated) made_.accelerations_.push_back(row_of_slot_[slot]);
    }
    std::vector<Node> outputs = trial;
    outputs.insert(outputs.end(), others.begin(), others.end());
    const std::vector<bool> reachable = graph_.findReachable(outputs);
    forms_.resize(reachable.size());
    for (std::size_t i = 0; i < reachable.size(); ++i) {
      if (reachable[i]) forms_[i] = makeForm(graph_.entry({static_cast<int>(i)}));
    }
    for (const Node output : outputs) {
      made_.outputs_.push_back(rowOf(forms_[static_cast<std::size_t>(output.index)]));
    }
    findPrograms(trial.size());
    made_.rows_.assign(made_.degree_.size() * 2 * made_.width_, 0.0);
    made_.changes_.assign(made_.degree_.size(), 0.0);
    made_.clear();
  }

 private:
  using Code = SeriesProgram::Code;
  using Begin = SeriesProgram::Begin;
  using Instruction = SeriesProgram::Instruction;
  using Term = SeriesProgram::Term;
  /// constant + sum factor row
  struct Form {
    double constant = 0.0;
    std::vector<Term> terms;
  };
  /// Forms with more terms get a row, so that what reads them does not repeat them.
  static constexpr std::size_t kMostTerms = 6;

  int addRow(int degree, bool is_accelerated) {
    made_.degree_.push_back(degree);
    made_.accelerated_.push_back(is_accelerated);
    made_.has_pole_.push_back(false);
    producer_.push_back(-1);
    return static_cast<int>(made_.degree_.size()) - 1;
  }
  int degree(int row) const { return made_.degree(row); }

  /// Appends an instruction; what it writes depends on what it reads.
  int append(Instruction it, std::initializer_list<int*> results, int degree) {
    bool is_accelerated = false;
    for (const int operand : it.operands) {
      is_accelerated = is_accelerated || (operand >= 0 && made_.isAccelerated(operand));
    }
    if (it.code == Code::kLinear) {
      for (int n = 0; n < it.aux[1]; ++n) {
        const int row =
            made_.terms_[static_cast<std::size_t>(it.aux[0]) + static_cast<std::size_t>(n)].row;
        is_accelerated = is_accelerated || made_.isAccelerated(row);
      }
    }
    it.result = addRow(degree, is_accelerated);
    made_.has_pole_.back() = mayHavePole(it);
    std::vector<int> written = {it.result};
    for (int* const result : results) {
      *result = addRow(SeriesProgram::kNoDegree, is_accelerated);
      written.push_back(*result);
    }
    return place(it, written);
  }
  bool mayHavePole(const Instruction& it) const {
    if (it.code == Code::kDivide || it.code == Code::kPower || it.code == Code::kTan ||
        (it.code == Code::kPrimitive && it.begin == Begin::kLog)) {
      return true;
    }
    const auto has_pole = [&](int row) {
      return row >= 0 && made_.has_pole_[static_cast<std::size_t>(row)];
    };
    bool found = std::any_of(std::begin(it.operands), std::end(it.operands), has_pole);
    for (int n = 0; it.code == Code::kLinear && n < it.aux[1]; ++n) {
      found =
          found ||
          has_pole(
              made_.terms_[static_cast<std::size_t>(it.aux[0]) + static_cast<std::size_t>(n)].row);
    }
    return found;
  }
  int place(const Instruction& it, const std::vector<int>& written) {
    for (const int row : written) {
      producer_[static_cast<std::size_t>(row)] = static_cast<int>(made_.instructions_.size());
    }
    if (SeriesProgram::mayBeFlat(it)) {
      made_.flat_.push_back(static_cast<int>(made_.instructions_.size()));
    }
    made_.instructions_.push_back(it);
    return it.result;
  }
  int addState() {
    made_.states_.push_back(0.0);
    return static_cast<int>(made_.states_.size()) - 1;
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

  /// The row of a form; `form` is that row from then on.
  int rowOf(Form& form) {
    if (form.terms.empty()) return constantRow(form.constant);
    if (form.terms.size() == 1 && form.constant == 0.0 && form.terms[0].factor == 1.0) {
      return form.terms[0].row;
    }
    Instruction it;
    it.code = Code::kLinear;
    it.constant = form.constant;
    it.aux[0] = static_cast<int>(made_.terms_.size());
    it.aux[1] = static_cast<int>(form.terms.size());
    int highest = 0;
    for (const Term& term : form.terms) {
      made_.terms_.push_back(term);
      highest = std::max(highest, degree(term.row));
    }
    const int row = append(it, {}, highest);
    form = Form{0.0, {{row, 1.0}}};
    return row;
  }
  int rowOf(int node) { return rowOf(forms_[static_cast<std::size_t>(node)]); }

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
  /// The factor of a form of one term, which is left without it; 1 of others.
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
    Instruction it;
    it.code = x == y ? Code::kSquare : Code::kMultiply;
    it.operands[0] = x;
    it.operands[1] = x == y ? -1 : y;
    const int highest = std::min(degree(x) + degree(y), SeriesProgram::kNoDegree);
    row = append(it, {}, highest);
    return row;
  }
  Form divide(Form& a, Form& b) {
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
    if (row < 0) {
      Instruction it;
      it.code = Code::kDivide;
      it.operands[0] = x;
      it.operands[1] = y;
      it.state = addState();
      row = append(it, {}, SeriesProgram::kNoDegree);
    }
    return single(row, factor);
  }

  /// The recurrence of other powers divides by x, which may be 0.
  static constexpr double kMostMultiplied = 1000.0;

  /// x^n by the same products as powerOf.
  int multipliedPower(int x, int n) {
    if (n == 1) return x;
    if (n % 2 == 1) return product(multipliedPower(x, n - 1), x);
    const int root = multipliedPower(x, n / 2);
    return product(root, root);
  }
  Form power(const Graph::Entry& entry) {
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
      Instruction it;
      it.code = Code::kPower;
      it.operands[0] = rowOf(base);
      it.operands[1] = rate(it.operands[0]);
      it.constant = k;
      return single(append(it, {}, SeriesProgram::kNoDegree));
    }
    // a^b = exp(b log a)
    Form logarithm;
    if (base.terms.empty()) {
      logarithm.constant = std::log(base.constant);
    } else {
      logarithm = single(primitive(Begin::kLog, rowOf(base), -1));
    }
    Form product = multiply(exponent, logarithm);
    return single(exponential(rowOf(product)));
  }

  /// D of x: its rate, j x_j at j - 1.
  int rate(int x) {
    int& row = rate_of_.try_emplace(x, -1).first->second;
    if (row >= 0) return row;
    Instruction it;
    it.code = Code::kRate;
    it.operands[0] = x;
    const bool is_polynomial = degree(x) < SeriesProgram::kNoDegree;
    row = append(it, {}, is_polynomial ? std::max(0, degree(x) - 1) : SeriesProgram::kNoDegree);
    return row;
  }
  int exponential(int x) {
    Instruction it;
    it.code = Code::kExp;
    it.operands[0] = x;
    it.operands[1] = rate(x);
    return append(it, {}, SeriesProgram::kNoDegree);
  }
  /// Sine and cosine of one argument; `second` tells which is asked for.
  int pair(Code code, int x, bool second) {
    auto& rows = pair_of_.try_emplace({code, x}, std::pair<int, int>{-1, -1}).first->second;
    if (rows.first < 0) {
      Instruction it;
      it.code = code;
      it.operands[0] = x;
      it.operands[1] = rate(x);
      int other = -1;
      rows.first = append(it, {&other}, SeriesProgram::kNoDegree);
      made_.instructions_.back().aux[0] = rows.second = other;
    }
    return second ? rows.second : rows.first;
  }
  int tangent(Code code, int x) {
    Instruction it;
    it.code = code;
    it.operands[0] = x;
    it.operands[1] = rate(x);
    int w = -1;
    const int row = append(it, {&w}, SeriesProgram::kNoDegree);
    made_.instructions_.back().aux[0] = w;
    return row;
  }
  /// log x, atan x, asin x, acos x, atan2(x, y).
  int primitive(Begin begin, int x, int y) {
    Instruction it;
    it.code = Code::kPrimitive;
    it.begin = begin;
    it.operands[0] = x;
    it.operands[1] = y;
    it.constant = begin == Begin::kAcos ? -1.0 : 1.0;
    Form one;
    one.constant = 1.0;
    const auto square = [this](int row) { return single(product(row, row)); };
    switch (begin) {
      case Begin::kLog:
        it.operands[2] = rate(x);
        it.operands[3] = x;
        break;
      case Begin::kAtan: {
        Form w = combine(one, 1.0, square(x), 1.0);
        it.operands[2] = rate(x);
        it.operands[3] = rowOf(w);
        break;
      }
      case Begin::kAsin:
      case Begin::kAcos: {
        Form w = combine(one, 1.0, square(x), -1.0);
        it.operands[2] = rate(x);
        it.operands[3] = root(rowOf(w));
        break;
      }
      case Begin::kAtan2: {
        // (x y' ..): of atan2(x, y) the rate is (y x' - x y') / (x^2 + y^2)
        Instruction wronskian;
        wronskian.code = Code::kWronskian;
        wronskian.operands[0] = y;
        wronskian.operands[1] = x;
        wronskian.operands[2] = rate(y);
        wronskian.operands[3] = rate(x);
        it.operands[2] = append(wronskian, {}, SeriesProgram::kNoDegree);
        Form w = combine(square(x), 1.0, square(y), 1.0);
        it.operands[3] = rowOf(w);
        break;
      }
    }
    int q = -1;
    const int row = append(it, {&q}, SeriesProgram::kNoDegree);
    made_.instructions_.back().aux[0] = q;
    return row;
  }
  int root(int x) {
    Instruction it;
    it.code = Code::kSqrt;
    it.operands[0] = x;
    return append(it, {}, SeriesProgram::kNoDegree);
  }

  Form function(const Graph::Entry& entry) {
    const int a = rowOf(entry.operands[0]);
    switch (entry.operation) {
      case Operation::kSin:
      case Operation::kCos:
        return single(pair(Code::kSinCos, a, entry.operation == Operation::kCos));
      case Operation::kSinh:
      case Operation::kCosh:
        return single(pair(Code::kSinhCosh, a, entry.operation == Operation::kCosh));
      case Operation::kTan:
        return single(tangent(Code::kTan, a));
      case Operation::kTanh:
        return single(tangent(Code::kTanh, a));
      case Operation::kExp:
        return single(exponential(a));
      case Operation::kLog:
        return single(primitive(Begin::kLog, a, -1));
      case Operation::kAtan:
        return single(primitive(Begin::kAtan, a, -1));
      case Operation::kAsin:
        return single(primitive(Begin::kAsin, a, -1));
      case Operation::kAcos:
        return single(primitive(Begin::kAcos, a, -1));
      case Operation::kAtan2:
        return single(primitive(Begin::kAtan2, a, rowOf(entry.operands[1])));
      case Operation::kSqrt:
        return single(root(a));
      case Operation::kTable:
      case Operation::kTable2:
        return single(table(entry, a));
      default:
        return single(branch(entry, a));
    }
  }
  int branch(const Graph::Entry& entry, int a) {
    Instruction it;
    switch (entry.operation) {
      case Operation::kAbs:
        it.code = Code::kAbs;
        break;
      case Operation::kSign:
        it.code = Code::kSign;
        break;
      case Operation::kMin:
        it.code = Code::kMin;
        break;
      case Operation::kMax:
        it.code = Code::kMax;
        break;
      case Operation::kSelect:
        it.code = Code::kSelect;
        break;
      case Operation::kWhereFinite:
        it.code = Code::kWhereFinite;
        break;
      default:
        throw std::invalid_argument("a function without a series");
    }
    it.operands[0] = a;
    int highest = degree(a);
    for (int k = 1; k < operandCount(entry.operation); ++k) {
      it.operands[k] = rowOf(entry.operands[k]);
      highest = std::max(highest, degree(it.operands[k]));
    }
    it.state = addState();
    return append(it, {}, entry.operation == Operation::kSign ? 0 : highest);
  }
  int table(const Graph::Entry& entry, int a) {
    SeriesProgram::Piece piece;
    const bool has_two = entry.operation == Operation::kTable2;
    Instruction it;
    it.operands[0] = a;
    std::vector<int> written;
    const auto reserve = [&](int* rows, int first, int last, bool is_accelerated) {
      for (int i = first; i <= last; ++i) {
        rows[i] = addRow(SeriesProgram::kNoDegree, is_accelerated);
        written.push_back(rows[i]);
      }
    };
    piece.order[0] = entry.order[0];
    piece.order[1] = entry.order[1];
    piece.degree[0] = Table::kDegree - entry.order[0];
    piece.degree[1] = has_two ? Table::kDegree - entry.order[1] : 0;
    bool is_accelerated = made_.isAccelerated(a);
    if (has_two) {
      it.code = Code::kTable2;
      it.operands[1] = rowOf(entry.operands[1]);
      is_accelerated = is_accelerated || made_.isAccelerated(it.operands[1]);
      piece.table2 = graph_.table2Of(entry);
      reserve(piece.powers_y, 2, piece.degree[1], is_accelerated);
      reserve(piece.sums, 1, piece.degree[0], is_accelerated);
    } else {
      it.code = Code::kTable;
      piece.table = graph_.tableOf(entry);
    }
    reserve(piece.powers_x, 2, piece.degree[0], is_accelerated);
    piece.a = static_cast<int>(made_.states_.size());
    made_.states_.resize(made_.states_.size() + 36, 0.0);
    it.state = static_cast<int>(made_.pieces_.size());
    made_.pieces_.push_back(piece);
    it.result = addRow(SeriesProgram::kNoDegree, is_accelerated);
    written.push_back(it.result);
    return place(it, written);
  }

  /// The first `count` outputs are those of the trial.
  void findPrograms(std::size_t count) {
    std::vector<bool> needed(made_.instructions_.size(), false);
    std::vector<int> open(made_.outputs_.begin(),
                          made_.outputs_.begin() + static_cast<std::ptrdiff_t>(count));
    while (!open.empty()) {
      const int row = open.back();
      open.pop_back();
      const int index = row < 0 ? -1 : producer_[static_cast<std::size_t>(row)];
      if (index < 0 || needed[static_cast<std::size_t>(index)]) continue;
      needed[static_cast<std::size_t>(index)] = true;
      const Instruction& it = made_.instructions_[static_cast<std::size_t>(index)];
      open.insert(open.end(), std::begin(it.operands), std::end(it.operands));
      for (int n = 0; it.code == Code::kLinear && n < it.aux[1]; ++n) {
        open.push_back(
            made_.terms_[static_cast<std::size_t>(it.aux[0]) + static_cast<std::size_t>(n)].row);
      }
    }
    for (std::size_t i = 0; i < needed.size(); ++i) {
      const bool is_accelerated = made_.isAccelerated(made_.instructions_[i].result);
      const int index = static_cast<int>(i);
      made_.instructions_[i].is_tried = needed[i];
      if (!is_accelerated) made_.programs_[0].push_back(index);
      if (is_accelerated && needed[i]) made_.programs_[1].push_back(index);
      if (is_accelerated) made_.programs_[2].push_back(index);
    }
  }

  const Graph& graph_;
  SeriesProgram& made_;
  std::vector<Form> forms_;    ///< of the nodes
  std::vector<int> producer_;  ///< the instruction that writes a row, or -1
  std::map<int, int> row_of_slot_;
  std::map<double, int> row_of_constant_;
  std::map<std::pair<int, int>, int> product_of_;
  std::map<std::pair<int, int>, int> quotient_of_;
  std::map<int, int> rate_of_;
  std::map<std::pair<Code, int>, std::pair<int, int>> pair_of_;
};

SeriesProgram::SeriesProgram(const Graph& graph, const std::vector<Node>& trial,
                             const std::vector<Node>& others, const std::vector<int>& slots,
                             int order) {
  SeriesCompiler(graph, *this).compile(trial, others, slots, order);
}

}  // namespace variator_sim::expression
