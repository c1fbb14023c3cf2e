#include "variator_sim/io/yaml_tree.h"

#include <regex.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <new>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "io/text_file.h"
#include "model/number_text.h"

namespace variator_sim {
namespace {

/// Bounds the values: aliases let a few lines stand for any number of them.
constexpr int kMostNodes = 100000;
/// Bytes; a device may have no end.
constexpr std::size_t kLongestFile = 1U << 24U;
/// Characters of the longest accepted number.
constexpr std::size_t kLongestNumber = 100;

/// "1:30.5" = 1 * 60 + 30.5 (YAML 1.1); without a colon a plain number.
bool parseSexagesimal(const std::string& text, double* value) {
  *value = 0.0;
  for (const std::string& digits : splitAt(text, ':')) {
    double part = 0.0;
    if (!readWhole(digits, &part)) return false;
    *value = *value * 60.0 + part;
  }
  return true;
}

/// An extended regular expression of POSIX that matches whole texts. (The C++ library's takes
/// longer to compile than the rest of this file.)
class Pattern {
 public:
  explicit Pattern(const std::string& expression) {
    if (regcomp(&compiled_, ("^(" + expression + ")$").c_str(), REG_EXTENDED | REG_NOSUB) != 0) {
      throw std::logic_error("not a regular expression: " + expression);
    }
  }
  ~Pattern() { regfree(&compiled_); }
  Pattern(const Pattern&) = delete;
  Pattern& operator=(const Pattern&) = delete;

  bool matches(const std::string& text) const {
    // To regexec a text ends at its first NUL.
    return text.find('\0') == std::string::npos &&
           regexec(&compiled_, text.c_str(), 0, nullptr, 0) == 0;
  }

 private:
  regex_t compiled_{};
};

/// Resolves a plain scalar by the expressions of PyYAML's resolver.
ParameterTree resolvePlain(const std::string& text) {
  static const Pattern kNothing("~|null|Null|NULL");
  static const Pattern kTrue("yes|Yes|YES|true|True|TRUE|on|On|ON");
  static const Pattern kFalse("no|No|NO|false|False|FALSE|off|Off|OFF");
  static const Pattern kReal(
      "[-+]?[0-9][0-9_]*\\.[0-9_]*([eE][-+][0-9]+)?"
      "|\\.[0-9][0-9_]*([eE][-+][0-9]+)?"
      "|[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+\\.[0-9_]*");
  static const Pattern kInfinity("[-+]?\\.(inf|Inf|INF)");
  static const Pattern kNan("\\.(nan|NaN|NAN)");
  static const Pattern kInteger(
      "[-+]?0b[0-1_]+|[-+]?0[0-7_]+|[-+]?(0|[1-9][0-9_]*)|[-+]?0x[0-9a-fA-F_]+"
      "|[-+]?[1-9][0-9_]*(:[0-5]?[0-9])+");

  if (text.size() > kLongestNumber) return ParameterTree::text(text);
  if (text.empty() || kNothing.matches(text)) return {};
  if (kTrue.matches(text)) return ParameterTree::boolean(true);
  if (kFalse.matches(text)) return ParameterTree::boolean(false);
  if (kNan.matches(text)) {
    return ParameterTree::real(std::numeric_limits<double>::quiet_NaN());
  }
  const bool is_negative = !text.empty() && text.front() == '-';
  const double sign = is_negative ? -1.0 : 1.0;
  if (kInfinity.matches(text)) {
    return ParameterTree::real(sign * std::numeric_limits<double>::infinity());
  }
  const bool is_real = kReal.matches(text);
  if (!is_real && !kInteger.matches(text)) return ParameterTree::text(text);

  const bool has_sign = is_negative || text.front() == '+';
  std::string digits = text.substr(has_sign ? 1 : 0);
  digits.erase(std::remove(digits.begin(), digits.end(), '_'), digits.end());
  const bool is_sexagesimal = digits.find(':') != std::string::npos;
  double real = 0.0;
  if (is_real || is_sexagesimal) {
    if (!parseSexagesimal(digits, &real)) return ParameterTree::text(text);
    if (is_real || std::abs(real) > 9e15) return ParameterTree::real(sign * real);
    return ParameterTree::integer(static_cast<std::int64_t>(sign * real));
  }

  const bool is_decimal = digits.size() == 1 || digits.front() != '0';
  const bool is_octal = !is_decimal && std::isdigit(static_cast<unsigned char>(digits[1])) != 0;
  const int base = is_decimal ? 10 : is_octal ? 8 : digits[1] == 'x' ? 16 : 2;
  const std::string number =
      (is_negative ? "-" : "") + digits.substr(is_decimal || is_octal ? 0 : 2);
  std::int64_t integer = 0;
  const auto [rest, error] =
      std::from_chars(number.data(), number.data() + number.size(), integer, base);
  if (error == std::errc() && rest == number.data() + number.size()) {
    return ParameterTree::integer(integer);
  }
  // More than 64 bits: a number all the same.
  if (is_decimal && readWhole(digits, &real)) return ParameterTree::real(sign * real);
  return ParameterTree::text(text);
}

class Converter {
 public:
  explicit Converter(std::string source_name) : source_name_(std::move(source_name)) {}

