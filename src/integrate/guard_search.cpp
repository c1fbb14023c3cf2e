#include "integrate/guard_search.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "integrate/bracket.h"
#include "variator_sim/interruption.h"

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

/// Relative to its size (and 1e-3): what moves by no more stands still.
constexpr double kSame = 1e-12;
/// Roots that are guessed of a guard whose rate is not known, in one step.
constexpr int kMostGuesses = 3;
/// Boxes after which an interruption is asked for.
constexpr int kAskAfter = 64;

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

/// Widens `range` to hold the slopes of a polynomial over `duration`, s.
void includeSlopes(const StepCurve::Coefficients& whole, double duration, Interval* range) {
  const double scale = static_cast<double>(whole.size() - 1) / duration;
  for (std::size_t n = 1; n < whole.size(); ++n) {
    const double slope = scale * (whole[n] - whole[n - 1]);
    range->low = std::min(range->low, slope);
    range->high = std::max(range->high, slope);
  }
}

/// The rate of a guard in `box`, with the slopes of the first `count` polynomials, those of the
/// parts `part` of the state, over `duration`, s. (Dense output of an angle has other slopes than
/// that of its velocity, next to stages far off.)
Interval rateAlong(const Guard& guard, StateBox box, const StepCurve::Coefficients* polynomials,
                   const int* part, std::size_t count, double duration) {
  for (std::size_t n = 0; n < count; ++n) {
    if (part[n] >= 2 * kMaxShafts) continue;
    includeSlopes(polynomials[n], duration, StepCurve::partOf(&box, part[n] + kMaxShafts));
  }
  return guard.rate(box);
}

