#include "variator_sim/torques/input_value.h"

#include <algorithm>

namespace variator_sim {
namespace {

/// The message of `error` told of the key at `path`.
SceneError movedTo(const std::string& path, const SceneError& error) {
  const std::string prefix = error.keyPath() + ": ";
  const std::string message = error.what();
  return {path, message.rfind(prefix, 0) == 0 ? message.substr(prefix.size()) : message};
}

}  // namespace

InputValue InputValue::read(ComponentContext& context, const std::string& key, Range range) {
  ParameterReader& parameters = context.parameters();
  const ParameterTree* tree = parameters.raw(key);
  switch (tree == nullptr ? ParameterTree::Kind::kNothing : tree->kind()) {
    case ParameterTree::Kind::kInteger:
    case ParameterTree::Kind::kReal:
    case ParameterTree::Kind::kText:
      return InputValue(parameters.number(key, range));
    case ParameterTree::Kind::kDictionary:
      break;
    default:
      throw SceneError(
          parameters.keyPath(key),
          (tree == nullptr ? std::string("missing") : tree->toText() + " is no value of an input") +
              "; expected a number (" + range.toText() +
              ") or the dictionary of a commanded input {topic: ...}");
  }
  ParameterReader section = parameters.section(key);
  section.allow("topic");  // a misspelt topic is told from a missing one
  for (const char* limited : {"min", "max", "initial"}) {
    if (section.has(limited)) section.number(limited, range);
  }
  CommandInputSettings settings = readCommandInput(section, context.name());
  section.finish();
  settings.minimum = std::max(settings.minimum, range.minimum);
  settings.maximum = std::min(settings.maximum, range.maximum);

  InputValue input;
  try {
    input.input_ = context.addInput(settings);
  } catch (const SceneError& error) {
    // The context takes the topic for a key of the component itself.
    throw movedTo(section.keyPath("topic"), error);
  }
  return input;
}

InputValue InputValue::read(ComponentContext& context, const std::string& key, Range range,
                            double default_value) {
  context.parameters().allow(key);
  return context.parameters().has(key) ? read(context, key, range) : InputValue(default_value);
}

}  // namespace variator_sim