  SceneError error(const YAML::Mark& mark, const std::string& message) const {
    std::string place = source_name_;
    if (!mark.is_null()) {
      place += ":" + std::to_string(mark.line + 1) + ":" + std::to_string(mark.column + 1);
    }
    return SceneError("", place + ": " + message);
  }

  SceneError tooManyValues(const YAML::Mark& mark) const {
    return error(mark, "more than " + std::to_string(kMostNodes) + " values");
  }

  ParameterTree convert(const YAML::Node& node, int depth) {
    if (depth > kDeepestNesting) {
      throw error(node.Mark(), "nested more than " + std::to_string(kDeepestNesting) + " deep");
    }
    if (++node_count_ > kMostNodes) throw tooManyValues(node.Mark());
    switch (node.Type()) {
      case YAML::NodeType::Undefined:
      case YAML::NodeType::Null:
        return {};
      case YAML::NodeType::Scalar:
        return convertScalar(node);
      case YAML::NodeType::Sequence: {
        requireTag(node, "seq");
        ParameterTree::List values;
        for (const YAML::Node& value : node) values.push_back(convert(value, depth + 1));
        return ParameterTree::list(std::move(values));
      }
      case YAML::NodeType::Map:
        return ParameterTree::dictionary(convertMap(node, depth));
    }
    return {};
  }

 private:
  static constexpr const char* kTagPrefix = "tag:yaml.org,2002:";

  SceneError tagError(const YAML::Node& node) const {
    return error(node.Mark(), "tag " + inQuotes(node.Tag()) +
                                  " is not supported; allowed: none, or one of YAML's own for "
                                  "this kind of value");
  }

  void requireTag(const YAML::Node& node, const std::string& name) const {
    const std::string& tag = node.Tag();
    if (!tag.empty() && tag != "?" && tag != kTagPrefix + name) throw tagError(node);
  }

  ParameterTree convertScalar(const YAML::Node& node) const {
    const std::string& tag = node.Tag();
    const std::string& text = node.Scalar();
    if (tag.empty() || tag == "?") return resolvePlain(text);
    const std::string prefix = kTagPrefix;
    if (tag == "!" || tag == prefix + "str") return ParameterTree::text(text);
    ParameterTree value = resolvePlain(text);
    const ParameterTree::Kind kind = value.kind();
    if (tag == prefix + "int" && kind == ParameterTree::Kind::kInteger) return value;
    if (tag == prefix + "bool" && kind == ParameterTree::Kind::kBoolean) return value;
    if (tag == prefix + "null" && kind == ParameterTree::Kind::kNothing) return value;
    if (tag == prefix + "float") {
      if (kind == ParameterTree::Kind::kReal) return value;
      if (kind == ParameterTree::Kind::kInteger) {
        return ParameterTree::real(static_cast<double>(value.asInteger()));
      }
      double real = 0.0;
      if (readWhole(text, &real)) return ParameterTree::real(real);
    }
    throw tagError(node);
  }

