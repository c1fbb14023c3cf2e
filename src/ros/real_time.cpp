#include "ros/real_time.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <cerrno>
#include <cstring>

namespace variator_sim {

std::string setRealTimePriority(std::thread& thread, int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int error = pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters);
  if (error == 0) return "";
  return "realtime_priority " + std::to_string(priority) + " is not permitted (" +
         std::strerror(error) +
         "): going on without it. It needs root, CAP_SYS_NICE, or a line '<user> - rtprio 99' in "
         "/etc/security/limits.conf.";
}

std::string lockMemory() {
  if (mlockall(MCL_CURRENT | MCL_ONFAULT) == 0) return "";
  return std::string("lock_memory is not permitted (") + std::strerror(errno) +
         "): going on without it. It needs root, CAP_IPC_LOCK, or a line '<user> - memlock "
         "unlimited' in /etc/security/limits.conf.";
}

}  // namespace variator_sim
