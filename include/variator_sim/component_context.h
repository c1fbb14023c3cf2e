/// What a torque or a constraint learns about its scene while it is configured.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/command_input.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {

class ComponentContext {
 public:
  /// `inputs` collects the commanded inputs of the whole scene.
  ComponentContext(std::string name, ParameterReader& parameters,
                   const std::vector<std::string>& shaft_names,
                   std::vector<CommandInputSettings>& inputs)
      : name_(std::move(name)),
        parameters_(parameters),
        shaft_names_(shaft_names),
        inputs_(inputs) {}

  /// The component's own name in the scene.
  const std::string& name() const { return name_; }
  /// The component's own dictionary. Keys left unread are an error after doConfigure.
  ParameterReader& parameters() { return parameters_; }
  /// Names of the scene's shafts, in the order of the indices 1..s.
  const std::vector<std::string>& shaftNames() const { return shaft_names_; }
  int shaftCount() const { return static_cast<int>(shaft_names_.size()); }

  /// Index (from 0) of the shaft that `key` names. SceneError with the nearest name otherwise.
  int readShaft(const std::string& key);
  /// Indices of the shafts that the list at `key` names, exactly `count` different ones.
  std::vector<int> readShafts(const std::string& key, int count);
  /// Declares a commanded input; the index into StateView::input and ::input_rate.
  int addInput(const CommandInputSettings& settings);

 private:
  int indexOf(const std::string& shaft, const std::string& path) const;

  std::string name_;
  ParameterReader& parameters_;
  const std::vector<std::string>& shaft_names_;
  std::vector<CommandInputSettings>& inputs_;
};

}  // namespace variator_sim
