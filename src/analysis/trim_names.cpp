#include "analysis/trim_names.h"

#include "variator_sim/nearest_name.h"

namespace variator_sim {

TrimNames::TrimNames(const Scene& scene, const VariableLayout& layout) {
  for (int i = 0; i < layout.S; ++i) {
    const std::string& shaft = scene.shafts[static_cast<std::size_t>(i)];
    variables_.push_back({"phi_" + shaft, layout.angle(i)});
    variables_.push_back({"w_" + shaft, layout.velocity(i)});
    variables_.push_back({"e_" + shaft, layout.acceleration(i)});
  }
  for (int i = 0; i < layout.U; ++i) {
    variables_.push_back({scene.inputs[static_cast<std::size_t>(i)].name, layout.input(i)});
  }
  variables_.push_back({"t", layout.time()});
  for (int i = 0; i < layout.S; ++i) {
    const std::string& shaft = scene.shafts[static_cast<std::size_t>(i)];
    variables_.push_back({shaft + "/angle", layout.angle(i)});
    variables_.push_back({shaft + "/velocity", layout.velocity(i)});
    variables_.push_back({shaft + "/acceleration", layout.acceleration(i)});
    quantities_.push_back({shaft + "/applied_torque", {-1, i, false}});
    quantities_.push_back({shaft + "/reaction_torque", {-1, i, true}});
  }
  for (std::size_t n = 0; n < scene.outputs.size(); ++n) {
    quantities_.push_back({scene.outputs[n].name(), {static_cast<int>(n), -1, false}});
  }
}

int TrimNames::findVariable(const std::string& name) const {
  for (const Named& named : variables_) {
    if (named.name == name) return named.variable;
  }
  return -1;
}

int TrimNames::findFree(const std::string& name) const {
  const int variable = findVariable(name);
  if (variable > 0) return variable;  // (the time is 0)
  std::vector<std::string> names;
  for (const Named& named : variables_) {
    if (named.variable != 0) names.push_back(named.name);
  }
  throw SceneError("", inQuotes(name) + " cannot be free" + suggestName(name, names) +
                           "; allowed: " + joinNames(names));
}

TrimNames::Quantity TrimNames::findQuantity(const std::string& name) const {
  std::vector<std::string> names;
  for (const Named& named : variables_) names.push_back(named.name);
  for (const NamedQuantity& named : quantities_) {
    if (named.name == name) return named.quantity;
    names.push_back(named.name);
  }
  throw SceneError("", inQuotes(name) + " cannot be fixed" + suggestName(name, names) +
                           "; allowed: " + joinNames(names));
}

std::string TrimNames::nameOf(int variable) const {
  for (const Named& named : variables_) {
    if (named.variable == variable) return named.name;
  }
  return "";
}

}  // namespace variator_sim
