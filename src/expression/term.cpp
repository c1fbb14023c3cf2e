#include "expression/term.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

namespace {

using Kind = Term::Kind;

std::shared_ptr<Term> make(Kind kind) {
  auto term = std::make_shared<Term>();
  term->kind = kind;
  return term;
}

bool isInteger(double value) {
  return value == std::trunc(value);
}

/// Returns number * factors in its simplest form.
TermPtr finishProduct(double number, std::vector<Factor> factors) {
  if (number == 0.0 || factors.empty()) return makeNumber(number);
  if (factors.size() == 1 && factors[0].exponent == 1.0) {
    if (number == 1.0) return factors[0].base;
    if (number == -1.0 && factors[0].base->kind == Kind::kSum) {
      std::vector<TermPtr> parts;
      for (const TermPtr& part : factors[0].base->parts) parts.push_back(makeNegative(part));
      return makeSum(parts);
    }
  }
  // Names come before functions, functions before sums.
  std::stable_sort(factors.begin(), factors.end(), [](const Factor& a, const Factor& b) {
    const auto rank = [](const Term& term) {
      return term.kind == Kind::kSymbol ? 0 : term.kind == Kind::kSum ? 2 : 1;
    };
    return rank(*a.base) < rank(*b.base);
  });
  const auto product = make(Kind::kProduct);
  product->number = number;
  product->factors = std::move(factors);
  return product;
}

/// Splits `term` into the number in front of it and the rest.
std::pair<double, TermPtr> splitNumber(const TermPtr& term) {
  if (term->kind == Kind::kNumber) return {term->number, makeNumber(1.0)};
  if (term->kind != Kind::kProduct) return {1.0, term};
  return {term->number, finishProduct(1.0, term->factors)};
}

/// Returns a key that ignores the order of factors.
std::string keyOf(const Term& term) {
  if (term.kind != Kind::kProduct) return toText(term);
  std::vector<std::string> factors;
  for (const Factor& factor : term.factors) {
    factors.push_back("(" + toText(*factor.base) + ")^" + toShortText(factor.exponent));
  }
  std::sort(factors.begin(), factors.end());
  std::string key;
  for (const std::string& factor : factors) key += factor + "*";
  return key;
}

/// Derivatives of growing functions are made in the scale of 2^-100 (graph.h), which is moved out
/// of a sum or a choice, to cancel with its inverse further up.
constexpr double kScale = 0x1p-100;
bool isScaled(double number) {
  return std::abs(number) < 1e-20;
}

}  // namespace

TermPtr makeNumber(double value) {
  const auto term = make(Kind::kNumber);
  term->number = value;
  return term;
}

TermPtr makeSymbol(Symbol symbol) {
  const auto term = make(Kind::kSymbol);
  term->symbol = std::move(symbol);
  return term;
}

TermPtr makeSum(const std::vector<TermPtr>& parts) {
  struct Part {
    double number;
    TermPtr rest;
    std::string text;
  };
  std::vector<Part> sum;
  const auto add = [&sum](const TermPtr& part) {
    const auto [number, rest] = splitNumber(part);
    std::string text = keyOf(*rest);
    const auto like =
        std::find_if(sum.begin(), sum.end(), [&](const Part& it) { return it.text == text; });
    if (like == sum.end()) {
      sum.push_back({number, rest, std::move(text)});
    } else {
      like->number += number;
    }
  };
  for (const TermPtr& part : parts) {
    if (part->kind == Kind::kSum) {
      for (const TermPtr& inner : part->parts) add(inner);
    } else {
      add(part);
    }
  }
  sum.erase(std::remove_if(sum.begin(), sum.end(), [](const Part& it) { return it.number == 0.0; }),
            sum.end());
  if (sum.empty()) return makeNumber(0.0);
  const bool is_scaled = sum.size() > 1 && std::all_of(sum.begin(), sum.end(), [](const Part& it) {
                           return isScaled(it.number);
                         });
  if (sum.front().number < 0.0) {
    const auto positive =
        std::find_if(sum.begin(), sum.end(), [](const Part& it) { return it.number > 0.0; });
    if (positive != sum.end()) std::rotate(sum.begin(), positive, positive + 1);
  }
  const auto term = make(Kind::kSum);
  for (const Part& it : sum) {
    const double number = is_scaled ? it.number / kScale : it.number;
    term->parts.push_back(makeProduct(makeNumber(number), it.rest));
  }
  if (sum.size() == 1) return term->parts.front();
  return is_scaled ? makeProduct(makeNumber(kScale), term) : term;
}

