#include "motion/stepped_program.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace variator_sim {

SteppedProgram::SteppedProgram(std::shared_ptr<const MotionProgram> program,
                               const MotionInputs& inputs)
    : program_(std::move(program)),
      inputs_(inputs),
      past_(*program_),
      host_(hostMotion(*program_)) {
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

// --- descriptions ----------------------------------------------------------------------------

const char* SteppedProgram::stepperName() const {
  if (program_->stepper != StepperKind::kAuto) return toString(program_->stepper);
  return isImplicit() ? "radau" : "taylor";
}

std::string SteppedProgram::describeStepper(std::uint64_t switches) const {
  if (program_->stepper != StepperKind::kAuto)
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
  if (program_->FIRST_JUDGED > 0) {
    skips.emplace_back("derivatives by the angles (nothing reads them)");
  }
  if (program_->INERTIA_VARIES == 0) {
    skips.emplace_back("inertial torques and connection (J is constant)");
  }
  if (program_->RESTS != 0) {
    skips.emplace_back("nearly all steps at rest until a command (no explicit time)");
  }
  return skips;
}

// --- machine code ----------------------------------------------------------------------------

bool SteppedProgram::use(const std::shared_ptr<KernelLibrary>& library) {
  std::unique_ptr<HostedMotion> compiled = hostMotion(library, *program_);
  if (compiled == nullptr) return false;
  // The next step has to be that of the interpreter.
  const std::unique_ptr<HostedMotion> interpreted = hostMotion(*program_);
  double state[2][3 * kMaxShafts] = {};
  double length[2] = {};
  vs_exchanged_signal input[kMaxInputs] = {};
  scene_status status[2];
  int n = 0;
  for (HostedMotion* const tried : {interpreted.get(), compiled.get()}) {
    leave();
    vs_exchange from = it;
    MotionPast past(*program_);  // its own: steps add to it
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

std::string SteppedProgram::loadCode(KernelLibrary::Missing missing, bool* compiled) {
  if (program_->HAS_SERIES == 0) return "a law reads a function that is not a formula";
  if (program_->isExplicit() || program_->fixed_step > 0.0)
    return "steps by '" + std::string(stepperName()) + "' are interpreted";
  std::string reason;
  const auto library = KernelLibrary::load(KernelLibrary::kUnits + program_->writeKernel(), missing,
                                           &reason, [this](const auto& made) { return use(made); });
  *compiled = library != nullptr && library->wasCompiled();
  return reason;
}

bool SteppedProgram::shareCode(const SteppedProgram& other) {
  return other.library_ != nullptr && program_->structure() == other.program_->structure() &&
         use(other.library_);
}

}  // namespace variator_sim
