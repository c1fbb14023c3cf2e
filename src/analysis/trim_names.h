/// What trim's names mean.
#pragma once

#include <string>
#include <vector>

#include "analysis/motion_equations.h"

namespace variator_sim {

class TrimNames {
 public:
  /// A quantity that is no variable: an output, or a torque of a shaft.
  struct Quantity {
    int output = -1;
    int shaft = -1;
    bool is_reaction = false;
  };

  TrimNames(const Scene& scene, const VariableLayout& layout);

  /// The variable of that name, or -1.
  int findVariable(const std::string& name) const;
  /// A variable that may be free. Throws SceneError.
  int findFree(const std::string& name) const;
  /// Throws SceneError.
  Quantity findQuantity(const std::string& name) const;
  /// "" where it has none.
  std::string nameOf(int variable) const;

 private:
  struct Named {
    std::string name;
    int variable;
  };
  struct NamedQuantity {
    std::string name;
    Quantity quantity;
  };
  std::vector<Named> variables_;  ///< the name that is told first
  std::vector<NamedQuantity> quantities_;
};

}  // namespace variator_sim
