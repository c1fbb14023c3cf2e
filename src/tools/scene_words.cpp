#include <algorithm>
#include <map>
#include <set>

#include "tools/scene_equations.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim {

using expression::Graph;
using expression::latexName;
using expression::Names;
using expression::Node;
using expression::Operation;
using expression::slotOf;
using expression::Source;
using expression::Symbol;

namespace {

/// Points of the longest table that is written out.
constexpr std::size_t kMostPoints = 8;

/// A set of unique names.
class Register {
 public:
  explicit Register(const Scene& scene) : scene_(scene) {
    for (const auto& input : scene.symbols.inputs) taken_.insert(input.first);
    for (const auto& table : scene.symbols.tables) taken_.insert(table.first);
  }

  bool isFree(const std::string& name) const {
    return taken_.count(name) == 0 && expression::isValidName(name) &&
           expression::describeTakenName(name, scene_.shafts).empty();
  }
  /// Returns the first name that is free, or the last one with a number if none is.
  Symbol take(const std::vector<std::string>& names) {
    auto name = std::find_if(names.begin(), names.end(),
                             [this](const std::string& it) { return isFree(it); });
    std::string taken = name != names.end() ? *name : names.back();
    for (int n = 2; !isFree(taken); ++n) taken = names.back() + "_" + std::to_string(n);
    taken_.insert(taken);
    return {taken, latexName(taken)};
  }
  const std::set<std::string>& taken() const { return taken_; }

 private:
  const Scene& scene_;
  std::set<std::string> taken_;
};

void nameVariables(const Scene& scene, Register& free, Names& names) {
  names.variables[slotOf(Source::kTime)] = {"t", "t"};
  for (int i = 0; i < scene.shaftCount(); ++i) {
    for (const Source of :
         {Source::kAngle, Source::kVelocity, Source::kAcceleration, Source::kJerk}) {
      names.variables[slotOf(of, i)] = shaftWords(scene, of, i);
    }
  }
  // The sides to which elements that hold slide.
  for (const TorquePtr& element : scene.torques) {
    int part = 0;
    for (const Holding& law : element->holdings()) {
      std::string name = "side_" + toIdentifier(element->name());
      if (part++ > 0) name += std::to_string(part);
      names.variables[scene.graph->entry(law.side.in(*scene.graph)).slot] = free.take({name, name});
    }
  }
  const std::vector<std::string> holds = scene.holdNames();
  for (std::size_t h = 0; h < holds.size(); ++h) {
    for (const auto& [value, word] : {std::pair{expression::HeldValue::kMultiplier, "lambda_"},
                                      {expression::HeldValue::kMode, "mode_"},
                                      {expression::HeldValue::kCounts, "stuck_"}}) {
      const std::string name = word + toIdentifier(holds[h]);
      const int slot = slotOf(Source::kHeld, expression::heldSlot(value, static_cast<int>(h)));
      names.variables[slot] = free.take({name, name});
    }
  }
  std::map<int, std::string> given;
  for (const auto& [name, index] : scene.symbols.inputs) given[index] = name;
  for (int i = 0; i < scene.inputCount(); ++i) {
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    const auto it = given.find(i);
    const std::string name = toIdentifier(input.name);
    const Symbol symbol = it != given.end() ? Symbol{it->second, latexName(it->second)}
                                            : free.take({name, "input_" + name});
    names.variables[slotOf(Source::kInput, i)] = symbol;
    names.variables[slotOf(Source::kInputRate, i)] = {symbol.text + "'", symbol.latex + "'"};
    names.variables[slotOf(Source::kInputSecondRate, i)] = {symbol.text + "''",
                                                            symbol.latex + "''"};
  }
}

void nameTables(const Scene& scene, Register& free, Names& names) {
  // A table that is read twice occurs twice.
  std::map<std::string, Symbol> by_origin;
  int anonymous_count = 0;
  const auto name = [&](const std::string& origin) -> Symbol {
    const auto known = by_origin.find(origin);
    if (known != by_origin.end()) return known->second;
    Symbol symbol;
    if (scene.symbols.tables.count(origin) != 0) {
      symbol = {origin, latexName(origin)};
    } else if (origin.empty()) {
      ++anonymous_count;
      return free.take({"table" + std::to_string(anonymous_count)});
    } else {
      const std::string identifier = toIdentifier(origin);
      symbol = free.take({identifier, identifier + "_table"});
    }
    return by_origin[origin] = symbol;
  };
  const Graph& graph = *scene.graph;
  for (int n = 0; n < graph.size(); ++n) {
    const Graph::Entry& entry = graph.entry({n});
    const bool is_table =
        entry.operation == Operation::kTable || entry.operation == Operation::kTable2;
    if (is_table && names.tables.count(entry.slot) == 0) {
      names.tables[entry.slot] = name(graph.tableOf(entry)->origin());
    }
  }
}

struct NamedNode {
  std::string element;
  std::string output;
  Node node;
};

std::vector<NamedNode> findOutputs(const Scene& scene) {
  std::vector<NamedNode> outputs;
  for (const Law* law : scene.laws()) {
    for (const auto& [name, node] : law->outputs()) outputs.push_back({law->name(), name, node});
  }
  return outputs;
}

void nameOutputs(const Scene& scene, Register& free, Names& names) {
  const std::vector<NamedNode> outputs = findOutputs(scene);
  for (const NamedNode& it : outputs) {
    if (names.nodes.count(it.node.index) != 0) continue;
    const Operation operation = scene.graph->entry(it.node).operation;
    if (operation == Operation::kVariable || operation == Operation::kConstant) continue;
    // The names of several slips include their elements.
    const bool is_alone =
        std::count_if(outputs.begin(), outputs.end(),
                      [&](const NamedNode& other) { return other.output == it.output; }) == 1;
    const std::string full = it.element + "_" + it.output;
    names.nodes[it.node.index] = is_alone ? free.take({it.output, full}) : free.take({full});
  }
}

std::string describeInput(const CommandInputSettings& input) {
  if (input.kind == InputKind::kState) return "state, which is integrated by its rate";
  if (input.kind == InputKind::kVariable) return "variable, constant between events";
  if (input.kind == InputKind::kDelayed) return "delayed by " + formatNumber(input.delay) + " s";
  return "input, topic '" + input.topic + "', " + toString(input.hold);
}

std::string describePoints(const Table& table) {
  const std::vector<double> x = table.points();
  const auto at = [&](double place) {
    return "(" + expression::toShortText(place) + ", " +
           expression::toShortText(table.value(place)) + ")";
  };
  std::string points;
  if (x.size() > kMostPoints) {
    points = std::to_string(x.size()) + " points from " + at(x.front()) + " to " + at(x.back());
  } else {
    for (const double place : x) points += (points.empty() ? "" : ", ") + at(place);
  }
  constexpr const char* kKinds[] = {"values held from ", "straight lines through "};
  return (table.smoothness() < 3 ? kKinds[table.smoothness()] : "table through ") + points +
         (table.isBounded() ? ", constant beyond" : ", straight on beyond");
}

std::string describeGrid(const Table& table) {
  const auto range = [](const std::vector<double>& x) {
    return std::to_string(x.size()) + " from " + expression::toShortText(x.front()) + " to " +
           expression::toShortText(x.back());
  };
  return "table of two variables over " + range(table.points(0)) + ", and " +
         range(table.points(1)) +
         (table.isBounded() ? ", constant beyond" : ", straight on beyond");
}

}  // namespace

