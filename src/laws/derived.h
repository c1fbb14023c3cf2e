/// Of which components the derivatives are nobody's statement.
#pragma once

#include <vector>

#include "variator_sim/formula_constraint.h"
#include "variator_sim/formula_torque.h"

namespace variator_sim {

/// Whether all derivatives of `torque` follow from formulas, those of no opaque function among
/// them.
inline bool isDerived(const Torque& torque) {
  const auto* law = dynamic_cast<const FormulaTorque*>(&torque);
  if (law == nullptr) return false;
  std::vector<expression::Node> nodes;
  for (const auto& [shaft, node] : law->torques()) nodes.push_back(node);
  return !law->graph().hasOpaque(nodes);
}

/// The same of a constraint.
inline bool isDerived(const Constraint& constraint) {
  const auto* law = dynamic_cast<const FormulaConstraint*>(&constraint);
  return law != nullptr && !law->graph().hasOpaque({law->function()});
}

}  // namespace variator_sim
