/// Beginnings of a motion by the scene's program: at the start, and at states of elsewhere.
#include <algorithm>
#include <cmath>

#include "motion/program_motion.h"

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

bool areFinite(const double* values, int count) {
  return std::all_of(values, values + count, [](double it) { return std::isfinite(it); });
}

}  // namespace

bool ProgramMotion::agree(const double* given, const double* found, int count) {
  for (int i = 0; i < count; ++i) {
    if (!(std::abs(found[i] - given[i]) <= 1e-6 * std::max(1.0, std::abs(given[i])))) return false;
  }
  return true;
}

void ProgramMotion::start() {
  const int S = scene.shaftCount();
  std::fill_n(it_.state, 3 * S, 0.0);
  std::fill_n(it_.multiplier, Exchange::kMostRows, 0.0);
  std::fill_n(it_.reaction, kMaxShafts, 0.0);
  std::fill_n(it_.longest, Exchange::kMostRows, 0.0);
  it_.time = time;
  it_.time_rest = 0.0;
  const InitialConditions& initial = scene.initial;
  std::copy(initial.angle.begin(), initial.angle.end(), it_.state);
  std::copy(initial.velocity.begin(), initial.velocity.end(), it_.state + S);
  std::copy(initial.acceleration.begin(), initial.acceleration.end(), it_.state + 2 * S);
  const scene_status status =
      beginNear(Begin::kStart, !initial.acceleration.empty(), initial.project);
  if (status != SCENE_OK && status_.ok()) {
    if (commands.isEmpty()) throwInitialError(status);
    stop(reasonOf(status));
  }
  energy_.begin(calcKineticEnergy());
  forgetSample();
}

scene_status ProgramMotion::beginNear(Begin how, bool are_given, bool may_move) {
  const int S = scene.shaftCount();
  misfit_ = {};
  std::copy_n(it_.state, 3 * S, misfit_.given);
  Exchange left;
  scene_status status = tryToBegin(how, are_given, may_move, &left);
  const bool is_of_modes = status == SCENE_INCONSISTENT && isCulprit(left);
  // A start that fails leaves the projection of the velocities; another one, what impacts made of
  // it.
  double found[2 * kMaxShafts];  // and the accelerations
  std::copy_n(left.state + S, 2 * S, found);
  const bool is_known = is_of_modes || (status == SCENE_OK && program_->HOLDS > 0);
  // The program is stricter with small values beside large ones than isNear is.
  if (status == SCENE_INCONSISTENT && !is_of_modes)
    status = tryToBegin(how, are_given, true, &left);
  if (areFinite(left.state + S, S)) std::copy_n(left.state + S, S, it_.state + S);
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
  std::copy_n(misfit_.given, 3 * S, it_.state);
  begin(Begin::kSaved);
  return status;
}

scene_status ProgramMotion::tryToBegin(Begin how, bool are_given, bool may_move, Exchange* left) {
  it_.are_given = are_given ? 1 : 0;
  it_.may_move = may_move ? 1 : 0;
  const scene_status status = begin(how);
  host_->leave(left);
  return status;
}

bool ProgramMotion::isCulprit(const Exchange& left) const {
  constexpr int kStuck = 0;  // in which it is tried for the torque that it would hold
  return program_->HOLDS > 0 && left.culprit >= 0 && left.hold[left.culprit].mode == kStuck;
}

void ProgramMotion::judgeVelocities(scene_status status, bool may_move, const double* found) {
  const int S = scene.shaftCount();
  const double* const given = misfit_.given + S;
  // Their projection comes first; the accelerations are those given, to the bit, where it fails.
  const bool is_first =
      program_->HAS_ORDER_1 != 0 && std::equal(given + S, given + 2 * S, found + S);
  const bool are_kept = isNear(given, found, S);
  const bool is_lost = status == SCENE_NOT_CONVERGED && is_first &&
                       (program_->HOLDS == 0 || !are_kept);  // (modes are decided behind it)
  const bool are_found = areFinite(found, S) && !is_lost;
  if (are_found && (may_move || are_kept)) return;
  if (status == SCENE_SINGULAR && is_first) return;
  misfit_.of_velocities = true;
  misfit_.kind = are_found ? Misfit::Kind::kInconsistent : Misfit::Kind::kNotFound;
  std::copy_n(found, S, misfit_.nearest);
}

