#include <map>
#include <set>
#include <utility>

#include "expression/characters.h"
#include "model/scene_readers.h"

namespace variator_sim {
namespace {

using Dictionary = ParameterTree::Dictionary;
using Kind = ParameterTree::Kind;
/// Names of a scene, and what they become in the scene around it.
using Renamed = std::map<std::string, std::string>;

std::vector<std::string> namesAt(const ParameterTree& tree, const std::string& key,
                                 const std::string& path) {
  ParameterReader reader(tree, path);
  return reader.names(key);
}

bool isNamePart(char c) {
  return expression::isNameStart(c) || expression::isDigit(c);
}

/// Gives the names in a part's texts their meaning in the scene around it.
class Renaming {
 public:
  Renaming(std::string part, const ParameterTree& scene, Renamed shafts)
      : part_(std::move(part)), names_(std::move(shafts)) {
    int number = 0;
    for (const std::string& shaft : namesAt(scene, "shafts", part_)) {
      const std::string index = std::to_string(++number);
      for (const char* of : {"phi", "w", "e", "j"}) {
        words_[of + index] = std::string(of) + "_" + names_.at(shaft);
      }
      for (const char* of : {"phi_", "w_", "e_", "j_", "R_", "Rr_", "G_"}) {
        words_[of + shaft] = of + names_.at(shaft);
      }
    }
    for (const SceneList& list : kSceneLists) {
      if (std::string(list.key) == "shafts") continue;
      for (const std::string& name : namesAt(scene, list.key, part_)) {
        names_[name] = part_ + "/" + name;
        for (const char* of : {"_torque", "_power", "_slip", "_mode", "_multiplier"}) {
          words_[name + of] = names_[name] + of;
        }
      }
    }
    words_.insert(names_.begin(), names_.end());
  }

  const Renamed& names() const { return names_; }

  /// Returns the value at `key` of an element.
  ParameterTree apply(const std::string& key, const ParameterTree& value) const {
    switch (value.kind()) {
      case Kind::kText:
        if (key == "type" || key == "unit") return value;
        if (key == "topic") return ParameterTree::text(part_ + "/" + value.asText());
        return ParameterTree::text(rewrite(value.asText()));
      case Kind::kList: {
        ParameterTree::List list;
        for (const ParameterTree& item : value.asList()) list.push_back(apply(key, item));
        return ParameterTree::list(std::move(list));
      }
      case Kind::kDictionary:
        return applyToAll(key, value.asDictionary());
      default:
        return value;
    }
  }

 private:
  ParameterTree applyToAll(const std::string& of, const Dictionary& entries) const {
    // Names of a file's columns are no names of the scene.
    if (of == "units" || entries.count("file") > 0) return ParameterTree::dictionary(entries);
    Dictionary made;
    Renaming inner = *this;
    const auto parameters = entries.find("parameters");
    if (parameters != entries.end()) {
      for (const auto& own : parameters->second.asDictionary()) inner.words_.erase(own.first);
    }
    const bool has_names = of == "set" || of == "reaction";
    for (const auto& [key, value] : entries) {
      const auto found = names_.find(key);
      const std::string& name = has_names && found != names_.end() ? found->second : key;
      made[name] = key == "parameters" ? value : inner.apply(key, value);
    }
    return ParameterTree::dictionary(std::move(made));
  }

  /// Returns `text` with its words renamed, of which the longest counts: in the part of a part,
  /// they are paths.
  std::string rewrite(const std::string& text) const {
    // A number may have a unit that is some name, too.
    if (ParameterReader::isNumber(ParameterTree::text(text))) return text;
    std::string made;
    for (std::size_t begin = 0; begin < text.size();) {
      std::size_t end = begin;
      while (end < text.size() && isNamePart(text[end])) ++end;
      if (end == begin) {
        made += text[begin++];
        continue;
      }
      const bool is_number = expression::isDigit(text[begin]);
      auto found = words_.end();
      for (std::size_t last = end; !is_number;) {
        const auto longer = words_.find(text.substr(begin, last - begin));
        if (longer != words_.end()) {
          found = longer;
          end = last;
        }
        if (last >= text.size() || text[last] != '/') break;
        for (++last; last < text.size() && isNamePart(text[last]);) ++last;
      }
      made += found != words_.end() ? found->second : text.substr(begin, end - begin);
      begin = end;
    }
    return made;
  }

  std::string part_;
  Renamed names_;  ///< those in the lists
  Renamed words_;  ///< and what formulas call quantities of them
};

/// J of a shaft that is in two scenes: numbers are added, {mean, harmonics} by their parts.
ParameterTree addInertias(const ParameterTree& a, const ParameterTree& b, const std::string& path) {
  double mean = 0.0;
  ParameterTree::List harmonics;
  for (const ParameterTree* of : {&a, &b}) {
    const ParameterTree* const its = of->kind() == Kind::kDictionary ? of->find("mean") : of;
    if (its != nullptr) mean += ParameterReader::toNumber(*its, path, Range::any("kg m^2"));
    const ParameterTree* const more = of->find("harmonics");
    if (more == nullptr) continue;
    harmonics.insert(harmonics.end(), more->asList().begin(), more->asList().end());
  }
  if (harmonics.empty()) return ParameterTree::real(mean);
  return ParameterTree::dictionary({{"mean", ParameterTree::real(mean)},
                                    {"harmonics", ParameterTree::list(std::move(harmonics))}});
}

/// Puts the parts of one scene into its lists.
class Merge {
 public:
  Merge(const ParameterTree& tree, const std::vector<std::string>& node_keys)
      : own_(tree),
        node_keys_(node_keys),
        root_(tree.asDictionary()),
        parts_(namesAt(tree, "parts", "")) {}

