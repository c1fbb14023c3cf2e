/// The formulas of a scene as programs over all elements, so that common subexpressions are
/// computed once.
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

/// Code of another part in the same library; `use` tells whether it is there and right.
struct MoreCode {
  std::string source;
  KernelLibrary::Check use;
};

/// `scene` has to outlive it. Evaluations are [loop].
class SceneProgram {
 public:
  /// Copies `like`, for a scene with the same elements; compiles if that is nullptr.
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
  /// For each constraint, consecutively: C (s values) and c0.
  const double* calcRows(const StateView& state) const { return rows_.evaluate(state); }
  /// For each constraint of order 1: f, then C (s values).
  const double* calcVelocityLevel(const StateView& state) const {
    return velocity_level_.evaluate(state);
  }
  /// For each constraint of order 1 or 2: f' or psi, then C.
  const double* calcAccelerationLevel(const StateView& state) const {
    return acceleration_level_.evaluate(state);
  }
  /// Q' (s values), then the values of calcAccelerationLevel.
  const double* calcRateAndLevel(const StateView& state) const {
    return rate_and_level_.evaluate(state);
  }
  /// Q' (s values), then the values of calcRows.
  const double* calcRateAndRows(const StateView& state) const {
    return rate_and_rows_.evaluate(state);
  }

  /// A derivative by x_q, x = (phi, omega, epsilon), for implicit steps.
  struct Partial {
    enum class Kind { kRate, kEntry, kResidual };  ///< of Q'_i, of C_mi, of psi_m (f' of order 1)
    Kind kind;
    int m;
    int i;
    int q;
  };
  /// Derivatives that are not zero everywhere, and their values; valid until the next evaluation.
  const std::vector<Partial>& partials() const { return partials_; }
  const double* calcPartials(const StateView& state) const {
    return partials_program_.evaluate(state);
  }
  /// False if there are too many derivatives or a constraint of order 3: laws are differentiated
  /// singly.
  bool hasPartials() const { return has_partials_; }

  /// Switches to machine code, which changes no bit. Returns an empty reason on success; then
  /// `compiled` tells whether it had to be compiled. What has `more` code switches as well. Not in
  /// the loop.
  std::string loadMachineCode(const MoreCode& more, KernelLibrary::Missing missing, bool* compiled);
  /// Switches to the machine code of `other`, if its scene differs in numbers alone. Not in the
  /// loop.
  bool shareMachineCode(const SceneProgram& other);
  /// Returns the C source; empty if a law reads an opaque function.
  std::string writeSource(const MoreCode& more = {}) const;

 private:
  void copyPrograms(const SceneProgram& like);
  /// Makes the programs of the constraints, with Q'.
  void makeRows(const std::vector<expression::Node>& rate);
  void makePartials(const std::vector<expression::Node>& rate);

  /// The functions of the code, in the order in which they are written.
  struct Part {
    const char* name;
    Program SceneProgram::*program;
  };
  static const std::array<Part, 8>& parts();
  /// Adds the functions of the selected parts.
  template <class IsWanted>
  void writeParts(const IsWanted& is_wanted, std::string* source) const;
  /// Notes the structure of the code.
  void noteStructure();
  /// Returns false if the code is missing.
  bool use(const std::shared_ptr<KernelLibrary>& library);
  bool agreesWithInterpreter();
  void interpret();

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
  std::vector<const void*> tables_;
  std::vector<const void*> tables2_;
  KernelTables host_{};
};

}  // namespace variator_sim
