#include "motion_program/motion_steps.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <string>

#include "expression/series_dot.h"
#include "motion_program/explicit_steps.h"
#include "variator_sim/types.h"

namespace variator_sim {

#include "motion_program/interpreted_ranges.inc"
#include "runtime/radau_tables.h"

/// Lists every table as both kinds.
static void listTables(const expression::SeriesProgram& rows, std::vector<vs_table>* one,
                       std::vector<vs_table_of_two>* two) {
  for (const expression::DenseTable& it : rows.tables()) {
    const std::vector<double>& x = it.points.front();
    const std::vector<double>& y = it.points.back();
    const int count = static_cast<int>(x.size());
    one->push_back({count, x.data(), it.pieces.data()});
    two->push_back({count, static_cast<int>(y.size()), x.data(), y.data(), it.pieces.data()});
  }
}

/// y = f(x_1, ..): its value, and with the gradient g there the coefficients y_n = sum_i g_i x_in,
/// of which the first is exact. piece: whether g is known, and g.
static void callOpaque(const OpaqueFunction& f, double* y,
                       const double* const (&x)[OpaqueFunction::kMostArguments], double* piece,
                       int n) {
  double* const gradient = piece + 1;
  const int count = f.argumentCount();
  if (n == 0 || piece[0] == 0.0) {
    double at[OpaqueFunction::kMostArguments] = {};
    for (int i = 0; i < count; ++i) at[i] = x[i][0];
    piece[0] = 0.0;
    if (n == 0) {
      y[0] = f.value(at);
      return;
    }
    std::fill_n(gradient, OpaqueFunction::kMostArguments, 0.0);
    f.calcGradient(at, gradient);  // (which may throw)
    piece[0] = 1.0;
  }
  y[n] = 0.0;
  for (int i = 0; i < count; ++i) y[n] += gradient[i] * x[i][n];
}

#undef VS_FUNCTION
#undef VS_FUNCTION_INLINE
#undef VS_FUNCTION_RARE
#define VS_FUNCTION
#define VS_FUNCTION_INLINE
#define VS_FUNCTION_RARE
#define VS_RANGES ranges_.data()
#define VS_CONSTANT(instruction) (instruction).constant
#define VS_FACTOR(term) (term).factor

namespace interpreted {
using namespace expression::library;  // NOLINT
using namespace expression::plain;    // NOLINT
#include "motion_program/motion_interpreter.inc"
}  // namespace interpreted

VARIATOR_SIM_BEGIN_FUSED
namespace interpreted_fused {
using namespace expression::library;  // NOLINT
using namespace expression::fused;    // NOLINT
#include "motion_program/motion_interpreter.inc"
}  // namespace interpreted_fused
VARIATOR_SIM_END_FUSED

std::unique_ptr<HostedMotion> hostMotion(const MotionProgram& program) {
  if (expression::fusesProducts()) return std::make_unique<interpreted_fused::Interpreter>(program);
  return std::make_unique<interpreted::Interpreter>(program);
}

namespace {

/// A kernel, its constants and the memory of its model.
class CompiledMotion {
 public:
  CompiledMotion(std::shared_ptr<KernelLibrary> library, const MotionProgram& program)
      : library_(std::move(library)), memory_(call<unsigned long>("size") / sizeof(double) + 1) {
    listTables(program.rows(), &tables_, &tables_of_two_);
    constants_ = program.rows().numbers();
    numbers_ = {program.RELATIVE_TOLERANCE,
                program.ABSOLUTE_TOLERANCE,
                program.MAXIMUM_STEP,
                program.DECAY,
                constants_.data(),
                program.coupling,
                program.constant_value,
                program.passage_points,
                tables_.data(),
                tables_of_two_.data(),
                program.resolved.values.data(),
                program.restitution,
                program.closes_below,
                program.delay_of};
    call<void>("begin", model(), static_cast<const vs_numbers*>(&numbers_));
  }
  CompiledMotion(const CompiledMotion&) = delete;
  CompiledMotion& operator=(const CompiledMotion&) = delete;

  void* model() { return memory_.data(); }
  template <class Result, class... Arguments>
  auto find(const char* name) const {
    return reinterpret_cast<Result (*)(Arguments...)>(
        library_->find((std::string("vs_kernel_") + name).c_str()));
  }
  template <class Result, class... Arguments>
  Result call(const char* name, Arguments... arguments) const {
    return find<Result, Arguments...>(name)(arguments...);
  }

 private:
  std::shared_ptr<KernelLibrary> library_;
  std::vector<double> memory_;
  std::vector<vs_table> tables_;
  std::vector<vs_table_of_two> tables_of_two_;
  std::vector<double> constants_;
  vs_numbers numbers_;
};

scene_status asStatus(int status) {
  return static_cast<scene_status>(status);
}

class CompiledHost final : public HostedMotion {
 public:
  CompiledHost(std::shared_ptr<KernelLibrary> library, const MotionProgram& program)
      : code_(std::move(library), program) {}
  scene_status begin(const vs_exchange& from) override {
    return asStatus(begin_(code_.model(), &from));
  }
  void leave(vs_exchange* to) override { leave_(code_.model(), to); }
  scene_status step(double left, vs_exchange* to) override {
    return asStatus(step_(code_.model(), left, to));
  }
  scene_status cut(double at) override { return asStatus(cut_(code_.model(), at)); }
  scene_status change(vs_exchange* from) override { return asStatus(change_(code_.model(), from)); }
  scene_status see(double at, vs_seen* to) override {
    return asStatus(see_(code_.model(), at, to));
  }
  double calcWork(double at, double* through) override { return work_(code_.model(), at, through); }
  void look(double at, double* entry) override { look_(code_.model(), at, entry); }

 private:
  CompiledMotion code_;
  int (*begin_)(void*,
                const vs_exchange*) = code_.find<int, void*, const vs_exchange*>("host_begin");
  void (*leave_)(void*, vs_exchange*) = code_.find<void, void*, vs_exchange*>("host_leave");
  int (*step_)(void*, double,
               vs_exchange*) = code_.find<int, void*, double, vs_exchange*>("host_step");
  int (*cut_)(void*, double) = code_.find<int, void*, double>("host_cut");
  int (*change_)(void*, vs_exchange*) = code_.find<int, void*, vs_exchange*>("host_change");
  int (*see_)(void*, double, vs_seen*) = code_.find<int, void*, double, vs_seen*>("host_see");
  double (*work_)(void*, double, double*) = code_.find<double, void*, double, double*>("host_work");
  void (*look_)(void*, double, double*) = code_.find<void, void*, double, double*>("host_look");
};

bool hasFunctions(const KernelLibrary& library, std::initializer_list<const char*> names) {
  return std::all_of(names.begin(), names.end(), [&](const char* name) {
    return library.find((std::string("vs_kernel_") + name).c_str()) != nullptr;
  });
}

}  // namespace

std::unique_ptr<HostedMotion> hostMotion(std::shared_ptr<KernelLibrary> library,
                                         const MotionProgram& program) {
  const bool has_all =
      hasFunctions(*library, {"size", "begin", "host_begin", "host_leave", "host_step", "host_cut",
                              "host_change", "host_see", "host_work", "host_look"});
  return has_all ? std::make_unique<CompiledHost>(std::move(library), program) : nullptr;
}

}  // namespace variator_sim
