#include "expression/series_statements.h"

#include <cctype>

namespace variator_sim::expression {

namespace {

/// The calls of VARIATOR_SIM_SERIES_FUNCTIONS, by Code.
constexpr const char* kCalls[] = {"",
#define VARIATOR_SIM_CALL(code, kind, call) #call,
                                  VARIATOR_SIM_SERIES_FUNCTIONS(VARIATOR_SIM_CALL)
#undef VARIATOR_SIM_CALL
};

}  // namespace

std::string SeriesStatements::constant(const Instruction& it) const {
  const auto index = static_cast<std::size_t>(&it - program_.instructions_.data());
  return number(it.constant, program_.terms_.size() + index);
}

std::string SeriesStatements::addTerm(const std::string& sum, int place,
                                      const std::string& x) const {
  double factor = program_.terms_[static_cast<std::size_t>(place)].factor;
  if (factor == 1.0) return sum.empty() ? x : sum + " + " + x;
  if (factor == -1.0) return sum.empty() ? "-" + x : sum + " - " + x;
  std::string product = number(factor, static_cast<std::size_t>(place)) + " * " + x;
  if (sum.empty()) return product;
  return product[0] == '-' ? sum + " - " + product.substr(1) : sum + " + " + product;
}

std::string SeriesStatements::sumOfTerms(const Instruction& it) const {
  std::string sum;
  for (int place = it.aux[0]; place < it.aux[0] + it.aux[1]; ++place) {
    sum = addTerm(sum, place, row(program_.terms_[static_cast<std::size_t>(place)].row) + "[n]");
  }
  const std::string y = row(it.result);
  std::string statement = y + "[n] = " + sum + ";";
  if (it.constant == 0.0) return statement;
  return statement + "\n  if (n == 0) " + y + "[0] += " + constant(it) + ";";
}

/// Writes the call with the names of an instruction's rows.
std::string SeriesStatements::call(const Instruction& it) const {
  const auto nameOf = [&](const std::string& word) -> std::string {
    if (word == "y") return row(it.result);
    if (word == "z") return row(it.aux[0]);
    if (word == "last") return std::to_string(it.last);
    if (word == "constant") return constant(it);
    if (word == "mode") return mode(it);
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

std::string SeriesStatements::compute(const Instruction& it) const {
  std::string statement = it.code == Code::kLinear ? sumOfTerms(it) : call(it);
  if (it.ends >= SeriesProgram::kNoDegree) return statement;
  return "if (n <= " + std::to_string(it.ends) + ") { " + statement + " }";
}

/// Returns the change of a product, quotient or sum, the coefficients n being linear in those of
/// operands. A quotient keeps the reciprocal of its divisor (vs_divide).
std::string SeriesStatements::changeOf(const Instruction& it) const {
  std::string sum;
  if (it.code == Code::kLinear) {
    for (int place = it.aux[0]; place < it.aux[0] + it.aux[1]; ++place) {
      const int of = program_.terms_[static_cast<std::size_t>(place)].row;
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

std::string SeriesStatements::correct(const Instruction& it, const std::string& computed,
                                      bool changes_quotients) const {
  const std::string y = row(it.result) + "[n]";
  if (it.code == Code::kMultiply || it.code == Code::kSquare || it.code == Code::kLinear ||
      (it.code == Code::kDivide && changes_quotients)) {
    std::string text = "const Real " + change(it.result) + " = " + changeOf(it) + ";\n  " + y +
                       " += " + change(it.result) + ";";
    if (it.code == Code::kDivide && program_.isAccelerated(it.operands[1])) {
      text +=
          "\n  if (n == 0) " + row(it.result) + "[VS_KEPT] = 1.0 / " + row(it.operands[1]) + "[0];";
    }
    return text;
  }
  if (isRate(it)) return computed;
  std::string text;
  const int rows[] = {it.result, it.aux[0]};
  const int count = hasTwoResults(it) ? 2 : 1;
  for (int k = 0; k < count; ++k) {
    text += "Real " + change(rows[k]) + " = -" + row(rows[k]) + "[n];\n  ";
  }
  text += computed;
  for (int k = 0; k < count; ++k) {
    text += "\n  " + change(rows[k]) + " += " + row(rows[k]) + "[n];";
  }
  return text;
}

}  // namespace variator_sim::expression
