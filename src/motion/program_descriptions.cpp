/// Descriptions of a motion by the scene's program, and its machine code.
#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>

#include "motion/culprit.h"
#include "motion/program_motion.h"
#include "motion/stop_message.h"
#include "variator_sim/errors.h"

namespace variator_sim {

void ProgramMotion::throwInitialError(scene_status status) {
  if (misfit_.kind == Misfit::Kind::kModes) throwInitialMode();
  if (misfit_.kind != Misfit::Kind::kNone) {
    Sample unused;
    look(0.0, &unused, nullptr);  // what the laws read beside the state
    variator_sim::throwInitialError(scene, misfit_, viewOf(misfit_.given, time),
                                    search_ != nullptr ? &search_->search() : nullptr);
  }
  const StopReason reason = reasonOf(status);
  const std::string why = explainReason(reason);
  throw SceneError(
      scene.initial.acceleration.empty() ? "initial/velocity" : "initial/acceleration",
      "no motion begins here: " + (why.empty() ? toString(reason) : why) + scene.extreme_numbers);
}

std::vector<std::string> ProgramMotion::skips() const {
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

void ProgramMotion::throwInitialMode() const {
  const auto element = static_cast<std::size_t>(misfit_.element);
  const std::string torque = formatNumber(misfit_.torque) + " N m";
  const bool is_stuck =
      program_->begins_in.values[element] == static_cast<int>(Holding::Begin::kStuck);
  std::string fault = "'slipping': it holds at the start, with " + torque;
  if (is_stuck) {
    fault = std::abs(misfit_.slip) > scene.solver.absolute_tolerance
                ? "'stuck': its slip is " + formatNumber(misfit_.slip) + " rad/s at the start"
                : "'stuck': it would have to hold " + torque + " at the start";
  }
  throw SceneError(program_->holdNames()[element] + "/initial",
                   fault + "; allowed: auto, or a start to which it belongs");
}

std::string ProgramMotion::findCulprit(MotionStatus* told) {
  Element owner;
  std::string function;
  switch (told->reason) {
    case StopReason::kStepLimit:
      told->measure = progress_.rateAt(frontTime());
      return "";
    case StopReason::kStepUnderflow:
      function = findBranch(&owner);
      break;
    case StopReason::kChattering:
      if (it_.passed >= 0 && it_.passed < program_->FIRST_EVENT) {
        const expression::Branch& branch =
            program_->branches()[static_cast<std::size_t>(it_.passed)];
        function = branch.function;
        owner = findOwner(scene, branch.argument);
      }
      break;
    default:
      return "";
  }
  told->torque = owner.torque;
  told->constraint = owner.constraint;
  return function;
}

/// Returns the commands that no machine has, of ordinary inputs.
std::string ProgramMotion::describeHugeCommands() const {
  constexpr double kNoMachine = 1e12;  // in any SI unit
  std::string text;
  for (int i = 0; i < scene.inputCount(); ++i) {
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    const double command = signal_[i].target();
    if (input.kind != InputKind::kCommanded || std::abs(command) < kNoMachine) continue;
    text += "; the command " + formatNumber(command) + " on " + inQuotes(input.topic) +
            " is out of all proportion: 'min' and 'max' of the input bound what is taken";
  }
  return text;
}

std::string ProgramMotion::describeStop(Element* culprit) {
  if (status_.ok()) return "";
  MotionStatus told = status_;
  const std::string function = findCulprit(&told);
  const StateView state = view();
  Inertia inertia(scene.inertia, scene.inertia_harmonics);
  inertia.update(state.angle);
  std::ostringstream text;
  std::string sentence = variator_sim::describeStop(scene, told, state, inertia, function, culprit);
  // (The node cuts long messages, such as those with the states of many shafts.)
  sentence.insert(std::min(sentence.find("; last good state: "), sentence.size()),
                  describeHugeCommands());
  text << sentence;
  const int event = it_.passed - program_->FIRST_EVENT;
  if (status_.reason == StopReason::kChattering && event >= 0 && event < program_->EVENTS) {
    text << "; the event " << inQuotes(scene.events[static_cast<std::size_t>(event)].name)
         << " came last: what it sets must not set it off again at once";
  }
  if (status_.reason == StopReason::kNoModes) {
    const char* before = "; rigid are ";
    for (std::size_t h = 0; h < program_->holdNames().size(); ++h) {
      const bool is_rigid = program_->closes_below.values[h] > 0.0 ||
                            program_->has_gap.values[h] != 0 ||
                            program_->slides_backward.values[h] == 0;
      if (!is_rigid) continue;
      text << before << inQuotes(program_->holdNames()[h]);
      before = ", ";
    }
  }
  if (past_.findFull() >= 0) {
    const auto input = static_cast<std::size_t>(
        program_->delay_input.values[static_cast<std::size_t>(past_.findFull())]);
    text << "; the past of " << inQuotes(scene.inputs[input].name) << " has "
         << MotionPast::kMostPieces
         << " steps, which is all that is kept: a shorter delay, or larger tolerances, have fewer";
  }
  return text.str();
}

const char* ProgramMotion::stepperName() const {
  if (scene.solver.stepper != StepperKind::kAuto) return toString(scene.solver.stepper);
  return isImplicit() ? "radau" : "taylor";
}

std::string ProgramMotion::describeStepper() const {
  if (scene.solver.stepper != StepperKind::kAuto)
    return std::string(stepperName()) + " (as the scene says)";
  std::string text =
      isImplicit()
          ? "auto (radau, as stability limited the steps of taylor"
          : "auto (taylor, the series of this scene; radau when stability limits its steps";
  if (isImplicit() && statistics_.stepper_switches == 0) text += " at the start";
  const std::uint64_t switches = statistics_.stepper_switches;
  if (switches > 0)
    text += "; changed " + std::to_string(switches) + (switches == 1 ? " time" : " times");
  return text + ")";
}

// --- machine code ----------------------------------------------------------------------------

bool ProgramMotion::use(const std::shared_ptr<KernelLibrary>& library) {
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
    host_->leave(&it_);
    vs_exchange from = it_;
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

std::string ProgramMotion::loadCode(KernelLibrary::Missing missing, bool* compiled) {
  if (program_->HAS_SERIES == 0) return "a law reads a function that is not a formula";
  if (program_->isExplicit() || program_->fixed_step > 0.0)
    return "steps by '" + std::string(stepperName()) + "' are interpreted";
  std::string reason;
  const auto library = KernelLibrary::load(KernelLibrary::kUnits + program_->writeKernel(), missing,
                                           &reason, [this](const auto& made) { return use(made); });
  *compiled = library != nullptr && library->wasCompiled();
  return reason;
}

bool ProgramMotion::shareMachineCode(const MotionBase& other) {
  const auto* const like = dynamic_cast<const ProgramMotion*>(&other);
  if (like == nullptr || like->library_ == nullptr) return false;
  if (program_->structure() != like->program_->structure()) return false;
  return use(like->library_);
}

}  // namespace variator_sim
