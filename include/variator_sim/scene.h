/// The model: all that is constant during a run. A Scene is complete and valid once it exists.
/// Copies share its components, and components may keep scratch memory: a scene that several
/// threads simulate is read once for each.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/command_input.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/constraint.h"
#include "variator_sim/expression/graph.h"
#include "variator_sim/node_names.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/torque.h"

namespace variator_sim {

enum class Principle {
  kGeneralizedGauss,  ///< the reaction changes least: R' = C^T Lambda
  kGauss              ///< the reaction is least: R = C^T lambda
};
const char* toString(Principle principle);

enum class StepperKind { kAuto, kRk4, kDopri5, kFehlberg78, kRadau, kTaylor, kTaylorFixed };
/// True for steppers that take steps of `solver/step`, whatever their error.
bool isFixedStep(StepperKind kind);
const char* toString(StepperKind kind);

/// Selects whether formulas run as machine code, compiled at run time, which changes no bit.
enum class MachineCode {
  kAuto,   ///< from the cache, or compiled if the run is long enough to repay it
  kNever,  ///< the interpreter
  kAlways  ///< compiled before the first step unless it is in the cache
};
const char* toString(MachineCode machine_code);

struct SolverSettings {
  StepperKind stepper = StepperKind::kAuto;
  double relative_tolerance = 1e-9;
  double absolute_tolerance = 1e-9;
  double step = 0.001;          ///< of fixed-step steppers, s
  double maximum_step = 1.0;    ///< of adaptive steppers, s: no feature narrower is stepped over
  int maximum_steps = 1000000;  ///< within one second of simulated time
  MachineCode machine_code = MachineCode::kAuto;
  bool sleep = true;  ///< stop stepping at equilibrium (doc/theory.md), until a command comes
};

struct InitialConditions {
  std::vector<double> angle;         ///< rad, s values
  std::vector<double> velocity;      ///< rad/s, s values
  std::vector<double> acceleration;  ///< rad/s^2; empty: accelerations of least reaction
  bool project = false;              ///< move inconsistent values to consistent ones near them
  double time = 0.0;                 ///< s, of these values: the motion begins there
};

/// One harmonic of a shaft's inertia: cosine cos(order phi) + sine sin(order phi), kg m^2.
struct InertiaHarmonic {
  int order = 1;
  double cosine = 0.0;
  double sine = 0.0;
};

/// A quantity y(t, phi, omega, epsilon) that a scene states as a formula. The motion does not
/// depend on it: it is computed for samples only, and only on request.
struct Output {
  std::string name;
  std::string unit;       ///< "" if the scene names none
  expression::Node si;    ///< its value in SI units, which other outputs read
  expression::Node node;  ///< its value in its unit
  /// It reads G, Z or the constraint measure, which the state alone does not tell.
  bool reads_principle = false;
};

// The memory of a scene: states that are integrated with the motion, and events that set them and
// the variables. The values of both are inputs of the scene (InputKind).

/// z' = rate
struct SceneState {
  int input = 0;          ///< index in Scene::inputs
  expression::Node rate;  ///< may read accelerations
  /// A law, an event or the rate of another state reads it: the motion is not at rest while it
  /// changes.
  bool is_read = false;
  bool trims_to_rest = false;  ///< trim looks for states in which its rate is 0
};

/// The instants at which a switching function passes 0, and what is set there.
struct SceneEvent {
  enum class Direction { kFalling = -1, kBoth = 0, kRising = 1 };

  std::string name;
  expression::Node when;
  Direction direction = Direction::kBoth;
  /// Index in Scene::inputs, and the value, which reads all values from before the event.
  std::vector<std::pair<int, expression::Node>> sets;
};

struct Scene {
  std::vector<std::string> shafts;
  /// J, kg m^2, s x s, symmetric; where a shaft has harmonics its entry is the mean. Positive
  /// definite at every angle.
  Eigen::MatrixXd inertia;
  /// The part of J that constraints lend to shafts without inertia, which moves nothing.
  Eigen::MatrixXd lent_inertia;
  /// Harmonics of each shaft's inertia: s lists, or none when all are constant.
  std::vector<std::vector<InertiaHarmonic>> inertia_harmonics;
  /// J_ij, s x s, where an entry is a formula of angles, the time and inputs (`inertia` has the
  /// values at the start then); else empty.
  std::vector<expression::Node> inertia_formulas;
  /// True where a formula reads a reaction, a jerk or a multiplier, which have J in them as
  /// numbers.
  bool formulas_read_inertia = false;
  std::vector<TorquePtr> torques;
  std::vector<ConstraintPtr> constraints;
  std::vector<CommandInputSettings> inputs;
  std::vector<Output> outputs;
  std::vector<SceneState> states;
  std::vector<SceneEvent> events;
  /// The formulas of all torques and constraints.
  std::shared_ptr<expression::Graph> graph = std::make_shared<expression::Graph>();
  /// The inputs and tables that have their own names.
  SceneSymbols symbols;
  Principle principle = Principle::kGeneralizedGauss;
  InitialConditions initial;
  SolverSettings solver;
  /// The scene as read, without node parameters: `~scene` publishes it as resolved parameters.
  ParameterTree resolved;
  /// The tree from which a scene with parts was read; nothing for others.
  ParameterTree with_parts;
  /// End of messages about a failed start or a stop: numbers so large or small that they may be to
  /// blame; "" if there are none.
  std::string extreme_numbers;
  /// Warnings for the author when the scene is loaded, a sentence each.
  std::vector<std::string> warnings;

  int shaftCount() const { return static_cast<int>(shafts.size()); }
  int constraintCount() const { return static_cast<int>(constraints.size()); }
  bool hasOrder3() const {
    return std::any_of(constraints.begin(), constraints.end(),
                       [](const ConstraintPtr& constraint) { return constraint->order() == 3; });
  }
  /// Returns all torques, then all constraints.
  std::vector<const Law*> laws() const;
  int inputCount() const { return static_cast<int>(inputs.size()); }
  /// Returns the names of what holds, in the order of elements: ELEMENT or ELEMENT/PART.
  std::vector<std::string> holdNames() const;
  /// Returns the same and the names of the scene's events.
  std::vector<std::string> eventNames() const;
  /// Returns the name of a constraint whose reaction is not along its gradient, "" if there is
  /// none.
  std::string nameOfDirection() const;
  /// True when the motion has more to go on from than shafts and commands.
  bool hasMemory() const { return !states.empty() || !events.empty() || firstDelay() >= 0; }
  /// Returns the index of the first delayed formula among the inputs, -1 if there is none.
  int firstDelay() const;
  /// Throws SceneError, with `why`, for a scene that reads a delayed formula.
  void refuseDelays(const std::string& why) const;
};

/// Reads a whole scene. `factory` makes the components. `node`: names that the program which runs
/// it reserves, by default those of variator_sim_node. Throws SceneError on the first fault.
Scene readScene(const ParameterTree& tree, ComponentFactory& factory,
                const NodeNames& node = nodeNames());

/// Reads anew inertias, initial conditions and the solver's settings, where no formula depends on
/// them (isOutsideFormulas), from a tree that differs from that of `scene` in nothing else; empties
/// its trees. Much faster than readScene. Throws SceneError as readScene does; `scene` is then
/// invalid.
void rereadNumbers(const ParameterTree& tree, const NodeNames& node, Scene* scene);
/// True for a path that rereadNumbers reads and no formula of the scene depends on.
bool isOutsideFormulas(const std::string& path, const Scene& scene);

}  // namespace variator_sim