  ParameterTree::Dictionary convertMap(const YAML::Node& node, int depth) {
    requireTag(node, "map");
    ParameterTree::Dictionary own;
    ParameterTree::Dictionary merged;
    for (const auto& entry : node) {
      const YAML::Node& key_node = entry.first;
      if (key_node.IsScalar() && key_node.Scalar() == "<<" && key_node.Tag() == "?") {
        merge(entry.second, depth, &merged);
        continue;
      }
      const ParameterTree key = convert(key_node, depth + 1);
      if (key.kind() != ParameterTree::Kind::kText) {
        throw error(key_node.Mark(), "expected a key, got " + key.describeKind() + ": " +
                                         key.toText() + "; a key that is a text needs quotes here");
      }
      const bool is_new = own.emplace(key.asText(), convert(entry.second, depth + 1)).second;
      if (!is_new) {
        throw error(key_node.Mark(),
                    "key " + inQuotes(key.asText()) + " stands twice in one mapping");
      }
    }
    // Own keys win over merged ones.
    own.merge(merged);
    return own;
  }

  /// Merges `<<: mapping` or `<<: [mapping, ...]`, of which earlier ones win.
  void merge(const YAML::Node& node, int depth, ParameterTree::Dictionary* merged,
             bool is_element = false) {
    if (depth > kDeepestNesting) {
      throw error(node.Mark(), "nested more than " + std::to_string(kDeepestNesting) + " deep");
    }
    if (node.IsMap()) {
      ParameterTree::Dictionary values = convertMap(node, depth + 1);
      merged->merge(values);
      return;
    }
    if (is_element || !node.IsSequence()) {
      throw error(node.Mark(), std::string("expected a mapping") +
                                   (is_element ? "" : " or a list of mappings") +
                                   " to merge by '<<'");
    }
    for (const YAML::Node& element : node) merge(element, depth, merged, true);
  }

  std::string source_name_;
  int node_count_ = 0;
};

/// Checks a text before a tree is built: records where its documents and their roots begin, and
/// bounds its values by kMostNodes.
class Listener : public YAML::EventHandler {
 public:
  explicit Listener(const Converter& converter) : converter_(converter) {}

  const YAML::Mark& start() const { return start_; }
  const YAML::Mark& root() const { return root_; }

