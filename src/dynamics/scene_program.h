/// The formulas of a scene as programs: those of all elements together, so that what they have in
/// common is computed once.
///
/// Q is the sum of all torques; C and c0 are those of all constraints [12].
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "dynamics/program.h"
#include "expression/c_code.h"
#include "machine_code/kernel_library.h"
#include "variator_sim/scene.h"

namespace variator_sim {

class MotionSeries;
class SeriesLanes;

/// `scene` has to outlive it. Evaluations are [loop].
class SceneProgram {
 public:
  /// A copy of `like`, for a scene with the same elements; made anew where that is nullptr.
  explicit SceneProgram(const Scene& scene, const SceneProgram* like = nullptr);

  /// Q, N m, s values.
  void calcTorque(const StateView& state, double* torque) const {
    std::copy_n(torque_.evaluate(state), S, torque);
  }
  /// Its total rate Q', N m/s, s values.
  void calcTorqueRate(const StateView& state, double* rate) const {
    std::copy_n(rate_.evaluate(state), S, rate);
  }

  // Each of these is valid until the next evaluation.
  /// One behind the other: for each constraint C (s values) and c0.
  const double* calcRows(const StateView& state) const { return rows_.evaluate(state); }
  /// Of each constraint of order 1: f, then C (s values).
  const double* calcVelocityLevel(const StateView& state) const {
    return velocity_level_.evaluate(state);
  }
  /// Of each constraint of order 1 or 2: f' or psi, then C.
  const double* calcAccelerationLevel(const StateView& state) const {
    return acceleration_level_.evaluate(state);
  }
  /// Q' (s values), then what calcAccelerationLevel gives.
  const double* calcRateAndLevel(const StateView& state) const {
    return rate_and_level_.evaluate(state);
  }
  /// Q' (s values), then what calcRows gives.
  const double* calcRateAndRows(const StateView& state) const {
    return rate_and_rows_.evaluate(state);
  }

  /// A derivative by x_q, x = (phi, omega, epsilon), that an implicit step asks for.
  struct Partial {
    enum class Kind { kRate, kEntry, kResidual };  ///< of Q'_i, of C_mi, of psi_m (f' of order 1)
    Kind kind;
    int m;
    int i;
    int q;
  };
  /// Those that are not zero everywhere, and their values; valid until the next evaluation.
  const std::vector<Partial>& partials() const { return partials_; }
  const double* calcPartials(const StateView& state) const {
    return partials_program_.evaluate(state);
  }
  /// False where the derivatives are too many, or a constraint is of order 3: laws are asked one by
  /// one.
  bool hasPartials() const { return has_partials_; }

  /// Goes over to machine code, which changes no bit. An empty reason when it did; then `compiled`
  /// tells whether it had to be compiled. Not in the loop.
  /// `series` of the same scene go along, or nullptr.
  std::string loadMachineCode(MotionSeries* series, KernelLibrary::Missing missing, bool* compiled);
  /// Goes over to the machine code of `other`, if its scene differs in numbers alone. Not in the
  /// loop.
  bool shareMachineCode(MotionSeries* series, const SceneProgram& other);
  /// Machine code of several motions at once, beside that of this one; nullptr where there is none.
  /// Not in the loop.
  std::shared_ptr<SeriesLanes> loadLanes(MotionSeries& series, KernelLibrary::Missing missing);
  const KernelTables* kernelTables() const { return &host_; }
  /// The C that it is compiled from; empty where a law reads what is no formula.
  std::string writeSource(const MotionSeries* series) const;

 private:
  void copyPrograms(const SceneProgram& like);
  /// The programs of the constraints; Q' goes along.
  void makeRows(const std::vector<expression::Node>& rate);
  void makePartials(const std::vector<expression::Node>& rate);

  /// The functions of the code, in the order in which they are written.
  struct Part {
    const char* name;
    Program SceneProgram::*program;
  };
  static const std::array<Part, 8>& parts();
  /// Adds the functions of the parts that are wanted.
  template <class IsWanted>
  void writeParts(const IsWanted& is_wanted, std::string* source) const;
  /// Notes what the code is made from.
  void noteStructure(const MotionSeries* series);
  /// False where the code is not there.
  bool use(const std::shared_ptr<KernelLibrary>& library, MotionSeries* series);
  bool agreesWithInterpreter(MotionSeries* series);
  void interpret(MotionSeries* series);

  const Scene& scene_;
  const int S;  // shafts
  Program torque_;
  Program rate_;
  Program rows_;
  Program rate_and_rows_;
  Program velocity_level_;
  Program acceleration_level_;
  Program rate_and_level_;
  Program partials_program_;
  std::vector<Partial> partials_;
  bool has_partials_ = false;
  std::shared_ptr<KernelLibrary> library_;
  expression::CodeStructure structure_;
  std::size_t constants_of_series_ = 0;  ///< from which on they are the series'
  std::vector<const void*> tables_;
  std::vector<const void*> tables2_;
  KernelTables host_{};
};

}  // namespace variator_sim
