/// The scene as a torque or a constraint sees it while it is configured.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/command_input.h"
#include "variator_sim/expression/graph.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/table.h"

namespace variator_sim {

using NamedTables = std::map<std::string, std::shared_ptr<const Table>>;

/// Inputs and tables that a scene names for all of its components.
struct SceneSymbols {
  /// Commanded inputs, variables and states: indices into StateView::input.
  std::map<std::string, int> inputs;
  NamedTables tables;
  /// Inputs that are played from a file, over time.
  NamedTables played;
  /// Formulas that have names: values of controllers and, for outputs, those of other outputs.
  std::map<std::string, expression::Node> values;
  /// Formulas for observers only, made when they are read.
  std::map<std::string, std::function<expression::Node()>> observed;
  /// The names that only observers may read.
  std::shared_ptr<std::set<std::string>> of_elements = std::make_shared<std::set<std::string>>();
};

class ComponentContext {
 public:
  /// `inputs` collects the commanded inputs of the whole scene and `graph` its formulas; `symbols`
  /// are its inputs and tables that have names of their own, `libraries` those of the factory.
  ComponentContext(std::string name, ParameterReader& parameters,
                   const std::vector<std::string>& shaft_names,
                   std::vector<CommandInputSettings>& inputs, SceneSymbols symbols = {},
                   std::shared_ptr<expression::Graph> graph = std::make_shared<expression::Graph>(),
                   std::shared_ptr<const void> libraries = nullptr)
      : name_(std::move(name)),
        parameters_(parameters),
        shaft_names_(shaft_names),
        inputs_(inputs),
        symbols_(std::move(symbols)),
        graph_(std::move(graph)),
        libraries_(std::move(libraries)) {}

  const std::string& name() const { return name_; }
  /// Returns the component's own dictionary. Keys left unread are an error after `build`.
  ParameterReader& parameters() { return parameters_; }
  /// Returns the names of the scene's shafts, in the order of the indices 1..s.
  const std::vector<std::string>& shaftNames() const { return shaft_names_; }
  int shaftCount() const { return static_cast<int>(shaft_names_.size()); }

  /// Declares a commanded input; returns the index into `input` and `input_rate` of StateView.
  int addInput(const CommandInputSettings& settings);
  /// Returns the index of the input that has the value of `node` from `seconds` ago; declares it
  /// under `text`, as the formula at `path` writes it, unless there is one. Throws SceneError.
  int addDelay(expression::Node node, double seconds, const std::string& text,
               const std::string& path);
  /// Returns the input of this index.
  CommandInputSettings& input(int index) { return inputs_[static_cast<std::size_t>(index)]; }
  const std::shared_ptr<expression::Graph>& graph() const { return graph_; }

  /// Adds a sentence that warns the author of the scene.
  void warn(std::string sentence) { warnings_.push_back(std::move(sentence)); }
  const std::vector<std::string>& warnings() const { return warnings_; }

  /// Keeps the component's code loaded (ComponentFactory::libraries).
  const std::shared_ptr<const void>& libraries() const { return libraries_; }

  /// Returns the inputs and tables that the scene names for all of its components.
  const SceneSymbols& symbols() const { return symbols_; }

 private:
  std::string name_;
  ParameterReader& parameters_;
  const std::vector<std::string>& shaft_names_;
  std::vector<CommandInputSettings>& inputs_;
  SceneSymbols symbols_;
  std::shared_ptr<expression::Graph> graph_;
  std::shared_ptr<const void> libraries_;
  std::vector<std::string> warnings_;
};

}  // namespace variator_sim