bool mayHaveSettled(const StepCurve& curve, double part) {
  return part > kSettled && part * curve.duration() > kSettledTime;
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
  ignored_.assign(guards_.size(), 0);
  std::size_t most = 1;  // polynomials that one of them needs
  for (const GuardPtr& guard : guards_) {
    has_opaque_ = has_opaque_ || guard->isOpaque();
    if (guard->linear() == nullptr) most = std::max(most, guard->reads().count());
    reads_inputs_ = reads_inputs_ || (!guard->isOpaque() && guard->readsInputs());
  }
  parts_.resize((kMostHalvings + 2) * most);
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

void GuardSearch::settleSides(const StepCurve& curve, double resolution, const StateView& first,
                              const StateBox& box) {
  step_sides_ = sides_;
  for (std::size_t i = 0; i < guards_.size(); ++i) {
    leaves_[i] = 0.0;
    const bool is_alone = muted_[i] > 0 || ignored_[i] != 0;
    if (is_alone || !guards_[i]->mayLeave(box, sides_[i])) {
      step_sides_[i] = Guard::kOnEdge;
      continue;
    }
    const bool is_near = isNear(static_cast<int>(i), first, curve.shafts());
    if (is_near) step_sides_[i] = Guard::kOnEdge;
    for (double part = resolution; step_sides_[i] == Guard::kOnEdge && part <= 1.0; part *= 4.0) {
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
                              const Interval& rate) {
  const double steepest = std::max(std::abs(rate.low), std::abs(rate.high));
  if (!std::isfinite(steepest)) return false;
  const double reach = 0.5 * (to - from) * curve.duration() * steepest;
  const double value = guards_[i]->distance(at(curve, 0.5 * (from + to)));
  const Interval kept = guards_[i]->bounds(step_sides_[i]);
  return value - reach > kept.low && value + reach < kept.high;
}

template <class IsClear>
GuardSearch::Verdict GuardSearch::crossOnce(std::size_t i, const StepCurve& curve,
                                            double resolution, double clear, double end,
                                            const IsClear& is_clear, GuardFinding* finding) {
  const Guard& guard = *guards_[i];
  const Interval kept = guard.bounds(step_sides_[i]);
  const double first = guard.distance(at(curve, clear));
  const double last = guard.distance(at(curve, end));
  if (!(first > kept.low && first < kept.high)) return Verdict::kUnclear;
  if (last > kept.low && last < kept.high)
    return is_clear(end) ? Verdict::kClear : Verdict::kUnclear;
  if (!(last < kept.low || last > kept.high)) return Verdict::kUnclear;
  const double sense = last < kept.low ? 1.0 : -1.0;
  const double bound = last < kept.low ? kept.low : kept.high;
  const auto gap = [&](double part) { return sense * (guard.distance(at(curve, part)) - bound); };
  double low = clear;
  double high = end;
  narrowBracket(gap, resolution, sense * (first - bound), sense * (last - bound), &low, &high);
  const bool is_left = is_clear(low) && noteIfLeft(i, curve, low, high, finding);
  return is_left ? Verdict::kFound : Verdict::kUnclear;
}

GuardFinding GuardSearch::find(const StepCurve& curve, double resolution) {
  double angle[kMaxShafts];
  double velocity[kMaxShafts];
  double acceleration[kMaxShafts];
  curve.evaluate(0.0, angle, velocity, acceleration);
  const StateView first{curve.time(), angle, velocity, acceleration, nullptr, nullptr};
  StateBox box;
  curve.enclose(&box);
  addInputs(box);
  settleSides(curve, resolution, first, box);
  GuardFinding finding;
  for (std::size_t i = 0; i < guards_.size(); ++i) {
    if (guards_[i]->isOpaque() || step_sides_[i] == Guard::kOnEdge) continue;
    if (guards_[i]->linear() != nullptr) {
      findLinear(i, curve, resolution, guards_[i]->distance(first), &finding);
    } else {
      findEnclosed(i, curve, resolution, &finding);
    }
  }
  // The first of several events at one instant is reported.
  for (std::size_t i = 0; finding.guard > static_cast<int>(i); ++i) {
    if (guards_[i]->isOpaque() || step_sides_[i] == Guard::kOnEdge) continue;
    noteIfLeft(i, curve, finding.clear, finding.beyond, &finding);
  }
  for (int i = 0; has_opaque_ && i < count(); ++i) {
    if (guards_[static_cast<std::size_t>(i)]->isOpaque()) {
      findOpaque(i, curve, resolution, &finding);
    }
  }
  return finding;
}

bool GuardSearch::noteIfLeft(std::size_t i, const StepCurve& curve, double clear, double end,
                             GuardFinding* finding) {
  if (end <= leaves_[i]) return false;
  const int branch = guards_[i]->branch(at(curve, end));
  if (branch == step_sides_[i]) return false;
  // A step that ends on an edge which it cannot but cross has its end on neither branch.
  if (branch == Guard::kOnEdge && !(end == 1.0 && guards_[i]->jumps())) return false;
  *finding = {GuardFinding::Kind::kCrossing, clear, end, static_cast<int>(i)};
  return true;
}

template <class Look>
void GuardSearch::halve(std::size_t i, const StepCurve& curve, double resolution, std::size_t count,
                        const Look& look, GuardFinding* finding) {
  const int most_boxes = std::max(1, std::min(kMostBoxes, kMostQuestions / this->count()));
  double ends[kMostHalvings + 2];  // of the parts still to be looked at, the nearest last
  int open = 1;
  ends[0] = finding->clear;
  double clear = 0.0;
  for (int boxes = 1; open > 0; ++boxes) {
    const double end = ends[open - 1];
    StepCurve::Coefficients* const here = &parts_[static_cast<std::size_t>(open - 1) * count];
    const Verdict verdict = look(here, clear, end);
    if (verdict == Verdict::kFound) return;
    const bool may_halve = end - clear > resolution && open <= kMostHalvings;
    if (verdict == Verdict::kUnclear && may_halve) {
      const bool is_over = boxes % kAskAfter == 0 && Interruption::isWanted();
      if (boxes >= most_boxes || is_over) {
        *finding = {GuardFinding::Kind::kUnknown, clear, end, -1};
        return;
      }
      StepCurve::Coefficients* const earlier = here + count;
      for (std::size_t n = 0; n < count; ++n) StepCurve::halve(here[n], &earlier[n]);
      ends[open++] = 0.5 * (clear + end);
      continue;
    }
    if (verdict != Verdict::kClear && noteIfLeft(i, curve, clear, end, finding)) return;
    clear = end;
    --open;
  }
}

void GuardSearch::findLinear(std::size_t i, const StepCurve& curve, double resolution, double first,
                             GuardFinding* finding) {
  using Coefficients = StepCurve::Coefficients;
  const LinearValue& form = *guards_[i]->linear();
  double size;
  const Coefficients change = curve.combine(form, &size);
  const Interval kept = guards_[i]->bounds(step_sides_[i]);
  for (const double sense : {1.0, -1.0}) {
    const double bound = sense > 0.0 ? kept.low : kept.high;
    if (std::isinf(bound)) continue;
    Coefficients gap;  // positive on the branch of the base
    for (std::size_t n = 0; n < gap.size(); ++n) gap[n] = sense * (first - bound + change[n]);
    if (*std::min_element(gap.begin(), gap.end()) > 0.0) continue;
    const double noise = 16.0 * std::numeric_limits<double>::epsilon() * (size + std::abs(bound));
    const auto look = [&](const Coefficients* here, double clear, double end) {
      const auto [least, most] = std::minmax_element(here->begin(), here->end());
      if (*least > 0.0 || end <= leaves_[i]) return Verdict::kClear;
      const bool is_rounding = *least >= -noise && *most <= noise && !guards_[i]->jumps();
      if (is_rounding && mayHaveSettled(curve, end - clear)) return Verdict::kClear;
      const double still = std::max(noise, 1e-3 * kSame);
      if (form.time == 0.0 && *most - *least <= still) return Verdict::kStands;
      int changes = 0;
      for (std::size_t n = 1; n < here->size(); ++n) {
        changes += ((*here)[n] > 0.0) != ((*here)[n - 1] > 0.0) ? 1 : 0;
      }
      if (changes != 1 || !(here->front() > 0.0) || !(here->back() < 0.0)) return Verdict::kUnclear;
      const double width = end - clear;
      double low = 0.0;
      double high = 1.0;
      narrowBracket(*here, resolution / width, &low, &high);
      // (By rounding the guard itself may be left a little later.)
      double beyond = clear + high * width;
      const double root = clear + low * width;
      bool is_left = noteIfLeft(i, curve, root, beyond, finding);
      while (!is_left && beyond < end) {
        beyond = std::min(end, root + 8.0 * (beyond - root) + resolution);
        is_left = noteIfLeft(i, curve, root, beyond, finding);
      }
      return is_left ? Verdict::kFound : Verdict::kClear;
    };
    parts_[0] = StepCurve::head(gap, finding->clear);
    halve(i, curve, resolution, 1, look, finding);
  }
}

void GuardSearch::findEnclosed(std::size_t i, const StepCurve& curve, double resolution,
                               GuardFinding* finding) {
  const Guard& guard = *guards_[i];
  int part[3 * kMaxShafts];
  double origin[3 * kMaxShafts];
  std::size_t count = 0;
  const StateSet reads = guard.reads();
  for (int n = 0; n < 3 * kMaxShafts; ++n) {
    if (!reads[static_cast<std::size_t>(n)] || n % kMaxShafts >= curve.shafts()) continue;
    part[count] = n;
    parts_[count] = StepCurve::head(curve.part(n, &origin[count]), finding->clear);
    ++count;
  }
  int guesses = 0;
  StateBox box;
  // Encloses the variables that the guard reads between two parts of the step; true if none moves.
  const auto enclose = [&](const StepCurve::Coefficients* here, double clear, double end) {
    box.time = {curve.time() + clear * curve.duration(), curve.time() + end * curve.duration()};
    bool stands = !guard.readsTime();
    for (std::size_t n = 0; n < count; ++n) {
      const Interval range = StepCurve::rangeOf(here[n], origin[n]);
      const double size = 1e-3 + std::max(std::abs(range.low), std::abs(range.high));
      stands = stands && range.high - range.low <= kSame * size;
      *StepCurve::partOf(&box, part[n]) = range;
    }
    if (guard.readsInputs()) addInputs(box);
    return stands;
  };
  const auto look = [&](const StepCurve::Coefficients* here, double clear, double end) {
    const bool stands = enclose(here, clear, end);
    if (end <= leaves_[i] || !guard.mayLeave(box, step_sides_[i])) return Verdict::kClear;
    const double duration = (end - clear) * curve.duration();
    const Interval rate = rateAlong(guard, box, here, part, count, duration);
    if (staysByRate(i, curve, clear, end, rate)) return Verdict::kClear;
    // (What jumps may be crossed back at once, and then there is no motion on the edge.)
    const bool may_settle = mayHaveSettled(curve, end - clear) && !guard.jumps();
    if (may_settle && guard.isRounding(box)) return Verdict::kClear;
    if (stands) return Verdict::kStands;
    if (rate.low > 0.0 || rate.high < 0.0) {
      const auto always = [](double) { return true; };
      return crossOnce(i, curve, resolution, clear, end, always, finding);
    }
    // The rate of a guard that reads inputs is unknown: a guess is tested by whether all before it
    // is clear.
    if (std::isfinite(rate.low) || ++guesses > kMostGuesses) return Verdict::kUnclear;
    const auto isClearUpTo = [&](double to) {
      if (to >= end) return false;  // as `box` has just told
      StepCurve::Coefficients before[3 * kMaxShafts];
      for (std::size_t n = 0; n < count; ++n) {
        before[n] = StepCurve::head(here[n], (to - clear) / (end - clear));
      }
      enclose(before, clear, to);
      return !guard.mayLeave(box, step_sides_[i]);
    };
    return crossOnce(i, curve, resolution, clear, end, isClearUpTo, finding);
  };
  halve(i, curve, resolution, count, look, finding);
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
