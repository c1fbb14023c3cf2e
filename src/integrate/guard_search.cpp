#include "integrate/guard_search.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace variator_sim {
namespace {

/// Parts of one step that are enclosed at the most, and of how many guards each may be asked for,
/// so that no number of guards makes one step take seconds.
constexpr int kMostBoxes = 20000;
constexpr int kMostQuestions = 500000;
/// Parts of a step that are longer (of it, and s), and all of which lie on an edge but for
/// rounding, have settled there; an edge that is crossed is left sooner.
constexpr double kSettled = 1e-6;
constexpr double kSettledTime = 1e-10;
/// Halvings: parts of a step are never shorter than 2^-kMostHalvings.
constexpr int kMostHalvings = 52;
/// Points of a step at which an opaque guard is looked at, first and at the most.
constexpr int kFewestPoints = 32;
constexpr int kMostPoints = 1024;

/// Steps for which a guard has to keep its branch to be looked at again.
constexpr int kMuted = 20;

/// True when the states of `box` cannot be told from each other.
bool isPoint(const StateBox& box, int shafts) {
  constexpr double kSame = 1e-12;
  const auto same = [](const Interval& a) {
    return a.high - a.low <= kSame * (1e-3 + std::max(std::abs(a.low), std::abs(a.high)));
  };
  for (int i = 0; i < shafts; ++i) {
    if (!same(box.angle[i]) || !same(box.velocity[i]) || !same(box.acceleration[i])) return false;
  }
  return true;
}

/// A state, its accelerations to within the part `width`.
StateBox boxAround(const StateView& state, int shafts, double width) {
  StateBox box;
  box.time = {state.time, state.time};
  for (int n = 0; n < shafts; ++n) {
    const double beside = width * (1.0 + std::abs(state.acceleration[n]));
    box.angle[n] = {state.angle[n], state.angle[n]};
    box.velocity[n] = {state.velocity[n], state.velocity[n]};
    box.acceleration[n] = {state.acceleration[n] - beside, state.acceleration[n] + beside};
  }
  return box;
}

}  // namespace

void GuardSearch::setGuards(std::vector<GuardPtr> guards, View view, InputRange input_range) {
  guards_ = std::move(guards);
  view_ = std::move(view);
  input_range_ = std::move(input_range);
  sides_.assign(guards_.size(), Guard::kOnEdge);
  step_sides_ = sides_;
  leaves_.assign(guards_.size(), 0.0);
  muted_.assign(guards_.size(), 0);
  for (const GuardPtr& guard : guards_) {
    (guard->isOpaque() ? has_opaque_ : has_enclosed_) = true;
    reads_inputs_ = reads_inputs_ || (!guard->isOpaque() && guard->readsInputs());
  }
}

void GuardSearch::addInputs(StateBox& box) {
  if (!reads_inputs_) return;
  input_range_(box.time, inputs_);
  box.input = inputs_;
}

bool GuardSearch::hasJumps() const {
  return std::any_of(guards_.begin(), guards_.end(),
                     [](const GuardPtr& guard) { return guard->jumps(); });
}

void GuardSearch::moveBase(const StateView& state) {
  for (std::size_t i = 0; i < guards_.size(); ++i) {
    const int branch = guards_[i]->branch(state);
    if (muted_[i] > 0) muted_[i] = branch == sides_[i] ? muted_[i] - 1 : kMuted;
    sides_[i] = branch;
  }
}

void GuardSearch::reset() {
  std::fill(muted_.begin(), muted_.end(), 0);
  last_ = 0;
}

void GuardSearch::mute(int index) {
  muted_[static_cast<std::size_t>(index)] = kMuted;
}

bool GuardSearch::isNear(int index, const StateView& state, int shafts) {
  StateBox box = boxAround(state, shafts, 0.0);
  addInputs(box);
  return guards_[static_cast<std::size_t>(index)]->isRounding(box);
}

void GuardSearch::muteOnEdge(int index, const StateView& state, int shafts) {
  constexpr double kNear = 1e-10;
  const auto i = static_cast<std::size_t>(index);
  if (guards_[i]->jumps() || guards_[i]->isOpaque()) return;
  StateBox box = boxAround(state, shafts, kNear);
  addInputs(box);
  const bool is_on_edge = sides_[i] == Guard::kOnEdge || guards_[i]->mayLeave(box, sides_[i]);
  if (is_on_edge) muted_[i] = std::max(muted_[i], 1);
}

