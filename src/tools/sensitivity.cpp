#include "tools/sensitivity.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "analysis/model_formulas.h"
#include "model/number_text.h"
#include "motion_program/motion_program.h"
#include "motion_program/tangent_steps.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

using expression::Node;
using Numbers = std::vector<double>;

/// Distance of the values next to a parameter, as a part of it: a number of the program is known by
/// them to the square of this, and to rounding / kDistance.
constexpr double kDistance = 1e-5;

/// A number of the scene.
struct Parameter {
  std::string path;
  double value;  ///< in SI units
  double unit;   ///< of its distances
};

/// Reads the number at a path, a text with its unit too. Throws SceneError.
double readNumber(const ParameterTree& tree, const std::string& path) {
  const ParameterTree value = getValue(tree, path);
  if (const std::optional<double> number = ParameterReader::findNumber(value)) return *number;
  throw SceneError(path, "is " + value.describeKind() + ", " + value.toText() +
                             "; allowed for a derivative: a number, or TOPIC@TIME of a command");
}

std::vector<Node> shownNodes(const Scene& scene) {
  std::vector<Node> nodes;
  for (const Output& it : scene.outputs) {
    if (!it.reads_principle) nodes.push_back(it.node);
  }
  return nodes;
}

void tighten(SolverSettings* solver) {
  for (double* tolerance : {&solver->relative_tolerance, &solver->absolute_tolerance}) {
    *tolerance = std::min(*tolerance, std::max(*tolerance / kTightening, 1e-13));
  }
}

struct Made {
  std::unique_ptr<Scene> scene;
  std::unique_ptr<MotionProgram> program;
  Numbers numbers;
  SolverSettings solver;  ///< of the scene, as it asks for
};

Made make(const ParameterTree& tree, const Sensitivity::SceneReader& read) {
  Made made;
  made.scene = std::make_unique<Scene>(read(tree));
  Scene& scene = *made.scene;
  scene.refuseDelays("derivatives of a run have no past here");
  made.solver = scene.solver;
  tighten(&scene.solver);
  made.program = std::make_unique<MotionProgram>(scene, shownNodes(scene));
  orRefuse("has no derivatives, since its motion is not stepped by power series",
           [&] { made.program->requireText(); });
  made.numbers = made.program->numbers();
  const auto shafts = scene.shafts.size();
  for (Numbers initial :
       {scene.initial.angle, scene.initial.velocity, scene.initial.acceleration}) {
    initial.resize(shafts);
    made.numbers.insert(made.numbers.end(), initial.begin(), initial.end());
  }
  return made;
}

/// Weights of f(0) and h f'(0) from f at places of a line, by Lagrange's polynomials.
struct Stencil {
  std::vector<double> places, of_value, of_slope;
};
/// To both sides of the line, or to one where the scene refuses the other.
const Stencil kStencils[] = {{{-1.0, 1.0}, {0.5, 0.5}, {-0.5, 0.5}},
                             {{1.0, 2.0, 3.0}, {3.0, -3.0, 1.0}, {-2.5, 4.0, -1.5}},
                             {{-1.0, -2.0, -3.0}, {3.0, -3.0, 1.0}, {2.5, -4.0, 1.5}}};

Numbers combine(const std::vector<Made>& made, const std::vector<double>& weights) {
  Numbers sum(made.front().numbers.size());
  for (std::size_t k = 0; k < made.size(); ++k) {
    for (std::size_t n = 0; n < sum.size(); ++n) sum[n] += weights[k] * made[k].numbers[n];
  }
  return sum;
}

/// The program, its numbers and their derivatives. Programs are made along lines through the
/// scene's values on which no parameter has a value that a formula simplifies by (0, 1) or shares
/// with another: they have one structure.
struct Source {
  Made base;
  TangentNumbers numbers;

