/// Formulas as people write them: sums of terms, products with one number in front, fractions,
/// powers. Terms are for reading: they are simplified as on paper, so that a term has its node's
/// value to a few roundings if all of its parts are finite.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace variator_sim::expression {

/// A named quantity or function.
struct Symbol {
  std::string text;
  std::string latex;
};

class Term;
using TermPtr = std::shared_ptr<const Term>;

/// base^exponent in a product; factors with a negative exponent are divisors.
struct Factor {
  TermPtr base;
  double exponent = 1.0;
};

class Term {
 public:
  enum class Kind {
    kNumber,
    kSymbol,
    kSum,      ///< `parts`, none of them a sum
    kProduct,  ///< `number` times `factors`, no base of which is a number or (to a power that is an
               ///< integer) a product
    kPower,    ///< parts[0]^parts[1]
    kCall,     ///< symbol(parts..)
    kChoice    ///< parts[0] <= parts[1] ? parts[2] : parts[3]
  };

  Kind kind = Kind::kNumber;
  double number = 0.0;
  Symbol symbol;
  std::vector<Factor> factors;
  std::vector<TermPtr> parts;
};

TermPtr makeNumber(double value);
TermPtr makeSymbol(Symbol symbol);
/// Adds up like terms, and avoids a minus at the beginning of a sum.
TermPtr makeSum(const std::vector<TermPtr>& parts);
TermPtr makeProduct(const TermPtr& a, const TermPtr& b);
TermPtr makePower(const TermPtr& base, const TermPtr& exponent);
inline TermPtr makeNegative(const TermPtr& a) {
  return makeProduct(makeNumber(-1.0), a);
}
TermPtr makeCall(Symbol function, std::vector<TermPtr> arguments);
TermPtr makeChoice(TermPtr left, TermPtr right, TermPtr yes, TermPtr no);

inline bool isNumber(const Term& term, double value) {
  return term.kind == Term::Kind::kNumber && term.number == value;
}
/// Returns the number of operations in a term; functions count twice, names nothing.
int weightOf(const Term& term);
/// Returns the number of occurrences of a name.
int countOccurrences(const Term& term, const std::string& name);

/// Writes a term as a formula of a scene (parser.h), with as few parentheses as needed, and spaces
/// around the signs of sums only.
std::string toText(const Term& term);
/// Writes a term in LaTeX for amsmath.
std::string toLatex(const Term& term);
/// Writes the terms of a sum with their signs, one by one ("a", "- b", "+ c"), for line breaks; one
/// for any other term.
std::vector<std::string> toLatexTerms(const Term& term);
/// Escapes a text without formulas.
std::string escapedLatex(const std::string& text);
/// Writes the name of an element of a scene, upright, in LaTeX.
std::string latexName(const std::string& name);

/// Returns the shortest text that reads back as `value`, or 15 digits if that is much shorter:
/// 0.1 + 0.2 is 0.3.
std::string toShortText(double value);

}  // namespace variator_sim::expression
