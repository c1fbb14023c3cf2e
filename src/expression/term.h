/// Formulas as people write them: sums of terms, products with one number in front, fractions,
/// powers. What is made here is for reading: it is simplified as on paper, so that its value is
/// that of the node it was made from to a few roundings, and where everything in it is finite.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace variator_sim::expression {

/// Something that is called by a name.
struct Symbol {
  std::string text;
  std::string latex;
};

class Term;
using TermPtr = std::shared_ptr<const Term>;

/// base^exponent in a product; what has a negative exponent is divided by.
struct Factor {
  TermPtr base;
  double exponent = 1.0;
};

class Term {
 public:
  enum class Kind {
    kNumber,
    kSymbol,
    kSum,      ///< of `parts`, none of them a sum
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
/// Like terms are added up, and a sum does not begin with a minus when it can be helped.
TermPtr makeSum(const std::vector<TermPtr>& parts);
TermPtr makeProduct(const TermPtr& a, const TermPtr& b);
TermPtr makePower(const TermPtr& base, const TermPtr& exponent);
inline TermPtr makeQuotient(const TermPtr& a, const TermPtr& b) {
  return makeProduct(a, makePower(b, makeNumber(-1.0)));
}
inline TermPtr makeNegative(const TermPtr& a) {
  return makeProduct(makeNumber(-1.0), a);
}
TermPtr makeCall(Symbol function, std::vector<TermPtr> arguments);
TermPtr makeChoice(TermPtr left, TermPtr right, TermPtr yes, TermPtr no);

inline bool isNumber(const Term& term, double value) {
  return term.kind == Term::Kind::kNumber && term.number == value;
}
/// How many operations it takes to write it; functions count twice, names nothing.
int weightOf(const Term& term);
/// How often the name occurs in it.
int countOccurrences(const Term& term, const std::string& name);

/// As formulas of a scene are written (parser.h): with as few parentheses as needed, and spaces
/// around the signs of sums only.
std::string toText(const Term& term);
/// For amsmath.
std::string toLatex(const Term& term);
/// The terms of a sum with their signs, one by one ("a", "- b", "+ c"), for who breaks lines; of
/// anything else one.
std::vector<std::string> toLatexTerms(const Term& term);
/// The name of something in a scene, upright, in LaTeX.
std::string latexName(const std::string& name);

/// The shortest text that reads back as `value`, or one of 15 digits where that is much shorter:
/// 0.1 + 0.2 is 0.3.
std::string toShortText(double value);

}  // namespace variator_sim::expression
