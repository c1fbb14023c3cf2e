#include "motion_program/c_text.h"

#include <boost/algorithm/string/replace.hpp>
#include <cctype>
#include <charconv>
#include <cmath>
#include <iterator>

namespace variator_sim {

std::string harmless(std::string text) {
  for (char& c : text) {
    const bool is_plain = c >= ' ' && c <= '~';
    // (A trigraph begins with question marks, and one of them is a backslash.)
    if (!is_plain || c == '*' || c == '\\' || c == '"' || c == '?') c = '_';
  }
  return text;
}

std::string inCapitals(std::string name) {
  for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return name;
}

void replaceAll(std::string& text, const std::string& from, const std::string& to) {
  boost::replace_all(text, from, to);
}

std::string withName(std::string text, const std::string& name) {
  replaceAll(text, "scene_", name + "_");
  replaceAll(text, "SCENE_", inCapitals(name) + "_");
  return text;
}

std::string literalOf(double value) {
  if (std::isnan(value)) return "NAN";
  if (std::isinf(value)) return value > 0.0 ? "INFINITY" : "-INFINITY";
  char text[40];
  std::string literal(text, std::to_chars(text, std::end(text), value).ptr);  // the shortest
  if (literal.find_first_of(".en") == std::string::npos) literal += ".0";
  return literal;
}

std::string arrayOf(const std::string& type, const std::string& name,
                    const std::vector<std::string>& values) {
  constexpr std::size_t kColumns = 92;
  std::string text;
  std::size_t begin = 0;
  for (const std::string& value : values) {
    const bool is_full = text.size() - begin + value.size() > kColumns;
    if (!text.empty()) text += is_full ? ",\n    " : ", ";
    if (is_full) begin = text.size() - 4;
    text += value;
  }
  return "static const " + type + " " + name + "[] = {" + (text.empty() ? "0" : text) + "};\n";
}

}  // namespace variator_sim
