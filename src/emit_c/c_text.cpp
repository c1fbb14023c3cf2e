#include "emit_c/c_text.h"

#include <cctype>

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
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
    text.replace(at, from.size(), to);
    at += to.size();
  }
}

std::string withName(std::string text, const std::string& name) {
  replaceAll(text, "scene_", name + "_");
  replaceAll(text, "SCENE_", inCapitals(name) + "_");
  return text;
}

}  // namespace variator_sim
