/// What an element tells by name beside its law.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/law_context.h"

namespace variator_sim {

/// The outputs that a law names (LawContext::output). They are computed for samples only, and only
/// while somebody wants to see them.
class NamedOutputs {
 public:
  NamedOutputs() = default;
  explicit NamedOutputs(const LawContext& law);

  const std::vector<std::string>& names() const { return names_; }
  /// Of the scene's graph, one for each name.
  const std::vector<expression::Node>& nodes() const { return nodes_; }
  /// One value for each name. [loop]
  void evaluate(const StateView& state, double* values) const { tape_.evaluate(state, values); }

 private:
  std::vector<std::string> names_;
  std::vector<expression::Node> nodes_;
  expression::Tape tape_;
};

}  // namespace variator_sim
