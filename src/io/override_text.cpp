#include "variator_sim/io/override_text.h"

#include <utility>
#include <vector>

#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

constexpr const char* kKey = "overrides";

bool isSpace(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/// Splits a text at the spaces outside of brackets and quotes.
std::vector<std::string> splitAtSpaces(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  int depth = 0;
  char quote = 0;
  bool escapes = false;
  for (const char c : text) {
    if (isSpace(c) && depth == 0 && quote == 0) {
      if (!word.empty()) words.push_back(std::exchange(word, ""));
      continue;
    }
    // A quote within a plain text is an apostrophe.
    const bool begins = word.empty() || std::string("=[{,: '\"").find(word.back()) != word.npos;
    if (quote != 0) {
      const bool is_escaped = quote == '"' && escapes;
      escapes = c == '\\' && !escapes;
      if (c == quote && !is_escaped) quote = 0;
    } else if ((c == '\'' || c == '"') && begins) {
      quote = c;
      escapes = false;
    } else if (c == '[' || c == '{') {
      ++depth;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
    word += c;
  }
  if (!word.empty()) words.push_back(word);
  return words;
}

}  // namespace

void applyOverride(ParameterTree& tree, const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw SceneError("", inQuotes(text) +
                             " is not an override; expected PATH=VALUE, e.g. drive/inertia=1.2; a "
                             "value with spaces stands in brackets or quotes");
  }
  const std::string path = text.substr(0, equals);
  setValue(tree, path, readYamlValue(text.substr(equals + 1), "value of " + inQuotes(path)));
}

void applyOwnOverrides(ParameterTree& tree) {
  ParameterTree* const found = tree.find(kKey);
  if (found == nullptr) return;
  const ParameterTree own = std::move(*found);
  tree.asDictionary().erase(kKey);
  if (own.kind() == ParameterTree::Kind::kNothing) return;
  std::vector<std::string> texts;
  if (own.kind() == ParameterTree::Kind::kText) {
    texts = splitAtSpaces(own.asText());
  } else {
    const ParameterTree holder = ParameterTree::dictionary({{kKey, own}});
    texts = ParameterReader(holder, "").names(kKey);
  }
  for (const std::string& text : texts) applyOverride(tree, text);
}

}  // namespace variator_sim
