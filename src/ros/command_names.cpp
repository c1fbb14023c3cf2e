#include "ros/command_names.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "variator_sim/message_text.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {

std::string readCommands(const std::vector<CommandInputSettings>& inputs,
                         const std::vector<std::string>& topics, const std::vector<double>& values,
                         CommandGroup& group) {
  if (topics.size() != values.size()) {
    return "there are " + std::to_string(topics.size()) + " command topics and " +
           std::to_string(values.size()) + " values";
  }
  group.count = 0;
  std::array<bool, kMaxInputs> seen{};
  for (std::size_t i = 0; i < topics.size(); ++i) {
    int input = 0;
    try {
      input = findInput(inputs, topics[i]);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    if (std::exchange(seen[static_cast<std::size_t>(input)], true)) {
      return "command topic " + inQuotes(topics[i]) + " is given twice";
    }
    if (!std::isfinite(values[i])) {
      return "the command for " + inQuotes(topics[i]) + " is " + formatReal(values[i]) +
             "; it must be finite";
    }
    group.commands[static_cast<std::size_t>(group.count++)] = {input, values[i]};
  }
  return "";
}

}  // namespace variator_sim
