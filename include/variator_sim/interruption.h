/// Lets a program end long work early: compiling and stepping poll it between their parts.
#pragma once

#include <functional>

#include "variator_sim/errors.h"

namespace variator_sim {

/// While it exists, long work of its thread polls `is_wanted` and ends early once that is true:
/// Simulation::advanceTo stays at the time reached, a compilation is given up.
class Interruption {
 public:
  explicit Interruption(std::function<bool()> is_wanted);
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  /// True when work of the calling thread has to end now. [loop]
  static bool isWanted();

 private:
  const std::function<bool()> is_wanted_;
  const Interruption* const outer_;
};

/// The end of work that has no result before its end: reading a scene, deriving its formulas.
class Interrupted : public Error {
 public:
  Interrupted() : Error("interrupted") {}
};

/// Throws Interrupted when work of the calling thread has to end now. Not for the stepping loop.
inline void endIfInterrupted() {
  if (Interruption::isWanted()) throw Interrupted();
}

}  // namespace variator_sim
