/// Commands by the names of their topics.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "ros/loop_messages.h"
#include "variator_sim/command_input.h"

namespace variator_sim {

/// Commands for different inputs at one instant.
struct CommandGroup {
  int count = 0;
  std::array<InputCommand, kMaxInputs> commands{};
};

/// Checks all commands before any takes effect. Returns why they are rejected, or "".
std::string readCommands(const std::vector<CommandInputSettings>& inputs,
                         const std::vector<std::string>& topics, const std::vector<double>& values,
                         CommandGroup& group);

}  // namespace variator_sim
