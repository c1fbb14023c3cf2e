#include "ros/command_names.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "variator_sim/nearest_name.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

std::string refuseTopic(const std::vector<std::string>& known, const std::string& topic) {
  const std::string allowed = known.empty() ? "; it has none" : "; it has: " + joinNames(known);
  return "command topic " + inQuotes(topic) + " is not in the scene" + suggestName(topic, known) +
         allowed;
}

}  // namespace

std::string readCommands(const std::vector<std::string>& known,
                         const std::vector<std::string>& topics, const std::vector<double>& values,
                         CommandGroup& group) {
  if (topics.size() != values.size()) {
    return "there are " + std::to_string(topics.size()) + " command topics and " +
           std::to_string(values.size()) + " values";
  }
  group.count = 0;
  std::array<bool, kMaxInputs> seen{};
  for (std::size_t i = 0; i < topics.size(); ++i) {
    const auto found = std::find(known.begin(), known.end(), topics[i]);
    if (found == known.end()) return refuseTopic(known, topics[i]);
    const auto input = static_cast<std::size_t>(found - known.begin());
    if (std::exchange(seen[input], true)) {
      return "command topic " + inQuotes(topics[i]) + " is given twice";
    }
    if (!std::isfinite(values[i])) {
      return "the command for " + inQuotes(topics[i]) + " is " +
             ParameterTree::real(values[i]).toText() + "; it must be finite";
    }
    group.commands[static_cast<std::size_t>(group.count++)] = {static_cast<int>(input), values[i]};
  }
  return "";
}

}  // namespace variator_sim
