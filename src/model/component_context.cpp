#include "variator_sim/component_context.h"

#include <algorithm>

namespace variator_sim {

int ComponentContext::addInput(const CommandInputSettings& settings) {
  const std::string path = parameters_.keyPath("topic");
  for (const CommandInputSettings& other : inputs_) {
    if (other.topic == settings.topic) {
      throw SceneError(path, "topic " + inQuotes(settings.topic) + " is used twice: by " +
                                 inQuotes(other.owner) + " and by " + inQuotes(settings.owner) +
                                 "; every commanded input needs a topic of its own");
    }
  }
  return addTo(inputs_, settings, path);
}

int ComponentContext::addDelay(expression::Node node, double seconds, const std::string& text,
                               const std::string& path) {
  const auto same = std::find_if(inputs_.begin(), inputs_.end(), [&](const auto& other) {
    return other.kind == InputKind::kDelayed && other.delayed == node && other.delay == seconds;
  });
  if (same != inputs_.end()) return static_cast<int>(same - inputs_.begin());
  CommandInputSettings made;
  made.kind = InputKind::kDelayed;
  made.topic = made.name = text;
  made.owner = name_;
  made.delayed = node;
  made.delay = seconds;
  return addTo(inputs_, made, path);
}

}  // namespace variator_sim
