/// The numbers of a scene that the importer of its FMU can set.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "motion_program/motion_program.h"

namespace variator_sim {

/// The numbers of a program follow from those of its scene:
///     number_j = factor_j prod_i parameter_i^e_ji,   e_ji an integer
/// A number of the scene is no parameter where one of the program follows from it in another way,
/// or where the program's form does.
class FmuParameters {
 public:
  struct Parameter {
    std::string path;  ///< as --set has it
    double start;
    Range range;
    bool is_never_zero;
  };
  /// A number of the program: its place in `numbers`, and parameters with exponents.
  struct Dependent {
    int place;
    double factor;
    std::vector<std::pair<int, int>> powers;
  };
  using MakeProgram = std::function<std::unique_ptr<MotionProgram>(const Scene&)>;

  /// `make` makes the FMU's program of a scene.
  FmuParameters(const Scene& scene, const MakeProgram& make);

  /// The program whose text the FMU has. It is that of the scene with other values of parameters,
  /// so that none is left out as a factor of 1, or is the same number as another one.
  const MotionProgram& program() const { return *program_; }
  const std::vector<Parameter>& list() const { return list_; }
  const std::vector<Dependent>& dependents() const { return dependents_; }
  /// Returns the program's numbers in the order of vs_numbers, with those of `resolved` behind.
  static std::vector<double> numbersOf(const MotionProgram& program);

 private:
  struct Form;
  class Trials;

  void addTolerances(const SolverSettings& solver);
  std::vector<int> findExponents(Trials& trials, const Form& form, const std::vector<double>& whole,
                                 Parameter* parameter) const;
  bool findPowers(Trials& trials);

  std::unique_ptr<MotionProgram> program_;
  std::vector<Parameter> list_;
  std::vector<Dependent> dependents_;
};

}  // namespace variator_sim
