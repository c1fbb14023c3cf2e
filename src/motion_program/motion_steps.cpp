#include "motion_program/motion_steps.h"

#include <cfloat>
#include <cmath>
#include <cstring>

#include "expression/series_dot.h"
#include "variator_sim/types.h"

namespace variator_sim {

namespace {
using expression::SeriesOperation;
using expression::SeriesOutputs;
using expression::SeriesRange;
using expression::SeriesResolution;
using namespace expression;           // NOLINT: the kinds of operations
using namespace expression::library;  // NOLINT: its functions are many
using Real = double;
#include "expression/series_resolution.inc"
//
#include "expression/series_ranges.inc"
}  // namespace

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

std::unique_ptr<MotionSteps> interpretMotion(const MotionProgram& program) {
  if (expression::fusesProducts()) return std::make_unique<interpreted_fused::Interpreter>(program);
  return std::make_unique<interpreted::Interpreter>(program);
}

namespace {

class CompiledSteps final : public MotionSteps {
 public:
  CompiledSteps(std::shared_ptr<KernelLibrary> library, const MotionProgram& program)
      : library_(std::move(library)),
        take_over_(find<void(void*, const vs_exchange*)>("vs_kernel_take_over")),
        advance_(find<int(void*, double, vs_exchange*)>("vs_kernel_advance")),
        model_(find<unsigned long()>("vs_kernel_size")() / sizeof(double) + 1) {
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
                program.resolved.values.data()};
    find<void(void*, const vs_numbers*)>("vs_kernel_begin")(model_.data(), &numbers_);
  }
  void takeOver(const vs_exchange& from) override { take_over_(model_.data(), &from); }
  scene_status advance(double left, vs_exchange* to) override {
    return static_cast<scene_status>(advance_(model_.data(), left, to));
  }

 private:
  template <class Function>
  Function* find(const char* name) const {
    return reinterpret_cast<Function*>(library_->find(name));
  }

  std::shared_ptr<KernelLibrary> library_;
  void (*take_over_)(void*, const vs_exchange*);
  int (*advance_)(void*, double, vs_exchange*);
  std::vector<double> model_;
  std::vector<vs_table> tables_;
  std::vector<vs_table_of_two> tables_of_two_;
  std::vector<double> constants_;
  vs_numbers numbers_;
};

}  // namespace

std::unique_ptr<MotionSteps> runMotion(std::shared_ptr<KernelLibrary> library,
                                       const MotionProgram& program) {
  for (const char* name :
       {"vs_kernel_size", "vs_kernel_begin", "vs_kernel_take_over", "vs_kernel_advance"}) {
    if (library->find(name) == nullptr) return nullptr;
  }
  return std::make_unique<CompiledSteps>(std::move(library), program);
}

}  // namespace variator_sim
