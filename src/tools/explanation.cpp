#include <algorithm>
#include <cctype>

#include "tools/scene_equations.h"

namespace variator_sim {

namespace {

constexpr std::size_t kWidth = 100;

bool isZero(const Equation& equation) {
  return expression::isNumber(*equation.right, 0.0);
}

/// Returns the position at which to break `text`, which is longer than `room`: before the sign of a
/// sum or behind a comma, as far outside of parentheses and as far right as possible. 0: none.
std::size_t findBreak(const std::string& text, std::size_t room) {
  // Penalty of a level of parentheses, characters.
  constexpr int kLevel = 25;
  std::size_t best = 0;
  int best_worth = 0;
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '(') ++depth;
    if (text[i] == ')') --depth;
    if (text[i] != ' ' || i == 0) continue;
    if (i > room && best != 0) break;
    const bool is_place =
        text[i - 1] == ',' ||
        (i + 2 < text.size() && (text[i + 1] == '+' || text[i + 1] == '-') && text[i + 2] == ' ');
    const int worth = static_cast<int>(i) - kLevel * depth;
    if (is_place && (best == 0 || worth > best_worth)) {
      best = i;
      best_worth = worth;
    }
  }
  return best;
}

/// Wraps `text` behind `margin` and indents the further lines as far.
std::string wrap(const std::string& margin, std::string text) {
  std::string lines = margin;
  const std::string indent(margin.size() + 4, ' ');
  std::size_t room = kWidth > margin.size() + 20 ? kWidth - margin.size() : 20;
  while (text.size() > room) {
    const std::size_t place = findBreak(text, room);
    if (place == 0) break;
    lines += text.substr(0, place) + "\n" + indent;
    text = text.substr(place + 1);
    room = kWidth > indent.size() + 20 ? kWidth - indent.size() : 20;
  }
  return lines + text + "\n";
}

/// Breaks words at spaces, but not within (x, y).
std::string wrapWords(const std::string& text) {
  std::string lines;
  std::string line = "  ";
  std::size_t begin = 0;
  while (begin <= text.size()) {
    std::size_t end = std::min(text.find(' ', begin), text.size());
    if (text[begin] == '(' && end > 0 && text[end - 1] == ',') {
      end = std::min(text.find(' ', end + 1), text.size());
    }
    const std::string word = text.substr(begin, end - begin);
    if (line.size() + word.size() + 1 > kWidth && line.size() > 6) {
      lines += line + "\n";
      line = "     ";
    }
    line += (line.back() == ' ' ? "" : " ") + word;
    begin = end + 1;
  }
  return lines + line + "\n";
}

/// Estimates the width of typeset LaTeX, in characters.
std::size_t visibleWidth(const std::string& latex) {
  std::size_t width = 0;
  for (std::size_t i = 0; i < latex.size(); ++i) {
    if (latex[i] == '\\') {
      std::size_t end = i + 1;
      while (end < latex.size() && std::isalpha(static_cast<unsigned char>(latex[end])) != 0) ++end;
      const std::string command = latex.substr(i, end - i);
      const bool is_silent = command == "\\mathrm" || command == "\\left" || command == "\\right" ||
                             command == "\\frac" || command == "\\dot" ||
                             command == "\\operatorname" || command == "\\text";
      width += is_silent || end == i + 1 ? 0 : command.size() > 6 ? 1 : 2;
      i = std::max(end, i + 2) - 1;
    } else if (latex[i] != '{' && latex[i] != '}' && latex[i] != ' ' && latex[i] != '_' &&
               latex[i] != '^') {
      ++width;
    }
  }
  return width;
}

std::string layOutLatex(const Equation& equation) {
  constexpr std::size_t kLatexWidth = 70;
  std::string lines = "  " + expression::toLatex(*equation.left) + " &=";
  std::size_t width = 0;
  for (const std::string& term : expression::toLatexTerms(*equation.right)) {
    const std::size_t added = visibleWidth(term);
    if (width > 0 && width + added > kLatexWidth) {
      lines += " \\\\\n    &\\quad {}";
      width = 0;
    }
    lines += " " + term;
    width += added;
  }
  return lines;
}

}  // namespace

std::string layOutText(const std::vector<EquationSection>& sections, const std::string& title) {
  std::string text = title + "\n";
  for (const EquationSection& section : sections) {
    text += "\n" + section.title.text + "\n";
    for (const Words& words : section.sentences) text += wrapWords(words.text);
    std::size_t width = 0;
    for (const Equation& it : section.equations) {
      // Vanishing parts are listed by themselves.
      if (isZero(it)) continue;
      width = std::max(width, expression::toText(*it.left).size());
    }
    for (const Equation& it : section.equations) {
      std::string margin = "  " + expression::toText(*it.left);
      if (!isZero(it)) margin.resize(width + 2, ' ');
      text += wrap(margin + " = ", expression::toText(*it.right));
    }
  }
  return text;
}

std::string layOutLatex(const std::vector<EquationSection>& sections, const std::string& title) {
  std::string text =
      "\\documentclass{article}\n"
      "\\usepackage[a4paper, margin=2cm]{geometry}\n"
      "\\usepackage{amsmath}\n"
      "\\allowdisplaybreaks\n"
      "\\setlength{\\parindent}{0pt}\n"
      "\\begin{document}\n"
      "\\section*{" +
      plainWords(title).latex + "}\n";
  for (const EquationSection& section : sections) {
    text += "\n\\subsection*{" + section.title.latex + "}\n";
    for (const Words& words : section.sentences) text += words.latex + "\n\n";
    if (section.equations.empty()) continue;
    text += "\\begin{align*}\n";
    for (std::size_t i = 0; i < section.equations.size(); ++i) {
      text += layOutLatex(section.equations[i]);
      text += i + 1 < section.equations.size() ? " \\\\\n" : "\n";
    }
    text += "\\end{align*}\n";
  }
  return text + "\\end{document}\n";
}

}  // namespace variator_sim
