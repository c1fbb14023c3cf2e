/// Named outputs of an element beside its law.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/law_context.h"

namespace variator_sim {

/// The outputs that a law names (LawContext::output), computed for samples only, and only on
/// request.
class NamedOutputs {
 public:
  NamedOutputs() = default;
  explicit NamedOutputs(const LawContext& law);

  const std::vector<std::string>& names() const { return names_; }
  /// Returns one node of the scene's graph for each name.
  const std::vector<expression::Node>& nodes() const { return nodes_; }
  /// Writes one value for each name. [loop]
  void evaluate(const StateView& state, double* values) const { tape_.evaluate(state, values); }

 private:
  std::vector<std::string> names_;
  std::vector<expression::Node> nodes_;
  expression::Tape tape_;
};

}  // namespace variator_sim
