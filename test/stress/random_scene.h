/// Random valid scenes: any number of shafts and constraints, all orders, both principles, random
/// smooth laws, inputs with every hold and commands to them. The same seed gives the same scene on
/// every machine.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stress/hazard.h"
#include "variator_sim/scene.h"

namespace variator_sim::test {

/// A scene in parts that can be left out, and what happens in it.
struct RandomScene {
  struct Component {
    std::string name;
    std::string line;  ///< its dictionary, YAML
  };
  struct Command {
    double time = 0.0;
    std::string topic;
    double value = 0.0;
  };
  std::vector<Component> shafts;
  std::vector<Component> torques;
  std::vector<Component> constraints;
  std::vector<std::string> couplings;  ///< of inertia: "[a, b, value]"
  std::string principle = "generalized_gauss";
  std::vector<double> angle;
  std::vector<double> velocity;
  std::vector<Command> commands;
  double duration = 2.0;  ///< s

  std::string yaml() const;
  /// As `simulate --commands` reads it.
  std::string csv() const;
};

RandomScene makeRandomScene(std::uint64_t seed);

/// The result of a scene, run by three methods.
struct Finding {
  enum class Kind {
    kAgrees,   ///< every run within what was asked for
    kStops,    ///< by name; agrees up to there
    kRefused,  ///< its start was refused by name
    kWrong
  };
  Kind kind = Kind::kAgrees;
  std::string name;      ///< of the stop
  double error = 0.0;    ///< worst, tolerances
  double allowed = 0.0;  ///< tolerances, by how much the motion amplifies errors
  std::string message;   ///< of kWrong
};

/// Runs `scene` with `commands` over `duration` by two methods at two tolerances and compares both
/// with a third method at a far tighter one.
///
/// The difference allowed is kAllowed tolerances times the growth of errors in this motion: how far
/// runs of the third method from slightly different states separate, per difference.
Finding examine(const Scene& scene, const std::vector<TimedCommand>& commands, double duration);
Finding examine(const RandomScene& random);

/// The smallest scene of those that `random` contains which is still found to be wrong: without
/// torques, constraints, couplings and commands that do not matter.
RandomScene shrink(const RandomScene& random);

}  // namespace variator_sim::test
