#include "motion_program/motion_steps.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>
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
class CompiledMotion final : public HostedMotion {
 public:
  CompiledMotion(std::shared_ptr<KernelLibrary> library, const MotionProgram& program)
      : library_(std::move(library)) {
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
    unsigned long (*size)() = nullptr;
    void (*prepare)(void*, const vs_numbers*) = nullptr;
    find("size", &size);
    find("begin", &prepare);
    find("host_begin", &begin_);
    find("host_leave", &leave_);
    find("host_step", &step_);
    find("host_cut", &cut_);
    find("host_change", &change_);
    find("host_see", &see_);
    find("host_work", &work_);
    find("host_look", &look_);
    if (!has_all_) return;
    memory_.resize(size() / sizeof(double) + 1);
    prepare(model(), &numbers_);
  }
  CompiledMotion(const CompiledMotion&) = delete;
  CompiledMotion& operator=(const CompiledMotion&) = delete;

  /// False where the library lacks a function.
  bool hasAll() const { return has_all_; }
  scene_status begin(const vs_exchange& from) override { return asStatus(begin_(model(), &from)); }
  void leave(vs_exchange* to) override { leave_(model(), to); }
  scene_status step(double left, vs_exchange* to) override {
    return asStatus(step_(model(), left, to));
  }
  scene_status cut(double at) override { return asStatus(cut_(model(), at)); }
  scene_status change(vs_exchange* from) override { return asStatus(change_(model(), from)); }
  scene_status see(double at, vs_seen* to) override { return asStatus(see_(model(), at, to)); }
  double calcWork(double at, double* through) override { return work_(model(), at, through); }
  void look(double at, double* entry) override { look_(model(), at, entry); }

 private:
  static scene_status asStatus(int status) { return static_cast<scene_status>(status); }
  void* model() { return memory_.data(); }
  template <class Function>
  void find(const char* name, Function* function) {
    *function =
        reinterpret_cast<Function>(library_->find((std::string("vs_kernel_") + name).c_str()));
    has_all_ = has_all_ && *function != nullptr;
  }

  std::shared_ptr<KernelLibrary> library_;
  bool has_all_ = true;
  std::vector<double> memory_;
  std::vector<vs_table> tables_;
  std::vector<vs_table_of_two> tables_of_two_;
  std::vector<double> constants_;
  vs_numbers numbers_;
  int (*begin_)(void*, const vs_exchange*);
  void (*leave_)(void*, vs_exchange*);
  int (*step_)(void*, double, vs_exchange*);
  int (*cut_)(void*, double);
  int (*change_)(void*, vs_exchange*);
  int (*see_)(void*, double, vs_seen*);
  double (*work_)(void*, double, double*);
  void (*look_)(void*, double, double*);
};

}  // namespace

std::unique_ptr<HostedMotion> hostMotion(std::shared_ptr<KernelLibrary> library,
                                         const MotionProgram& program) {
  auto made = std::make_unique<CompiledMotion>(std::move(library), program);
  if (!made->hasAll()) return nullptr;
  return made;
}

}  // namespace variator_sim
