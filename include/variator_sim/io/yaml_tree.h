/// YAML as a parameter tree.
#pragma once

#include <functional>
#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// Reads one YAML document whose root is a mapping. Plain scalars mean what they mean to rosparam
/// (YAML 1.1 as PyYAML's safe_load resolves it): `yes` is true, `010` is 8, `1e-9` stays a text,
/// which the readers take as a number. Quoted scalars are texts. Anchors, aliases and merge keys
/// (`<<`) work; a key twice in one mapping is an error. Throws SceneError that starts with
/// "file:line:column". Relative paths at the key `file` of its dictionaries become absolute ones,
/// from the folder of the scene, and the scenes in the files of `parts` come into their places.
ParameterTree readYamlFile(const std::string& path);

/// Returns the path of the file that the dictionary `name` of a scene gives as `file`.
using FilePlace = std::function<std::string(const std::string& name, const std::string& file)>;
/// Puts it in the place of each relative path, but of addresses (package://).
void placeFiles(ParameterTree* tree, const FilePlace& place_of);

/// Puts the scenes in the files of `parts` into their places. Throws SceneError.
void loadParts(ParameterTree* tree);

/// Reads `text` as readYamlFile does; `source_name` stands for the file in messages.
ParameterTree readYamlText(const std::string& text, const std::string& source_name);

/// Reads `text`, whose root may be anything: a number, a text, a list, nothing.
ParameterTree readYamlValue(const std::string& text, const std::string& source_name);

/// Returns the whole tree, uncut, in block style. Read again (YAML 1.1 or 1.2) it gives the same
/// tree: reals keep every bit and stay reals, texts stay texts.
std::string toYaml(const ParameterTree& tree);

}  // namespace variator_sim
