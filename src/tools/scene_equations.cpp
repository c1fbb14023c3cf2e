#include "tools/scene_equations.h"

#include <algorithm>
#include <map>
#include <utility>

namespace variator_sim {

using expression::Graph;
using expression::latexName;
using expression::makeCall;
using expression::makeNumber;
using expression::makeProduct;
using expression::makeSum;
using expression::makeSymbol;
using expression::Node;
using expression::Operation;
using expression::Source;
using expression::Symbol;
using expression::TermPtr;

namespace {

/// Returns a sentence that begins with a symbol.
Words about(const Symbol& symbol, const std::string& rest) {
  const Words words = plainWords(rest);
  return {symbol.text + words.text, "$" + symbol.latex + "$" + words.latex};
}

Symbol withPrime(const Symbol& symbol) {
  return {symbol.text + "'", symbol.latex + "'"};
}

class Writer {
 public:
  explicit Writer(const Simulation& simulation)
      : simulation_(simulation),
        scene_(simulation.scene()),
        graph_(*scene_.graph),
        is_classical_(scene_.principle == Principle::kGauss && !scene_.hasOrder3()) {}

  std::vector<EquationSection> write() {
    expression::Names names = nameThings(scene_);
    findNodes(names);
    std::vector<Node> nodes;
    for (const auto& root : roots_) nodes.push_back(root.second);
    const expression::Terms terms = makeTerms(graph_, nodes, names);
    for (std::size_t i = 0; i < nodes.size(); ++i) term_of_[nodes[i].index] = terms.roots[i];
    writeNames(describeThings(scene_, names, nodes));
    writeShared(terms);
    writeInertia();
    for (const TorquePtr& torque : scene_.torques) writeTorque(*torque);
    for (const ConstraintPtr& constraint : scene_.constraints) writeConstraint(*constraint);
    writeMemory();
    writeMotion();
    writeSkips();
    return std::move(sections_);
  }

 private:
  // ------------------------------------------------------------------------------ what is written
  /// Collects the named nodes of the scene's graph.
  void findNodes(expression::Names& names) {
    for (const TorquePtr& torque : scene_.torques) {
      for (const auto& [i, node] : torque->torques()) call(torqueSymbol(*torque, i), node, names);
      if (is_classical_) continue;
      for (const auto& [i, node] : torque->rates()) {
        call(withPrime(torqueSymbol(*torque, i)), node, names);
      }
    }
    for (const ConstraintPtr& constraint : scene_.constraints) {
      add(functionSymbol(*constraint), constraint->function());
      for (int i = 0; i < scene_.shaftCount(); ++i) {
        add(rowSymbol(*constraint, "C", "C", i), constraint->row()[static_cast<std::size_t>(i)]);
      }
      if (!is_classical_) add(rowSymbol(*constraint, "c0", "c_{0}"), constraint->row().back());
      if (is_classical_ && constraint->order() == 1) {
        add(withPrime(functionSymbol(*constraint)), constraint->residual());
      }
    }
    const auto at = [&names](int input) {
      return names.variables.at(expression::slotOf(Source::kInput, input));
    };
    for (const SceneState& it : scene_.states)
      rates_.emplace_back(withPrime(at(it.input)), it.rate);
    for (const SceneEvent& it : scene_.events) {
      auto& event = events_.emplace_back();
      event.emplace_back(Symbol{it.name, latexName(it.name)}, it.when);
      for (const auto& [input, value] : it.sets) event.emplace_back(at(input), value);
      for (const auto& [symbol, node] : event) add(symbol, node);
    }
    for (const auto& [symbol, node] : rates_) add(symbol, node);
  }
  /// Gives a node the symbol that other formulas use for it; the first symbol counts.
  void call(const Symbol& symbol, Node node, expression::Names& names) {
    add(symbol, node);
    const Operation operation = graph_.entry(node).operation;
    if (operation == Operation::kConstant || operation == Operation::kVariable) return;
    names.nodes.emplace(node.index, symbol);
  }
  void add(const Symbol& symbol, Node node) { roots_.emplace_back(symbol, node); }

