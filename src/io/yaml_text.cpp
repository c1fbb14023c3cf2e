#include <yaml-cpp/emitter.h>
#include <yaml-cpp/emittermanip.h>

#include <set>

#include "variator_sim/io/yaml_tree.h"

namespace variator_sim {
namespace {

/// Returns true for texts that no version of YAML reads as a boolean or null.
bool isPlain(const std::string& text) {
  static const std::set<std::string> kReserved = {"y",  "n",   "yes",  "no",   "true",
                                                  "on", "off", "null", "false"};
  if (text.empty()) return false;
  std::string lower;
  for (const char c : text) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
    const bool later = (c >= '0' && c <= '9') || c == '/';
    if (!letter && !(later && !lower.empty())) return false;
    lower += static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  }
  return kReserved.count(lower) == 0;
}

void writeText(const std::string& text, YAML::Emitter& emitter) {
  if (!isPlain(text)) emitter << YAML::DoubleQuoted;
  emitter << text;
}

// Numbers are written as texts, since yaml-cpp writes fewer digits.
void write(const ParameterTree& tree, YAML::Emitter& emitter) {
  switch (tree.kind()) {
    case ParameterTree::Kind::kNothing:
      emitter << YAML::Null;
      break;
    case ParameterTree::Kind::kBoolean:
      emitter << (tree.asBoolean() ? "true" : "false");
      break;
    case ParameterTree::Kind::kInteger:
      emitter << std::to_string(tree.asInteger());
      break;
    case ParameterTree::Kind::kReal:
      emitter << formatReal(tree.asReal());
      break;
    case ParameterTree::Kind::kText:
      writeText(tree.asText(), emitter);
      break;
    case ParameterTree::Kind::kList:
      if (tree.asList().empty()) emitter << YAML::Flow;
      emitter << YAML::BeginSeq;
      for (const ParameterTree& entry : tree.asList()) write(entry, emitter);
      emitter << YAML::EndSeq;
      break;
    case ParameterTree::Kind::kDictionary:
      if (tree.asDictionary().empty()) emitter << YAML::Flow;
      emitter << YAML::BeginMap;
      for (const auto& [key, entry] : tree.asDictionary()) {
        writeText(key, emitter);
        write(entry, emitter);
      }
      emitter << YAML::EndMap;
      break;
  }
}

}  // namespace

std::string toYaml(const ParameterTree& tree) {
  YAML::Emitter emitter;
  write(tree, emitter);
  return std::string(emitter.c_str(), emitter.size()) + "\n";
}

}  // namespace variator_sim
