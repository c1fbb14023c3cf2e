/// The texts of src/runtime at work, interpreted or compiled, to the same bits.
#pragma once

#include <memory>

#include "machine_code/kernel_library.h"
#include "motion_program/motion_program.h"
#include "variator_sim/types.h"

namespace variator_sim {

#define SCENE_REAL double
#include "runtime/status.h"
//
#include "runtime/table_data.h"
//
#include "runtime/exchange_data.h"

/// Steps a motion and keeps its state; shows any instant inside the last step. The functions are
/// those of host.h. All are [loop].
class HostedMotion {
 public:
  virtual ~HostedMotion() = default;
  virtual scene_status begin(const vs_exchange& from) = 0;
  virtual void leave(vs_exchange* to) = 0;
  virtual scene_status step(double left, vs_exchange* to) = 0;
  virtual scene_status cut(double at) = 0;
  virtual scene_status change(vs_exchange* from) = 0;
  virtual scene_status see(double at, vs_seen* to) = 0;
  virtual double calcWork(double at, double* through) = 0;
  virtual void look(double at, double* entry) = 0;
};

/// `program` has to outlive what is returned.
std::unique_ptr<HostedMotion> hostMotion(const MotionProgram& program);
/// The library is that of MotionProgram::writeKernel; `program` has to outlive what is returned;
/// null if it lacks a function.
std::unique_ptr<HostedMotion> hostMotion(std::shared_ptr<KernelLibrary> library,
                                         const MotionProgram& program);

}  // namespace variator_sim
