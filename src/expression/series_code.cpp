// A SeriesProgram as C: the same operations in the same order, so that they make the same bits.
// Order 0 remains interpreted if it looks up tables.
#include <set>
#include <sstream>

#include "expression/c_code.h"
#include "expression/series_program.h"
#include "expression/series_text.h"

namespace variator_sim::expression {

std::string SeriesProgram::codePrelude() {
  return std::string(kSeriesSineText) + R"c(
typedef double Four __attribute__((vector_size(32)));
/* a b + c, rounded once where the processor does that. */
#if defined(__x86_64__) && !(defined(__FMA__) && defined(__AVX2__))
#undef FUSES
#endif
#ifdef FUSES
static inline double fuse(double a, double b, double c) { return __builtin_fma(a, b, c); }
#else
static inline double fuse(double a, double b, double c) { return a * b + c; }
#endif
static inline __attribute__((always_inline)) void store(double* to, Four values) {
  __builtin_memcpy(to, &values, sizeof values);
}
#define SERIES_HAS_FOURS
static inline Four fuseFour(Four a, Four b, Four c) {
#if defined(FUSES) && defined(__clang__)
#pragma clang fp contract(fast)
  return a * b + c;
#elif defined(FUSES) && defined(__x86_64__)
  return __builtin_ia32_vfmaddpd256(a, b, c);
#elif defined(FUSES)
  for (int j = 0; j < 4; ++j) c[j] = fuse(a[j], b[j], c[j]);
  return c;
#else
  return a * b + c;
#endif
}
static inline __attribute__((always_inline)) Four load(const double* from) {
  Four values;
  __builtin_memcpy(&values, from, sizeof values);
  return values;
}
/* sum of a[j] b[j] for j < count, every fourth term into one of four sums; those without a term are left out */
static inline __attribute__((always_inline)) double dot(const double* a, const double* b, int count) {
  if (count < 8) {
    double s0, s1, s2, s3;
    if (count < 1) return 0.0;
    s0 = a[0] * b[0];
    if (count < 2) return s0;
    if (count > 4) s0 = fuse(a[4], b[4], s0);
    s1 = a[1] * b[1];
    if (count < 3) return s0 + s1;
    if (count > 5) s1 = fuse(a[5], b[5], s1);
    s2 = a[2] * b[2];
    if (count < 4) return (s0 + s2) + s1;
    if (count > 6) s2 = fuse(a[6], b[6], s2);
    s3 = a[3] * b[3];
    return (s0 + s2) + (s1 + s3);
  }
  Four sum = load(a) * load(b);
  int j = 4;
  for (; j + 4 <= count; j += 4) sum = fuseFour(load(a + j), load(b + j), sum);
  double s0 = sum[0], s1 = sum[1], s2 = sum[2];
  if (j < count) s0 = fuse(a[j], b[j], s0);
  if (j + 1 < count) s1 = fuse(a[j + 1], b[j + 1], s1);
  if (j + 2 < count) s2 = fuse(a[j + 2], b[j + 2], s2);
  return (s0 + s2) + (s1 + sum[3]);
}
static inline __attribute__((always_inline)) double between(const double* a, const double* b, int low, int high) {
  return low > high ? 0.0 : dot(a + low, b + low, high - low + 1);
}
static inline int least(int a, int b) { return a < b ? a : b; }
static inline __attribute__((always_inline)) double rates(const double* rate, const double* back, double first, int n, int degree) {
  const double sum = dot(rate, back - (n - 1), least(n - 1, degree + 1));
  return n - 1 > degree ? sum : fuse(rate[n - 1], first, sum);
}
static inline __attribute__((always_inline)) double squareOf(const double* x, const double* back, int n) {
  double sum = 2.0 * dot(x + 1, back - (n - 1), (n - 1) / 2);
  if (n % 2 == 0) sum = fuse(x[n / 2], x[n / 2], sum);
  return fuse(2.0 * x[0], x[n], sum);
}
static inline int most(int a, int b) { return a > b ? a : b; }
static const double zero = 0.0;
#define BACKWARD(row, mirror, n) (r + (mirror) - (n))
static inline int overflows(double from, double to) { return isinf(from) && isfinite(to); }
static inline double sideOf(double a, double b) { return a < b ? -1.0 : a > b ? 1.0 : a - b; }
)c";
}

class SeriesWriter {
 public:
  SeriesWriter(const SeriesProgram& program, std::set<int>* mirrored)
      : program_(program), mirrored_(*mirrored) {}

