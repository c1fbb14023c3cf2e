// Terms as text and as LaTeX.
#include <charconv>
#include <cmath>

#include "expression/term.h"

namespace variator_sim::expression {

namespace {

using Kind = Term::Kind;

/// The precedence of a written term's outer operation.
enum Binding { kLoose, kAdditive, kMultiplicative, kPowerful, kAtomic };

int significantDigits(const std::string& text) {
  const std::string digits = text.substr(0, text.find('e'));
  int count = 0;
  bool begun = false;
  int zeros = 0;  // zeros that may be trailing
  for (const char c : digits) {
    if (c < '0' || c > '9') continue;
    begun = begun || c != '0';
    if (!begun) continue;
    ++count;
    zeros = c == '0' ? zeros + 1 : 0;
  }
  return count - zeros;
}

constexpr double kHalfTurn = 3.14159265358979323846;

/// A positive number as a fraction: "2/3" reads better than its sixteen digits.
struct Fraction {
  std::string numerator;
  std::string denominator;  ///< empty: 1
  bool has_pi = false;      ///< times pi
};

Fraction toFraction(double value) {
  constexpr int kFew = 6;
  if (!std::isnormal(value)) return {toShortText(value), ""};
  std::string text = toShortText(value);
  if (significantDigits(text) <= kFew) return {text, ""};
  const auto findMultiple = [value](bool is_whole) -> Fraction {
    for (int n = 2; n < 100; ++n) {
      const std::string multiple = toShortText(value * n);
      const bool is_fit = is_whole ? multiple.size() <= 4 && multiple.find('.') == std::string::npos
                                   : significantDigits(multiple) <= 4;
      if (is_fit) return {multiple, std::to_string(n)};
    }
    return {};
  };
  Fraction ratio = findMultiple(true);
  if (!ratio.numerator.empty()) return ratio;
  const std::string inverse = toShortText(1.0 / value);
  if (significantDigits(inverse) <= kFew + 2) return {"1", inverse};
  const std::string turns = toShortText(value / kHalfTurn);
  if (significantDigits(turns) <= kFew) return {turns, "", true};
  Fraction multiple = findMultiple(false);
  if (!multiple.numerator.empty()) return multiple;
  return {text, ""};
}

// ------------------------------------------------------------------------------------------- text

/// The base class of printers: subclasses implement the differences of text and LaTeX.
class Printer {
 public:
  explicit Printer(bool is_latex) : is_latex_(is_latex) {}

  /// Prints a term, in parentheses if it binds less than `least`.
  std::string print(const Term& term, int least = kLoose) const {
    const std::string text = printBare(term);
    return bindingOf(term) < least ? parenthesized(text) : text;
  }
  /// Prints the terms of a sum, each with its sign.
  std::vector<std::string> printTerms(const Term& term) const {
    if (term.kind != Kind::kSum) return {print(term)};
    std::vector<std::string> terms;
    for (const TermPtr& part : term.parts) {
      const std::string text = print(*part, kMultiplicative - 1);
      const bool is_negative = text.front() == '-';
      if (terms.empty()) {
        terms.push_back(text);
      } else {
        terms.push_back(is_negative ? "- " + text.substr(1) : "+ " + text);
      }
    }
    return terms;
  }

 private:
  static Binding bindingOf(const Term& term) {
    switch (term.kind) {
      case Kind::kNumber:
        if (std::signbit(term.number)) return kAdditive;
        return bindingOf(toFraction(term.number));
      case Kind::kSum:
        return kAdditive;
      case Kind::kProduct:
        if (term.number < 0.0) return kAdditive;
        return term.number == 1.0 && term.factors.size() == 1 && term.factors[0].exponent > 0.0
                   ? kPowerful
                   : kMultiplicative;
      case Kind::kPower:
        return kPowerful;
      default:
        return kAtomic;
    }
  }

