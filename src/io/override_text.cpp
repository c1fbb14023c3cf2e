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
class Splitter {
 public:
  std::vector<std::string> split(const std::string& text) {
    for (const char c : text) {
      if (isSpace(c) && depth_ == 0 && quote_ == 0) {
        endWord();
      } else {
        take(c);
        word_ += c;
      }
    }
    endWord();
    return std::move(words_);
  }

 private:
  void endWord() {
    if (!word_.empty()) words_.push_back(word_);
    word_.clear();
  }
  /// Tracks brackets and quotes, within which a space ends no word.
  void take(char c) {
    if (quote_ != 0) {
      const bool is_escaped = quote_ == '"' && escapes_;
      escapes_ = c == '\\' && !escapes_;
      if (c == quote_ && !is_escaped) quote_ = 0;
      return;
    }
    // A quote within a plain text is an apostrophe.
    const bool begins = word_.empty() || std::string("=[{,: '\"").find(word_.back()) != word_.npos;
    if ((c == '\'' || c == '"') && begins) {
      quote_ = c;
      escapes_ = false;
    }
    if (c == '[' || c == '{') ++depth_;
    if ((c == ']' || c == '}') && depth_ > 0) --depth_;
  }

  std::vector<std::string> words_;
  std::string word_;
  int depth_ = 0;
  char quote_ = 0;
  bool escapes_ = false;
};

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
    texts = Splitter().split(own.asText());
  } else {
    const ParameterTree holder = ParameterTree::dictionary({{kKey, own}});
    texts = ParameterReader(holder, "").names(kKey);
  }
  for (const std::string& text : texts) applyOverride(tree, text);
}

}  // namespace variator_sim