scene_status ProgramMotion::judgeAccelerations(const Exchange& left) {
  const int S = scene.shaftCount();
  const double* const given = misfit_.given + 2 * S;
  const double* const found = left.state + 2 * S;
  if (program_->HOLDS > 0) return SCENE_OK;  // the modes give them
  const bool are_kept =
      program_->IS_CLASSICAL != 0 ? agree(given, found, S) : isNear(given, found, S);
  if (are_kept) return SCENE_OK;
  misfit_.kind = Misfit::Kind::kInconsistent;
  std::copy_n(found, S, misfit_.nearest);
  return SCENE_INCONSISTENT;
}

scene_status ProgramMotion::beginWithFound(Begin how, bool are_given, Exchange* left) {
  using Verdict = FirstAccelerations::Verdict;
  const int S = scene.shaftCount();
  const bool is_classical = program_->IS_CLASSICAL != 0;
  const double* const given = misfit_.given + 2 * S;
  double* const epsilon = it_.state + 2 * S;
  std::copy_n(given, S, epsilon);
  const StateView at = viewOf(it_.state, time);
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
  if (is_classical) search_->calcMultipliers(at, it_.multiplier);
  return tryToBegin(how, true, true, left);
}

scene_status ProgramMotion::explainFault(scene_status status) {
  const int S = scene.shaftCount();
  const StateView at = viewOf(it_.state, time);
  status_.time = time;
  if (findBadValue(at)) return SCENE_NOT_FINITE;
  // A rank is lost on psi = 0 only; elsewhere no start was found at all.
  const bool is_lost = findLostRow(at, 1) || (findLostRow(at, 3) && isOnConstraints(at));
  if (is_lost) return SCENE_SINGULAR;
  status_ = MotionStatus{};
  const bool is_missed = status == SCENE_NOT_CONVERGED || status == SCENE_SINGULAR;
  if (status == SCENE_NOT_FINITE || (is_missed && program_->HAS_RESIDUAL == 0)) {
    status_.reason = StopReason::kNonFiniteValue;  // (sums of laws overflow)
    status_.time = time;
    return SCENE_NOT_FINITE;
  }
  if (!is_missed || program_->HOLDS > 0) return status;
  misfit_.kind = Misfit::Kind::kNotFound;
  std::copy_n(it_.state + 2 * S, S, misfit_.given + 2 * S);
  return SCENE_NOT_CONVERGED;
}

bool ProgramMotion::isOnConstraints(const StateView& state) const {
  return std::all_of(scene.constraints.begin(), scene.constraints.end(), [&](const auto& it) {
    double C[kMaxShafts];
    return it->order() == 3 || it->calcResidualAndJacobian(state, C) == 0.0;
  });
}

bool ProgramMotion::isConsistent(const MotionState& state) {
  // A state of a motion may lie on an event, the side of which a moment later is its own.
  constexpr double kMoment = 1e-9;  // s
  if (hasMoreThanLaws(scene)) return true;
  MotionState tried = state;
  tried.history = {};
  tried.is_acceleration_given = true;
  const auto goesOn = [&] { return goOnFrom(tried, false) == SCENE_OK && status_.ok(); };
  if (goesOn()) return true;
  tried.time += kMoment;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    tried.angle[i] += kMoment * state.velocity[i];
    tried.velocity[i] += kMoment * state.acceleration[i];
  }
  for (int i = 0; i < scene.inputCount(); ++i) {
    if (tried.signal[i].segmentEnd() <= kMoment) tried.signal[i].finishSegment();
    tried.signal[i].moveOrigin(kMoment);
  }
  return goesOn();
}

}  // namespace variator_sim