  static Binding bindingOf(const Fraction& it) {
    const bool is_name = it.has_pi && it.numerator == "1";
    return it.denominator.empty() && (!it.has_pi || is_name) ? kAtomic : kMultiplicative;
  }

  std::string parenthesized(const std::string& text) const {
    return is_latex_ ? "\\left(" + text + "\\right)" : "(" + text + ")";
  }

  std::string printBare(const Term& term) const {
    switch (term.kind) {
      case Kind::kNumber:
        return printNumber(term.number);
      case Kind::kSymbol:
        return is_latex_ ? term.symbol.latex : term.symbol.text;
      case Kind::kSum: {
        std::string text;
        for (const std::string& part : printTerms(term)) text += (text.empty() ? "" : " ") + part;
        return text;
      }
      case Kind::kProduct:
        return printProduct(term);
      case Kind::kPower:
        return raised(*term.parts[0], print(*term.parts[1], is_latex_ ? kLoose : kAtomic));
      case Kind::kCall:
        return printCall(term, "");
      default:
        return printChoice(term);
    }
  }

  std::string printNumber(double value) const {
    const std::string sign = std::signbit(value) ? "-" : "";
    const Fraction it = toFraction(std::abs(value));
    const std::string pi = is_latex_ ? "\\pi" : "pi";
    if (it.has_pi) {
      return sign + (it.numerator == "1" ? "" : number(it.numerator) + (is_latex_ ? " " : "*")) +
             pi;
    }
    if (it.denominator.empty()) return sign + number(it.numerator);
    if (!is_latex_) return sign + it.numerator + "/" + it.denominator;
    return sign + "\\frac{" + number(it.numerator) + "}{" + number(it.denominator) + "}";
  }

  /// "1e-9" in LaTeX is a power of ten.
  std::string number(const std::string& text) const {
    const std::size_t e = text.find('e');
    if (!is_latex_ || e == std::string::npos) return text;
    const std::string mantissa = text.substr(0, e);
    const std::string power = "10^{" + text.substr(e + 1) + "}";
    return mantissa == "1" ? power : mantissa + " \\cdot " + power;
  }

  /// Prints `base` with a printed power; "" is 1.
  std::string raised(const Term& base, const std::string& exponent) const {
    if (exponent.empty()) return print(base, kPowerful);
    if (!is_latex_) return print(base, kAtomic) + "^" + exponent;
    // tanh^2(x)
    if (base.kind == Kind::kCall && isFunction(base)) return printCall(base, exponent);
    return print(base, kAtomic) + "^{" + exponent + "}";
  }

  /// True for a function with its own LaTeX name, like \tanh.
  static bool isFunction(const Term& call) {
    return !call.symbol.latex.empty() && call.symbol.latex.front() == '\\' &&
           call.symbol.latex.compare(0, 7, "\\mathrm") != 0;
  }

  std::string printCall(const Term& term, const std::string& exponent) const {
    std::string arguments;
    for (const TermPtr& part : term.parts) {
      arguments += (arguments.empty() ? "" : ", ") + print(*part);
    }
    if (!is_latex_) return term.symbol.text + "(" + arguments + ")";
    if (term.symbol.text == "abs") return "\\left|" + arguments + "\\right|";
    if (term.symbol.text == "sqrt") return "\\sqrt{" + arguments + "}";
    return term.symbol.latex + (exponent.empty() ? "" : "^{" + exponent + "}") +
           parenthesized(arguments);
  }

  std::string printChoice(const Term& term) const {
    const std::string left = print(*term.parts[0]);
    const std::string right = print(*term.parts[1]);
    const std::string yes = print(*term.parts[2]);
    const std::string no = print(*term.parts[3]);
    if (!is_latex_) return "if(" + left + " <= " + right + ", " + yes + ", " + no + ")";
    return "\\left(\\begin{cases} " + yes + " & \\text{if } " + left + " \\le " + right + " \\\\ " +
           no + " & \\text{else} \\end{cases}\\right)";
  }

