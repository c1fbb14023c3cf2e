/// The instructions of a Tape: tape_compiler.cpp writes them, tape_interpreter.cpp executes them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace variator_sim::expression {

// The four operations and, made of them, instructions of two and three operations:
//   pair a o1 b, triad (a o1 b) o2 c in several forms, quad (a o1 b) o2 (c o3 d).
enum Arithmetic : int { kPlus, kMinus, kTimes, kOver };

constexpr int kForms = 7;  // of a triad: t+c, t-c, c-t, t*c, t/c, c/t, -t
enum TriadForm : int {
  kThenPlus,
  kThenMinus,
  kFromThen,
  kThenTimes,
  kThenOver,
  kOverThen,
  kThenNegate
};

constexpr int kPairBase = 0;
constexpr int kTriadBase = kPairBase + 4;
constexpr int kQuadBase = kTriadBase + 4 * kForms;
constexpr int kArithmeticCount = kQuadBase + 4 * 4 * 4;

// Consecutive instructions with the same code form a run of up to this length: the code of the
// first tells how many follow, the codes of the others are ignored.
constexpr int kLongestRun = 4;
constexpr int kFunctionBase = kArithmeticCount * kLongestRun;
constexpr int runCode(int code, int length) {
  return code * kLongestRun + length - 1;
}

// Fields of an instruction. The head has the code, the result's register, operands A and B; the
// tail has operands C and D. Operands are registers, with the exceptions that FunctionCode names.
constexpr int kFieldBits = 16;
enum HeadField : int { kCodeField, kResultField, kAField, kBField };
enum TailField : int { kCField, kDField };
constexpr std::size_t fieldOf(std::uint64_t word, int field) {
  return word >> (kFieldBits * field) & 0xFFFFU;
}

constexpr int pairCode(int o1) {
  return kPairBase + o1;
}
constexpr int triadCode(int o1, int form) {
  return kTriadBase + o1 * kForms + form;
}
constexpr int quadCode(int o1, int o2, int o3) {
  return kQuadBase + (o1 * 4 + o2) * 4 + o3;
}

// Functions: one instruction each. X(name of the Operation, value; A to D are the operands)
#define VARIATOR_SIM_FUNCTIONS(X)   \
  X(Negate, -A)                     \
  X(Power, std::pow(A, B))          \
  X(Sin, std::sin(A))               \
  X(Cos, std::cos(A))               \
  X(Tan, std::tan(A))               \
  X(Asin, std::asin(A))             \
  X(Acos, std::acos(A))             \
  X(Atan, std::atan(A))             \
  X(Atan2, std::atan2(A, B))        \
  X(Sinh, std::sinh(A))             \
  X(Cosh, std::cosh(A))             \
  X(Tanh, std::tanh(A))             \
  X(Exp, std::exp(A))               \
  X(Log, std::log(A))               \
  X(Sqrt, std::sqrt(A))             \
  X(Abs, std::abs(A))               \
  X(Sign, signOf(A))                \
  X(Min, minimumOf(A, B))           \
  X(Max, maximumOf(A, B))           \
  X(WhereFinite, whereFinite(A, B)) \
  X(Select, selectOf(A, B, C, D))

enum FunctionCode : int {
  kBeforeFunctions = kFunctionBase - 1,
#define VARIATOR_SIM_CODE(name, value) kCode##name,
  VARIATOR_SIM_FUNCTIONS(VARIATOR_SIM_CODE)
#undef VARIATOR_SIM_CODE
      kCodeSinCos,  ///< B: register of the cosine
  kCodeTable,       ///< A: x, B: table's index, C: order of the derivative
  kCodeTable2,      ///< A: x, B: y, C: table's index, D: 256 times the order by y and that by x
  kCodeOpaque,      ///< A: index of the call
  kCodeCopy,        ///< copies one output to another
  kCodeReturn,
  kCodeCount
};

}  // namespace variator_sim::expression
