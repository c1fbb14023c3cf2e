/// Makes torques and constraints from the type names in a scene.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "variator_sim/constraint.h"
#include "variator_sim/torque.h"

namespace variator_sim {

/// The core asks for components through this interface and so needs no plugin library.
class ComponentFactory {
 public:
  virtual ~ComponentFactory() = default;
  /// Returns a new, not yet configured component, or nullptr for an unknown type. Throws
  /// std::runtime_error when the type is known and cannot be loaded.
  virtual ConstraintPtr createConstraint(const std::string& type) = 0;
  virtual TorquePtr createTorque(const std::string& type) = 0;
  /// Returns all known types, for error messages.
  virtual std::vector<std::string> constraintTypes() = 0;
  virtual std::vector<std::string> torqueTypes() = 0;
  /// Returns a handle that keeps the code of the components loaded; null if none is needed.
  virtual std::shared_ptr<const void> libraries() { return nullptr; }
};

/// The components this package ships, made without any plugin library ("variator_sim/...").
class BuiltinComponentFactory : public ComponentFactory {
 public:
  ConstraintPtr createConstraint(const std::string& type) override;
  TorquePtr createTorque(const std::string& type) override;
  std::vector<std::string> constraintTypes() override;
  std::vector<std::string> torqueTypes() override;
};

}  // namespace variator_sim