Words plainWords(const std::string& text) {
  return {text, expression::escapedLatex(text)};
}

Words shaftWords(const Scene& scene, const char* text, const char* latex, int shaft) {
  const std::string& name = scene.shafts[static_cast<std::size_t>(shaft)];
  return {text + ("_" + name), latex + ("_{" + latexName(name) + "}")};
}

Words shaftWords(const Scene& scene, Source of, int shaft) {
  static const std::map<Source, std::pair<const char*, const char*>> words = {
      {Source::kAngle, {"phi", "\\varphi"}},
      {Source::kVelocity, {"w", "\\omega"}},
      {Source::kAcceleration, {"e", "\\varepsilon"}},
      {Source::kJerk, {"j", "\\eta"}}};
  const auto& [text, latex] = words.at(of);
  return shaftWords(scene, text, latex, shaft);
}

Names nameThings(const Scene& scene) {
  Names names;
  Register free(scene);
  nameVariables(scene, free, names);
  nameTables(scene, free, names);
  nameOutputs(scene, free, names);
  names.taken = free.taken();
  return names;
}

std::vector<Words> describeThings(const Scene& scene, const Names& names,
                                  const std::vector<Node>& nodes) {
  std::vector<Words> described;
  std::set<std::string> known;
  const auto describe = [&](const Symbol& name, const char* arguments, const std::string& what) {
    if (!known.insert(name.text).second) return;
    const Words words = plainWords(what);
    described.push_back({name.text + arguments + ": " + words.text,
                         "$" + name.latex + arguments + "$: " + words.latex});
  };
  const Graph& graph = *scene.graph;
  const std::vector<int> reachable = graph.listReachable(nodes);
  std::set<int> read;
  for (const int n : reachable) {
    const Graph::Entry& entry = graph.entry({n});
    const bool is_input = entry.operation == Operation::kVariable &&
                          expression::sourceOf(entry.slot) >= Source::kInput &&
                          expression::sourceOf(entry.slot) <= Source::kInputSecondRate;
    if (is_input) read.insert(expression::indexOf(entry.slot));
  }
  for (const int i : read) {
    const bool is_side = i >= scene.inputCount();  // of an element that holds
    describe(names.variables.at(slotOf(Source::kInput, i)), "",
             is_side ? "the side to which it slides, 1 or -1"
                     : describeInput(scene.inputs[static_cast<std::size_t>(i)]));
  }
  const std::size_t inputs = known.size();
  for (const int n : reachable) {
    const Graph::Entry& entry = graph.entry({n});
    if (entry.operation == Operation::kTable) {
      describe(names.tables.at(entry.slot), "(x)", describePoints(*graph.tableOf(entry)));
    } else if (entry.operation == Operation::kTable2) {
      describe(names.tables.at(entry.slot), "(x, y)", describeGrid(*graph.tableOf(entry)));
    }
  }
  if (known.size() > inputs) {
    described.push_back({"T'(x): the slope of a table T; T'10(x, y), T'01(x, y): by x, by y",
                         "$T'(x)$: the slope of a table $T$; $T^{(1,0)}(x, y)$, "
                         "$T^{(0,1)}(x, y)$: by $x$, by $y$"});
  }
  return described;
}

}  // namespace variator_sim
