#include "ros/plugin_loader.h"

#include <mutex>
#include <pluginlib/class_loader.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace variator_sim {
namespace {

constexpr const char* kPackage = "variator_sim";

/// Packages are searched and libraries loaded by one thread at a time.
std::mutex g_plugins;

/// One pluginlib loader, made when it is first needed: making it searches all packages.
template <class Base>
class LazyLoader {
 public:
  explicit LazyLoader(const char* base_class) : base_class_(base_class) {}

  std::shared_ptr<Base> create(const std::string& type) {
    // The types of this package are all built in, so an unknown name in its namespace is misspelt.
    const bool ours = type.rfind(std::string(kPackage) + "/", 0) == 0;
    const std::lock_guard<std::mutex> lock(g_plugins);
    try {
      pluginlib::ClassLoader<Base>& found = loader();
      if (!found.isClassAvailable(type)) return nullptr;
      return wrap(std::shared_ptr<Base>(found.createUniqueInstance(type)));
    } catch (const std::runtime_error&) {  // pluginlib's are, too
      if (ours) return nullptr;
      throw;
    }
  }

  void appendTypes(std::vector<std::string>& types) {
    const std::lock_guard<std::mutex> lock(g_plugins);
    try {
      for (const std::string& type : loader().getDeclaredClasses()) {
        if (!contains(types, type)) types.push_back(type);
      }
    } catch (const std::runtime_error&) {
      // Packages cannot be searched, so the list has the built-in types only.
    }
  }

 private:
  pluginlib::ClassLoader<Base>& loader() {
    if (!loader_) loader_ = std::make_shared<pluginlib::ClassLoader<Base>>(kPackage, base_class_);
    return *loader_;
  }

  /// The component first, then the loader: its code lies in the library that the loader holds.
  std::shared_ptr<Base> wrap(std::shared_ptr<Base> component) {
    Base* const raw = component.get();
    return std::shared_ptr<Base>(
        raw, [component = std::move(component), loader = loader_](Base*) mutable {
          component.reset();
          loader.reset();
        });
  }

  const char* base_class_;
  std::shared_ptr<pluginlib::ClassLoader<Base>> loader_;
};

struct Loaders {
  LazyLoader<Constraint> constraints{"variator_sim::Constraint"};
  LazyLoader<Torque> torques{"variator_sim::Torque"};
};

class PluginFactory : public ComponentFactory {
 public:
  ConstraintPtr createConstraint(const std::string& type) override {
    if (ConstraintPtr constraint = builtin_.createConstraint(type)) return constraint;
    return loaders_->constraints.create(type);
  }
  TorquePtr createTorque(const std::string& type) override {
    if (TorquePtr torque = builtin_.createTorque(type)) return torque;
    return loaders_->torques.create(type);
  }
  std::vector<std::string> constraintTypes() override {
    std::vector<std::string> types = builtin_.constraintTypes();
    loaders_->constraints.appendTypes(types);
    return types;
  }
  std::vector<std::string> torqueTypes() override {
    std::vector<std::string> types = builtin_.torqueTypes();
    loaders_->torques.appendTypes(types);
    return types;
  }
  std::shared_ptr<const void> libraries() override { return loaders_; }

 private:
  BuiltinComponentFactory builtin_;
  const std::shared_ptr<Loaders> loaders_ = std::make_shared<Loaders>();
};

}  // namespace

std::shared_ptr<ComponentFactory> makePluginFactory() {
  return std::make_shared<PluginFactory>();
}

}  // namespace variator_sim
