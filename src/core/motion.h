/// The motion of one scene, whatever its number of shafts: what Simulation holds.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "variator_sim/simulation.h"

namespace variator_sim {

/// See Simulation for what each method promises.
class Motion {
 public:
  virtual ~Motion() = default;
  virtual const Scene& scene() const = 0;
  virtual double time() const = 0;
  virtual const MotionStatus& advanceTo(double time) = 0;
  virtual double quietUntil() const = 0;
  virtual CommandResult command(int input, double value) = 0;
  virtual const Sample& sample() = 0;
  virtual void trackEnergy(bool on) = 0;
  virtual Energy energy() = 0;
  virtual EnergyDoubt energyDoubt() const = 0;
  virtual const MotionStatus& status() const = 0;
  virtual const Statistics& statistics() const = 0;
  virtual void reset() = 0;
  virtual const char* stepperName() const = 0;
  virtual std::string describeStepper() const = 0;
  virtual std::vector<std::string> skips() const = 0;
  virtual bool isSleeping() const = 0;
  /// Row m of C at the present, s values; for messages.
  virtual void calcConstraintRow(int m, double* C) = 0;
};

/// The motion of a scene of S shafts. Defined in make_motion.h and compiled once for each size, in
/// motion_1.cpp to motion_8.cpp, so that a build does the sizes side by side.
template <int S>
std::unique_ptr<Motion> makeMotion(Scene scene);

}  // namespace variator_sim
