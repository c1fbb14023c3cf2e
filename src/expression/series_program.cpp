// What the arithmetic is, and what the text of the C depends on: equal structures have the same
// text.
#include "expression/series_program.h"

#include <cmath>
#include <iterator>

#include "expression/series_dot.h"

namespace variator_sim::expression {

namespace {

bool hasFusedProducts() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("fma") != 0 && __builtin_cpu_supports("avx2") != 0;
#elif defined(__aarch64__)
  return true;
#else
  return false;
#endif
}

bool is_fusing = hasFusedProducts();

}  // namespace

bool fusesProducts() {
  return is_fusing;
}
void fuseProducts(bool on) {
  is_fusing = on && hasFusedProducts();
}
const char* arithmeticOfCode() {
  return is_fusing ? "#if !defined(__x86_64__) || (defined(__FMA__) && defined(__AVX2__))\n"
                     "#define VS_FUSES\n#endif\n"
                   : "";
}

bool isWrittenOut(double value) {
  return (value == 0.0 && !std::signbit(value)) || value == 1.0 || value == -1.0;
}

void SeriesProgram::addStructure(std::vector<int>* words) const {
  const auto count = [&words](std::size_t n) { words->push_back(static_cast<int>(n)); };
  const auto add = [&](const std::vector<int>& numbers) {
    count(numbers.size());
    words->insert(words->end(), numbers.begin(), numbers.end());
  };
  const auto addConstant = [&](double value) {
    words->push_back(isWrittenOut(value) ? static_cast<int>(value) : 2);
  };
  add(degree_);
  for (const char is : accelerated_) count(is);
  for (const bool has : has_pole_) count(has ? 1 : 0);
  add(accelerations_);
  count(terms_.size());
  for (const Term& term : terms_) {
    count(static_cast<std::size_t>(term.row));
    addConstant(term.factor);
  }
  count(instructions_.size());
  for (const Instruction& it : instructions_) {
    words->insert(words->end(), {static_cast<int>(it.code), static_cast<int>(it.part), it.result,
                                 it.aux[0], it.aux[1], it.mode, it.piece, it.table, it.ends});
    words->insert(words->end(), std::begin(it.operands), std::end(it.operands));
    addConstant(it.constant);
  }
}

std::vector<double> SeriesProgram::numbers() const {
  std::vector<double> made;
  for (const Term& term : terms_) made.push_back(term.factor);
  for (const Instruction& it : instructions_) made.push_back(it.constant);
  return made;
}

}  // namespace variator_sim::expression
