/// Sums of products of coefficients, in two arithmetics: where the processor has an instruction for
/// a b + c that rounds once, machine code uses it, and so does the interpreter, to the same bits.
/// What is read twice for that, once in each arithmetic, is text (*.inc).
#pragma once

#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

// In between stand functions of processors that have it: nothing may be included there.
#if defined(__x86_64__) && defined(__clang__)
#define VARIATOR_SIM_BEGIN_FUSED \
  _Pragma("clang attribute push(__attribute__((target(\"avx2,fma\"))), apply_to = function)")
#define VARIATOR_SIM_END_FUSED _Pragma("clang attribute pop")
#elif defined(__x86_64__)
#define VARIATOR_SIM_BEGIN_FUSED _Pragma("GCC push_options") _Pragma("GCC target(\"avx2,fma\")")
#define VARIATOR_SIM_END_FUSED _Pragma("GCC pop_options")
#else
#define VARIATOR_SIM_BEGIN_FUSED
#define VARIATOR_SIM_END_FUSED
#endif

namespace variator_sim::expression {

/// Whether products are added before they are rounded: where the processor does that, unless
/// somebody has turned it off. [loop]
bool fusesProducts();
/// For tests: the arithmetic of what is set up from now on. True changes nothing where the
/// processor has no instruction for it.
void fuseProducts(bool on);
/// What stands before the C of kernels: their arithmetic, too.
const char* arithmeticOfCode();

/// Two doubles that are added and multiplied at once.
using Two = double __attribute__((vector_size(16)));

inline Two loadTwo(const double* from) {
  Two values;
  std::memcpy(&values, from, sizeof values);
  return values;
}

namespace plain {

inline double fuse(double a, double b, double c) {
  return a * b + c;
}

/// sum_{j < count} a[j] b[j], every fourth term into one of four sums, of which those that have no
/// term are left out. What was written just before is best left out of it, too: a load of several
/// numbers waits until each of them has reached memory.
inline double dot(const double* a, const double* b, int count) {
  if (count < 4) {
    if (count < 1) return 0.0;
    double sum = a[0] * b[0];
    if (count > 2) sum += a[2] * b[2];
    return count > 1 ? sum + a[1] * b[1] : sum;
  }
  Two first = loadTwo(a) * loadTwo(b);
  Two second = loadTwo(a + 2) * loadTwo(b + 2);
  int j = 4;
  for (; j + 4 <= count; j += 4) {
    first += loadTwo(a + j) * loadTwo(b + j);
    second += loadTwo(a + j + 2) * loadTwo(b + j + 2);
  }
  if (j < count) first[0] += a[j] * b[j];
  if (j + 1 < count) first[1] += a[j + 1] * b[j + 1];
  if (j + 2 < count) second[0] += a[j + 2] * b[j + 2];
  return (first[0] + second[0]) + (first[1] + second[1]);
}

}  // namespace plain

VARIATOR_SIM_BEGIN_FUSED
namespace fused {

inline double fuse(double a, double b, double c) {
  return __builtin_fma(a, b, c);
}

#if defined(__x86_64__)
inline Two fuseTwo(Two a, Two b, Two c) {
  return Two(_mm_fmadd_pd(a, b, c));
}
#else
inline Two fuseTwo(Two a, Two b, Two c) {
  return Two{fuse(a[0], b[0], c[0]), fuse(a[1], b[1], c[1])};
}
#endif

/// The same sums.
__attribute__((always_inline)) inline double dot(const double* a, const double* b, int count) {
  if (count < 4) {
    if (count < 1) return 0.0;
    double sum = a[0] * b[0];
    if (count > 2) sum += a[2] * b[2];
    return count > 1 ? sum + a[1] * b[1] : sum;
  }
  Two first = loadTwo(a) * loadTwo(b);
  Two second = loadTwo(a + 2) * loadTwo(b + 2);
  int j = 4;
  for (; j + 4 <= count; j += 4) {
    first = fuseTwo(loadTwo(a + j), loadTwo(b + j), first);
    second = fuseTwo(loadTwo(a + j + 2), loadTwo(b + j + 2), second);
  }
  if (j < count) first[0] = fuse(a[j], b[j], first[0]);
  if (j + 1 < count) first[1] = fuse(a[j + 1], b[j + 1], first[1]);
  if (j + 2 < count) second[0] = fuse(a[j + 2], b[j + 2], second[0]);
  return (first[0] + second[0]) + (first[1] + second[1]);
}

}  // namespace fused
VARIATOR_SIM_END_FUSED

}  // namespace variator_sim::expression