  ParameterTree run() {
    for (std::size_t n = 0; n < parts_.size(); ++n) readPart(n);
    findShafts();
    for (const std::string& part : parts_) addPart(part);
    for (const SceneList& list : kSceneLists) addNames(list.key);
    root_.erase("parts");
    for (const std::string& part : parts_) root_.erase(part);
    addInitial();
    return ParameterTree::dictionary(std::move(root_));
  }

 private:
  struct Part {
    ParameterTree scene;  ///< with its own parts in its lists
    Renamed connected;    ///< its shafts, by shafts of this scene
    Renamed shafts;
  };

  void readPart(std::size_t index) {
    const std::string& name = parts_[index];
    if (!isName(name) || isTaken(name)) {
      throw SceneError(elementPath("parts", index),
                       inQuotes(name) + (isName(name) ? " is taken" : " is no name") +
                           "; allowed: letters, digits and '_', starting with a letter, and no "
                           "other name or key of the scene");
    }
    const auto found = root_.find(name);
    if (found == root_.end() || found->second.kind() != Kind::kDictionary) {
      throw SceneError(name,
                       "missing; expected {file: SCENE.yaml, connect: {ITS_SHAFT: SHAFT}}, "
                       "as it is in the list parts");
    }
    Part part;
    Dictionary content = found->second.asDictionary();
    const auto connect = content.find("connect");
    if (connect != content.end()) {
      requireKind(Kind::kDictionary, connect->second, name + "/connect", "{ITS_SHAFT: SHAFT}");
      for (const auto& [its, outer] : connect->second.asDictionary()) {
        part.connected[its] = outer.asText();
      }
      content.erase(connect);
    }
    if (content.count("shafts") == 0) {
      throw SceneError(name + "/file",
                       "missing; a part is another scene: the path of its file, from the folder of "
                       "this one");
    }
    try {
      part.scene = ParameterTree::dictionary(std::move(content));
      if (auto merged = mergeParts(part.scene, node_keys_)) part.scene = *std::move(merged);
      ParameterReader reader(part.scene, "");
      readSceneNames(part.scene, reader, node_keys_);
    } catch (const SceneError& error) {
      throw SceneError(error.keyPath().empty() ? name : entryPath(name, error.keyPath()),
                       error.message());
    }
    checkPrinciple(name, part.scene);
    made_[name] = std::move(part);
  }

  bool isTaken(const std::string& name) const {
    bool is_taken = made_.count(name) > 0 || isSceneKey(name);
    for (const SceneList& list : kSceneLists) {
      const std::vector<std::string> names = namesAt(own_, list.key, "");
      is_taken = is_taken || contains(names, name);
    }
    return is_taken || contains(node_keys_, name);
  }

  /// One machine has one principle.
  void checkPrinciple(const std::string& name, const ParameterTree& scene) const {
    const ParameterTree* const its = scene.find("principle");
    if (its == nullptr) return;
    const ParameterTree* const own = own_.find("principle");
    const std::string taken = own == nullptr ? "generalized_gauss" : own->asText();
    if (its->asText() == taken) return;
    throw SceneError(name + "/principle", inQuotes(its->asText()) +
                                              " where the scene around it has " + inQuotes(taken) +
                                              "; allowed: one for all, here by 'principle' of this "
                                              "scene, or of the part in its dictionary");
  }

  /// Finds what each shaft of each part is called in this scene.
  void findShafts() {
    std::vector<std::string> all = namesAt(own_, "shafts", "");
    for (const std::string& name : parts_) {
      Part& part = made_[name];
      const std::vector<std::string> its = namesAt(part.scene, "shafts", name);
      for (const std::string& shaft : its) {
        const std::string path = part.shafts[shaft] = entryPath(name, shaft);
        if (part.connected.count(shaft) == 0) all.push_back(path);
      }
      for (const auto& connected : part.connected) {
        placeOf(connected.first, its, name + "/connect", "is not a shaft of this part");
      }
    }
    for (const std::string& name : parts_) {
      Part& part = made_[name];
      std::set<std::string> taken;
      for (const auto& [shaft, outer] : part.connected) {
        const std::string path = entryPath(name + "/connect", shaft);
        placeOf(outer, all, path, "is not a shaft of this scene");
        if (!taken.insert(outer).second) {
          throw SceneError(path, inQuotes(outer) +
                                     " is connected twice: shafts that turn together are "
                                     "one shaft in the part, too");
        }
        part.shafts[shaft] = outer;
      }
    }
  }

