/// Real-time priority and locked memory of Linux. An ordinary user may lack the right to both; then
/// the node runs without them and logs it.
#pragma once

#include <string>
#include <thread>

namespace variator_sim {

/// Sets SCHED_FIFO with `priority` (1 to 99). Returns why not and the remedy, or "".
std::string setRealTimePriority(std::thread& thread, int priority);

/// Locks the pages that the process has mapped by now, from their next use on. Later mappings are
/// not locked: a running stepping loop maps nothing more, and a limit can fail no later allocation.
/// Returns why not and the remedy, or "".
std::string lockMemory();

}  // namespace variator_sim