  std::string write(SeriesProgram::Part part) {
    const bool corrects = part == SeriesProgram::Part::kAccelerated;
    for (const int row : program_.accelerations_) {
      if (corrects) text_ << "  const double " << change(row) << " = " << coefficient(row) << ";\n";
    }
    for (const int index : program_.programs_[static_cast<std::size_t>(part)]) {
      const Instruction& it = program_.instructions_[static_cast<std::size_t>(index)];
      if (corrects && it.is_tried) {
        correct(it);
      } else {
        write(it);
      }
    }
    return text_.str();
  }

  std::string begin(SeriesProgram::Part part) {
    for (const int index : program_.programs_[static_cast<std::size_t>(part)]) {
      begin(program_.instructions_[static_cast<std::size_t>(index)]);
    }
    return text_.str();
  }

  /// Writes sum_{0 < j < n} a_j b_{n-j}: SeriesInterpreter's products; convolveOld.
  std::string convolveInside(int a, int b) const {
    std::string low = "1";
    std::string high = "n - 1";
    if (isPolynomial(b)) low = "most(1, n - " + std::to_string(program_.degree(b)) + ")";
    if (isPolynomial(a)) high = "least(n - 1, " + std::to_string(program_.degree(a)) + ")";
    return "between(" + forward(a) + ", " + backward(b, "n") + ", " + low + ", " + high + ")";
  }
  /// As in SeriesInterpreter::run; square, too.
  std::string convolveKnown(int a, int b) const {
    return fuse(coefficient(a), forward(b) + "[0]", convolveInside(a, b));
  }
  std::string convolveOld(int a, int b, const std::string& n) const {
    std::string high = n;
    if (isPolynomial(a)) high = "least(" + n + ", " + std::to_string(program_.degree(a)) + ")";
    return "between(" + forward(a) + ", " + backward(b, n) + ", 1, " + high + ")";
  }

 private:
  using Code = SeriesProgram::Code;
  using Instruction = SeriesProgram::Instruction;

  std::string forward(int row) const {
    return "(r + " + std::to_string(static_cast<std::size_t>(row) * 2 * program_.width_) + ")";
  }
  /// Returns the start of a sum that runs down from coefficient n of a row.
  std::string backward(int row, const std::string& n) const {
    mirrored_.insert(row);
    return "BACKWARD(" + std::to_string(program_.offset(row)) + ", " +
           std::to_string(program_.backwardOffset(row)) + ", " + n + ")";
  }
  std::string coefficient(int row) const { return forward(row) + "[n]"; }
  void set(int row, const std::string& value, const std::string& at = "n") {
    text_ << "  { const double y = " << value << "; " << forward(row) << "[" << at << "] = y; "
          << SeriesProgram::writeMirror(row) << " r[" << program_.backwardOffset(row) << " - ("
          << at << ")] = y; }\n";
  }
  bool isPolynomial(int row) const { return program_.degree(row) < SeriesProgram::kNoDegree; }
  std::string sumOfRates(int rate, int w) const {
    return "rates(" + forward(rate) + ", " + backward(w, "0") + ", " + forward(w) + "[0], n, " +
           std::to_string(program_.degree(rate)) + ")";
  }
  std::string chain(int rate, int w) const { return sumOfRates(rate, w) + " * (1.0 / n)"; }
  std::string square(int a) const {
    const std::string x = forward(a);
    return "squareOf(" + x + ", " + backward(a, "0") + ", n)";
  }
  /// Constants of the terms, then of the instructions: see SeriesProgram::addStructure.
  std::string constantOf(const Instruction& it) const {
    const auto index = static_cast<std::size_t>(&it - program_.instructions_.data());
    return writeNumber(it.constant, program_.terms_.size() + index);
  }
  static std::string fuse(const std::string& a, const std::string& b, const std::string& c) {
    return "fuse(" + a + ", " + b + ", " + c + ")";
  }
  /// Writes sum + factor x.
  static std::string addTerm(const std::string& sum, const std::string& factor,
                             const std::string& x) {
    if (sum.empty()) return factor == "1.0" ? x : factor + " * " + x;
    if (factor == "1.0") return sum + " + " + x;
    return factor == "(-1.0)" ? sum + " - " + x : fuse(factor == "0.0" ? "zero" : factor, x, sum);
  }
  /// Writes the sum of terms; of changes, terms of accelerations alone.
  std::string sumOfTerms(const Instruction& it, bool of_changes = false) const {
    std::string sum;
    for (int n = 0; n < it.aux[1]; ++n) {
      const std::size_t place = static_cast<std::size_t>(it.aux[0]) + static_cast<std::size_t>(n);
      const SeriesProgram::Term& term = program_.terms_[place];
      if (of_changes && !program_.isAccelerated(term.row)) continue;
      sum = addTerm(sum, writeNumber(term.factor, place),
                    of_changes ? change(term.row) : coefficient(term.row));
    }
    return sum;
  }
  /// Writes a_0 b + a b_0 of changes; at least one factor has changed.
  std::string changeOfProduct(int a, int b) const {
    const std::string first = forward(a) + "[0]";
    const std::string second = forward(b) + "[0]";
    if (!program_.isAccelerated(a)) return first + " * " + change(b);
    const std::string sum = change(a) + " * " + second;
    return program_.isAccelerated(b) ? fuse(first, change(b), sum) : sum;
  }
  std::string state(const Instruction& it) const { return "s[" + std::to_string(it.state) + "]"; }