  /// Returns the value at `key`, for more to be put into it: an empty one if there is none. Throws
  /// SceneError where it is of another kind.
  ParameterTree& valueAt(const std::string& key, const ParameterTree& empty) {
    ParameterTree& value = root_[key];
    if (value.kind() == Kind::kNothing) value = empty;
    requireKind(empty.kind(), value, key, empty.describeKind());
    return value;
  }

  ParameterTree::List& listAt(const std::string& key) {
    return valueAt(key, ParameterTree::list()).asList();
  }

  void addPart(const std::string& name) {
    const Part& part = made_[name];
    const Renaming renaming(name, part.scene, part.shafts);
    const Dictionary& its = part.scene.asDictionary();
    for (const SceneList& list : kSceneLists) {
      const bool has_shafts = std::string(list.key) == "shafts";
      for (const std::string& element : namesAt(part.scene, list.key, name)) {
        const std::string& full = renaming.names().at(element);
        const auto content = its.find(element);
        const bool is_connected = has_shafts && part.connected.count(element) > 0;
        if (!is_connected) added_[list.key].push_back(ParameterTree::text(full));
        if (content == its.end()) continue;  // told where the scene is read
        ParameterTree made = renaming.apply("", content->second);
        if (is_connected) made = withInertia(full, made);
        root_[full] = std::move(made);
      }
    }
    const auto coupling = its.find("inertia_coupling");
    if (coupling != its.end()) {
      if (coupling->second.kind() != Kind::kNothing)
        requireKind(Kind::kList, coupling->second, name + "/inertia_coupling", "a list");
      const ParameterTree made = renaming.apply("", coupling->second);
      ParameterTree::List& all = listAt("inertia_coupling");
      all.insert(all.end(), made.asList().begin(), made.asList().end());
    }
  }

  /// The scene's own shafts come first; its other elements may read those of its parts.
  void addNames(const std::string& key) {
    const auto added = added_.find(key);
    if (added == added_.end()) return;
    ParameterTree::List& own = listAt(key);
    const auto at = key == "shafts" ? own.end() : own.begin();
    own.insert(at, added->second.begin(), added->second.end());
  }

  /// Returns the dictionary of a shaft with the inertia of a part added to it.
  ParameterTree withInertia(const std::string& shaft, const ParameterTree& its) {
    const auto own = root_.find(shaft);
    if (own == root_.end() || own->second.kind() != Kind::kDictionary) return its;
    ParameterTree made = own->second;
    const ParameterTree* const more = its.find("inertia");
    if (more == nullptr) return made;
    ParameterTree& sum = made.asDictionary()["inertia"];
    sum = sum.kind() == Kind::kNothing ? *more : addInertias(sum, *more, shaft + "/inertia");
    return made;
  }

  /// Puts the values at the start of the parts' own shafts behind those of the scene's, which
  /// connected ones are.
  void addInitial() {
    Dictionary& own = valueAt("initial", ParameterTree::dictionary()).asDictionary();
    for (const char* key : {"angle", "velocity", "acceleration"}) {
      ParameterTree::List all;
      bool is_given = false;
      const auto add = [&](const std::string& path, const ParameterTree* values,
                           const std::vector<std::string>& shafts, const Renamed& connected,
                           const std::string& of) {
        if (values != nullptr && values->asList().size() != shafts.size()) {
          throw SceneError(path + key, "expected a list of " + std::to_string(shafts.size()) +
                                           " numbers" + of + ", got " + values->toText());
        }
        is_given = is_given || values != nullptr;
        for (std::size_t i = 0; i < shafts.size(); ++i) {
          if (connected.count(shafts[i]) > 0) continue;
          all.push_back(values == nullptr ? ParameterTree::real(0.0) : values->asList()[i]);
        }
      };
      const std::vector<std::string> shafts = namesAt(own_, "shafts", "");
      const auto found = own.find(key);
      add("initial/", found == own.end() ? nullptr : &found->second, shafts, {},
          ", of the scene's own shafts: " + joinNames(shafts) +
              " (those of a part are in its own 'initial')");
      for (const std::string& name : parts_) {
        const Part& part = made_[name];
        const ParameterTree* const its = part.scene.find("initial");
        if (its != nullptr && its->kind() != Kind::kNothing)
          requireKind(Kind::kDictionary, *its, name + "/initial", "a dictionary");
        add(name + "/initial/", its == nullptr ? nullptr : its->find(key),
            namesAt(part.scene, "shafts", name), part.connected, "");
      }
      if (is_given) own[key] = ParameterTree::list(std::move(all));
    }
    if (own.empty()) root_.erase("initial");
  }

  const ParameterTree& own_;
  const std::vector<std::string>& node_keys_;
  Dictionary root_;
  const std::vector<std::string> parts_;
  std::map<std::string, Part> made_;
  std::map<std::string, ParameterTree::List> added_;  ///< names, by their list
};

}  // namespace

std::optional<ParameterTree> mergeParts(const ParameterTree& tree,
                                        const std::vector<std::string>& node_keys) {
  if (tree.asDictionary().count("parts") == 0) return {};
  return Merge(tree, node_keys).run();
}

}  // namespace variator_sim