  /// Writes the shared terms that no later section defines.
  void writeShared(const expression::Terms& terms) {
    begin("parts in common, each computed once");
    for (const auto& [name, term] : terms.shared) {
      const auto root = std::find_if(roots_.begin(), roots_.end(), [&name = name](const auto& it) {
        return it.first.text == name.text;
      });
      if (root == roots_.end()) {
        equate(makeSymbol(name), term);
      } else {
        term_of_[root->second.index] = term;
        defined_[root->second.index] = name;
      }
    }
    if (sections_.back().equations.empty()) sections_.pop_back();
  }

  // ------------------------------------------------------------------------------------- symbols
  TermPtr shaft(Source of, int i) const { return makeSymbol(shaftWords(scene_, of, i)); }
  Symbol inertiaSymbol(int i) const { return shaftWords(scene_, "J", "J", i); }

  /// Returns Q_motor, or Q_clutch_a for an element with several shafts.
  Symbol torqueSymbol(const Torque& torque, int i) const {
    Symbol symbol{"Q_" + torque.name(), latexName(torque.name())};
    if (torque.shafts().size() > 1) {
      const std::string& name = scene_.shafts[static_cast<std::size_t>(i)];
      // Another element may be called clutch_a.
      const bool is_taken = std::any_of(
          scene_.torques.begin(), scene_.torques.end(),
          [&](const TorquePtr& other) { return other->name() == torque.name() + "_" + name; });
      symbol = {symbol.text + (is_taken ? "__" : "_") + name, symbol.latex + "," + latexName(name)};
    }
    return {symbol.text, "Q_{" + symbol.latex + "}"};
  }

  /// Returns psi, or psi_belt if there are several constraints; `of`: a shaft.
  Symbol rowSymbol(const Constraint& constraint, const char* text, const char* latex,
                   int of = -1) const {
    std::string name = text;
    std::string index;
    const auto add = [&](const std::string& part) {
      name += "_" + part;
      index += (index.empty() ? "" : ",") + latexName(part);
    };
    if (scene_.constraintCount() > 1) add(constraint.name());
    if (of >= 0) add(scene_.shafts[static_cast<std::size_t>(of)]);
    std::string formula = latex;
    if (!index.empty()) {
      // c_0 has an index already.
      const bool is_indexed = formula.back() == '}';
      if (is_indexed) formula.pop_back();
      formula += (is_indexed ? "," : "_{") + index + "}";
    }
    return {name, formula};
  }

  /// Returns C of a shaft in the equations of motion: a number, or its name.
  TermPtr entry(const Constraint& constraint, int i) const {
    const Node C = constraint.row()[static_cast<std::size_t>(i)];
    if (graph_.isConstant(C)) return makeNumber(graph_.constantValue(C));
    return makeSymbol(rowSymbol(constraint, "C", "C", i));
  }

  // ------------------------------------------------------------------------------------- sections
  void begin(const std::string& title) { sections_.push_back({plainWords(title), {}, {}}); }
  void say(const Words& words) { sections_.back().sentences.push_back(words); }
  void sayPlain(const std::string& text) { say(plainWords(text)); }
  void equate(const TermPtr& left, const TermPtr& right) {
    sections_.back().equations.push_back({left, right});
  }
  /// symbol = node
  void define(const Symbol& symbol, Node node) {
    const auto name = defined_.find(node.index);
    const bool is_elsewhere = name != defined_.end() && name->second.text != symbol.text;
    equate(makeSymbol(symbol), is_elsewhere ? makeSymbol(name->second) : term_of_.at(node.index));
  }

  /// "name (ExpressionTorque)"
  std::string describe(const std::string& name) const {
    const ParameterTree* const section = scene_.resolved.find(name);
    const ParameterTree* const type = section == nullptr ? nullptr : section->find("type");
    if (type == nullptr) return name;
    const std::string& full = type->asText();
    const std::string own = "variator_sim/";
    return name + " (" + (full.compare(0, own.size(), own) == 0 ? full.substr(own.size()) : full) +
           ")";
  }

