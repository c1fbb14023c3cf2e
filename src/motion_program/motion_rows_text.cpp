// The instructions of a motion as C.
#include <cctype>
#include <cmath>

#include "motion_program/c_text.h"
#include "motion_program/motion_program.h"

namespace variator_sim {

using expression::DenseTable;
using expression::SeriesProgram;

namespace {

using Code = SeriesProgram::Code;
using Instruction = SeriesProgram::Instruction;
using Part = SeriesProgram::Part;

/// The calls of VARIATOR_SIM_SERIES_FUNCTIONS, by Code.
constexpr const char* kCalls[] = {"",
#define VARIATOR_SIM_CALL(code, kind, call) #call,
                                  VARIATOR_SIM_SERIES_FUNCTIONS(VARIATOR_SIM_CALL)
#undef VARIATOR_SIM_CALL
};

/// True for 0, 1 and -1, which are literals in the code: a compiler simplifies their operations.
bool isWrittenOut(double value) {
  return (value == 0.0 && !std::signbit(value)) || value == 1.0 || value == -1.0;
}

/// Writes the functions of all parts.
class Writer {
 public:
  Writer(const SeriesProgram& program, bool shares) : program_(program), shares_(shares) {}

  std::string write() const {
    std::string text;
    for (std::size_t n = 0; n < program_.tables().size() && !shares_; ++n) {
      text += writeTable(program_.tables()[n], static_cast<int>(n));
    }
    const std::string constants =
        shares_ ? "  const double *const c = it->numbers->constants;\n  (void)c;\n" : "";
    const auto add = [&](const char* name, const char* note, const std::string& body,
                         const std::string& parameter = "") {
      text +=
          std::string("\n/* ") + note + " */\nVS_INLINE void vs_" + name +
          "(scene_series *it, int n" + (parameter.empty() ? "" : ", const Real *" + parameter) +
          ")\n{\n  vs_row *const r = it->row;\n  Real *const s = it->mode;\n  double *const a = "
          "it->piece;\n  (void)r, (void)s, (void)a, (void)n" +
          (parameter.empty() ? "" : ", (void)" + parameter) + ";\n" + constants + body + "}\n";
    };
    const auto textOf = [this](Part part) {
      std::string body;
      for (const Instruction* it : program_.instructions(part)) body += "  " + write(*it) + "\n";
      return body;
    };
    add("given", "Rows that read no acceleration.", textOf(Part::kGiven));
    add("tried", "Rows with accelerations that constraints read.", textOf(Part::kTried));
    add("corrected", "These after the accelerations n have changed by de.", writeCorrections(),
        "de");
    add("rest", "Other rows with accelerations.", textOf(Part::kRest));
    add("at_once", "Rows that are read at order 0 only.", textOf(Part::kAtOnce));
    return text;
  }

 private:
  static std::string row(int n) { return "r[" + std::to_string(n) + "]"; }
  static std::string change(int row) { return "d" + std::to_string(row); }

  /// Writes constant `place` of numbers().
  std::string number(double value, std::size_t place) const {
    if (shares_ && !isWrittenOut(value)) return "c[" + std::to_string(place) + "]";
    return literalOf(value);
  }

  std::string constant(const Instruction& it) const {
    return number(it.constant, program_.placeOf(it));
  }

  /// Appends factor x, Term `place`, to a sum.
  std::string addTerm(const std::string& sum, int place, const std::string& x) const {
    double factor = program_.terms()[static_cast<std::size_t>(place)].factor;
    if (factor == 1.0) return sum.empty() ? x : sum + " + " + x;
    if (factor == -1.0) return sum.empty() ? "-" + x : sum + " - " + x;
    std::string product = number(factor, static_cast<std::size_t>(place)) + " * " + x;
    if (sum.empty()) return product;
    return product[0] == '-' ? sum + " - " + product.substr(1) : sum + " + " + product;
  }

  std::string sumOfTerms(const Instruction& it) const {
    std::string sum;
    for (int place = it.aux[0]; place < it.aux[0] + it.aux[1]; ++place) {
      sum = addTerm(sum, place, row(program_.terms()[static_cast<std::size_t>(place)].row) + "[n]");
    }
    const std::string y = row(it.result);
    std::string statement = y + "[n] = " + sum + ";";
    if (it.constant == 0.0) return statement;
    return statement + "\n  if (n == 0) " + y + "[0] += " + constant(it) + ";";
  }

  /// Writes the call with the names of an instruction's rows.
  std::string call(const Instruction& it) const {
    const auto nameOf = [&](const std::string& word) -> std::string {
      if (word == "y") return row(it.result);
      if (word == "z") return row(it.aux[0]);
      if (word == "last") return std::to_string(it.last);
      if (word == "constant") return constant(it);
      if (word == "mode") return "s + " + std::to_string(it.mode);
      if (word.size() == 1 && word[0] >= 'a' && word[0] <= 'd')
        return row(it.operands[word[0] - 'a']);
      return word;
    };
    std::string text;
    std::string word;
    for (const char* at = kCalls[static_cast<int>(it.code)];; ++at) {
      if (std::isalnum(static_cast<unsigned char>(*at)) != 0 || *at == '_') {
        word += *at;
        continue;
      }
      text += nameOf(word);
      word.clear();
      if (*at == '\0') return text + ";";
      text += *at;
    }
  }