TermPtr makeProduct(const TermPtr& a, const TermPtr& b) {
  double number = 1.0;
  std::vector<Factor> factors;
  const auto multiply = [&factors](const Factor& factor) {
    const std::string text = toText(*factor.base);
    for (Factor& other : factors) {
      if (!isInteger(other.exponent) || !isInteger(factor.exponent) ||
          toText(*other.base) != text) {
        continue;
      }
      other.exponent += factor.exponent;
      return;
    }
    factors.push_back(factor);
  };
  for (const TermPtr& term : {a, b}) {
    if (term->kind == Kind::kNumber) {
      number *= term->number;
    } else if (term->kind == Kind::kProduct) {
      number *= term->number;
      for (const Factor& factor : term->factors) multiply(factor);
    } else {
      multiply({term, 1.0});
    }
  }
  factors.erase(std::remove_if(factors.begin(), factors.end(),
                               [](const Factor& it) { return it.exponent == 0.0; }),
                factors.end());
  return finishProduct(number, std::move(factors));
}

TermPtr makePower(const TermPtr& base, const TermPtr& exponent) {
  if (exponent->kind != Kind::kNumber) {
    const auto term = make(Kind::kPower);
    term->parts = {base, exponent};
    return term;
  }
  const double n = exponent->number;
  if (base->kind == Kind::kNumber) return makeNumber(powerOf(base->number, n));
  if (n == 1.0) return base;
  if (base->kind == Kind::kProduct && isInteger(n)) {
    std::vector<Factor> factors = base->factors;
    // (x^0.5)^2 is x only for x >= 0; both have a value there.
    for (Factor& factor : factors) factor.exponent *= n;
    return finishProduct(powerOf(base->number, n), std::move(factors));
  }
  return finishProduct(1.0, {{base, n}});
}

TermPtr makeCall(Symbol function, std::vector<TermPtr> arguments) {
  const auto term = make(Kind::kCall);
  term->symbol = std::move(function);
  term->parts = std::move(arguments);
  return term;
}

TermPtr makeChoice(TermPtr left, TermPtr right, TermPtr yes, TermPtr no) {
  const auto is_small = [](const Term& it) {
    return isNumber(it, 0.0) || (it.kind == Kind::kProduct && isScaled(it.number));
  };
  if (is_small(*yes) && is_small(*no) && !(isNumber(*yes, 0.0) && isNumber(*no, 0.0))) {
    const TermPtr inverse = makeNumber(1.0 / kScale);
    return makeProduct(makeNumber(kScale),
                       makeChoice(std::move(left), std::move(right), makeProduct(inverse, yes),
                                  makeProduct(inverse, no)));
  }
  const auto term = make(Kind::kChoice);
  term->parts = {std::move(left), std::move(right), std::move(yes), std::move(no)};
  return term;
}

int weightOf(const Term& term) {
  int weight = 0;
  for (const TermPtr& part : term.parts) weight += weightOf(*part);
  for (const Factor& factor : term.factors) {
    weight += weightOf(*factor.base) + (std::abs(factor.exponent) == 1.0 ? 0 : 1);
  }
  switch (term.kind) {
    case Kind::kSum:
      return weight + static_cast<int>(term.parts.size()) - 1;
    case Kind::kProduct:
      return weight + static_cast<int>(term.factors.size()) -
             (std::abs(term.number) == 1.0 ? 1 : 0);
    case Kind::kPower:
      return weight + 1;
    case Kind::kCall:
    case Kind::kChoice:
      return weight + 2;
    default:
      return weight;
  }
}

int countOccurrences(const Term& term, const std::string& name) {
  int count = term.kind == Kind::kSymbol && term.symbol.text == name ? 1 : 0;
  for (const TermPtr& part : term.parts) count += countOccurrences(*part, name);
  for (const Factor& factor : term.factors) count += countOccurrences(*factor.base, name);
  return count;
}

}  // namespace variator_sim::expression
