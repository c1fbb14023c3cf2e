#include "expression/series_program.h"

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

std::vector<double> SeriesProgram::numbers() const {
  std::vector<double> made;
  for (const Term& term : terms_) made.push_back(term.factor);
  for (const Instruction& it : instructions_) made.push_back(it.constant);
  return made;
}

}  // namespace variator_sim::expression
