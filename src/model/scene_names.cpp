#include <map>
#include <utility>

#include "model/scene_readers.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/types.h"

namespace variator_sim {
namespace {

constexpr std::size_t kLongestName = 100;

/// Returns the keys at the scene's root that are not names in one of its lists.
const std::vector<std::string>& sceneKeys() {
  static const std::vector<std::string> keys{
      "shafts",  "parts",     "inertia_coupling", "torques", "constraints",
      "inputs",  "tables",    "variables",        "states",  "events",
      "outputs", "principle", "initial",          "solver",  "verify_derivatives"};
  return keys;
}

std::vector<std::string> joined(std::vector<std::string> first,
                                const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// True for a name, or those of parts before it, with slashes between.
bool isPathOfNames(const std::string& path) {
  const std::size_t end = path.find('/');
  if (end == path.npos) return isName(path);
  return isName(path.substr(0, end)) && isPathOfNames(path.substr(end + 1));
}

/// Rejects invalid and repeated names, and keys of the scene or of the node.
void checkNames(const SceneNames& lists, const std::vector<std::string>& node_keys) {
  std::map<std::string, std::string> listed_in;
  const std::vector<std::string> taken = joined(sceneKeys(), node_keys);
  for (const auto& [list, its] : kSceneLists) {
    const std::vector<std::string>& names = lists.*its;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string path = elementPath(list, i);
      const std::string& name = names[i];
      if (!isPathOfNames(name)) {
        throw SceneError(path, inQuotes(name) +
                                   " is not a valid name; allowed: letters, digits and '_', "
                                   "starting with a letter, " +
                                   std::to_string(kLongestName) + " at most");
      }
      if (contains(taken, name)) {
        throw SceneError(path, inQuotes(name) + " is a key of the " +
                                   (contains(sceneKeys(), name) ? "scene" : "node") +
                                   " itself; allowed: any name but " + joinNames(taken));
      }
      const auto [other, is_new] = listed_in.emplace(name, list);
      if (!is_new) {
        throw SceneError(path,
                         inQuotes(name) + " is listed twice" +
                             (other->second == list ? std::string()
                                                    : ": in " + other->second + " and in " + list) +
                             "; allowed: names that differ from those of all shafts, torques, "
                             "constraints, inputs, tables, variables, states, events and outputs");
      }
    }
  }
}

SceneNames readLists(ParameterReader& root, const std::vector<std::string>& node_keys) {
  const std::string shafts_expected =
      "a list of 1 to " + std::to_string(kMaxShafts) + " names of shafts";
  root.require("shafts", shafts_expected);
  SceneNames lists;
  for (const SceneList& list : kSceneLists) lists.*list.names = root.names(list.key);
  if (lists.shafts.empty() || lists.shafts.size() > static_cast<std::size_t>(kMaxShafts)) {
    throw SceneError("shafts",
                     std::to_string(lists.shafts.size()) + " shafts; allowed: " + shafts_expected);
  }
  checkNames(lists, node_keys);
  if (lists.constraints.size() >= lists.shafts.size()) {
    throw SceneError("constraints",
                     std::to_string(lists.constraints.size()) + " constraints on " +
                         std::to_string(lists.shafts.size()) +
                         " shafts leave nothing to move; allowed: fewer constraints than shafts, "
                         "here at most " +
                         std::to_string(lists.shafts.size() - 1));
  }
  return lists;
}

/// Returns the list in which the name of such a dictionary is probably missing.
std::string likelyList(const ParameterTree& value) {
  const ParameterTree::Dictionary& keys = value.asDictionary();
  for (const auto& [key, list] : {std::pair{"inertia", "'shafts'"},
                                  {"type", "'torques' or 'constraints'"},
                                  {"topic", "'inputs'"},
                                  {"values", "'tables'"},
                                  {"rate", "'states'"},
                                  {"when", "'events'"},
                                  {"expression", "'outputs'"}}) {
    if (keys.count(key) > 0) return std::string(", as its '") + key + "' belongs in " + list;
  }
  return "";
}

/// Rejects keys at the root that are neither the scene's, nor the node's, nor a listed name, plain
/// values first: a misspelt list would otherwise be blamed on the dictionaries it orders.
void checkRootKeys(const ParameterTree& tree, const std::vector<std::string>& allowed) {
  const auto is_dictionary = [](const ParameterTree& value) {
    return value.kind() == ParameterTree::Kind::kDictionary;
  };
  for (const bool dictionaries : {false, true}) {
    for (const auto& [key, value] : tree.asDictionary()) {
      if (is_dictionary(value) != dictionaries || contains(allowed, key)) continue;
      throw SceneError(
          key,
          "unknown key" + suggestName(key, allowed) +
              (dictionaries ? "; it is in none of the lists shafts, torques, constraints, inputs, "
                              "tables, variables, states, events, outputs" +
                                  likelyList(value)
                            : "") +
              "; allowed: " + joinNames(allowed));
    }
  }
}

}  // namespace

std::vector<std::string> SceneNames::all() const {
  std::vector<std::string> names;
  for (const SceneList& list : kSceneLists) names = joined(names, this->*list.names);
  return names;
}

bool isSceneKey(const std::string& key) {
  return contains(sceneKeys(), key);
}

bool isName(const std::string& name) {
  return name.size() <= kLongestName && expression::isValidName(name) && name.front() != '_';
}

SceneNames readSceneNames(const ParameterTree& tree, ParameterReader& root,
                          const std::vector<std::string>& node_keys) {
  for (const std::string& key : joined(sceneKeys(), node_keys)) root.allow(key);
  SceneNames lists = readLists(root, node_keys);
  const std::vector<std::string> names = lists.all();
  // A name without a dictionary is reported first: it explains the misspelt dictionary.
  for (const std::string& name : names) root.allow(name);
  for (const std::string& name : names) {
    if (!root.has(name)) root.section(name);
  }
  checkRootKeys(tree, joined(joined(sceneKeys(), names), node_keys));
  return lists;
}

}  // namespace variator_sim