  /// See SeriesProgram::isAtLimit.
  void noteLimit(int operand, int result) {
    if (program_.has_pole_[static_cast<std::size_t>(operand)]) return;
    text_ << "  limit |= overflows(" << forward(operand) << "[0], " << forward(result) << "[0]);\n";
  }
  /// Writes coefficient 0.
  void begin(const Instruction& it) {
    const auto first = [this](int row) { return forward(row) + "[0]"; };
    const int a = it.operands[0];
    const int b = it.operands[1];
    const int y = it.result;
    switch (it.code) {
      case Code::kLinear:
        set(y, sumOfTerms(it) + " + " + constantOf(it));
        return;
      case Code::kMultiply:
        set(y, first(a) + " * " + first(b));
        return;
      case Code::kSquare:
        set(y, first(a) + " * " + first(a));
        return;
      case Code::kDivide:
        text_ << "  " << state(it) << " = 1.0 / " << first(b) << ";\n";
        set(y, first(a) + " / " + first(b));
        noteLimit(b, y);
        return;
      case Code::kRate:
      case Code::kWronskian:
        return;
      case Code::kSign:
        set(y, "sign_of(" + first(a) + ")");
        return;
      case Code::kWhereFinite:
        text_ << "  " << state(it) << " = where_finite(" << first(a) << ", 1.0);\n";
        writeBranch(it);
        return;
      case Code::kAbs:
      case Code::kMin:
      case Code::kMax:
      case Code::kSelect:
        text_ << "  " << state(it) << " = 0.0;\n";
        writeBranch(it);
        return;
      default:
        beginFunction(it);
        noteLimit(a, y);
        if (it.begin == SeriesProgram::Begin::kAtan2) noteLimit(b, y);
        return;
    }
  }
  void beginFunction(const Instruction& it) {
    const std::string x = forward(it.operands[0]) + "[0]";
    const auto both = [&](const char* one, const char* other) {
      set(it.result, std::string(one) + "(" + x + ")");
      set(it.aux[0], std::string(other) + "(" + x + ")");
    };
    const auto withSquare = [&](const char* one, const char* other) {
      set(it.result, std::string(one) + "(" + x + ")");
      text_ << "  { const double cosine = " << other << "(" << x << ");\n";
      set(it.aux[0], "1.0 / (cosine * cosine)");
      text_ << "  }\n";
    };
    switch (it.code) {
      case Code::kExp:
        set(it.result, "exp(" + x + ")");
        return;
      case Code::kSinCos:
        text_ << "  { double sine, cosine;\n  sineAndCosine(" << x << ", &sine, &cosine);\n";
        set(it.result, "sine");
        set(it.aux[0], "cosine");
        text_ << "  }\n";
        return;
      case Code::kSinhCosh:
        both("sinh", "cosh");
        return;
      case Code::kTan:
        withSquare("tan", "cos");
        return;
      case Code::kTanh:
        withSquare("tanh", "cosh");
        return;
      case Code::kPrimitive: {
        static constexpr const char* kNames[] = {"log", "atan", "asin", "acos", "atan2"};
        const bool has_two = it.begin == SeriesProgram::Begin::kAtan2;
        set(it.result, std::string(kNames[static_cast<std::size_t>(it.begin)]) + "(" + x +
                           (has_two ? ", " + forward(it.operands[1]) + "[0]" : "") + ")");
        return;
      }
      case Code::kSqrt:
        set(it.result, "sqrt(" + x + ")");
        return;
      case Code::kPower:
        set(it.result, "pow(" + x + ", " + constantOf(it) + ")");
        return;
      default:
        return;
    }
  }

