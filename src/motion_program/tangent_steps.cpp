#include "motion_program/tangent_steps.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>

#include "expression/series_dot.h"
#include "motion_program/tangent.h"

namespace variator_sim {

#include "motion_program/interpreted_ranges.inc"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // coefficients behind the order
#endif
#undef SCENE_REAL
#undef VS_IS_SAME
#undef VS_SET_VALUE
#undef VS_INSTANT
#undef VS_PLAIN
#undef VS_CONVERGED
#undef VS_CONVERGES_LATE
#undef VS_JUDGED
#undef VS_MAY_END_EARLY
#define SCENE_REAL Real
#define VS_IS_SAME(a, b) isSame(a, b)
#define VS_SET_VALUE(x, to) (x).value = static_cast<double>(to)
#define VS_INSTANT(m, at, theta) instantOf(m, at, theta)
#define VS_PLAIN(array, count) plain(array, count)
#define VS_CONVERGED 1e-13
#define VS_CONVERGES_LATE IS_CURVED  // multipliers follow the accelerations
#define VS_JUDGED(x, n, part, allowed) judge(x, n, part, allowed)
#define VS_MAY_END_EARLY 0
#define VS_RANGES ranges_.data()
#define VS_CONSTANT(instruction) constants_[rows_.placeOf(instruction)]
#define VS_FACTOR(term) constants_[at(static_cast<int>(&(term)-rows_.terms().data()))]

template <int P>
bool isSame(const Tangent<P>& a, const Tangent<P>& b) {
  return a.value == b.value && std::equal(a.slope, a.slope + P, b.slope);
}
template <int P>
bool isSame(const Tangent<P>& a, double b) {
  return isSame(a, Tangent<P>(b));
}

#define VS_TANGENTS 1
namespace tangents_of_one {
#include "motion_program/tangent_interpreter.inc"
}  // namespace tangents_of_one
#undef VS_TANGENTS

#define VS_TANGENTS 4
namespace tangents_of_four {
#include "motion_program/tangent_interpreter.inc"
}  // namespace tangents_of_four

VARIATOR_SIM_BEGIN_FUSED
namespace tangents_of_four_fused {
#include "motion_program/tangent_interpreter.inc"
}  // namespace tangents_of_four_fused
VARIATOR_SIM_END_FUSED
#undef VS_TANGENTS

std::unique_ptr<TangentMotion> hostTangents(const MotionProgram& program,
                                            const TangentNumbers& numbers,
                                            const std::vector<int>& shown) {
  if (numbers.slopes.size() <= 1)
    return std::make_unique<tangents_of_one::Interpreter>(program, numbers, shown);
  if (expression::fusesProducts())
    return std::make_unique<tangents_of_four_fused::Interpreter>(program, numbers, shown);
  return std::make_unique<tangents_of_four::Interpreter>(program, numbers, shown);
}

}  // namespace variator_sim