  void writeNames(const std::vector<Words>& described) {
    begin("names");
    if (is_classical_) {
      say(about({"phi, w, e", "\\varphi, \\omega, \\varepsilon"},
                ": angle, velocity, acceleration of a shaft, rad, rad/s, rad/s^2"));
    } else {
      say(about({"phi, w, e, j", "\\varphi, \\omega, \\varepsilon, \\eta"},
                ": angle, velocity, acceleration, jerk of a shaft, rad, rad/s, rad/s^2, rad/s^3"));
    }
    say({"t: time, s; x': the rate of x", "$t$: time, s; $x'$: the rate of $x$"});
    for (const Words& words : described) say(words);
  }

  bool hasHarmonics(int i) const {
    return !scene_.inertia_harmonics.empty() &&
           !scene_.inertia_harmonics[static_cast<std::size_t>(i)].empty();
  }

  /// Returns J_ij as the scene states it.
  double ownInertia(int i, int j) const { return scene_.inertia(i, j) - scene_.lent_inertia(i, j); }

  void writeInertia() {
    bool is_first = true;
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      if (!hasHarmonics(i)) continue;
      if (is_first) begin("inertia that depends on the angle, kg m^2");
      is_first = false;
      std::vector<TermPtr> sum = {makeNumber(ownInertia(i, i))};
      for (const InertiaHarmonic& it : scene_.inertia_harmonics[static_cast<std::size_t>(i)]) {
        const TermPtr angle = makeProduct(makeNumber(it.order), shaft(Source::kAngle, i));
        sum.push_back(makeProduct(makeNumber(it.cosine), makeCall({"cos", "\\cos"}, {angle})));
        sum.push_back(makeProduct(makeNumber(it.sine), makeCall({"sin", "\\sin"}, {angle})));
      }
      equate(makeSymbol(inertiaSymbol(i)), makeSum(sum));
    }
    if (!is_first) {
      say({"J' and J'' are derivatives by the angle",
           "$J'$ and $J''$ are derivatives by the angle"});
    }
  }

  void writeTorque(const Torque& torque) {
    std::vector<std::string> shafts;
    for (const int i : torque.shafts())
      shafts.push_back(scene_.shafts[static_cast<std::size_t>(i)]);
    begin("torque " + describe(torque.name()) + " on " + join(shafts, " and ") + ", N m" +
          (is_classical_ ? "" : " and N m/s"));
    for (const auto& [i, node] : torque.torques()) {
      define(torqueSymbol(torque, i), node);
    }
    if (is_classical_) return;
    for (const auto& [i, node] : torque.rates()) {
      define(withPrime(torqueSymbol(torque, i)), node);
    }
    for (const auto& [i, node] : torque.torques()) {
      if (hasRate(torque, i)) continue;
      const Symbol rate = withPrime(torqueSymbol(torque, i));
      fallen_.push_back(about(rate, " is 0: the torque is constant"));
    }
  }

  bool hasRate(const Torque& torque, int i) const {
    return std::any_of(torque.rates().begin(), torque.rates().end(),
                       [i](const auto& rate) { return rate.first == i; });
  }

  void writeMemory() {
    if (!rates_.empty()) begin("states, integrated with the motion");
    for (const auto& [symbol, node] : rates_) define(symbol, node);
    for (std::size_t i = 0; i < events_.size(); ++i) {
      const SceneEvent::Direction direction = scene_.events[i].direction;
      const char* const way = direction == SceneEvent::Direction::kRising    ? "rises"
                              : direction == SceneEvent::Direction::kFalling ? "falls"
                                                                             : "goes";
      begin("event " + scene_.events[i].name + ", where the first " + way +
            " through 0; the others are set there");
      for (const auto& [symbol, node] : events_[i]) define(symbol, node);
    }
  }

  /// Returns the name of f or psi; for order 3, C j + c0.
  Symbol functionSymbol(const Constraint& constraint) const {
    return constraint.order() == 1 ? rowSymbol(constraint, "f", "f")
                                   : rowSymbol(constraint, "psi", "\\psi");
  }