bool GuardSearch::hasLeft(int index, const StateView& state) const {
  const auto i = static_cast<std::size_t>(index);
  if (sides_[i] == Guard::kOnEdge) return false;
  const int branch = guards_[i]->branch(state);
  return branch != Guard::kOnEdge && branch != sides_[i];
}

bool GuardSearch::hasAnyLeft(const StateView& state) const {
  for (int i = 0; i < count(); ++i) {
    if (hasLeft(i, state)) return true;
  }
  return false;
}

bool GuardSearch::isClear(StateBox& box) {
  if (has_opaque_) return false;
  addInputs(box);
  for (std::size_t n = 0; n < guards_.size(); ++n) {
    const std::size_t i = (last_ + n) % guards_.size();
    if (muted_[i] > 0) continue;
    if (guards_[i]->mayLeave(box, sides_[i])) {
      last_ = i;
      return false;
    }
  }
  return true;
}

StateView GuardSearch::at(const StepCurve& curve, double part) {
  curve.evaluate(part, angle_, velocity_, acceleration_);
  return view_(curve.time() + part * curve.duration(), angle_, velocity_, acceleration_);
}

void GuardSearch::settleSides(const StepCurve& curve, double resolution) {
  step_sides_ = sides_;
  for (std::size_t i = 0; i < guards_.size(); ++i) {
    leaves_[i] = 0.0;
    const bool is_muted = muted_[i] > 0;
    const bool is_near = !is_muted && isNear(static_cast<int>(i), at(curve, 0.0), curve.shafts());
    if (is_muted || is_near) step_sides_[i] = Guard::kOnEdge;
    if (is_muted) continue;
    double part = resolution;
    for (; step_sides_[i] == Guard::kOnEdge && part <= 1.0; part *= 4.0) {
      const StateView state = at(curve, part);
      if (is_near && isNear(static_cast<int>(i), state, curve.shafts())) continue;
      step_sides_[i] = guards_[i]->branch(state);
      leaves_[i] = part;
    }
    if (sides_[i] == Guard::kOnEdge || step_sides_[i] == sides_[i]) continue;
    // It is crossed there. (A jump is not, as long as the motion stays within rounding of it.)
    const bool stays = step_sides_[i] == Guard::kOnEdge && guards_[i]->jumps();
    if (!stays) step_sides_[i] = sides_[i];
    leaves_[i] = 0.0;
  }
}

bool GuardSearch::staysByRate(std::size_t i, const StepCurve& curve, double from, double to,
                              const StateBox& box) {
  const Interval rate = guards_[i]->rate(box);
  const double steepest = std::max(std::abs(rate.low), std::abs(rate.high));
  if (!std::isfinite(steepest)) return false;
  const double reach = 0.5 * (to - from) * curve.duration() * steepest;
  const double value = guards_[i]->distance(at(curve, 0.5 * (from + to)));
  return (step_sides_[i] > 0 ? value : -value) > reach;
}

bool GuardSearch::mayLeave(const StepCurve& curve, double from, double to, StateBox& box) {
  addInputs(box);
  for (std::size_t n = 0; n < guards_.size(); ++n) {
    const std::size_t i = (last_ + n) % guards_.size();
    if (guards_[i]->isOpaque() || step_sides_[i] == Guard::kOnEdge) continue;
    if (to <= leaves_[i] || !guards_[i]->mayLeave(box, step_sides_[i])) continue;
    if (!staysByRate(i, curve, from, to, box)) {
      last_ = i;
      return true;
    }
  }
  return false;
}

bool GuardSearch::haveSettled(const StateBox& box) const {
  for (std::size_t i = 0; i < guards_.size(); ++i) {
    if (guards_[i]->isOpaque() || step_sides_[i] == Guard::kOnEdge) continue;
    // (What jumps may be crossed back at once, and then there is no motion on the edge.)
    const bool has_settled = !guards_[i]->jumps() && guards_[i]->isRounding(box);
    if (guards_[i]->mayLeave(box, step_sides_[i]) && !has_settled) return false;
  }
  return true;
}

GuardFinding GuardSearch::find(const StepCurve& curve, double resolution) {
  settleSides(curve, resolution);
  GuardFinding finding;
  if (has_enclosed_) finding = findEnclosed(curve, resolution);
  for (int i = 0; has_opaque_ && i < count(); ++i) {
    if (guards_[static_cast<std::size_t>(i)]->isOpaque()) {
      findOpaque(i, curve, resolution, &finding);
    }
  }
  return finding;
}