  void OnDocumentStart(const YAML::Mark& mark) override {
    start_ = mark;
    root_ = YAML::Mark::null_mark();
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { see(mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { see(mark); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                const std::string&) override {
    see(mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    see(mark);
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    see(mark);
  }
  void OnMapEnd() override {}

 private:
  void see(const YAML::Mark& mark) {
    if (root_.is_null()) root_ = mark;
    if (++value_count_ > kMostNodes) throw converter_.tooManyValues(mark);
  }

  const Converter& converter_;
  YAML::Mark start_ = YAML::Mark::null_mark();
  YAML::Mark root_ = YAML::Mark::null_mark();
  int value_count_ = 0;
};

/// Returns the root of the only document of `text`, or a null node if there is none. yaml-cpp reads
/// a token that can begin no document (a comma) as an empty document without consuming it: so
/// documents are read one by one, and each has to begin behind the last.
YAML::Node loadOnlyDocument(const std::string& text, const Converter& converter, bool* is_empty) {
  Listener listener(converter);
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  *is_empty = !parser.HandleNextDocument(listener);
  if (*is_empty) return {};
  const auto stuck = [&](const YAML::Mark& mark) {
    return converter.error(mark, "not valid YAML: no value can begin here");
  };
  const YAML::Mark first = listener.start();
  if (parser.HandleNextDocument(listener)) {
    const YAML::Mark second = listener.start();
    if (second.pos == first.pos) throw stuck(second);
    const YAML::Mark root = listener.root();
    if (parser.HandleNextDocument(listener) && listener.start().pos == second.pos) {
      throw stuck(second);
    }
    throw converter.error(root, "a second document starts here; allowed: one document");
  }
  return YAML::Load(text);
}

/// Explains a fault on the 0-based `line` that yaml-cpp does not: a tab indents it, or the one
/// before.
std::string describeTab(const std::string& text, int line) {
  std::istringstream lines(text);
  std::string words;
  for (int i = 0; i <= line && std::getline(lines, words); ++i) {
    const std::size_t begin = words.find_first_not_of(" \t");
    const bool has_tab = words.substr(0, begin).find('\t') != std::string::npos;
    if (i + 1 < line || !has_tab || begin == std::string::npos) continue;
    return "; line " + std::to_string(i + 1) + " is indented by a tab: YAML wants spaces";
  }
  return "";
}

ParameterTree readYaml(const std::string& text, const std::string& source_name,
                       bool requires_mapping) {
  Converter converter(source_name);
  if (text.size() > kLongestFile) {
    throw converter.error(YAML::Mark::null_mark(),
                          "longer than " + std::to_string(kLongestFile) + " bytes");
  }
  try {
    bool is_empty = false;
    const YAML::Node root = loadOnlyDocument(text, converter, &is_empty);
    ParameterTree tree = converter.convert(root, 0);
    const ParameterTree::Kind kind = tree.kind();
    if (requires_mapping && kind != ParameterTree::Kind::kDictionary) {
      throw converter.error(
          is_empty ? YAML::Mark() : root.Mark(),
          "expected a mapping (key: value), got " + tree.describeKind() +
              (kind == ParameterTree::Kind::kNothing ? "" : ": " + tree.toText()));
    }
    return tree;
  } catch (const YAML::Exception& error) {
    throw converter.error(error.mark,
                          "not valid YAML: " + error.msg + describeTab(text, error.mark.line));
  } catch (const std::bad_alloc&) {
    throw converter.error(YAML::Mark::null_mark(), "takes more memory than there is");
  }
}

}  // namespace

ParameterTree readYamlText(const std::string& text, const std::string& source_name) {
  return readYaml(text, source_name, /*requires_mapping=*/true);
}

ParameterTree readYamlValue(const std::string& text, const std::string& source_name) {
  return readYaml(text, source_name, /*requires_mapping=*/false);
}

void placeFiles(ParameterTree* tree, const FilePlace& place_of) {
  for (auto& [name, value] : tree->asDictionary()) {
    ParameterTree* const given = value.find("file");
    const std::filesystem::path file = given == nullptr ? "" : given->asText();
    if (file.empty() || file.is_absolute() || file.string().find("://") != std::string::npos)
      continue;
    const std::filesystem::path place = place_of(name, file.string());
    *given = ParameterTree::text(place.lexically_normal().string());
  }
}

namespace {

ParameterTree readFile(const std::string& path, const std::vector<std::string>& within);

/// Puts `over` over `tree`: dictionaries key by key, other values as a whole.
void putOver(const ParameterTree& over, ParameterTree* tree) {
  const bool are_dictionaries = over.kind() == ParameterTree::Kind::kDictionary &&
                                tree->kind() == ParameterTree::Kind::kDictionary;
  if (!are_dictionaries) {
    *tree = over;
    return;
  }
  for (const auto& [key, value] : over.asDictionary()) putOver(value, &tree->asDictionary()[key]);
}

/// Puts the scene of each part's file into its dictionary, whose other keys count before those of
/// the file. `within`: the files around `tree`, the outermost first.
void loadParts(ParameterTree* tree, const std::vector<std::string>& within) {
  const ParameterTree* const parts = std::as_const(*tree).find("parts");
  const ParameterTree::List names = parts == nullptr ? ParameterTree::List() : parts->asList();
  for (const ParameterTree& name : names) {
    ParameterTree* const part = tree->find(name.asText());
    if (part == nullptr || part->find("file") == nullptr) continue;
    ParameterTree own = *part;
    const std::string file = std::as_const(own).find("file")->asText();
    std::vector<std::string> chain = within;
    chain.push_back(file);
    if (contains(within, file)) {
      throw SceneError(name.asText() + "/file",
                       "a scene cannot be a part of itself: " + joinNames(chain));
    }
    own.asDictionary().erase("file");
    ParameterTree content;
    try {
      content = readFile(file, chain);
    } catch (const SceneError& error) {
      throw SceneError(name.asText() + (error.keyPath().empty() ? "/file" : "/" + error.keyPath()),
                       error.message());
    }
    putOver(own, &content);
    *part = std::move(content);
  }
}

ParameterTree readFile(const std::string& path, const std::vector<std::string>& within) {
  std::string text;
  const std::string failure = readTextFile(path, &text, kLongestFile);
  if (!failure.empty()) throw SceneError("", path + ":1:1: cannot be read: " + failure);
  ParameterTree tree = readYamlText(text, path);
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  placeFiles(&tree, [&](const std::string& /*name*/, const std::string& file) {
    return (folder / file).string();
  });
  loadParts(&tree, within);
  return tree;
}

}  // namespace

ParameterTree readYamlFile(const std::string& path) {
  return readFile(path, {std::filesystem::absolute(path).lexically_normal().string()});
}

void loadParts(ParameterTree* tree) {
  loadParts(tree, {});
}

}  // namespace variator_sim
