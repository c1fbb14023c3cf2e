/// Reads doc/scene.md: the examples of its chapters, and the keys in the tables of its types.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "variator_sim/component_factory.h"
#include "variator_sim/scene.h"

namespace variator_sim::test {

inline std::ifstream openScenePage() {
  return std::ifstream(std::string(VARIATOR_SIM_TEST_DIR) + "/../doc/scene.md");
}

/// Returns the text between each ```yaml and the next ``` of a chapter, "## " + `chapter`.
inline std::vector<std::string> readExamples(const std::string& chapter) {
  std::ifstream file = openScenePage();
  std::vector<std::string> examples;
  bool in_chapter = false;
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("## ", 0) == 0) in_chapter = line == "## " + chapter;
    if (line.rfind("```", 0) == 0) {
      inside = in_chapter && !inside && line == "```yaml";
      if (inside) examples.emplace_back();
    } else if (inside) {
      examples.back() += line + "\n";
    }
  }
  return examples;
}

/// Returns the keys in the first column of the tables "| key | ..." below the heading of a type.
inline std::set<std::string> documentedKeys(const std::string& type) {
  std::ifstream file = openScenePage();
  std::set<std::string> keys;
  bool in_section = false;
  bool in_table = false;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("## ", 0) == 0 || line.rfind("### ", 0) == 0) {
      in_section = line == "### " + type;
    }
    if (line.rfind("| key |", 0) == 0) in_table = true;
    if (line.empty()) in_table = false;
    const std::size_t begin = line.find('`');
    if (!in_section || !in_table || begin == std::string::npos) continue;
    keys.insert(line.substr(begin + 1, line.find('`', begin + 1) - begin - 1));
  }
  return keys;
}

/// Returns the keys that the message for an unknown one in `dictionary`, a part of `scene`, allows.
inline std::set<std::string> allowedKeys(const ParameterTree& scene, ParameterTree& dictionary) {
  std::set<std::string> keys;
  dictionary.asDictionary()["unknown_key"] = ParameterTree::integer(1);
  try {
    BuiltinComponentFactory factory;
    readScene(scene, factory);
    ADD_FAILURE() << "accepted";
  } catch (const SceneError& error) {
    const std::string message = error.what();
    const std::size_t list = message.find("allowed: ");
    EXPECT_NE(message.find("unknown_key: unknown key"), std::string::npos) << message;
    std::stringstream names(message.substr(list + 9));
    for (std::string name; std::getline(names, name, ',');) {
      keys.insert(name.substr(name.find_first_not_of(' ')));
    }
  }
  dictionary.asDictionary().erase("unknown_key");
  return keys;
}

}  // namespace variator_sim::test