  struct Side {
    std::string text;
    int count = 0;
    void add(const std::string& factor, const char* times) {
      text += (text.empty() ? "" : times) + factor;
      ++count;
    }
  };

  std::string printProduct(const Term& term) const {
    const char* const times = is_latex_ ? " \\, " : "*";
    Side above;
    Side below;
    const Fraction in_front = toFraction(std::abs(term.number));
    if (in_front.numerator != "1") above.add(number(in_front.numerator), times);
    if (in_front.has_pi) above.add(is_latex_ ? "\\pi" : "pi", times);
    if (!in_front.denominator.empty()) below.add(number(in_front.denominator), times);
    for (const Factor& factor : term.factors) {
      const double exponent = std::abs(factor.exponent);
      Side& side = factor.exponent > 0.0 ? above : below;
      side.add(
          raised(*factor.base,
                 exponent == 1.0 ? "" : print(*makeNumber(exponent), is_latex_ ? kLoose : kAtomic)),
          times);
    }
    if (above.count == 0) above.add("1", times);
    const std::string sign = term.number < 0.0 ? "-" : "";
    if (below.count == 0) return sign + above.text;
    if (!is_latex_) {
      const std::string divisor = below.count > 1 ? parenthesized(below.text) : below.text;
      return sign + above.text + "/" + divisor;
    }
    return sign + "\\frac{" + alone(above.text, above.count) + "}{" +
           alone(below.text, below.count) + "}";
  }

  /// Removes parentheses, which a single factor over or under a bar does not need.
  static std::string alone(const std::string& text, int count) {
    const std::string begin = "\\left(";
    const std::string end = "\\right)";
    if (count != 1 || text.compare(0, begin.size(), begin) != 0 ||
        text.size() < begin.size() + end.size() ||
        text.compare(text.size() - end.size(), end.size(), end) != 0) {
      return text;
    }
    // The outer parentheses are one pair, not two side by side.
    std::string inner = text.substr(begin.size(), text.size() - begin.size() - end.size());
    int depth = 0;
    for (std::size_t i = 0; i < inner.size(); ++i) {
      if (inner.compare(i, 5, "\\left") == 0) ++depth;
      if (inner.compare(i, 6, "\\right") == 0 && --depth < 0) return text;
    }
    return inner;
  }

  bool is_latex_;
};

}  // namespace

std::string toShortText(double value) {
  char buffer[32];
  char* const last = buffer + sizeof buffer;
  std::string text(buffer, std::to_chars(buffer, last, value).ptr);
  if (significantDigits(text) > 12) {
    double rounded = value;
    const char* const end = std::to_chars(buffer, last, value, std::chars_format::general, 15).ptr;
    std::from_chars(buffer, end, rounded);
    const std::string shorter(buffer, std::to_chars(buffer, last, rounded).ptr);
    if (significantDigits(shorter) <= 12) text = shorter;
  }
  // 1e-09 and 1e+20 are 1e-9 and 1e20.
  const std::size_t e = text.find('e');
  if (e == std::string::npos) return text;
  std::size_t digits = e + 2;
  while (digits + 1 < text.size() && text[digits] == '0') ++digits;
  return text.substr(0, e + 1) + (text[e + 1] == '-' ? "-" : "") + text.substr(digits);
}

std::string toText(const Term& term) {
  return Printer(false).print(term);
}

std::string toLatex(const Term& term) {
  return Printer(true).print(term);
}

std::vector<std::string> toLatexTerms(const Term& term) {
  return Printer(true).printTerms(term);
}

std::string escapedLatex(const std::string& text) {
  std::string latex;
  for (const char c : text) {
    if (std::string("_%&#${}").find(c) != std::string::npos) latex += '\\';
    latex += c == '^' ? "\\^{}" : c == '~' ? "\\~{}" : c == '\\' ? "/" : std::string(1, c);
  }
  return latex;
}

std::string latexName(const std::string& name) {
  return "\\mathrm{" + escapedLatex(name) + "}";
}

}  // namespace variator_sim::expression