  /// Writes the statement that computes coefficient n of an instruction's results.
  std::string compute(const Instruction& it) const {
    std::string statement = it.code == Code::kLinear ? sumOfTerms(it) : call(it);
    if (it.ends >= SeriesProgram::kNoDegree) return statement;
    return "if (n <= " + std::to_string(it.ends) + ") { " + statement + " }";
  }

  /// Returns the change of a product, quotient or sum, the coefficients n being linear in those of
  /// operands. A quotient keeps the reciprocal of its divisor (vs_divide).
  std::string changeOf(const Instruction& it) const {
    std::string sum;
    if (it.code == Code::kLinear) {
      for (int place = it.aux[0]; place < it.aux[0] + it.aux[1]; ++place) {
        const int of = program_.terms()[static_cast<std::size_t>(place)].row;
        if (program_.isAccelerated(of)) sum = addTerm(sum, place, change(of));
      }
      return sum;
    }
    const int a = it.operands[0];
    if (it.code == Code::kSquare) return "2.0 * " + change(a) + " * " + row(a) + "[0]";
    const int b = it.operands[1];
    if (it.code == Code::kDivide) {
      if (program_.isAccelerated(a)) sum = change(a);
      if (program_.isAccelerated(b)) sum += " - " + change(b) + " * " + row(it.result) + "[0]";
      return "(" + sum + ") * " + row(it.result) + "[VS_KEPT]";
    }
    if (program_.isAccelerated(a)) sum = change(a) + " * " + row(b) + "[0]";
    if (!program_.isAccelerated(b)) return sum;
    return (sum.empty() ? "" : sum + " + ") + change(b) + " * " + row(a) + "[0]";
  }

  /// Returns the statements that correct coefficient n of an instruction's results for those of the
  /// accelerations; the changes of its operands are declared before. Functions without a simple
  /// change are computed anew, and so are quotients that may stay at a limit.
  std::string correct(const Instruction& it) const {
    const std::string y = row(it.result) + "[n]";
    if (it.code == Code::kMultiply || it.code == Code::kSquare || it.code == Code::kLinear ||
        (it.code == Code::kDivide && it.limit < 0)) {
      std::string text = "const Real " + change(it.result) + " = " + changeOf(it) + ";\n  " + y +
                         " += " + change(it.result) + ";";
      if (it.code == Code::kDivide && program_.isAccelerated(it.operands[1])) {
        text += "\n  if (n == 0) " + row(it.result) + "[VS_KEPT] = 1.0 / " + row(it.operands[1]) +
                "[0];";
      }
      return text;
    }
    if (it.code == Code::kRate || it.code == Code::kWronskian) return write(it);
    std::vector<int> rows = {it.result};
    if (it.hasTwoResults()) rows.push_back(it.aux[0]);
    std::string before;
    std::string after;
    for (const int of : rows) {
      before += "Real " + change(of) + " = -" + row(of) + "[n];\n  ";
      after += "\n  " + change(of) + " += " + row(of) + "[n];";
    }
    return before + write(it) + after;
  }

  std::string write(const Instruction& it) const {
    const std::string y = row(it.result);
    if (it.table < 0) {
      std::string call = compute(it);
      if (it.limit < 0) return call;
      return "if (vs_is_at_limit(" + row(it.limit) + ", " + y + ", n)) " + y +
             "[n] = 0.0;\n  else " + call;
    }
    const bool has_two = it.code == Code::kTable2;
    const std::string rows = std::to_string(it.rows);
    const bool ends = it.ends < SeriesProgram::kNoDegree;
    return (ends ? "if (n <= " + std::to_string(it.ends) + ") " : "") +
           std::string(has_two ? "vs_look_up_two(r + " : "vs_look_up(" + y + ", r + ") + rows +
           ", " + row(it.operands[0]) + ", " + (has_two ? row(it.operands[1]) + ", " : "") +
           (!shares_  ? "&table_"
            : has_two ? "it->numbers->table_of_two + "
                      : "it->numbers->table + ") +
           std::to_string(it.table) + ", s + " + std::to_string(it.mode) + ", a + " +
           std::to_string(it.piece) + ", n);" +
           (has_two ? "\n  " + y + "[n] = " + row(it.rows) + "[n];" : "");
  }

  static std::string writeTable(const DenseTable& table, int index) {
    const std::string name = "table_" + std::to_string(index);
    std::string counts;
    std::string names;
    std::string text = "\n/* " + harmless(table.origin) + " */\n";
    for (std::size_t n = 0; n < table.points.size(); ++n) {
      const std::string axis = name + "_" + std::string(1, static_cast<char>('x' + n));
      text += arrayOf("double", axis, table.points[n]);
      counts += std::to_string(table.points[n].size()) + ", ";
      names += axis + ", ";
    }
    text += arrayOf("double", name + "_pieces", table.pieces);
    return text + "static const vs_table" + (table.points.size() > 1 ? "_of_two " : " ") + name +
           " = {" + counts + names + name + "_pieces};\n";
  }

  std::string writeCorrections() const {
    std::string text;
    for (const int of : program_.accelerations()) {
      text += "  const Real " + change(of) + " = de[" +
              std::to_string(of - program_.accelerations().front()) + "];\n  (void)" + change(of) +
              ";\n";
    }
    for (const Instruction* it : program_.instructions(Part::kTried)) {
      text += "  " + correct(*it) + "\n";
    }
    return text;
  }

  const SeriesProgram& program_;
  const bool shares_;
};

}  // namespace

std::string MotionProgram::writeRows(bool shares) const {
  return Writer(program_, shares).write();
}

}  // namespace variator_sim
