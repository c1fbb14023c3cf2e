/// The system x' = f(t, x) to be integrated, and what a step needs beside it. A principle is one
/// of these (generalized_gauss.h, classical_gauss.h), and so is the path of a jump (jump_map.h).
#pragma once

#include <cstdint>

#include "dynamics/linearization.h"
#include "dynamics/projection_result.h"
#include "dynamics/state_vector.h"

namespace variator_sim {

class MotionSeries;

/// A system of ordinary differential equations, as steppers see it. All are [loop].
class System {
 public:
  virtual ~System() = default;

  /// How many numbers x has, and how many of them belong to one level (angles, velocities, ...).
  int size() const { return size_; }
  int shafts() const { return S; }
  /// True for systems that know the applied torque by its rate only: the accelerations are part of
  /// their state, and x' has Q' in it.
  bool integratesTorque() const { return integrates_torque_; }

  /// x' at (t, x). NaN where there is none.
  void operator()(const State& x, State& dxdt, double t) { derive_(*this, x, dxdt, t); }

  /// True when some derivative depends on an angle.
  virtual bool readsAngles() const { return true; }

  /// Projects x, which stands at t, onto the constraints; `moved` gets by how much.
  virtual ProjectionResult project(double /*t*/, State& /*x*/, State& moved,
                                   std::uint64_t* /*iterations*/) {
    moved.fill(0.0);
    return ProjectionResult::kConverged;
  }

  /// Adds what rounding of the time makes of the accelerations that project() leads to, besides
  /// that of psi, s values.
  virtual void addReactionRounding(double /*t*/, const State& /*x*/, double* /*acceleration*/) {}

  /// d(x')/dx at (t, x).
  virtual void calcLinearization(double t, const State& x, Linearization& linearization) {
    linearizeByDifferences(*this, t, x, readsAngles(), 1.0, linearization);
  }
  /// True where a constraint holds jerks, and nothing holds the accelerations.
  virtual bool hasOrder3() const { return false; }
  /// True when implicit steps hold psi = 0 in their stages instead of C eta + c0 = 0.
  virtual bool keepsConstraintsInStages() const { return false; }
  /// Computes the residual of an implicit stage: M x' - f in its last rows, `rate` the last rows of
  /// x'. NaN if C has lost rank.
  virtual void calcStageResidual(double t, const State& x, const double* rate,
                                 const Linearization& /*linearization*/, double* residual) {
    State dxdt(size_);
    (*this)(x, dxdt, t);
    for (int i = 0; i < S; ++i) residual[i] = rate[i] - dxdt[size_ - S + i];
  }
  /// Its derivatives at x, whose derivative is dxdt.
  virtual void calcStageLinearization(double t, const State& x, const State& /*dxdt*/,
                                      Linearization& linearization) {
    linearization.mass().setIdentity();
    calcLinearization(t, x, linearization);
  }

  /// The motion as power series; nullptr where it has none.
  virtual MotionSeries* series() const { return nullptr; }

  /// Q' at the last derivative taken, N m/s, s values.
  virtual const double* torqueRate() const { return nullptr; }
  /// Q' at (t, x), where x need not satisfy the constraints.
  virtual const double* calcTorqueRate(double /*t*/, const State& /*x*/) { return nullptr; }

 protected:
  System(int shafts, int levels, bool integrates_torque)
      : S(shafts), size_(shafts * levels), integrates_torque_(integrates_torque) {}
  System(const System&) = default;
  System& operator=(const System&) = delete;

  /// Computes x'. It is called more often than anything else: a function pointer that is chosen
  /// once, for the scene's size, costs half of a virtual function that then chooses.
  using Derive = void (*)(System& self, const State& x, State& dxdt, double t);
  /// The one that calls `T::derive`.
  template <class T>
  static void deriveOf(System& self, const State& x, State& dxdt, double t) {
    static_cast<T&>(self).derive(x, dxdt, t);
  }
  /// To be set by the constructor of every system.
  Derive derive_ = nullptr;

  const int S;  // shafts
  const int size_;
  const bool integrates_torque_;
};

}  // namespace variator_sim
