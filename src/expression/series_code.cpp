// A SeriesProgram as C: calls of the functions that the interpreter calls, so that they make the
// same bits. Order 0 remains interpreted if it looks up tables.
#include <set>

#include "expression/c_code.h"
#include "expression/series_statements.h"
#include "expression/series_text.h"

namespace variator_sim::expression {

std::string SeriesProgram::codePrelude(const std::string& stride, const char* lanes) {
  const bool has_lanes = lanes != nullptr;
  return std::string(kSeriesSineText) + (has_lanes ? lanes : "") +
         "#if defined(__x86_64__) && !(defined(__FMA__) && defined(__AVX2__))\n#undef VS_FUSES\n"
         "#endif\n" +
         stride + "#define VS_SINE_AND_COSINE(x, s, c) " + (has_lanes ? "each_" : "") +
         "sineAndCosine(x, s, c)\n" + kOperationsText;
}

/// The parts of a program as functions.
class SeriesWriter : private SeriesStatements {
 public:
  explicit SeriesWriter(const SeriesProgram& program) : SeriesStatements(program) {}

  std::string write() const {
    using Part = SeriesProgram::Part;
    std::string rest;
    std::string corrected;
    for (const int of : program_.accelerations_) {
      corrected += "  const Real " + change(of) + " = " + row(of) + "[n];\n";
    }
    for (const int index : program_.programs_[static_cast<std::size_t>(Part::kAccelerated)]) {
      const Instruction& it = program_.instructions_[static_cast<std::size_t>(index)];
      if (it.is_tried) {
        corrected += "  " + correct(it, statement(it)) + "\n";
      } else {
        rest += statements(it);
      }
    }
    return function("series_given", statements(Part::kGiven)) +
           function("series_trial", statements(Part::kTrial)) +
           function("series_corrected", corrected) + function("series_rest", rest);
  }

 private:
  static std::string function(const char* name, const std::string& body) {
    return std::string("VS_INLINE void ") + name +
           "(int n, vs_row* restrict r, Real* restrict s, const Real* restrict c, int* limit) {\n"
           "  (void)n, (void)s, (void)c, (void)limit;\n" +
           body + "}\n";
  }
  std::string statements(SeriesProgram::Part part) const {
    std::string text;
    for (const int index : program_.programs_[static_cast<std::size_t>(part)]) {
      text += statements(program_.instructions_[static_cast<std::size_t>(index)]);
    }
    return text;
  }
  std::string statements(const Instruction& it) const {
    std::string text = "  " + statement(it) + "\n";
    for (const int of : SeriesProgram::limitingOperands(it)) {
      if (of < 0 || program_.has_pole_[static_cast<std::size_t>(of)]) continue;
      text +=
          "  if (n == 0) *limit |= vs_overflows(" + row(of) + "[0], " + row(it.result) + "[0]);\n";
    }
    return text;
  }
  std::string statement(const Instruction& it) const {
    if (it.code != Code::kTable && it.code != Code::kTable2) return compute(it);
    const Piece& piece = program_.pieces_[static_cast<std::size_t>(it.state)];
    std::string operands = row(it.operands[0]);
    std::string degrees = std::to_string(piece.degree[0]);
    const bool has_two = it.code == Code::kTable2;
    if (has_two) {
      operands += ", " + row(it.operands[1]);
      degrees += ", " + std::to_string(piece.degree[1]);
    }
    return std::string(has_two ? "vs_follow_two(" : "vs_follow(") + row(it.result) + ", r + " +
           std::to_string(piece.rows) + ", " + operands + ", s + " + std::to_string(piece.a) +
           ", " + degrees + ", n);";
  }
  std::string number(double value, std::size_t place) const override {
    if (!isWrittenOut(value)) return "c[" + std::to_string(place) + "]";
    return value == 0.0 ? "vs_zero" : value > 0.0 ? "(vs_zero + 1.0)" : "(vs_zero - 1.0)";
  }
  std::string mode(const Instruction& it) const override {
    return "s + " + std::to_string(it.state);
  }
};

std::string SeriesProgram::writeCode() const {
  return SeriesWriter(*this).write();
}

std::string writeHiding(const std::vector<SeriesOperation>& operations, int most,
                        const std::function<std::string(int)>& row) {
  std::string reaches;
  std::string sums;
  std::set<int> reached;
  const auto reach = [&](int n) {
    const std::string name = std::to_string(n);
    if (reached.insert(n).second) {
      reaches += "  Real u" + name + ", w" + name + " = seriesReach(" + row(n) + ", p, last, &u" +
                 name + ");\n";
    }
    return "w" + name + ", u" + name;
  };
  for (const SeriesOperation& op : operations) {
    if (!seriesMayHide(&op, 0)) continue;
    const int b = op.b < 0 ? op.a : op.b;
    if (op.degree <= most) sums += "  if (last < " + std::to_string(op.degree) + ")\n";
    sums += "  sum += seriesHides(" + std::to_string(op.kind);
    for (const int n : {op.result, op.second, op.a, b}) sums += ", " + row(n < 0 ? op.a : n);
    sums += ", " + reach(op.kind == kSeriesQuotient ? b : op.a) + ", " + reach(b) + ", p, last);\n";
  }
  return reaches + sums;
}

}  // namespace variator_sim::expression
