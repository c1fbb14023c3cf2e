/// Derivatives of a run by numbers of its scene and by values of commands: `simulate
/// --sensitivity`, variator_sim.simulate(.., gradient=[..]).
///
/// Beside the run, motions over numbers with derivatives (TangentMotion) get the same commands and
/// are sampled at the same instants. A number of the scene enters the motion by those of its
/// program, c(p): their derivatives are differences of programs that are made for values nearby,
///     dc/dp = sum_k w_k c(p + k h),  k = +-1, +-2, +-3,
/// exact to rounding for what a program makes of a number. All else is differentiated by the chain
/// rule, the instants of events with it.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tools/offline_run.h"
#include "variator_sim/scene.h"

namespace variator_sim {

class MotionProgram;
class TangentMotion;

class Sensitivity {
 public:
  using SceneReader = std::function<Scene(const ParameterTree&)>;

  /// `paths`: numbers of the scene ("drive/inertia"), or commands, `ratio@2.0` that at 2 s,
  /// which have to be among `commands`. Throws SceneError for others, and for a scene whose motion
  /// has no series.
  Sensitivity(const ParameterTree& tree, const SceneReader& read,
              const std::vector<std::string>& paths, const std::vector<TimedCommand>& commands);
  ~Sensitivity();

  /// Returns "d(load/velocity)/d(drive/inertia)", ..: for each path, of each shaft angle, velocity,
  /// acceleration, applied and reaction torque; of each constraint the multiplier; states; outputs.
  const std::vector<std::string>& names() const { return names_; }

  /// The run, at its start, is about to move.
  void follow(Simulation& run);
  /// A command at the run's current time.
  void command(const Simulation& run, int input, double value);
  /// Writes one value for each name at the run's current time, NaN once there are none.
  void calc(Simulation& run, double* values);
  /// Returns why and when the derivatives have ended; "" while they have not.
  const std::string& stop() const { return stop_; }

 private:
  struct Seed {
    int input = -1;
    double time = 0.0;
  };
  struct Given {
    int input;
    double value;
  };
  void give(double time, const Given& command);
  void note(int status, double time);

  std::vector<std::string> names_;
  std::vector<Seed> seeds_;  ///< of each path; input -1: a number of the scene
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<MotionProgram> program_;
  std::vector<std::unique_ptr<TangentMotion>> motions_;
  std::vector<Given> waiting_;  ///< commands of the start
  std::size_t quantities_ = 0;
  bool is_begun_ = false;
  std::string stop_;
};

}  // namespace variator_sim
