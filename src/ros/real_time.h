/// What Linux offers to be on time: priority, and memory that stays. Both may be refused to
/// ordinary users; then the node goes on without, as the log says.
#pragma once

#include <string>
#include <thread>

namespace variator_sim {

/// SCHED_FIFO with `priority` (1 to 99) for `thread`. Why not, and what to do, or "".
std::string setRealTimePriority(std::thread& thread, int priority);

/// Keeps in memory what the process has mapped by now, from its next use on. What is mapped later
/// is not locked: a stepping loop that is set up maps nothing more, and a limit can fail no later
/// allocation. Why not, and what to do, or "".
std::string lockMemory();

}  // namespace variator_sim
