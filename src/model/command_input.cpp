#include "variator_sim/command_input.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "expression/characters.h"
#include "expression/series_dot.h"
#include "variator_sim/types.h"

namespace variator_sim {
namespace {

// As they are enumerated.
const Choices<Hold> kHolds{{"zero_order", Hold::kZeroOrder},
                           {"first_order_lag", Hold::kFirstOrderLag},
                           {"rate_limit", Hold::kRateLimit},
                           {"first_order_hold", Hold::kFirstOrderHold},
                           {"second_order_lag", Hold::kSecondOrderLag}};
/// The key that only each and few other holds read, or "".
constexpr const char* kOwnKeys[] = {"", "time_constant", "rate", "period", "time_constant"};

std::string ownKeyOf(Hold hold) {
  return kOwnKeys[static_cast<std::size_t>(hold)];
}

// NOLINTBEGIN: a text of the runtime
using scene_signal = CommandSignal::Closed;
using namespace expression::plain;
using expression::VS_STRIDE;
#include "runtime/signals.h"
// NOLINTEND

/// True for a relative graph name: letters, digits and underscores, joined by single slashes.
bool isRelativeTopic(const std::string& topic) {
  for (const std::string& part : splitAt(topic, '/')) {
    if (part.empty() || part != toIdentifier(part)) return false;
  }
  return expression::isNameStart(topic.front()) && topic.front() != '_';
}

std::string readTopic(ParameterReader& reader) {
  std::string topic = reader.text("topic");
  if (!isRelativeTopic(topic)) {
    throw reader.error(
        "topic", inQuotes(topic) +
                     " is not a relative topic name; allowed: letters, digits, '_' and single "
                     "'/' between parts, starting with a letter (no leading '/' or '~': topics "
                     "are private to the node)");
  }
  return topic;
}

Hold readHold(ParameterReader& reader) {
  const Hold hold = reader.choice("hold", kHolds, "zero_order");
  for (const std::string key : {"time_constant", "rate", "period"}) {
    if (key == ownKeyOf(hold) || !reader.has(key)) continue;
    std::string holds;
    for (const auto& [name, other] : kHolds) {
      if (ownKeyOf(other) == key) holds += (holds.empty() ? "" : " or ") + inQuotes(name);
    }
    throw reader.error(key, "belongs to hold " + holds + ", but this input's hold is " +
                                inQuotes(toString(hold)) +
                                ": leave it out there, or choose such a hold");
  }
  return hold;
}

}  // namespace

const char* toString(Hold hold) {
  return kHolds[static_cast<std::size_t>(hold)].first;
}

int findInput(const std::vector<CommandInputSettings>& inputs, const std::string& topic) {
  std::vector<std::string> topics;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i].kind != InputKind::kCommanded) continue;
    if (inputs[i].topic == topic) return static_cast<int>(i);
    topics.push_back(inputs[i].topic);
  }
  throw std::invalid_argument("unknown topic " + inQuotes(topic) + suggestName(topic, topics) +
                              "; " +
                              (topics.empty() ? "this scene takes no commands"
                                              : "the scene's topics are " + joinNames(topics)));
}

int addTo(std::vector<CommandInputSettings>& inputs, const CommandInputSettings& input,
          const std::string& path) {
  if (inputs.size() >= static_cast<std::size_t>(kMaxInputs)) {
    throw SceneError(path, inQuotes(input.name) +
                               " is one input, variable, state or delay too many; allowed: " +
                               std::to_string(kMaxInputs) + " in one scene");
  }
  inputs.push_back(input);
  return static_cast<int>(inputs.size()) - 1;
}

std::string describeClamped(const CommandInputSettings& settings, double command) {
  const bool is_above = command > settings.maximum;
  const std::string limit = formatNumber(is_above ? settings.maximum : settings.minimum);
  return "the command " + formatNumber(command) + " on " + inQuotes(settings.topic) +
         (is_above ? " is above the input's maximum, " : " is below the input's minimum, ") +
         limit + ": " + limit + " acts (told once; all are counted as clamped)";
}

