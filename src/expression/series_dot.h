/// The recurrences of runtime/operations.h in two arithmetics: if the processor has an instruction
/// for a b + c that rounds once, machine code and the interpreter use it, to the same bits. The
/// texts (*.inc) are compiled twice, once in each arithmetic.
#pragma once

#include <cmath>

#include "expression/series_program.h"

// The functions between require such a processor: only texts (*.inc) may be included there.
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

/// Returns true if products are added before they are rounded: the default on processors that can.
/// [loop]
bool fusesProducts();
/// For tests: sets the arithmetic of later programs. True has no effect on a processor without the
/// instruction.
void fuseProducts(bool on);
/// Returns the head of the C of kernels, including their arithmetic.
const char* arithmeticOfCode();

enum { VS_STRIDE = SeriesProgram::kStride };  // NOLINT: a name of C
#define VS_ORDER_VARIES

/// The library's functions, which those of formulas (Expression) would hide.
namespace library {
using std::acos;
using std::asin;
using std::atan;
using std::atan2;
using std::cos;
using std::cosh;
using std::exp;
using std::isfinite;
using std::isinf;
using std::isnan;
using std::log;
using std::pow;
using std::sin;
using std::sinh;
using std::sqrt;
using std::tan;
using std::tanh;
}  // namespace library

namespace plain {

using namespace library;  // NOLINT: its functions are many

#include "runtime/operations.h"
#undef vs_fuse_four

}  // namespace plain

VARIATOR_SIM_BEGIN_FUSED
namespace fused {

using namespace library;  // NOLINT: its functions are many
#define VS_FUSES
#include "runtime/operations.h"
#undef VS_FUSES

}  // namespace fused
VARIATOR_SIM_END_FUSED

}  // namespace variator_sim::expression
