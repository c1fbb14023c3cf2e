#include "variator_sim/constraints/time_value.h"

#include <algorithm>

namespace variator_sim {
namespace {

CommandInputSettings readInput(ParameterReader& section, const std::string& owner, Range range,
                               TimeValue::Need need) {
  for (const char* limited : {"min", "max", "initial"}) {
    if (section.has(limited)) section.number(limited, range);
  }
  CommandInputSettings settings = readCommandInput(section, owner);
  if (need == TimeValue::Need::kTwice && settings.hold != Hold::kSecondOrderLag) {
    throw SceneError(section.keyPath("hold"),
                     "a constraint of order 1 takes an input with two derivatives only: a jump of "
                     "the value or of its rate would need an impulse; allowed: second_order_lag");
  }
  if (!range.contains(settings.initial)) {
    throw SceneError(section.keyPath("initial"),
                     ParameterTree::real(settings.initial).toText() +
                         (section.has("initial") ? "" : " (the default)") +
                         " is not allowed; allowed: a number " + range.toText());
  }
  if (settings.on_timeout == OnTimeout::kZero && !range.contains(0.0)) {
    throw SceneError(section.keyPath("on_timeout"),
                     "'zero' would leave the range of the value, a number " + range.toText() +
                         "; allowed: hold");
  }
  settings.minimum = std::max(settings.minimum, range.minimum);
  settings.maximum = std::min(settings.maximum, range.maximum);
  return settings;
}

}  // namespace

TimeValue TimeValue::read(ComponentContext& context, const std::string& key, Range range, Need need,
                          int slot) {
  ParameterReader& parameters = context.parameters();
  const ParameterTree* tree = parameters.raw(key);
  if (tree == nullptr || tree->kind() != ParameterTree::Kind::kDictionary) {
    const ParameterTree::Kind kind = tree == nullptr ? ParameterTree::Kind::kNothing : tree->kind();
    if (kind == ParameterTree::Kind::kInteger || kind == ParameterTree::Kind::kReal ||
        kind == ParameterTree::Kind::kText) {
      return TimeValue(parameters.number(key, range));
    }
    throw SceneError(parameters.keyPath(key),
                     (tree == nullptr ? std::string("missing") : tree->toText() + " is no value") +
                         "; expected a number (" + range.toText() +
                         "), a table over time {times: [...], values: [...]} or a commanded input "
                         "{topic: ...}");
  }
  TimeValue value;
  value.slot_ = slot;
  ParameterReader section = parameters.section(key);
  if (section.has("times") || section.has("values")) {
    value.form_ = Form::kTable;
    value.table_ =
        Table::read(section, {"times", Range::any()}, {"values", range}, Table::Beyond::kConstant);
    section.finish();
    return value;
  }
  value.form_ = Form::kCommanded;
  for (const char* known : {"times", "values", "topic"}) section.allow(known);
  const CommandInputSettings settings = readInput(section, context.name(), range, need);
  section.finish();
  try {
    value.input_ = context.addInput(settings);
  } catch (const SceneError& error) {
    // The context takes the topic for a key of the constraint itself.
    const std::string prefix = error.keyPath() + ": ";
    const std::string message = error.what();
    throw SceneError(section.keyPath("topic"),
                     message.rfind(prefix, 0) == 0 ? message.substr(prefix.size()) : message);
  }
  return value;
}

TimeValue TimeValue::read(ComponentContext& context, const std::string& key, Range range, Need need,
                          int slot, double default_value) {
  context.parameters().allow(key);
  return context.parameters().has(key) ? read(context, key, range, need, slot)
                                       : TimeValue(default_value);
}

}  // namespace variator_sim
