/// The interface of a law's `build` (constraint.h, torque.h): reads its keys of the scene and
/// states its formulas.
#pragma once

#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/component_context.h"
#include "variator_sim/expression/expression.h"
#include "variator_sim/table.h"

namespace variator_sim {

/// One shaft of the scene, as laws write it.
struct Shaft {
  int index = 0;            ///< in the scene, from 0
  Expression angle;         ///< phi, rad
  Expression velocity;      ///< omega, rad/s
  Expression acceleration;  ///< epsilon, rad/s^2; not in torques
  Expression jerk;          ///< eta, rad/s^3; linearly, and in constraints of order 3 only
};

/// Losses of a constraint with the reaction D' lambda, as friction that grows with lambda. While it
/// slides to the side s = 1 or -1 its torque is
///     T = s max(slope_1 s lambda + base_1, slope_2 s lambda + base_2)      N m
struct Losses {
  Expression slope[2];
  Expression base[2];
};

/// A way in which an element may hold: a constraint of order 1 that is on while it is stuck, and
/// the torque T against the slip, positive where the slip is.
///     stuck   slip = 0, and T in [lower, upper] is found from that
///     slides  T = torque, in which `side` is the sign of the slip
///     free    T = 0: where `level` is not above 0 or `gap` is open
/// On each shaft acts -T dslip/domega.
struct Holding {
  Expression slip;                  ///< rad/s, linear in velocities
  Expression torque;                ///< N m; 0 where `side` is
  Expression side;                  ///< from LawContext::side; -1, 0 or 1
  std::optional<Expression> upper;  ///< N m; none: any torque is held
  std::optional<Expression> lower;
  std::optional<Expression> level;
  /// Grows by the slip, rad: the slip is free while it is above 0, and then at most what opens it.
  std::optional<Expression> gap;
  /// For constraints: stands for `torque`, `upper` and `lower`. Only `slip` and `side` go with it.
  std::optional<Losses> losses;
  bool slides_backward = true;  ///< false: a negative slip is stopped by an impact
  double restitution = 0.0;     ///< of impacts
  /// Above 0: it never slides, and closes, by an impact, where |slip|, rad/s, is not above this.
  double closes_below = 0.0;
  enum class Begin { kAuto, kStuck, kSlipping };
  Begin begins = Begin::kAuto;  ///< the scene asks for it
  std::string part;             ///< name within the element, of those that hold in several ways
};

class LawContext : public ComponentContext {
 public:
  using ComponentContext::ComponentContext;

  // --- keys of the scene -----------------------------------------------------------------------
  /// Declares all keys of the law, for the message when one is misspelt.
  void keys(std::initializer_list<const char*> keys);

  /// Return the shaft that `key` names, and the `count` different ones of the list at `key`. All
  /// throw SceneError.
  Shaft shaft(const std::string& key);
  std::vector<Shaft> shafts(const std::string& key, int count);
  /// Returns the shaft of this index in the scene, from 0.
  Shaft shaftAt(int index);

  /// Returns a number in `range`, constant during a run.
  double number(const std::string& key, const Range& range = Range::any(),
                std::optional<double> default_value = {}) {
    return parameters().number(key, range, default_value);
  }

  /// Returns a quantity in `range` that may change during a run:
  ///     ratio: 0.6
  ///     ratio: "0.6 + 0.1*sin(t)"                          # a formula of t, inputs and tables
  ///     ratio: {times: [0, 2, 5], values: [0.4, 0.8, 0.6]} # s; C2, constant beyond the ends
  ///     ratio: {topic: ratio, hold: ..., initial: 0.6}     # commanded
  ///     ratio: {input: NAME}                               # one of the scene's `inputs`
  /// Numbers, tables and commanded values are checked against `range`; of a formula only its
  /// constants can be. Numbers may be texts with a unit of the range's dimension, "3 deg".
  Expression quantity(const std::string& key, const Range& range = Range::any(),
                      std::optional<double> default_value = {}) {
    return quantity(parameters(), key, range, default_value);
  }
  /// Reads the quantity from a dictionary of the law.
  Expression quantity(ParameterReader& section, const std::string& key, const Range& range,
                      std::optional<double> default_value = {});
  /// Returns the input that the law's own keys `topic`, `hold`, .. declare (command_input.h).
  Expression command(const Range& range = Range::any());

  Expression time();  ///< t, s
  /// Returns `f` at its arguments: a function that states its values and first derivatives in C++.
  Expression function(std::shared_ptr<const OpaqueFunction> f, std::vector<Expression> arguments);
  Expression lookUp(const Table& table, const Expression& x);
  /// Rises from 0 at `begin` to 1 at `end`, two times continuously differentiable: with
  /// z = (x - begin)/(end - begin) it is 10 z^3 - 15 z^4 + 6 z^5 between them.
  Expression smoothStep(const Expression& x, double begin, double end);

  // --- the law ---------------------------------------------------------------------------------
  /// States psi = 0. Its order is that of the highest derivative in it: 1 with velocities, 2 with
  /// accelerations, 3 with jerks. For constraints.
  void constrain(const Expression& psi) { psi_ = psi; }
  /// States the direction of the constraint's reaction on `shaft`, R += D lambda, which is else
  /// that of its gradient; of shafts that are not named 0. For constraints.
  void react(const Shaft& shaft, const Expression& D) { directions_.emplace_back(shaft.index, D); }
  /// Adds a torque on `shaft`, N m, positive accelerates. For torques.
  void apply(const Shaft& shaft, const Expression& torque);
  /// Adds a torque on `a` and its reaction, the opposite, on `b`.
  void applyBetween(const Shaft& a, const Shaft& b, const Expression& torque) {
    apply(a, torque);
    apply(b, -torque);
  }
  /// Returns the side of a Holding for its formulas: constant between events.
  Expression side();
  /// Lets the element hold, and adds its torques. Constraints do with `losses` only. doc/scene.md
  /// has a brake as an example, and one of `function`.
  void hold(const Holding& holding);
  /// Names a quantity of this element for output (`--columns elements`).
  void output(const std::string& name, const Expression& value) {
    outputs_.emplace_back(name, value);
  }

  /// Makes messages about the law as a whole refer to its `key` instead of its name.
  void tellOf(const std::string& key) { place_ = parameters().keyPath(key); }

  const std::string& place() const { return place_.empty() ? name() : place_; }
  const Expression& psi() const { return psi_; }
  /// Returns the torques by index of the shaft, in the order of the first `apply`.
  const std::vector<std::pair<int, Expression>>& torques() const { return torques_; }
  const std::vector<std::pair<int, Expression>>& directions() const { return directions_; }
  const std::vector<std::pair<std::string, Expression>>& outputs() const { return outputs_; }
  const std::vector<Holding>& holdings() const { return holdings_; }

 private:
  std::string place_;
  Expression psi_;
  std::vector<std::pair<int, Expression>> torques_;
  std::vector<std::pair<int, Expression>> directions_;
  std::vector<std::pair<std::string, Expression>> outputs_;
  std::vector<Holding> holdings_;
};

}  // namespace variator_sim
