#include "variator_sim/io/yaml_text.h"

#include <array>
#include <cstdio>
#include <set>

namespace variator_sim {
namespace {

bool isPlain(const std::string& text) {
  // What some YAML version takes for a boolean or for nothing.
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

std::string quotedScalar(const std::string& text) {
  if (isPlain(text)) return text;
  std::string result = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\x%02x", byte);
      result += escape.data();
    } else {
      result += c;
    }
  }
  return result + "\"";
}

bool isBranch(const ParameterTree& tree) {
  return (tree.kind() == ParameterTree::Kind::kList && !tree.asList().empty()) ||
         (tree.kind() == ParameterTree::Kind::kDictionary && !tree.asDictionary().empty());
}

std::string leafText(const ParameterTree& tree) {
  switch (tree.kind()) {
    case ParameterTree::Kind::kNothing:
      return "null";
    case ParameterTree::Kind::kBoolean:
      return tree.asBoolean() ? "true" : "false";
    case ParameterTree::Kind::kInteger:
      return std::to_string(tree.asInteger());
    case ParameterTree::Kind::kReal:
      return formatReal(tree.asReal());
    case ParameterTree::Kind::kText:
      return quotedScalar(tree.asText());
    case ParameterTree::Kind::kList:
      return "[]";
    case ParameterTree::Kind::kDictionary:
      return "{}";
  }
  return "null";
}

/// Appends `tree` after "key:" or "-", at `indent` columns.
void append(const ParameterTree& tree, const std::string& indent, std::string& text) {
  if (!isBranch(tree)) {
    text += " " + leafText(tree) + "\n";
    return;
  }
  text += "\n";
  if (tree.kind() == ParameterTree::Kind::kList) {
    for (const ParameterTree& entry : tree.asList()) {
      text += indent + "-";
      append(entry, indent + "  ", text);
    }
  } else {
    for (const auto& [key, entry] : tree.asDictionary()) {
      text += indent + quotedScalar(key) + ":";
      append(entry, indent + "  ", text);
    }
  }
}

}  // namespace

std::string toYaml(const ParameterTree& tree) {
  std::string text;
  append(tree, "", text);
  // The root has no "key:" in front of it.
  return text.substr(1);
}

}  // namespace variator_sim
