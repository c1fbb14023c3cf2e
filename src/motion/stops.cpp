#include "motion/stops.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "dynamics/constraint_rows.h"
#include "dynamics/dense.h"
#include "motion/motion.h"
#include "motion/stop_message.h"

namespace variator_sim {

StopReason reasonOf(scene_status status) {
  switch (status) {
    case SCENE_SINGULAR:
      return StopReason::kSingularConstraint;
    case SCENE_NOT_CONVERGED:
    case SCENE_INCONSISTENT:
      return StopReason::kProjectionFailed;
    case SCENE_NOT_FINITE:
    case SCENE_BAD_ARGUMENT:
      return StopReason::kNonFiniteValue;
    case SCENE_TOO_MANY_STEPS:
      return StopReason::kStepUnderflow;
    case SCENE_CHATTERING:
      return StopReason::kChattering;
    case SCENE_NO_MOTION:
      return StopReason::kJumpFailed;
    case SCENE_NO_MODES:
      return StopReason::kNoModes;
    case SCENE_STEP_TOO_LARGE:
      return StopReason::kStepTooLarge;
    case SCENE_OK:
      break;
  }
  return StopReason::kNone;
}

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

StopSearch::StopSearch(Motion& motion)
    : motion_(motion), scene_(motion.scene), program_(motion.program), S(scene_.shaftCount()) {}

void StopSearch::explain() {
  const double front = program_.front();
  double slope[3 * kMaxShafts];
  calcSlope(slope);
  const StateView state = motion_.observation.view(program_.it.state, front);
  if (motion_.quantities.isInertiaLost(state))
    motion_.status.reason = StopReason::kIndefiniteInertia;
  switch (motion_.status.reason) {
    case StopReason::kChattering:
    case StopReason::kNoModes:
    case StopReason::kIndefiniteInertia:
      return;
    case StopReason::kJumpFailed:
      if (scene_.constraintCount() == 1) motion_.status.constraint = 0;
      return;
    case StopReason::kNonFiniteValue:  // where a formula has no series steps end, too
      motion_.status.reason = StopReason::kStepUnderflow;
      break;
    default:
      break;
  }
  const double least = leastDistance();
  if (findBadValue(state) || findLostRow(state, 3) || findFaultAhead(slope, least)) return;
  if (motion_.status.reason != StopReason::kStepUnderflow) return;
  if (doSolutionsMeet()) {
    motion_.status.reason = StopReason::kProjectionFailed;
    return;
  }
  for (int i = 0; i < (program_.text().IS_CLASSICAL != 0 ? 2 : 3) * S; ++i) {
    const double rate = std::abs(slope[i]) / std::max(1.0, std::abs(program_.it.state[i]));
    motion_.status.measure = std::max(motion_.status.measure, rate);
  }
}

void StopSearch::calcSlope(double* slope) {
  Sample unused;
  motion_.observation.look(std::numeric_limits<double>::infinity(), &unused, slope + 2 * S);
  std::copy_n(program_.it.state + S, 2 * S, slope);
}

double StopSearch::leastDistance() const {
  return 1e-14 * std::max(1.0, std::abs(program_.front()));
}

bool StopSearch::findBadValue(const StateView& state) {
  if (!findNonFinite(scene_, state, &motion_.status.torque, &motion_.status.constraint))
    return false;
  motion_.status.reason = StopReason::kNonFiniteValue;
  return true;
}

bool StopSearch::findLostRow(const StateView& state, int highest_order) {
  int which[kMaxConstraints];
  int count = 0;
  for (int m = 0; m < scene_.constraintCount(); ++m) {
    if (scene_.constraints[static_cast<std::size_t>(m)]->order() <= highest_order) {
      which[count++] = m;
    }
  }
  ConstraintRows rows(S, count);
  for (int n = 0; n < count; ++n) {
    double row[kMaxShafts];
    double c0;
    scene_.constraints[static_cast<std::size_t>(which[n])]->calcRow(state, row, &c0);
    rows.jacobian().row(n) = DenseVector::Map(row, S);
  }
  const DenseMatrix J = motion_.quantities.calcInertia(state);
  SquareMatrix mobility(S, S);
  for (int i = 0; i < S; ++i) {
    DenseVector unit = DenseVector::Unit(S, i);
    if (!solveSymmetric(J, 0.0, &unit)) return false;
    mobility.col(i) = unit;
  }
  const auto blame = [&](int n, double measure) {
    motion_.status.reason = StopReason::kSingularConstraint;
    motion_.status.constraint = which[n];
    motion_.status.measure = measure;
    return true;
  };
  // The step underflows before the rank is lost outright: eta grows without bound near there.
  if (!rows.factor(mobility) || rows.rankLeft() < 1e-9) {
    return blame(rows.weakest(), rows.rankLeft());
  }
  for (int n = 0; n < count; ++n) {
    // If C goes to zero like sqrt(t* - t), the step underflows first, at C ~ 1e-8.
    const double left =
        std::sqrt(rows.lengthSquared(n) / std::max(program_.it.longest[which[n]], 1e-300));
    if (left < 1e-5) return blame(n, left);
  }
  return false;
}

bool StopSearch::followAhead(double h, double* values, double* multipliers) {
  const double front = program_.front();
  double* const epsilon = values + 2 * S;
  std::copy_n(program_.it.state + 2 * S, S, epsilon);
  motion_.beginning.search()->calcMultipliers(motion_.observation.view(program_.it.state, front),
                                              multipliers);
  return motion_.beginning.search()->follow(motion_.observation.view(values, front + h), epsilon,
                                            multipliers);
}

bool StopSearch::findFaultAhead(const double* slope, double least) {
  const double front = program_.front();
  const bool follows = motion_.beginning.search() != nullptr && program_.text().IS_CLASSICAL != 0;
  double h = least;
  for (int decade = 0; decade < 12; ++decade, h *= 10.0) {
    Ahead ahead(program_.it.state, slope, 3 * S, h);
    if (!std::all_of(ahead.values, ahead.values + 3 * S, [](double x) { return std::isfinite(x); }))
      return false;
    double multipliers[kMaxShafts] = {};
    const bool is_solved = !follows || followAhead(h, ahead.values, multipliers);
    if (!is_solved) std::fill_n(ahead.values + 2 * S, S, kNaN);
    if (findBadValue(motion_.observation.view(ahead.values, front + h))) return true;
    if (is_solved) continue;
    motion_.status.reason = StopReason::kProjectionFailed;
    return true;
  }
  return false;
}

bool StopSearch::doSolutionsMeet() {
  // Points of stationary reaction meet where the matrix of Newton's iteration for them,
  //     [ J - sum lambda_m H_m   -C^T ]
  //     [ C                       0   ],
  // becomes singular: without H the answer d to a force J r is no longer than r.
  constexpr double kGain = 1e3;
  const int K = scene_.constraintCount();
  const MotionProgram& text = program_.text();
  if (text.IS_CLASSICAL == 0 || text.HOLDS > 0 || K == 0 || K >= S) return false;
  const StateView state = motion_.observation.view(program_.it.state, program_.front());
  const DenseMatrix J = motion_.quantities.calcInertia(state);
  DenseVector r = DenseVector::Zero(S);
  for (int i = 0; i < S; ++i) r(i) = std::cos(i + 1.0);  // of no special direction
  DenseVector force = DenseVector::Zero(S + K);
  force.head(S) = J * r;
  DenseMatrix all = DenseMatrix::Zero(S + K, S + K);
  all.topLeftCorner(S, S) = J;
  for (int m = 0; m < K; ++m) {
    double C[kMaxShafts];
    double H[kMaxShafts * kMaxShafts];
    const Constraint& it = *scene_.constraints[static_cast<std::size_t>(m)];
    it.calcResidualAndJacobian(state, C);
    it.calcHessian(state, H);
    for (int i = 0; i < S; ++i) {
      all(S + m, i) = C[i];
      all(i, S + m) = -C[i];
      for (int j = 0; j < S; ++j) all(i, j) -= program_.it.multiplier[m] * H[i * S + j];
    }
  }
  DenseVector answer;
  if (!all.allFinite() || !solveScaled(all, force, &answer)) return false;
  const DenseVector d = answer.head(S);
  return d.dot(J * d) > kGain * kGain * r.dot(J * r);
}

std::string StopSearch::findBranch(Element* owner) {
  const std::vector<expression::Branch>& branches = program_.text().branches();
  std::vector<expression::Node> arguments;
  arguments.reserve(branches.size());
  for (const expression::Branch& it : branches) arguments.push_back(it.argument);
  const expression::Tape tape(*scene_.graph, arguments);
  double slope[3 * kMaxShafts];
  calcSlope(slope);
  const double reach = std::pow(10.0, kReach) * leastDistance();
  // A motion that runs away in a finite time never has the state so far ahead.
  if (motion_.status.measure * reach > 1.0) return "";
  std::vector<int> signs[3];
  for (int side = -1; side <= 1; ++side) {
    const Ahead ahead(program_.it.state, slope, 3 * S, side * reach);
    const double* const values =
        tape.evaluate(motion_.observation.view(ahead.values, program_.front() + side * reach));
    for (std::size_t n = 0; n < branches.size(); ++n) {
      signs[side + 1].push_back((values[n] > 0.0) - (values[n] < 0.0));
    }
  }
  for (std::size_t n = 0; n < branches.size(); ++n) {
    if (signs[0][n] == signs[1][n] && signs[1][n] == signs[2][n]) continue;
    *owner = findOwner(scene_, branches[n].argument);
    if (owner->exists()) return branches[n].function;
  }
  return "";
}

// --- descriptions ----------------------------------------------------------------------------

std::string StopSearch::findCulprit(MotionStatus* told) {
  Element owner;
  std::string function;
  if (told->reason == StopReason::kStepUnderflow) {
    function = findBranch(&owner);
  } else if (told->reason == StopReason::kChattering && program_.it.passed >= 0 &&
             program_.it.passed < program_.text().FIRST_EVENT) {
    const expression::Branch& branch =
        program_.text().branches()[static_cast<std::size_t>(program_.it.passed)];
    function = branch.function;
    owner = findOwner(scene_, branch.argument);
  } else {
    return "";
  }
  told->torque = owner.torque;
  told->constraint = owner.constraint;
  return function;
}

std::string StopSearch::describe(Element* culprit) {
  MotionStatus told = motion_.status;
  const std::string function = findCulprit(&told);
  const StateView state = motion_.view();
  Inertia inertia(scene_.inertia, scene_.inertia_harmonics);
  inertia.update(state.angle);
  std::string text = describeStop(scene_, told, state, inertia, function, culprit);
  // (The node cuts long messages, such as those with the states of many shafts.)
  text.insert(std::min(text.find("; last good state: "), text.size()), describeHugeCommands());
  if (motion_.status.reason == StopReason::kProjectionFailed && doSolutionsMeet())
    text += "; two solutions for the accelerations meet here, and none goes on behind";
  return text + describeLastEvent() + describeRigid() + describePast();
}

/// Returns the commands that no machine has, of ordinary inputs.
std::string StopSearch::describeHugeCommands() const {
  constexpr double kNoMachine = 1e12;  // in any SI unit
  std::string text;
  for (int i = 0; i < scene_.inputCount(); ++i) {
    const CommandInputSettings& input = scene_.inputs[static_cast<std::size_t>(i)];
    const double command = motion_.inputs.signal(i).target();
    if (input.kind != InputKind::kCommanded || std::abs(command) < kNoMachine) continue;
    text += "; the command " + formatNumber(command) + " on " + inQuotes(input.topic) +
            " is out of all proportion: 'min' and 'max' of the input bound what is taken";
  }
  return text;
}

std::string StopSearch::describeLastEvent() const {
  const int event = program_.it.passed - program_.text().FIRST_EVENT;
  if (motion_.status.reason != StopReason::kChattering || event < 0 ||
      event >= program_.text().EVENTS)
    return "";
  return "; the event " + inQuotes(scene_.events[static_cast<std::size_t>(event)].name) +
         " came last: what it sets must not set it off again at once";
}

std::string StopSearch::describeRigid() const {
  if (motion_.status.reason != StopReason::kNoModes) return "";
  const MotionProgram& text = program_.text();
  std::string rigid;
  for (std::size_t h = 0; h < text.holdNames().size(); ++h) {
    const bool is_rigid = text.closes_below.values[h] > 0.0 || text.has_gap.values[h] != 0 ||
                          text.slides_backward.values[h] == 0;
    if (is_rigid) rigid += (rigid.empty() ? "; rigid are " : ", ") + inQuotes(text.holdNames()[h]);
  }
  return rigid;
}

std::string StopSearch::describePast() const {
  const int full = program_.past().findFull();
  if (full < 0) return "";
  const auto input =
      static_cast<std::size_t>(program_.text().delay_input.values[static_cast<std::size_t>(full)]);
  return "; the past of " + inQuotes(scene_.inputs[input].name) + " has " +
         std::to_string(MotionPast::kMostPieces) +
         " steps, which is all that is kept: a shorter delay, or larger tolerances, have fewer";
}

}  // namespace variator_sim
