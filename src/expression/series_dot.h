/// Sums of products of coefficients.
#pragma once

#include <cstring>

namespace variator_sim::expression {

/// Two doubles that are added and multiplied at once.
using Two = double __attribute__((vector_size(16)));

inline Two loadTwo(const double* from) {
  Two values;
  std::memcpy(&values, from, sizeof values);
  return values;
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

}  // namespace variator_sim::expression