  void writeConstraint(const Constraint& constraint) {
    begin("constraint " + describe(constraint.name()) + ", order " +
          std::to_string(constraint.order()));
    define(functionSymbol(constraint), constraint.function());
    if (is_classical_ && constraint.order() == 1) {
      define(withPrime(functionSymbol(constraint)), constraint.residual());
    }
    static constexpr const char* kHighest[] = {"velocity", "acceleration", "jerk"};
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      const Node C = constraint.row()[static_cast<std::size_t>(i)];
      const Symbol symbol = rowSymbol(constraint, "C", "C", i);
      if (!graph_.isConstant(C, 0.0)) {
        define(symbol, C);
        continue;
      }
      fallen_.push_back(about(symbol, " is 0: " + constraint.name() + " does not read the " +
                                          kHighest[constraint.order() - 1] + " of " +
                                          scene_.shafts[static_cast<std::size_t>(i)]));
    }
    if (is_classical_) return;
    const Symbol c0 = rowSymbol(constraint, "c0", "c_{0}");
    if (graph_.isConstant(constraint.row().back(), 0.0)) {
      fallen_.push_back(about(c0, " is 0: nothing else in the constraint changes"));
    } else {
      define(c0, constraint.row().back());
    }
  }

  // ------------------------------------------------------------------------------------- motion
  void writeMotion() {
    const bool has_rates = scene_.principle == Principle::kGeneralizedGauss;
    begin(std::string("equations of motion, ") + (has_rates ? "N m/s" : "N m"));
    if (is_classical_) {
      say({"J e = Q + C^T lambda, psi = 0: the reaction is least (classical Gauss principle)",
           "$J \\varepsilon = Q + C^T \\lambda$, $\\psi = 0$: the reaction is least (classical "
           "Gauss principle)"});
    } else if (scene_.principle == Principle::kGauss) {
      say(
          {"J e = Q + C^T lambda, differentiated once, and C j + c0 = 0 (Gauss principle with a "
           "constraint of order 3)",
           "$J \\varepsilon = Q + C^T \\lambda$, differentiated once, and $C \\eta + c_0 = 0$ "
           "(Gauss principle with a constraint of order 3)"});
    } else {
      say(
          {"J j = Q' + C^T Lambda, C j + c0 = 0: the reaction changes least (generalized Gauss "
           "principle)",
           "$J \\eta = Q' + C^T \\Lambda$, $C \\eta + c_0 = 0$: the reaction changes least "
           "(generalized Gauss principle)"});
    }
    tellOfInertia(has_rates);
    for (int i = 0; i < scene_.shaftCount(); ++i) writeShaft(i, has_rates);
    for (const ConstraintPtr& constraint : scene_.constraints) {
      if (!is_classical_) {
        std::vector<TermPtr> sum;
        sum.reserve(static_cast<std::size_t>(scene_.shaftCount()) + 1);
        for (int i = 0; i < scene_.shaftCount(); ++i) {
          sum.push_back(makeProduct(entry(*constraint, i), shaft(Source::kJerk, i)));
        }
        if (!graph_.isConstant(constraint->row().back(), 0.0)) {
          sum.push_back(makeSymbol(rowSymbol(*constraint, "c0", "c_{0}")));
        }
        equate(makeSum(sum), makeNumber(0.0));
      } else {
        const Symbol function = functionSymbol(*constraint);
        equate(makeSymbol(constraint->order() == 1 ? withPrime(function) : function),
               makeNumber(0.0));
      }
    }
  }