  Source(const ParameterTree& tree, const Sensitivity::SceneReader& read,
         const std::vector<Parameter>& by)
      : base(make(tree, read)) {
    numbers.values = base.numbers;
    numbers.relative_tolerance = base.solver.relative_tolerance;
    numbers.absolute_tolerance = base.solver.absolute_tolerance;
    if (by.empty()) return;
    std::vector<double> direction;
    for (std::size_t k = 0; k < by.size(); ++k) {
      direction.push_back(1.0 + std::fmod(0.618 * static_cast<double>(k), 1.0));
    }
    std::vector<Made> made;
    const Numbers along = slopeAlong(tree, read, by, direction, by.front().path, &made);
    for (const Made& it : made) requireKnown(tree, read, by, *it.program);
    const std::string structure = made.front().program->structure();
    const Numbers values = combine(made, stencil_->of_value);
    Made node = std::move(made.front());
    for (std::size_t j = 0; j < by.size(); ++j) {
      std::vector<double> other = direction;
      other[j] += 1.0;
      Numbers slope = slopeAlong(tree, read, by, other, by[j].path, &made);
      requireSame(made.front().program->structure(), structure, by[j].path);
      for (std::size_t n = 0; n < slope.size(); ++n) {
        slope[n] = (slope[n] - along[n]) / by[j].unit;  // (0 where j changes nothing)
      }
      numbers.slopes.push_back(std::move(slope));
    }
    if (structure == base.program->structure()) return;
    base = std::move(node);
    numbers.values = values;
    for (std::size_t n = 0; n < values.size(); ++n) {
      if (std::abs(values[n]) < 1e-11 * std::abs(base.numbers[n])) numbers.values[n] = 0.0;
    }
  }

 private:
  const Stencil* stencil_ = kStencils;  ///< with which the slopes were made

  static void requireSame(const std::string& one, const std::string& other,
                          const std::string& path) {
    if (one == other) return;
    throw SceneError(path,
                     "changes which formulas the motion has, and not their numbers alone: there "
                     "is no derivative by it");
  }

  /// Throws SceneError where a program of neighbouring values differs in numbers that have no
  /// slope.
  void requireKnown(const ParameterTree& tree, const Sensitivity::SceneReader& read,
                    const std::vector<Parameter>& by, const MotionProgram& there) const {
    const Numbers here = base.program->otherNumbers();
    if (there.otherNumbers() == here) return;
    std::string path = by.front().path;
    for (std::size_t j = 0; by.size() > 1 && j < by.size(); ++j) {
      ParameterTree moved = tree;
      setValue(moved, by[j].path,
               ParameterTree::real(by[j].value + stencil_->places.back() * by[j].unit));
      if (make(moved, read).program->otherNumbers() != here) path = by[j].path;
    }
    throw SceneError(path,
                     "changes how the motion is stepped, by what has no derivative; allowed: "
                     "numbers of laws, inputs, tables and initial values");
  }

  /// Makes programs along a line, and returns the slopes of their numbers, per unit.
  Numbers slopeAlong(const ParameterTree& tree, const Sensitivity::SceneReader& read,
                     const std::vector<Parameter>& by, const std::vector<double>& direction,
                     const std::string& path, std::vector<Made>* made) {
    std::string fault;
    for (const Stencil* it = stencil_; it != std::end(kStencils); ++it) {
      try {
        made->clear();
        for (const double place : it->places) {
          ParameterTree there = tree;
          for (std::size_t k = 0; k < by.size(); ++k) {
            setValue(there, by[k].path,
                     ParameterTree::real(by[k].value + place * direction[k] * by[k].unit));
          }
          made->push_back(make(there, read));
        }
      } catch (const SceneError& error) {
        if (fault.empty()) fault = error.what();
        continue;
      }
      for (const Made& one : *made) {
        requireSame(one.program->structure(), made->front().program->structure(), path);
        if (one.numbers.size() != made->front().numbers.size()) requireSame({}, {0}, path);
      }
      stencil_ = it;
      return combine(*made, it->of_slope);
    }
    throw SceneError(path, "has no derivative: values next to it are refused: " + fault);
  }
};

}  // namespace

Sensitivity::~Sensitivity() = default;