GuardFinding GuardSearch::findEnclosed(const StepCurve& curve, double resolution) {
  const int most_boxes = std::min(kMostBoxes, kMostQuestions / std::max(1, count()));
  double ends[kMostHalvings + 2];  // of the parts still to be looked at, the nearest last
  int open = 0;
  ends[open++] = 1.0;
  double clear = 0.0;
  for (int boxes = 0; open > 0; ++boxes) {
    const double end = ends[open - 1];
    if (boxes >= most_boxes) return {GuardFinding::Kind::kUnknown, clear, end, -1};
    StateBox box;
    curve.enclose(clear, end, &box);
    if (!mayLeave(curve, clear, end, box)) {
      clear = end;
      --open;
      continue;
    }
    const double part = end - clear;
    if (part > kSettled && part * curve.duration() > kSettledTime && haveSettled(box)) {
      clear = end;
      --open;
      continue;
    }
    const bool reads_time = guards_[last_]->readsTime();
    const bool is_short = end - clear <= resolution || open > kMostHalvings;
    if (!is_short && (reads_time || !isPoint(box, curve.shafts()))) {
      ends[open++] = 0.5 * (clear + end);
      continue;
    }
    const StateView state = at(curve, end);
    for (std::size_t i = 0; i < guards_.size(); ++i) {
      if (guards_[i]->isOpaque() || step_sides_[i] == Guard::kOnEdge) continue;
      if (end <= leaves_[i]) continue;
      const int branch = guards_[i]->branch(state);
      if (branch == step_sides_[i]) continue;
      // A step that ends on an edge which it cannot but cross has its end on neither branch.
      const bool ends_on_edge = end == 1.0 && guards_[i]->jumps();
      if (branch == Guard::kOnEdge && !ends_on_edge) continue;
      return {GuardFinding::Kind::kCrossing, clear, end, static_cast<int>(i)};
    }
    clear = end;
    --open;
  }
  return {};
}

double GuardSearch::distanceAt(int index, const StepCurve& curve, double part) {
  const auto i = static_cast<std::size_t>(index);
  const double distance = guards_[i]->distance(at(curve, part));
  return step_sides_[i] > 0 ? distance : -distance;  // positive on the branch of the base
}

void GuardSearch::findOpaque(int index, const StepCurve& curve, double resolution,
                             GuardFinding* finding) {
  if (step_sides_[static_cast<std::size_t>(index)] == Guard::kOnEdge) return;
  const double limit = finding->clear;  // behind an earlier finding nothing counts
  double clear = 0.0;
  double beyond = -1.0;
  for (int points = kFewestPoints; points <= kMostPoints && beyond < 0.0; points *= 2) {
    double before[2] = {distanceAt(index, curve, 0.0), 0.0};
    before[1] = before[0];
    int turns = 0;
    for (int n = 1; n <= points && beyond < 0.0; ++n) {
      const double width = limit / points;
      const double part = n == points ? limit : n * width;
      const double here = distanceAt(index, curve, part);
      if (here < 0.0) {
        clear = part - width;
        beyond = part;
        break;
      }
      const bool is_least = n >= 2 && before[1] <= before[0] && before[1] <= here;
      if (n >= 2 && (before[1] - before[0]) * (here - before[1]) < 0.0) ++turns;
      if (is_least) {
        // by thirds around the least of three
        double low = part - 2.0 * width;
        double high = part;
        while (high - low > resolution && beyond < 0.0) {
          const double third = (high - low) / 3.0;
          const double left = distanceAt(index, curve, low + third);
          const double right = distanceAt(index, curve, high - third);
          if (left < 0.0 || right < 0.0) {
            clear = part - 2.0 * width;
            beyond = left < 0.0 ? low + third : high - third;
          }
          (left <= right ? high : low) = left <= right ? high - third : low + third;
        }
      }
      before[0] = before[1];
      before[1] = here;
    }
    // A guard that turns only a few times has been seen well enough.
    if (8 * turns < points) break;
    if (beyond < 0.0 && 2 * points > kMostPoints) {
      *finding = {GuardFinding::Kind::kUnknown, 0.25 * limit, limit, -1};
      return;
    }
  }
  if (beyond < 0.0) return;
  clear = std::max(clear, 0.0);
  while (beyond - clear > resolution) {
    const double middle = 0.5 * (clear + beyond);
    (distanceAt(index, curve, middle) < 0.0 ? beyond : clear) = middle;
  }
  *finding = {GuardFinding::Kind::kCrossing, clear, beyond, index};
}

}  // namespace variator_sim