  /// Writes the shaft's own equation, in torques or in their rates.
  void writeShaft(int i, bool has_rates) {
    const Source of = has_rates ? Source::kJerk : Source::kAcceleration;
    std::vector<TermPtr> left;
    for (int n = 0; n < scene_.shaftCount(); ++n) {
      const TermPtr J =
          n == i && hasHarmonics(i) ? makeSymbol(inertiaSymbol(i)) : makeNumber(ownInertia(i, n));
      left.push_back(makeProduct(J, shaft(of, n)));
    }
    std::vector<TermPtr> right;
    for (const TorquePtr& torque : scene_.torques) {
      const std::vector<int> shafts = torque->shafts();
      if (!contains(shafts, i)) continue;
      const Symbol Q = torqueSymbol(*torque, i);
      if (has_rates && !hasRate(*torque, i)) continue;
      right.push_back(makeSymbol(has_rates ? withPrime(Q) : Q));
    }
    if (hasHarmonics(i)) addInertialTorque(i, has_rates, right);
    for (const ConstraintPtr& constraint : scene_.constraints) {
      const Symbol multiplier = has_rates ? rowSymbol(*constraint, "Lambda", "\\Lambda")
                                          : rowSymbol(*constraint, "lambda", "\\lambda");
      right.push_back(makeProduct(entry(*constraint, i), makeSymbol(multiplier)));
    }
    equate(makeSum(left), makeSum(right));
  }

  /// Adds -J' w^2/2, or, from its rate and the connection (theory.md), -2 J' w e - J'' w^3/2 + J' w
  /// (J^-1 R)/2.
  void addInertialTorque(int i, bool has_rates, std::vector<TermPtr>& right) const {
    const Symbol J = inertiaSymbol(i);
    const TermPtr first = makeSymbol(withPrime(J));
    const TermPtr second = makeSymbol(withPrime(withPrime(J)));
    const TermPtr w = shaft(Source::kVelocity, i);
    const TermPtr w2 = makeProduct(w, w);
    const auto add = [&](double factor, const TermPtr& a, const TermPtr& b) {
      right.push_back(makeProduct(makeNumber(factor), makeProduct(a, b)));
    };
    if (!has_rates) {
      add(-0.5, first, w2);
      return;
    }
    add(-2.0, makeProduct(first, w), shaft(Source::kAcceleration, i));
    add(-0.5, second, makeProduct(w2, w));
    add(0.5, makeProduct(first, w), makeSymbol(shaftWords(scene_, "(J^-1 R)", "(J^{-1} R)", i)));
  }

  void tellOfInertia(bool has_rates) {
    for (int i = 0; i < scene_.shaftCount(); ++i) {
      if (!hasHarmonics(i)) continue;
      say({"where inertia depends on the angle, J e has n = J' w^2/2 beside it",
           "where inertia depends on the angle, $J \\varepsilon$ has $n = J' \\omega^2/2$ beside "
           "it"});
      if (has_rates) {
        say({"and the rate of R = J e + n - Q the connection -J' w (J^-1 R)/2",
             "and the rate of $R = J \\varepsilon + n - Q$ the connection "
             "$-J' \\omega (J^{-1} R)/2$"});
      }
      return;
    }
  }

  void writeSkips() {
    begin("not computed");
    for (const Words& words : fallen_) say(words);
    for (const std::string& skip : simulation_.skips()) sayPlain(skip);
    if (sections_.back().sentences.empty()) sections_.pop_back();
  }

  const Simulation& simulation_;
  const Scene& scene_;
  Graph& graph_;
  const bool is_classical_;                     ///< accelerations follow from torques; no rates
  std::vector<std::pair<Symbol, Node>> roots_;  ///< all nodes to write
  std::vector<std::pair<Symbol, Node>> rates_;  ///< of states
  std::vector<std::vector<std::pair<Symbol, Node>>> events_;  ///< what passes 0, then what is set
  std::map<int, Symbol> defined_;   ///< by the node's index: the one place where it is written out
  std::map<int, TermPtr> term_of_;  ///< by the node's index
  std::vector<Words> fallen_;       ///< vanishing terms, with reasons
  std::vector<EquationSection> sections_;
};

}  // namespace

std::vector<EquationSection> writeEquations(const Simulation& simulation) {
  if (!simulation.scene().inertia_formulas.empty()) {
    throw SceneError(
        "inertia", "is a formula, which --explain does not write; allowed: numbers and harmonics");
  }
  return Writer(simulation).write();
}

}  // namespace variator_sim
