/// Why a motion stops: a law or a row of C that fails at the last state or just ahead of it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "dynamics/constraint_rows.h"
#include "motion/culprit.h"
#include "motion/program_motion.h"

namespace variator_sim {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
/// The shortest step reaches no further than this power of ten of the distance at which a search
/// ahead begins.
constexpr int kReach = 5;

/// A state `h` s ahead of another one, along its slopes.
struct Ahead {
  Ahead(const double* state, const double* slope, int size, double h) {
    for (int i = 0; i < size; ++i) values[i] = state[i] + h * slope[i];
  }
  double values[3 * kMaxShafts] = {};
};

}  // namespace

void ProgramMotion::stop(scene_status status) {
  stop(reasonOf(status));
  status_.time = status == SCENE_NO_MODES ? std::max(it_.stopped, frontTime()) : frontTime();
  host_->leave(&it_);
  if (status == SCENE_STEP_TOO_LARGE) {
    status_.measure = it_.error * scene.solver.relative_tolerance;
    return;
  }
  explainStop();
  // (Of accelerations that follow from the state: those of gauss.)
  const bool is_lost = it_.rounding > 1.0 && status_.reason == StopReason::kStepUnderflow;
  if (!is_lost || status != SCENE_TOO_MANY_STEPS) return;
  status_.reason = StopReason::kToleranceTooSmall;
  status_.measure = it_.rounding;
}

void ProgramMotion::explainStop() {
  const int S = scene.shaftCount();
  const double front = frontTime();
  double slope[3 * kMaxShafts];
  calcSlope(slope);
  const StateView state = viewOf(it_.state, front);
  if (quantities.isInertiaLost(state)) status_.reason = StopReason::kIndefiniteInertia;
  switch (status_.reason) {
    case StopReason::kChattering:
    case StopReason::kNoModes:
    case StopReason::kIndefiniteInertia:
      return;
    case StopReason::kJumpFailed:
      if (scene.constraintCount() == 1) status_.constraint = 0;
      return;
    case StopReason::kNonFiniteValue:  // where a formula has no series steps end, too
      status_.reason = StopReason::kStepUnderflow;
      break;
    default:
      break;
  }
  const double least = leastDistance();
  if (findBadValue(state) || findLostRow(state, 3) || findFaultAhead(slope, least)) return;
  if (status_.reason != StopReason::kStepUnderflow) return;
  if (leapsAhead(slope, least)) {
    status_.reason = StopReason::kProjectionFailed;
    return;
  }
  for (int i = 0; i < (program_->IS_CLASSICAL != 0 ? 2 : 3) * S; ++i) {
    const double rate = std::abs(slope[i]) / std::max(1.0, std::abs(it_.state[i]));
    status_.measure = std::max(status_.measure, rate);
  }
}

void ProgramMotion::calcSlope(double* slope) {
  const int S = scene.shaftCount();
  Sample unused;
  look(std::numeric_limits<double>::infinity(), &unused, slope + 2 * S);
  std::copy_n(it_.state + S, 2 * S, slope);
}

double ProgramMotion::leastDistance() const {
  return 1e-14 * std::max(1.0, std::abs(frontTime()));
}

bool ProgramMotion::findBadValue(const StateView& state) {
  if (!findNonFinite(scene, state, &status_.torque, &status_.constraint)) return false;
  status_.reason = StopReason::kNonFiniteValue;
  return true;
}

bool ProgramMotion::findLostRow(const StateView& state, int highest_order) {
  const int S = scene.shaftCount();
  int which[kMaxConstraints];
  int count = 0;
  for (int m = 0; m < scene.constraintCount(); ++m) {
    if (scene.constraints[static_cast<std::size_t>(m)]->order() <= highest_order) {
      which[count++] = m;
    }
  }
  ConstraintRows rows(S, count);
  for (int n = 0; n < count; ++n) {
    double c0;
    scene.constraints[static_cast<std::size_t>(which[n])]->calcRow(state, rows.row(n), &c0);
  }
  const DenseMatrix J = quantities.calcInertia(state);
  SquareMatrix mobility(S, S);
  for (int i = 0; i < S; ++i) {
    DenseVector unit = DenseVector::Unit(S, i);
    if (!solveSymmetric(J, 0.0, &unit)) return false;
    mobility.col(i) = unit;
  }
  const auto blame = [&](int n, double measure) {
    status_.reason = StopReason::kSingularConstraint;
    status_.constraint = which[n];
    status_.measure = measure;
    return true;
  };
  // The step underflows before the rank is lost outright: eta grows without bound near there.
  if (!rows.factor(mobility) || rows.rankLeft() < 1e-9) {
    return blame(rows.weakest(), rows.rankLeft());
  }
  for (int n = 0; n < count; ++n) {
    // If C goes to zero like sqrt(t* - t), the step underflows first, at C ~ 1e-8.
    const double left = std::sqrt(rows.lengthSquared(n) / std::max(it_.longest[which[n]], 1e-300));
    if (left < 1e-5) return blame(n, left);
  }
  return false;
}