  static std::string change(int row) { return "d" + std::to_string(row); }
  /// See SeriesArranger::arrangeChange.
  void correct(const Instruction& it) {
    const int a = it.operands[0];
    const int b = it.code == Code::kSquare ? a : it.operands[1];
    const int y = it.result;
    const bool is_sum = it.code == Code::kLinear;
    if (is_sum || it.code == Code::kMultiply || it.code == Code::kSquare) {
      text_ << "  const double " << change(y) << " = "
            << (is_sum ? sumOfTerms(it, true) : changeOfProduct(a, b)) << ";\n";
      set(y, coefficient(y) + " + " + change(y));
      return;
    }
    std::vector<int> rows = {y};
    if (it.code == Code::kSinCos || it.code == Code::kSinhCosh) rows.push_back(it.aux[0]);
    for (const int row : rows) {
      text_ << "  const double before" << row << " = " << coefficient(row) << ";\n";
    }
    write(it);
    for (const int row : rows) {
      text_ << "  const double " << change(row) << " = " << coefficient(row) << " - before" << row
            << ";\n";
    }
  }

  void write(const Instruction& it) {
    const int a = it.operands[0];
    const int b = it.operands[1];
    const int y = it.result;
    switch (it.code) {
      case Code::kLinear:
        set(y, sumOfTerms(it));
        return;
      case Code::kMultiply:
        set(y, fuse(coefficient(a), forward(b) + "[0]",
                    fuse(forward(a) + "[0]", coefficient(b), convolveInside(a, b))));
        return;
      case Code::kSquare:
        set(y, square(a));
        return;
      case Code::kDivide:
        set(y, "(" + coefficient(a) + " - " + convolveKnown(b, y) + ") * " + state(it));
        return;
      case Code::kRate:
        text_ << "  " << forward(y) << "[n - 1] = n * " << coefficient(a) << ";\n";
        return;
      case Code::kAbs:
      case Code::kSign:
      case Code::kMin:
      case Code::kMax:
      case Code::kSelect:
      case Code::kWhereFinite:
        writeBranch(it);
        return;
      case Code::kTable:
      case Code::kTable2:
        writeTable(it, program_.pieces_[static_cast<std::size_t>(it.state)]);
        return;
      default:
        writeFunction(it);
        return;
    }
  }

  void writeFunction(const Instruction& it) {
    const int a = it.operands[0];
    const int rate = it.operands[1];
    const int y = it.result;
    const int other = it.aux[0];
    switch (it.code) {
      case Code::kExp:
        set(y, chain(rate, y));
        return;
      case Code::kSinCos:
      case Code::kSinhCosh:
        text_ << "  { const double sine = " << chain(rate, other)
              << "; const double cosine = " << chain(rate, y) << ";\n";
        set(y, "sine");
        set(other, it.code == Code::kSinCos ? "-cosine" : "cosine");
        text_ << "  }\n";
        return;
      case Code::kTan:
      case Code::kTanh:
        set(y, chain(rate, other));
        set(other, std::string(it.code == Code::kTan ? "1.0" : "-1.0") + " * " + square(y));
        return;
      case Code::kPrimitive: {
        const int p = it.operands[2];
        const int w = it.operands[3];
        text_ << "  { const double q = (" << forward(p) << "[n - 1] - (n > 1 ? "
              << convolveOld(w, other, "n - 1") << " : zero)) / " << forward(w) << "[0];\n";
        set(other, "q", "(n - 1)");
        set(y, constantOf(it) + " * q * (1.0 / n)");
        text_ << "  }\n";
        return;
      }
      case Code::kWronskian:
        text_ << "  " << forward(y) << "[n - 1] = " << sumOfRates(it.operands[3], a) << " - "
              << sumOfRates(it.operands[2], it.operands[1]) << ";\n";
        return;
      case Code::kSqrt:
        set(y, "(" + coefficient(a) + " - dot(" + forward(y) + " + 1, " + backward(y, "n - 1") +
                   ", n - 1)) / (2.0 * " + forward(y) + "[0])");
        return;
      case Code::kPower:
        set(y,
            fuse("zero + " + constantOf(it) + " + 1.0", chain(rate, y), "-" + convolveKnown(a, y)) +
                " / " + forward(a) + "[0]");
        return;
      default:
        return;
    }
  }

