#include "motion/stepped_program.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <utility>

#include "model/number_text.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

SteppedProgram::SteppedProgram(const Scene& scene, const MotionInputs& inputs)
    : scene_(scene),
      inputs_(inputs),
      program_(scene, {}, MotionProgram::Steps::kByStepper),
      past_(program_),
      host_(hostMotion(program_)) {
  it.past = past_.data();
}

// --- steps -----------------------------------------------------------------------------------

scene_status SteppedProgram::begin(Begin how) {
  it.begin = static_cast<int>(how);
  it.usual = kFirstUnit;
  inputs_.describe(it.input);
  const scene_status status = host_->begin(it);
  begin_ = it.time;
  begin_rest_ = it.time_rest;
  has_step_ = false;
  made_since_ = 0;
  return status;
}

void SteppedProgram::beginAnew() {
  leave();
  if (next_host_ != nullptr) host_ = std::move(next_host_);
  it.begin = static_cast<int>(Begin::kSaved);
  host_->begin(it);
}

scene_status SteppedProgram::step(double left) {
  // (Implicit steps begin Newton's iteration at the last one, which a beginning forgets.)
  const bool is_due = made_since_ > 0 && made_since_ % kMostBetween == 0;
  if (is_due || (next_host_ != nullptr && !isImplicit())) beginAnew();
  begin_ = it.time;
  begin_rest_ = it.time_rest;
  const scene_status status = host_->step(left, &it);
  has_step_ = status == SCENE_OK;
  if (has_step_) ++made_since_;
  return status;
}

scene_status SteppedProgram::cut(double at) {
  const scene_status status = host_->cut(at);
  if (status != SCENE_OK) return status;
  leave();
  has_step_ = false;
  return status;
}

scene_status SteppedProgram::change() {
  inputs_.describe(it.input);
  return host_->change(&it);
}

// --- what is seen ----------------------------------------------------------------------------

scene_status SteppedProgram::look(double at, Sample* sample, double* jerk) {
  vs_seen_hold seen_hold[kMaxHolds];
  double on_shaft[kMaxHolds * kMaxShafts];
  vs_seen seen = {sample->angle,
                  sample->velocity,
                  sample->acceleration,
                  sample->applied_torque,
                  sample->reaction_torque,
                  sample->reaction_torque_rate,
                  sample->reaction_torque_covariant_rate,
                  sample->residual,
                  sample->multiplier,
                  0.0,
                  seen_hold,
                  on_shaft,
                  seen_input_,
                  jerk};
  const scene_status status = host_->see(at, &seen);
  kinetic_ = seen.kinetic;
  for (int h = 0; h < program_.HOLDS; ++h) {
    const vs_seen_hold& from = seen_hold[h];
    HeldElement& held = held_[h];
    held = {from.mode, from.torque, from.slip, from.reserve, from.heat, {}};
    std::copy_n(on_shaft + h * scene_.shaftCount(), scene_.shaftCount(), held.on_shaft);
    input_value_[kMaxInputs + h] = from.side;
    const auto valueOf = [&](expression::HeldValue value) -> double& {
      return held_value_[expression::heldSlot(value, h)];
    };
    valueOf(expression::HeldValue::kMultiplier) = from.multiplier;
    valueOf(expression::HeldValue::kMode) = from.mode;
    valueOf(expression::HeldValue::kCounts) = from.counts;
  }
  return status;
}

StateView SteppedProgram::view(double time, const double* angle, const double* velocity,
                               const double* acceleration) {
  for (int i = 0; i < scene_.inputCount(); ++i) {
    CommandSignal::Moment moment = inputs_.at(i, time);
    const InputKind kind = scene_.inputs[static_cast<std::size_t>(i)].kind;
    if (kind != InputKind::kCommanded) moment.value = seen_input_[3 * i];
    if (kind == InputKind::kDelayed) {
      moment.rate = seen_input_[3 * i + 1];
      moment.second_rate = seen_input_[3 * i + 2];
    }
    input_value_[i] = moment.value;
    input_rate_[i] = moment.rate;
    input_second_rate_[i] = moment.second_rate;
  }
  return {time,         angle,       velocity,           acceleration,
          input_value_, input_rate_, input_second_rate_, program_.HOLDS > 0 ? held_ : nullptr,
          held_value_};
}

// --- descriptions ----------------------------------------------------------------------------

const char* SteppedProgram::stepperName() const {
  if (program_.stepper != StepperKind::kAuto) return toString(program_.stepper);
  return isImplicit() ? "radau" : "taylor";
}