CommandInputSettings readCommandInput(ParameterReader& reader, const std::string& owner,
                                      const Range& allowed) {
  // All keys are known from the start, so that a missing one can be told from a misspelt one.
  reader.allow({"topic", "hold", "time_constant", "rate", "period", "initial", "min", "max",
                "timeout", "on_timeout"});
  const std::string& unit = allowed.unit;
  CommandInputSettings settings;
  settings.owner = owner;
  settings.topic = readTopic(reader);
  settings.name = settings.topic;
  settings.topic_path = reader.keyPath("topic");

  settings.hold = readHold(reader);
  if (settings.hold != Hold::kZeroOrder) {
    const std::string of_rate = unit.empty() ? "" : unit + "/s";
    settings.hold_parameter =
        reader.number(ownKeyOf(settings.hold),
                      Range::positive(settings.hold == Hold::kRateLimit ? of_rate : "s"));
  }

  // Absent limits are infinite; written ones must be finite.
  Range limits;
  if (reader.has("min")) limits.minimum = reader.number("min", allowed);
  if (reader.has("max")) {
    reader.number("max", allowed);
    limits.maximum = reader.number("max", Range::atLeast(limits.minimum, unit));
  }
  settings.minimum = std::max(limits.minimum, allowed.minimum);
  settings.maximum = std::min(limits.maximum, allowed.maximum);
  settings.initial = reader.number("initial", Range::any(unit), 0.0);
  const auto check = [&](const char* key, double value, const std::string& shown,
                         const char* else_allowed) {
    for (const Range& range : {limits, allowed}) {
      if (range.contains(value)) continue;
      throw reader.error(
          key, shown + (allowed.contains(value) ? " is outside of [min, max]" : " is not allowed") +
                   "; allowed: a number " + range.toText() + else_allowed);
    }
  };
  check("initial", settings.initial,
        formatNumber(settings.initial) + (reader.has("initial") ? "" : " (the default)"), "");

  settings.timeout = reader.number("timeout", Range::notNegative("s"), 0.0);
  settings.on_timeout = reader.choice<OnTimeout>(
      "on_timeout", {{"hold", OnTimeout::kHold}, {"zero", OnTimeout::kZero}}, "hold");
  if (settings.on_timeout == OnTimeout::kZero) check("on_timeout", 0.0, "'zero'", ", or hold");
  return settings;
}

void CommandSignal::reset(const CommandInputSettings& settings) {
  vs_hold_constant(&it_, settings.initial);
}

bool CommandSignal::command(const CommandInputSettings& settings, double time, double value,
                            double resolution) {
  it_.age += time;
  const double before = at(0.0).value;
  bool jumps =
      vs_command_signal(&it_, static_cast<int>(settings.hold), settings.hold_parameter, value) != 0;
  if (it_.form != Closed::kConstant && !(time + it_.end > time && it_.end > resolution)) {
    // The remainder of a ramp shorter than the resolution of time.
    finishSegment();
    jumps = value != before;
  }
  it_.age = -time;
  return jumps;
}

CommandSignal::Moment CommandSignal::at(double time) const {
  Closed aged = it_;
  // (Rounding may leave the age at the end short of it.)
  aged.age = time < segmentEnd() ? it_.age + time : it_.end;
  double u[3];
  vs_expand_input(&aged, 1.0, 2, u);
  return {u[0], u[1], aged.form == Closed::kCritical ? 2.0 * u[2] : 0.0};
}

ParameterTree CommandSignal::toTree() const {
  ParameterTree::Dictionary tree{{"value", ParameterTree::real(it_.start)}};
  if (it_.form != Closed::kConstant) {
    tree["since"] = ParameterTree::real(-it_.age);
    tree["target"] = ParameterTree::real(it_.target);
    tree["until"] = ParameterTree::real(segmentEnd());
  }
  if (it_.form == Closed::kCritical) tree["linear"] = ParameterTree::real(it_.linear);
  return ParameterTree::dictionary(std::move(tree));
}

CommandSignal CommandSignal::fromTree(ParameterReader& reader,
                                      const CommandInputSettings& settings) {
  CommandSignal signal;
  Closed& it = signal.it_;
  const Range limits = Range::between(settings.minimum, settings.maximum);
  const bool is_moving = settings.hold != Hold::kZeroOrder && reader.has("target");
  it.start = reader.number("value", is_moving ? Range::any() : limits);
  it.target = it.start;
  if (!is_moving) return signal;
  it.target = reader.number("target", limits);
  Range past;
  past.maximum = 0.0;
  const double since = reader.number("since", past);
  const double until = reader.number("until", Range::atLeast(since));
  vs_set_form(&it, static_cast<int>(settings.hold), settings.hold_parameter);
  it.age = -since;
  if (it.form == Closed::kCritical) it.linear = reader.number("linear");
  // Saved times are a few roundings off. A value that arrives at another time than 'until' would
  // stand still while its rate does not.
  const double rounding = 1e-9 * (it.end + std::abs(since));
  if (!(it.end > 0.0) || !std::isfinite(it.target - it.start) ||
      !(std::abs(until - signal.segmentEnd()) <= rounding)) {
    throw reader.error(
        "until", formatNumber(until) +
                     " s contradicts 'value', 'target' and 'since': by this input's hold (" +
                     toString(settings.hold) + ") the way from " + formatNumber(it.start) + " to " +
                     formatNumber(it.target) + " ends at " + formatNumber(signal.segmentEnd()) +
                     " s; allowed: that time, or 'value' alone for an input that stands still");
  }
  return signal;
}

void CommandSignal::finishSegment() {
  vs_hold_constant(&it_, it_.target);
}

}  // namespace variator_sim
