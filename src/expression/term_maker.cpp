#include "expression/term_maker.h"

#include <cmath>

#include "expression/operations.h"

namespace variator_sim::expression {

namespace {

/// Least weight of a part that gets a name, unless it has one already.
constexpr int kLeastWeight = 2;

/// Returns T', T'', .. for a table's name.
Symbol derivativeOf(const Symbol& table, int order) {
  const std::string primes(static_cast<std::size_t>(order), '\'');
  return {table.text + primes, table.latex + primes};
}

/// Returns T_10 for the derivative of a table of two variables by the first one.
Symbol derivativeOf(Symbol table, int order_x, int order_y) {
  if (order_x + order_y == 0) return table;
  const std::string x = std::to_string(order_x);
  const std::string y = std::to_string(order_y);
  return {table.text + "'" + x + y, table.latex + "^{(" + x + "," + y + ")}"};
}

/// Returns true for extreme factors, temporary in derivatives of growing functions: no name.
bool isExtreme(double number) {
  return number != 0.0 && (std::abs(number) < 1e-20 || std::abs(number) > 1e20);
}

/// One attempt, with the nodes in `unnamed` always written out.
class TermMaker {
 public:
  TermMaker(const Graph& graph, const std::vector<Node>& nodes, const Names& names,
            const std::set<int>& unnamed)
      : graph_(graph), names_(names) {
    for (const auto& [index, uses] : countUses(nodes)) {
      terms_[index] = make(graph.entry({index}));
      if (uses > 1 && unnamed.count(index) == 0) nameIt(index);
    }
    for (const Node node : nodes) made_.roots.push_back(withoutScale(terms_.at(node.index)));
  }

  const Terms& made() const { return made_; }
  /// The nodes of `made().shared`.
  const std::vector<int>& named() const { return named_; }

 private:
  /// Returns the number of readers of each node, operands first.
  std::map<int, int> countUses(const std::vector<Node>& nodes) const {
    std::map<int, int> uses;
    for (const Node node : nodes) ++uses[node.index];
    for (const int i : graph_.listReachable(nodes)) {
      const Graph::Entry& entry = graph_.entry({i});
      for (int p = 0; p < operandCount(entry.operation); ++p) ++uses[entry.operands[p]];
    }
    return uses;
  }

  /// Gives the node a name, if its weight justifies one.
  void nameIt(int index) {
    TermPtr& term = terms_[index];
    double scale = 1.0;
    TermPtr definition = term;
    if (term->kind == Term::Kind::kProduct && isExtreme(term->number)) {
      scale = term->number;
      definition = makeProduct(makeNumber(1.0 / scale), term);
    }
    const auto given = names_.nodes.find(index);
    const int weight = weightOf(*definition);
    if (weight < (given == names_.nodes.end() ? kLeastWeight : 1)) return;
    const std::string text = toText(*definition);
    const auto same = name_of_.find(text);
    const auto opposite = name_of_.find(toText(*makeNegative(definition)));
    if (given == names_.nodes.end() && opposite != name_of_.end()) {
      term = makeProduct(makeNumber(-scale), makeSymbol(opposite->second));
      return;
    }
    Symbol name;
    if (same != name_of_.end()) {
      name = same->second;
    } else {
      name = given == names_.nodes.end() ? nextName() : given->second;
      name_of_[text] = name;
      made_.shared.emplace_back(name, definition);
      named_.push_back(index);
    }
    term = makeProduct(makeNumber(scale), makeSymbol(name));
  }

  Symbol nextName() {
    std::string name;
    do {
      name = "a" + std::to_string(++last_name_);
    } while (names_.taken.count(name) != 0);
    return {name, "a_{" + std::to_string(last_name_) + "}"};
  }

  static TermPtr withoutScale(const TermPtr& term) {
    if (term->kind != Term::Kind::kProduct || !isExtreme(term->number) ||
        term->factors.size() != 1 || term->factors[0].base->kind != Term::Kind::kSum) {
      return term;
    }
    std::vector<TermPtr> parts;
    for (const TermPtr& part : term->factors[0].base->parts) {
      parts.push_back(makeProduct(makeNumber(term->number), part));
    }
    return makeSum(parts);
  }

  TermPtr make(const Graph::Entry& entry) const {
    const auto operand = [&](int p) { return terms_.at(entry.operands[p]); };
    switch (entry.operation) {
      case Operation::kConstant:
        return makeNumber(entry.value);
      case Operation::kVariable:
        return makeSymbol(names_.variables.at(entry.slot));
      case Operation::kNegate:
        return makeNegative(operand(0));
      case Operation::kAdd:
        return makeSum({operand(0), operand(1)});
      case Operation::kSubtract:
        return makeSum({operand(0), makeNegative(operand(1))});
      case Operation::kMultiply:
        return makeProduct(operand(0), operand(1));
      case Operation::kDivide:
        return makeProduct(operand(0), makePower(operand(1), makeNumber(-1.0)));
      case Operation::kPower:
        return makePower(operand(0), operand(1));
      case Operation::kTable:
        return makeCall(derivativeOf(names_.tables.at(entry.slot), entry.order[0]), {operand(0)});
      case Operation::kTable2:
        return makeCall(derivativeOf(names_.tables.at(entry.slot), entry.order[0], entry.order[1]),
                        {operand(0), operand(1)});
      case Operation::kSelect:
        return makeChoice(operand(0), operand(1), operand(2), operand(3));
      case Operation::kWhereFinite:
        return operand(1);
      default:
        break;
    }
    std::vector<TermPtr> arguments;
    arguments.reserve(4);
    for (int p = 0; p < operandCount(entry.operation); ++p) arguments.push_back(operand(p));
    const Function& function = functionOf(entry.operation);  // an opaque one has no name
    return makeCall({function.name, function.latex}, std::move(arguments));
  }

  const Graph& graph_;
  const Names& names_;
  std::map<int, TermPtr> terms_;           ///< by index
  std::map<std::string, Symbol> name_of_;  ///< by key of the named term
  int last_name_ = 0;
  Terms made_;
  std::vector<int> named_;
};

}  // namespace

Terms makeTerms(const Graph& graph, const std::vector<Node>& nodes, const Names& names) {
  // Gathering products and sums may leave names that are used once or not at all.
  std::set<int> unnamed;
  for (;;) {
    const TermMaker maker(graph, nodes, names, unnamed);
    const Terms& made = maker.made();
    const std::size_t before = unnamed.size();
    for (std::size_t i = 0; i < made.shared.size(); ++i) {
      const std::string& name = made.shared[i].first.text;
      int count = 0;
      for (const TermPtr& root : made.roots) count += countOccurrences(*root, name);
      for (const auto& shared : made.shared) count += countOccurrences(*shared.second, name);
      if (count < 2) unnamed.insert(maker.named()[i]);
    }
    if (unnamed.size() == before) return made;
  }
}

}  // namespace variator_sim::expression