std::string SteppedProgram::describeStepper(std::uint64_t switches) const {
  if (program_.stepper != StepperKind::kAuto)
    return std::string(stepperName()) + " (as the scene says)";
  std::string text =
      isImplicit()
          ? "auto (radau, as stability limited the steps of taylor"
          : "auto (taylor, the series of this scene; radau when stability limits its steps";
  if (isImplicit() && switches == 0) text += " at the start";
  if (switches > 0)
    text += "; changed " + std::to_string(switches) + (switches == 1 ? " time" : " times");
  return text + ")";
}

std::vector<std::string> SteppedProgram::skips() const {
  std::vector<std::string> skips;
  if (program_.FIRST_JUDGED > 0) {
    skips.emplace_back("derivatives by the angles (nothing reads them)");
  }
  if (program_.INERTIA_VARIES == 0) {
    skips.emplace_back("inertial torques and connection (J is constant)");
  }
  if (program_.RESTS != 0) {
    skips.emplace_back("nearly all steps at rest until a command (no explicit time)");
  }
  return skips;
}

// --- machine code ----------------------------------------------------------------------------

bool SteppedProgram::use(const std::shared_ptr<KernelLibrary>& library) {
  std::unique_ptr<HostedMotion> compiled = hostMotion(library, program_);
  if (compiled == nullptr) return false;
  // The next step has to be that of the interpreter.
  const std::unique_ptr<HostedMotion> interpreted = hostMotion(program_);
  double state[2][3 * kMaxShafts] = {};
  double length[2] = {};
  vs_exchanged_signal input[kMaxInputs] = {};
  scene_status status[2];
  int n = 0;
  for (HostedMotion* const tried : {interpreted.get(), compiled.get()}) {
    leave();
    vs_exchange from = it;
    MotionPast past(program_);  // its own: steps add to it
    past.restore(past_.save());
    from.past = past.data();
    from.begin = static_cast<int>(Begin::kSaved);
    status[n] = tried->begin(from);
    vs_exchange made = from;
    made.state = state[n];
    made.input = input;
    if (status[n] == SCENE_OK) status[n] = tried->step(kFirstUnit, &made);
    if (status[n] == SCENE_OK) tried->leave(&made);
    length[n++] = made.made;
  }
  const bool is_right =
      status[0] == status[1] &&
      (status[0] != SCENE_OK ||
       (length[0] == length[1] && std::equal(state[0], std::end(state[0]), state[1])));
  if (!is_right) return false;
  next_host_ = std::move(compiled);
  library_ = library;
  return true;
}

bool SteppedProgram::loadCode(bool compile, bool patiently) {
  using Missing = KernelLibrary::Missing;
  if (hasCode()) return true;
  const MachineCode wanted = scene_.solver.machine_code;
  const auto begin = std::chrono::steady_clock::now();
  std::string reason;
  if (wanted == MachineCode::kNever) {
    reason = "'solver/machine_code' is 'never'";
  } else if (program_.HAS_SERIES == 0) {
    reason = "a law reads a function that is not a formula";
  } else if (program_.isExplicit() || program_.fixed_step > 0.0) {
    reason = "steps by '" + std::string(stepperName()) + "' are interpreted";
  } else {
    const bool waits = patiently || wanted == MachineCode::kAlways;
    const Missing missing = !compile ? Missing::kLeave
                            : waits  ? Missing::kCompilePatiently
                                     : Missing::kCompile;
    try {
      KernelLibrary::load(KernelLibrary::kUnits + program_.writeKernel(), missing, &reason,
                          [this](const auto& made) { return use(made); });
    } catch (const Interrupted&) {  // while the C of the formulas was written
      reason = "it was interrupted";
    }
  }
  code_ = "the interpreter: " + reason;
  if (!hasCode()) return false;
  structure_ = program_.structure();
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  code_ = library_->wasCompiled() ? printed("machine code, compiled in %.2g s", seconds.count())
                                  : "machine code, from the cache";
  return true;
}

bool SteppedProgram::shareCode(const SteppedProgram& other) {
  if (hasCode() || scene_.solver.machine_code == MachineCode::kNever) return hasCode();
  if (!other.hasCode()) return false;
  std::string structure = program_.structure();
  if (structure != other.structure_ || !use(other.library_)) return false;
  structure_ = std::move(structure);
  code_ = "machine code, of another run";
  return true;
}

}  // namespace variator_sim
