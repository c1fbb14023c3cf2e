/// Interruptions of work that has no result before its end: reading a scene, deriving its formulas.
#pragma once

#include "variator_sim/errors.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

class Interrupted : public Error {
 public:
  Interrupted() : Error("interrupted") {}
};

/// Throws Interrupted when work of the calling thread has to end now (Interruption). Not for the
/// stepping loop.
inline void endIfInterrupted() {
  if (Interruption::isWanted()) throw Interrupted();
}

}  // namespace variator_sim