bool ProgramMotion::followAhead(double h, double* values, double* multipliers) {
  const int S = scene.shaftCount();
  const double front = frontTime();
  double* const epsilon = values + 2 * S;
  std::copy_n(it_.state + 2 * S, S, epsilon);
  search_->calcMultipliers(viewOf(it_.state, front), multipliers);
  return search_->follow(viewOf(values, front + h), epsilon, multipliers);
}

bool ProgramMotion::findFaultAhead(const double* slope, double least) {
  const int S = scene.shaftCount();
  const double front = frontTime();
  const bool follows = search_ != nullptr && program_->IS_CLASSICAL != 0;
  double h = least;
  for (int decade = 0; decade < 12; ++decade, h *= 10.0) {
    Ahead ahead(it_.state, slope, 3 * S, h);
    if (!std::all_of(ahead.values, ahead.values + 3 * S, [](double x) { return std::isfinite(x); }))
      return false;
    double multipliers[kMaxShafts] = {};
    const bool is_solved = !follows || followAhead(h, ahead.values, multipliers);
    if (!is_solved) std::fill_n(ahead.values + 2 * S, S, kNaN);
    if (findBadValue(viewOf(ahead.values, front + h))) return true;
    if (is_solved) continue;
    status_.reason = StopReason::kProjectionFailed;
    return true;
  }
  return false;
}

bool ProgramMotion::leapsAhead(const double* slope, double least) {
  const int S = scene.shaftCount();
  const double front = frontTime();
  if (search_ == nullptr || program_->IS_CLASSICAL == 0) return false;
  double h = least;
  for (int decade = 0; decade <= kReach; ++decade, h *= 10.0) {
    Ahead ahead(it_.state, slope, 2 * S, h);
    double multipliers[kMaxShafts] = {};
    double* const epsilon = ahead.values + 2 * S;
    if (!followAhead(h, ahead.values, multipliers)) return false;
    // Continued back to the front, another branch leads to other accelerations.
    const bool leads_back = search_->follow(viewOf(it_.state, front), epsilon, multipliers);
    if (leads_back && !agree(it_.state + 2 * S, epsilon, S)) return true;
  }
  return false;
}

std::string ProgramMotion::findBranch(Element* owner) {
  const std::vector<expression::Branch>& branches = program_->branches();
  std::vector<expression::Node> arguments;
  arguments.reserve(branches.size());
  for (const expression::Branch& it : branches) arguments.push_back(it.argument);
  const expression::Tape tape(*scene.graph, arguments);
  double slope[3 * kMaxShafts];
  calcSlope(slope);
  const double reach = std::pow(10.0, kReach) * leastDistance();
  std::vector<int> signs[3];
  for (int side = -1; side <= 1; ++side) {
    const Ahead ahead(it_.state, slope, 3 * scene.shaftCount(), side * reach);
    const double* const values = tape.evaluate(viewOf(ahead.values, frontTime() + side * reach));
    for (std::size_t n = 0; n < branches.size(); ++n) {
      signs[side + 1].push_back((values[n] > 0.0) - (values[n] < 0.0));
    }
  }
  for (std::size_t n = 0; n < branches.size(); ++n) {
    if (signs[0][n] == signs[1][n] && signs[1][n] == signs[2][n]) continue;
    *owner = findOwner(scene, branches[n].argument);
    if (owner->exists()) return branches[n].function;
  }
  return "";
}

}  // namespace variator_sim