Sensitivity::Sensitivity(const ParameterTree& tree, const SceneReader& read,
                         const std::vector<std::string>& paths,
                         const std::vector<TimedCommand>& commands) {
  std::vector<Parameter> by;
  for (const std::string& path : paths) {
    if (path.find('@') != std::string::npos) continue;
    const double value = readNumber(tree, path);
    by.push_back({path, value, kDistance * (value == 0.0 ? 1.0 : std::abs(value))});
  }
  Source source(tree, read, by);
  scene_ = std::move(source.base.scene);
  program_ = std::move(source.base.program);
  const Scene& scene = *scene_;
  TangentNumbers all = std::move(source.numbers);
  std::size_t next = 0;
  std::vector<Numbers> slopes;
  for (const std::string& path : paths) {
    const std::size_t place = path.find('@');
    Seed seed;
    if (place == std::string::npos) {
      slopes.push_back(all.slopes[next++]);
    } else {
      slopes.emplace_back();
      seed.input = findInput(scene.inputs, path.substr(0, place));
      const bool is_number = readWhole(path.substr(place + 1), &seed.time);
      double nearest = std::numeric_limits<double>::infinity();
      for (const TimedCommand& it : commands) {
        if (it.input != seed.input) continue;
        if (std::abs(it.time - seed.time) < std::abs(nearest - seed.time)) nearest = it.time;
      }
      if (!is_number || !(std::abs(nearest - seed.time) <= 1e-9 * std::max(1.0, seed.time))) {
        throw SceneError("", inQuotes(path) + ": there is no command to that input at that time; " +
                                 (std::isfinite(nearest)
                                      ? "the nearest one is at " + formatNumber(nearest) + " s"
                                      : "there is none at all"));
      }
      seed.time = nearest;
    }
    seeds_.push_back(seed);
  }
  std::vector<std::string> quantities = shaftQuantities(scene);
  for (const ConstraintPtr& it : scene.constraints)
    quantities.push_back(it->name() + "/multiplier");
  for (const SceneState& it : scene.states) {
    quantities.push_back("states/" + scene.inputs[static_cast<std::size_t>(it.input)].name);
  }
  for (const Output& it : scene.outputs) {
    if (!it.reads_principle) quantities.push_back("outputs/" + it.name);
  }
  quantities_ = quantities.size();
  for (const std::string& path : paths) {
    for (const std::string& it : quantities)
      names_.push_back(std::string("d(").append(it).append(")/d(").append(path).append(")"));
  }
  const std::vector<int> shown = program_->rowsOf(shownNodes(scene)).values;
  for (std::size_t first = 0; first < paths.size();) {
    all.slopes.assign(slopes.begin() + static_cast<std::ptrdiff_t>(first), slopes.end());
    motions_.push_back(hostTangents(*program_, all, shown));
    first += static_cast<std::size_t>(motions_.back()->width());
  }
}

void Sensitivity::note(int status, double time) {
  if (status == SCENE_OK || !stop_.empty()) return;
  static const char* const kReasons[] = {"",
                                         "a bad argument",
                                         "C has lost rank",
                                         "no state on the constraints was found",
                                         "a value is not finite or has no power series",
                                         "steps become too short",
                                         "a law chatters",
                                         "a jump leads to no state on the constraints",
                                         "the first commands contradict the initial values",
                                         "no modes of the elements that hold go on"};
  stop_ = std::string("no derivatives from ") + formatNumber(time) + " s on: " + kReasons[status];
}

void Sensitivity::follow(Simulation& run) {
  if (is_begun_) return;
  is_begun_ = true;
  const Sample& start = run.sample();
  for (const auto& it : motions_) note(it->begin(start.acceleration), start.time);
  for (const Given& it : waiting_) give(run.time(), it);
}

void Sensitivity::give(double time, const Given& command) {
  std::size_t first = 0;
  for (const auto& it : motions_) {
    const auto width = static_cast<std::size_t>(it->width());
    std::vector<double> slope(width);
    for (std::size_t j = 0; j < width && first + j < seeds_.size(); ++j) {
      const Seed& seed = seeds_[first + j];
      if (seed.input == command.input && seed.time == time) slope[j] = 1.0;
    }
    note(it->advance(time), time);
    it->command(command.input, command.value, slope.data());
    first += width;
  }
}

void Sensitivity::command(const Simulation& run, int input, double value) {
  if (!std::isfinite(value)) return;
  if (is_begun_)
    give(run.time(), {input, value});
  else
    waiting_.push_back({input, value});
}

void Sensitivity::calc(Simulation& run, double* values) {
  follow(run);
  std::size_t first = 0;
  for (const auto& it : motions_) {
    const auto width = static_cast<std::size_t>(it->width());
    std::vector<double> slopes(quantities_ * width);
    note(it->advance(run.time()), run.time());
    if (stop_.empty()) note(it->see(slopes.data()), run.time());
    for (std::size_t j = 0; j < width && first + j < seeds_.size(); ++j) {
      for (std::size_t q = 0; q < quantities_; ++q) {
        values[(first + j) * quantities_ + q] =
            stop_.empty() ? slopes[q * width + j] : std::numeric_limits<double>::quiet_NaN();
      }
    }
    first += width;
  }
}

}  // namespace variator_sim
