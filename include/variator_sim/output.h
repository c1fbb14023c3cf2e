/// Quantities that a scene defines for its observers.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/component_context.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/scene_symbols.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// A quantity y(t, phi, omega, epsilon) that a scene states as a formula. The motion does not
/// depend on it: it is computed for samples only, and only on request.
///
/// Keys: `expression` (SI units; names t, phi1.., w1.., e1.. and the parameters), `parameters`
/// (optional dictionary of numbers), `unit` (optional, "rpm": the value is told in it).
///
/// One instance is evaluated by one thread at a time.
class Output {
 public:
  /// Reads the keys. Throws SceneError.
  explicit Output(ComponentContext& context);

  /// Adds the names that outputs alone read: G_SHAFT, Z, constraint_measure. `graph` has to outlive
  /// the symbols.
  static void nameObserved(const std::vector<std::string>& shafts, expression::Graph& graph,
                           SceneSymbols* symbols);

  const std::string& name() const { return name_; }
  /// Returns its unit; "" if the scene names none.
  const std::string& unit() const { return unit_; }
  /// Returns NaN for a value that does not exist, which stops nothing. [loop]
  double calcValue(const StateView& state) const { return *formula_.evaluate(state); }
  /// Tells whether it reads G, Z or the constraint measure, which the state alone does not tell.
  bool readsPrinciple() const { return reads_principle_; }
  /// Returns the formula of the value in its unit, of the scene's graph.
  expression::Node node() const { return node_; }
  /// Returns the formula of the value in SI units, which other outputs read.
  expression::Node value() const { return value_; }

 private:
  static int slotOf(int n);

  std::string name_;
  std::string unit_;
  bool reads_principle_ = false;
  expression::Node node_;
  expression::Node value_;
  expression::Tape formula_;
};

}  // namespace variator_sim
