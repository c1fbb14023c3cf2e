#include "motion_program/motion_steps.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <string>

#include "expression/series_dot.h"
#include "variator_sim/types.h"

namespace variator_sim {

#include "motion_program/interpreted_ranges.inc"
#include "runtime/radau_tables.h"

/// Lists every table as both kinds.
static void listTables(const MotionRows& rows, std::vector<vs_table>* one,
                       std::vector<vs_table_of_two>* two) {
  for (const MotionRows::DenseTable& it : rows.tables()) {
    const std::vector<double>& x = it.points.front();
    const std::vector<double>& y = it.points.back();
    const int count = static_cast<int>(x.size());
    one->push_back({count, x.data(), it.pieces.data()});
    two->push_back({count, static_cast<int>(y.size()), x.data(), y.data(), it.pieces.data()});
  }
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

template <class Hosted>
static std::unique_ptr<Hosted> interpret(const MotionProgram& program) {
  if (expression::fusesProducts()) return std::make_unique<interpreted_fused::Interpreter>(program);
  return std::make_unique<interpreted::Interpreter>(program);
}
std::unique_ptr<HostedMotion> hostMotion(const MotionProgram& program) {
  return interpret<HostedMotion>(program);
}
std::unique_ptr<HostedSeries> hostSeries(const MotionProgram& program) {
  return interpret<HostedSeries>(program);
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
  void look(double* entry) override { look_(code_.model(), entry); }

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
  void (*look_)(void*, double*) = code_.find<void, void*, double*>("host_look");
};

/// Series and values by a kernel; what is rarely asked for is interpreted.
class CompiledSeries final : public HostedSeries {
 public:
  CompiledSeries(std::shared_ptr<KernelLibrary> library, const MotionProgram& program)
      : code_(std::move(library), program), interpreted_(hostSeries(program)) {}
  bool expand(const vs_exchange& from, double limit, vs_shown* to) override {
    return expand_(code_.model(), &from, limit, to) != 0;
  }
  void evaluate(const vs_exchange& at, double* rows) override {
    evaluate_(code_.model(), &at, rows);
  }
  bool isResolvedAlong(const vs_exchange& from, const vs_path& path) override {
    return interpreted_->isResolvedAlong(from, path);
  }

 private:
  CompiledMotion code_;
  const std::unique_ptr<HostedSeries> interpreted_;
  int (*expand_)(void*, const vs_exchange*, double, vs_shown*) =
      code_.find<int, void*, const vs_exchange*, double, vs_shown*>("host_expand");
  void (*evaluate_)(void*, const vs_exchange*, double*) =
      code_.find<void, void*, const vs_exchange*, double*>("host_evaluate");
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

std::unique_ptr<HostedSeries> hostSeries(std::shared_ptr<KernelLibrary> library,
                                         const MotionProgram& program) {
  const bool has_all = hasFunctions(*library, {"size", "begin", "host_expand", "host_evaluate"});
  return has_all ? std::make_unique<CompiledSeries>(std::move(library), program) : nullptr;
}

}  // namespace variator_sim
