/// Formulas at run time: interpreted, or as machine code if there is some.
#pragma once

#include <cmath>
#include <vector>

#include "variator_sim/expression/tape.h"

namespace variator_sim {

/// The host's tables for kernels, as declared by the C of expression/c_code.h.
struct KernelTables {
  const double* constants;
  const void* const* tables;
  const void* const* tables2;
  double (*table)(const void* table, int order, double x);
  double (*table2)(const void* table, int order_x, int order_y, double x, double y);
};
/// See expression/c_code.h.
using Kernel = void (*)(double t, const double* p, const double* w, const double* e,
                        const double* u, const double* v, const double* a,
                        const KernelTables* tables, double* y);

/// True for the same bits; NaN is one number.
inline bool areSameBits(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) || (a == b && std::signbit(a) == std::signbit(b));
}

/// A tape, and a kernel that gives the same bits. One thread may use it at a time.
class Program {
 public:
  Program() = default;
  Program(const expression::Graph& graph, const std::vector<expression::Node>& outputs)
      : tape_(graph, outputs), outputs_(outputs), values_(outputs.size()) {}

  const std::vector<expression::Node>& outputs() const { return outputs_; }

  /// The outputs; valid until the next evaluation. [loop]
  const double* evaluate(const StateView& state) const {
    if (kernel_ == nullptr) return tape_.evaluate(state);
    kernel_(state.time, state.angle, state.velocity, state.acceleration, state.input,
            state.input_rate, state.input_second_rate, tables_, values_.data());
    return values_.data();
  }
  /// True when the outputs are the tape's bits at `state`.
  bool agreesWithInterpreter(const StateView& state) const;
  /// Uses `kernel` from now on; the tape if it is null.
  void use(Kernel kernel, const KernelTables* tables) {
    kernel_ = kernel;
    tables_ = tables;
  }

 private:
  expression::Tape tape_;
  std::vector<expression::Node> outputs_;
  Kernel kernel_ = nullptr;
  const KernelTables* tables_ = nullptr;
  mutable std::vector<double> values_;
};

}  // namespace variator_sim
