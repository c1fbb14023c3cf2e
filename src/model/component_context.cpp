#include "variator_sim/component_context.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

int ComponentContext::readShaft(const std::string& key) {
  return placeOf(parameters_.text(key), shaft_names_, parameters_.keyPath(key), "is not a shaft");
}

std::vector<int> ComponentContext::readShafts(const std::string& key, int count) {
  const std::vector<std::string> names = parameters_.names(key);
  const std::string path = parameters_.keyPath(key);
  const std::string expected = "expected a list of " + std::to_string(count) + " different shafts";
  if (static_cast<int>(names.size()) != count) {
    throw SceneError(path, expected + ", got " +
                               (parameters_.has(key) ? "[" + joinNames(names) + "]" : "nothing") +
                               "; allowed: " + joinNames(shaft_names_));
  }
  std::vector<int> shafts;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const int shaft = placeOf(names[i], shaft_names_, elementPath(path, i), "is not a shaft");
    if (contains(shafts, shaft)) {
      throw SceneError(path, expected + ", got " + inQuotes(names[i]) + " twice");
    }
    shafts.push_back(shaft);
  }
  return shafts;
}

int ComponentContext::addInput(const CommandInputSettings& settings) {
  const std::string path = parameters_.keyPath("topic");
  for (const CommandInputSettings& other : inputs_) {
    if (other.topic == settings.topic) {
      throw SceneError(path, "topic " + inQuotes(settings.topic) + " is used twice: by " +
                                 inQuotes(other.owner) + " and by " + inQuotes(settings.owner) +
                                 "; every commanded input needs a topic of its own");
    }
  }
  return *used_inputs_.insert(addTo(inputs_, settings, path)).first;
}

void ComponentContext::limitInput(int index, const Range& range) {
  CommandInputSettings& input = inputs_[static_cast<std::size_t>(index)];
  if (input.kind != InputKind::kCommanded) return;
  if (std::isinf(input.minimum) && range.minimum_included) input.minimum = range.minimum;
  if (std::isinf(input.maximum) && range.maximum_included) input.maximum = range.maximum;
}

int ComponentContext::addDelay(expression::Node node, double seconds, const std::string& text,
                               const std::string& path) {
  const auto same = std::find_if(inputs_.begin(), inputs_.end(), [&](const auto& other) {
    return other.kind == InputKind::kDelayed && other.delayed == node && other.delay == seconds;
  });
  if (same != inputs_.end()) {
    return *used_inputs_.insert(static_cast<int>(same - inputs_.begin())).first;
  }
  CommandInputSettings made;
  made.kind = InputKind::kDelayed;
  made.topic = made.name = text;
  made.owner = name_;
  made.delayed = node;
  made.delay = seconds;
  return *used_inputs_.insert(addTo(inputs_, made, path)).first;
}

int ComponentContext::useInput(const std::string& name, const std::string& path) {
  std::vector<std::string> names;
  for (const auto& input : symbols_.inputs) names.push_back(input.first);
  placeOf(name, names, path, "is not in the list inputs");
  const int index = symbols_.inputs.at(name);
  used_inputs_.insert(index);
  return index;
}

}  // namespace variator_sim