  void writeBranch(const Instruction& it) {
    const std::string a = coefficient(it.operands[0]);
    const std::string b = it.operands[1] < 0 ? "0.0" : coefficient(it.operands[1]);
    const std::string side = state(it);
    const std::string none = side + " != " + side + " ? " + side + " : ";
    const auto decide = [&](const std::string& with) {
      text_ << "  if (" << side << " == 0.0) " << side << " = " << with << ";\n";
    };
    switch (it.code) {
      case Code::kAbs:
        decide(a + " > 0.0 ? 1.0 : " + a + " < 0.0 ? -1.0 : " + a);
        set(it.result, side + " * " + a);
        return;
      case Code::kSign:
        set(it.result, "0.0");
        return;
      case Code::kMin:
      case Code::kMax:
        decide("sideOf(" + a + ", " + b + ")");
        set(it.result, none + "(" + side + (it.code == Code::kMin ? " <= " : " >= ") + "0.0 ? " +
                           a + " : " + b + ")");
        return;
      case Code::kSelect: {
        decide("sideOf(" + a + ", " + b + ")");
        const std::string yes = forward(it.operands[2]);
        const std::string no = forward(it.operands[3]);
        text_ << "  if (" << side << " == 0.0 && " << yes << "[0] != " << no << "[0]) " << side
              << " = -1.0;\n";
        set(it.result, none + "(" + side + " <= 0.0 ? " + yes + "[n] : " + no + "[n])");
        return;
      }
      default:
        set(it.result, side + " == 0.0 ? 0.0 : " + side + " * " + b);
        return;
    }
  }

  /// Writes (x - x_0)^i, up to `degree`.
  void writePowers(int base, const int* powers, int degree) {
    int before = base;
    for (int i = 2; i <= degree; ++i) {
      text_ << "  if (n >= " << i << ")\n";
      set(powers[i], "dot(" + forward(base) + " + 1, " + backward(before, "n - 1") + ", n - " +
                         std::to_string(i - 1) + ")");
      before = powers[i];
    }
  }
  void writeTable(const Instruction& it, const SeriesProgram::Piece& piece) {
    const int x = it.operands[0];
    const auto a = [&](int i, int j) { return "s[" + std::to_string(piece.a + 6 * i + j) + "]"; };
    writePowers(x, piece.powers_x, piece.degree[0]);
    if (piece.table != nullptr) {
      text_ << "  { double sum = " << a(1, 0) << " * " << coefficient(x) << ";\n";
      for (int i = 2; i <= piece.degree[0]; ++i) {
        text_ << "  if (n >= " << i
              << ") sum = " << fuse(a(i, 0), coefficient(piece.powers_x[i]), "sum") << ";\n";
      }
      set(it.result, "sum");
      text_ << "  }\n";
      return;
    }
    const int y = it.operands[1];
    writePowers(y, piece.powers_y, piece.degree[1]);
    text_ << "  { double sum = 0.0;\n";
    for (int i = 0; i <= piece.degree[0]; ++i) {
      text_ << "  { double inner = " << a(i, 1) << " * " << coefficient(y) << ";\n";
      for (int j = 2; j <= piece.degree[1]; ++j) {
        text_ << "  if (n >= " << j
              << ") inner = " << fuse(a(i, j), coefficient(piece.powers_y[j]), "inner") << ";\n";
      }
      if (i == 0) {
        text_ << "  sum += inner; }\n";
        continue;
      }
      set(piece.sums[i], "inner");
      const int power = i == 1 ? x : piece.powers_x[i];
      text_ << "  if (n >= " << i << ") sum += dot(" << forward(power) << " + " << i << ", "
            << backward(piece.sums[i], "n - " + std::to_string(i)) << ", n - " << i - 1 << "); }\n";
    }
    set(it.result, "sum");
    text_ << "  }\n";
  }

  const SeriesProgram& program_;
  std::set<int>& mirrored_;
  std::ostringstream text_;
};

std::string SeriesProgram::writeConvolution(int a, int b, const std::string& n,
                                            std::set<int>* mirrored) const {
  return SeriesWriter(*this, mirrored).convolveOld(a, b, n);
}

std::string SeriesProgram::writeCode(Part part, std::set<int>* mirrored) const {
  return SeriesWriter(*this, mirrored).write(part);
}

std::string SeriesProgram::writeBegin(Part part) const {
  std::set<int> unused;  // order 0 reads no row backwards
  return SeriesWriter(*this, &unused).begin(part);
}

std::string SeriesProgram::writeMirror(int row) {
  return "if (mirrors_" + std::to_string(row) + ")";
}

std::string SeriesProgram::writeMirrors(const std::set<int>& mirrored) const {
  std::string text;
  for (int row = 0; row < static_cast<int>(degree_.size()); ++row) {
    text += (row > 0 ? ", " : "enum { ") + std::string("mirrors_") + std::to_string(row) + " = " +
            (mirrored.count(row) > 0 ? "1" : "0");
  }
  return text + " };\n";
}

}  // namespace variator_sim::expression
