#include "motion/beginning.h"

#include <algorithm>
#include <cmath>

#include "motion/motion.h"
#include "motion/stop_message.h"
#include "variator_sim/errors.h"

namespace variator_sim {

namespace {

/// Given values count as consistent when the nearest consistent ones are not further away than
/// this, relative to max(1, |largest|): what is left of values printed with ten digits.
bool isNear(const double* given, const double* found, int count) {
  constexpr double kConsistent = 1e-9;
  double scale = 1.0;
  double distance = 0.0;
  for (int i = 0; i < count; ++i) {
    scale = std::max(scale, std::abs(given[i]));
    if (!(std::abs(found[i] - given[i]) <= distance)) distance = std::abs(found[i] - given[i]);
  }
  return distance <= kConsistent * scale;
}

/// True where accelerations that follow from the state agree with given ones.
bool agree(const double* given, const double* found, int count) {
  for (int i = 0; i < count; ++i) {
    if (!(std::abs(found[i] - given[i]) <= 1e-6 * std::max(1.0, std::abs(given[i])))) return false;
  }
  return true;
}

bool areFinite(const double* values, int count) {
  return std::all_of(values, values + count, [](double it) { return std::isfinite(it); });
}

bool searchesAccelerations(const Scene& scene) {
  return !hasMoreThanLaws(scene) &&
         std::any_of(scene.constraints.begin(), scene.constraints.end(),
                     [](const ConstraintPtr& it) { return it->nonlinearAccelerations().any(); });
}

}  // namespace

Beginning::Beginning(Motion& motion)
    : motion_(motion),
      scene_(motion.scene),
      program_(motion.program),
      S(scene_.shaftCount()),
      search_(searchesAccelerations(scene_) ? std::make_unique<LeastReactionSearch>(scene_)
                                            : nullptr) {}

scene_status Beginning::findNear(Begin how, bool are_given, bool may_move) {
  misfit_ = {};
  std::copy_n(program_.it.state, 3 * S, misfit_.given);
  Exchange left;
  scene_status status = tryToBegin(how, are_given, may_move, &left);
  constexpr int kStuck = 0;  // the mode in which it is tried for the torque that it would hold
  const bool is_of_modes = status == SCENE_INCONSISTENT && program_.text().HOLDS > 0 &&
                           left.culprit >= 0 && left.hold[left.culprit].mode == kStuck;
  // A start that fails leaves the projection of the velocities; another one, what impacts made of
  // it.
  double found[2 * kMaxShafts];  // and the accelerations
  std::copy_n(left.state + S, 2 * S, found);
  const bool is_known = is_of_modes || (status == SCENE_OK && program_.text().HOLDS > 0);
  // The program is stricter with small values beside large ones than isNear is.
  if (status == SCENE_INCONSISTENT && !is_of_modes)
    status = tryToBegin(how, are_given, true, &left);
  if (areFinite(left.state + S, S)) std::copy_n(left.state + S, S, program_.it.state + S);
  if (!is_known) judgeVelocities(status, may_move, found);
  if (misfit_.kind != Misfit::Kind::kNone) {
    status = SCENE_INCONSISTENT;
  } else if (status == SCENE_INCONSISTENT) {
    misfit_.kind = Misfit::Kind::kModes;
    misfit_.element = left.culprit;
    misfit_.torque = left.culprit_torque;
    misfit_.slip = left.culprit_slip;
    return status;
  } else {
    if (search_ != nullptr) status = beginWithFound(how, are_given, &left);
    if (status == SCENE_OK && are_given && !may_move) status = judgeAccelerations(left);
    if (status == SCENE_OK) return status;
    if (misfit_.kind == Misfit::Kind::kNone) status = explainFault(status);
  }
  std::copy_n(misfit_.given, 3 * S, program_.it.state);
  program_.begin(Begin::kSaved);
  return status;
}

scene_status Beginning::tryToBegin(Begin how, bool are_given, bool may_move, Exchange* left) {
  program_.it.are_given = are_given ? 1 : 0;
  program_.it.may_move = may_move ? 1 : 0;
  const scene_status status = program_.begin(how);
  program_.leave(left);
  return status;
}

void Beginning::judgeVelocities(scene_status status, bool may_move, const double* found) {
  const double* const given = misfit_.given + S;
  // Their projection comes first; the accelerations are those given, to the bit, where it fails.
  const bool is_first =
      program_.text().HAS_ORDER_1 != 0 && std::equal(given + S, given + 2 * S, found + S);
  const bool are_kept = isNear(given, found, S);
  const bool is_lost = status == SCENE_NOT_CONVERGED && is_first &&
                       (program_.text().HOLDS == 0 || !are_kept);  // (modes are decided behind it)
  const bool are_found = areFinite(found, S) && !is_lost;
  if (are_found && (may_move || are_kept)) return;
  if (status == SCENE_SINGULAR && is_first) return;
  misfit_.of_velocities = true;
  misfit_.kind = are_found ? Misfit::Kind::kInconsistent : Misfit::Kind::kNotFound;
  std::copy_n(found, S, misfit_.nearest);
}

scene_status Beginning::judgeAccelerations(const Exchange& left) {
  const double* const given = misfit_.given + 2 * S;
  const double* const found = left.state + 2 * S;
  if (program_.text().HOLDS > 0) return SCENE_OK;  // the modes give them
  const bool are_kept =
      program_.text().IS_CLASSICAL != 0 ? agree(given, found, S) : isNear(given, found, S);
  if (are_kept) return SCENE_OK;
  misfit_.kind = Misfit::Kind::kInconsistent;
  std::copy_n(found, S, misfit_.nearest);
  return SCENE_INCONSISTENT;
}

scene_status Beginning::beginWithFound(Begin how, bool are_given, Exchange* left) {
  using Verdict = LeastReactionSearch::Verdict;
  const bool is_classical = program_.text().IS_CLASSICAL != 0;
  const double* const given = misfit_.given + 2 * S;
  double* const epsilon = program_.it.state + 2 * S;
  std::copy_n(given, S, epsilon);
  const StateView at = program_.view(program_.it.state, motion_.time);
  const auto follow = [&] {
    double multipliers[kMaxShafts] = {};
    std::copy_n(given, S, epsilon);
    return search_->calcMultipliers(at, multipliers) && search_->follow(at, epsilon, multipliers);
  };
  Verdict verdict = Verdict::kFound;
  if (are_given && !is_classical) {
    if (!search_->retract(at, epsilon)) {
      std::copy_n(given, S, epsilon);
      verdict = Verdict::kNone;
    }
  } else if (!(are_given && how == Begin::kWritten && follow())) {
    verdict = search_->findLeastReaction(at, epsilon);
    // Given ones select one of several stationary points.
    if (are_given && (verdict == Verdict::kTie || verdict == Verdict::kDoubtful)) {
      verdict = follow() ? Verdict::kFound : Verdict::kNone;
    }
  }
  if (verdict == Verdict::kTie) misfit_.kind = Misfit::Kind::kNotUnique;
  if (verdict == Verdict::kDoubtful) misfit_.kind = Misfit::Kind::kDoubtful;
  if (verdict != Verdict::kFound) return SCENE_NOT_CONVERGED;
  if (is_classical) search_->calcMultipliers(at, program_.it.multiplier);
  return tryToBegin(how, true, true, left);
}

scene_status Beginning::explainFault(scene_status status) {
  const StateView at = program_.view(program_.it.state, motion_.time);
  motion_.status.time = motion_.time;
  if (motion_.findBadValue(at)) return SCENE_NOT_FINITE;
  // A rank is lost on psi = 0 only; elsewhere no start was found at all.
  const auto is_met = [&at](const ConstraintPtr& it) {
    double C[kMaxShafts];
    return it->order() == 3 || it->calcResidualAndJacobian(at, C) == 0.0;
  };
  const bool is_lost = motion_.findLostRow(at, 1) ||
                       (motion_.findLostRow(at, 3) &&
                        std::all_of(scene_.constraints.begin(), scene_.constraints.end(), is_met));
  if (is_lost) return SCENE_SINGULAR;
  motion_.status = MotionStatus{};
  const bool is_missed = status == SCENE_NOT_CONVERGED || status == SCENE_SINGULAR;
  if (status == SCENE_NOT_FINITE || (is_missed && program_.text().HAS_RESIDUAL == 0)) {
    motion_.status.reason = StopReason::kNonFiniteValue;  // (sums of laws overflow)
    motion_.status.time = motion_.time;
    return SCENE_NOT_FINITE;
  }
  if (!is_missed || program_.text().HOLDS > 0) return status;
  misfit_.kind = Misfit::Kind::kNotFound;
  std::copy_n(program_.it.state + 2 * S, S, misfit_.given + 2 * S);
  return SCENE_NOT_CONVERGED;
}

// --- explanations ----------------------------------------------------------------------------

/// Returns the candidates that have the same reaction, or may have.
std::string Beginning::listCandidates() const {
  std::string text =
      misfit_.kind == Misfit::Kind::kNotUnique
          ? "more than one has the least reaction, and they lead to different motions: "
          : "which one has the least reaction is not certain, the constraints have too many like "
            "these: ";
  for (int n = 0; n < search_->candidateCount(); ++n) {
    const auto& candidate = search_->candidate(n);
    text += (n > 0 ? ", " : "") + formatNumbers(candidate.epsilon, S) +
            " with 1/2 R^T J^-1 R = " + formatNumber(candidate.reaction);
  }
  return text + "; give 'initial/acceleration'";
}

std::string Beginning::explainMisfit(bool is_start) {
  if (misfit_.kind == Misfit::Kind::kNotUnique || misfit_.kind == Misfit::Kind::kDoubtful) {
    return is_start ? listCandidates()
                    : "which accelerations have the least reaction is not certain; give them";
  }
  Sample unused;
  program_.look(0.0, &unused);  // what the laws read beside the state
  const StateView state = program_.view(misfit_.given, motion_.time);
  const bool of_velocities = misfit_.of_velocities;
  const std::string level = of_velocities ? "velocities" : "accelerations";
  const std::string values = formatNumbers(of_velocities ? state.velocity : state.acceleration, S);
  std::string residuals;
  for (const ConstraintPtr& constraint : scene_.constraints) {
    if (constraint->order() > (of_velocities ? 1 : 2)) continue;
    double C[kMaxShafts];
    residuals += (residuals.empty() ? " residual of '" : ", residual of '") + constraint->name() +
                 "' = " +
                 formatNumber(of_velocities ? constraint->calcResidual(state)
                                            : constraint->calcResidualAndJacobian(state, C));
  }
  if (misfit_.kind == Misfit::Kind::kNotFound) {
    const bool is_given = of_velocities || !scene_.initial.acceleration.empty();
    const std::string near = !is_start ? "near " + values
                             : is_given
                                 ? "near those given"
                                 : "from " + values + " rad/s^2; give 'initial/acceleration'";
    return "no " + level + " that satisfy the constraints were found " + near +
           (residuals.empty() ? "" : " (there:" + residuals + ")");
  }
  const bool by_principle = scene_.principle == Principle::kGauss && !of_velocities;
  const std::string fault =
      !is_start
          ? "the " + level + " " + values + " do not satisfy the constraints or the principle:"
          : values + (by_principle ? " is not what the principle 'gauss' gives:"
                                   : " does not satisfy the constraints:");
  return fault + residuals + (residuals.empty() ? "" : ";") + " consistent " + level +
         " near them are " + formatNumbers(misfit_.nearest, S) +
         (is_start ? " (write these, or set 'initial/project: true' to start there)"
                   : " (set these, or have them projected)");
}

std::string Beginning::describeFault(scene_status status) {
  if (misfit_.kind == Misfit::Kind::kNone || misfit_.kind == Misfit::Kind::kModes) {
    return std::string("the motion cannot go on from there: ") + toString(reasonOf(status));
  }
  return explainMisfit(/*is_start=*/false);
}

void Beginning::throwFault(scene_status status) {
  if (misfit_.kind == Misfit::Kind::kModes) throwMode();
  if (misfit_.kind != Misfit::Kind::kNone) {
    throw SceneError(misfit_.of_velocities ? "initial/velocity" : "initial/acceleration",
                     explainMisfit(/*is_start=*/true) + scene_.extreme_numbers);
  }
  const StopReason reason = reasonOf(status);
  const std::string why = explainReason(reason);
  throw SceneError(
      scene_.initial.acceleration.empty() ? "initial/velocity" : "initial/acceleration",
      "no motion begins here: " + (why.empty() ? toString(reason) : why) + scene_.extreme_numbers);
}

void Beginning::throwMode() const {
  const MotionProgram& text = program_.text();
  const auto element = static_cast<std::size_t>(misfit_.element);
  if (text.has_gap.values[element] != 0) {
    throw SceneError("initial/angle", "the start lies " + formatNumber(-misfit_.slip) +
                                          " rad beyond " + inQuotes(text.holdNames()[element]) +
                                          "; allowed: angles within its limits");
  }
  const std::string torque = formatNumber(misfit_.torque) + " N m";
  const bool is_stuck = text.begins_in.values[element] == static_cast<int>(Holding::Begin::kStuck);
  std::string fault = "'slipping': it holds at the start, with " + torque;
  if (is_stuck) {
    fault = std::abs(misfit_.slip) > scene_.solver.absolute_tolerance
                ? "'stuck': its slip is " + formatNumber(misfit_.slip) + " rad/s at the start"
                : "'stuck': it would have to hold " + torque + " at the start";
  }
  throw SceneError(text.holdNames()[element] + "/initial",
                   fault + "; allowed: auto, or a start to which it belongs");
}

}  // namespace variator_sim
