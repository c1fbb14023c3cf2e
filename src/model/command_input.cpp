#include "variator_sim/command_input.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "expression/characters.h"
#include "variator_sim/types.h"

namespace variator_sim {
namespace {

struct HoldName {
  const char* name;
  Hold hold;
  const char* own_key;  ///< the key that only this and few other holds read, or ""
};

constexpr std::array<HoldName, 5> kHolds{
    {{"zero_order", Hold::kZeroOrder, ""},
     {"first_order_lag", Hold::kFirstOrderLag, "time_constant"},
     {"rate_limit", Hold::kRateLimit, "rate"},
     {"first_order_hold", Hold::kFirstOrderHold, "period"},
     {"second_order_lag", Hold::kSecondOrderLag, "time_constant"}}};

/// Time constants after which a lag has arrived: exp(-50) of the way is less than any rounding.
constexpr double kSettled = 50.0;

/// True for a relative graph name: letters, digits and underscores, joined by single slashes.
bool isRelativeTopic(const std::string& topic) {
  using expression::isDigit;
  const auto is_letter = [](char c) { return c != '_' && expression::isNameStart(c); };
  if (topic.empty() || !is_letter(topic.front()) || topic.back() == '/') return false;
  for (std::size_t i = 0; i < topic.size(); ++i) {
    const char c = topic[i];
    if (c == '/' && topic[i - 1] == '/') return false;
    if (!expression::isNameStart(c) && !isDigit(c) && c != '/') return false;
  }
  return true;
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

const HoldName& readHold(ParameterReader& reader) {
  std::vector<std::string> names;
  names.reserve(kHolds.size());
  for (const HoldName& hold : kHolds) names.emplace_back(hold.name);
  const std::string name = reader.choice("hold", names, kHolds[0].name);
  const auto chosen = std::find_if(kHolds.begin(), kHolds.end(),
                                   [&](const HoldName& hold) { return name == hold.name; });
  for (const std::string key : {"time_constant", "rate", "period"}) {
    if (key == chosen->own_key || !reader.has(key)) continue;
    std::string holds;
    for (const HoldName& hold : kHolds) {
      if (hold.own_key != key) continue;
      holds += (holds.empty() ? "" : " or ") + inQuotes(std::string(hold.name));
    }
    throw reader.error(key, "belongs to hold " + holds + ", but this input's hold is " +
                                inQuotes(name) + ": leave it out there, or choose such a hold");
  }
  return *chosen;
}

}  // namespace

const char* toString(Hold hold) {
  const auto it = std::find_if(kHolds.begin(), kHolds.end(),
                               [hold](const HoldName& name) { return name.hold == hold; });
  return it == kHolds.end() ? "" : it->name;
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

  const HoldName& hold = readHold(reader);
  settings.hold = hold.hold;
  switch (hold.hold) {
    case Hold::kZeroOrder:
      break;
    case Hold::kFirstOrderLag:
    case Hold::kSecondOrderLag:
      settings.time_constant = reader.number(hold.own_key, Range::positive("s"));
      break;
    case Hold::kRateLimit:
      settings.rate = reader.number(hold.own_key, Range::positive(unit.empty() ? "" : unit + "/s"));
      break;
    case Hold::kFirstOrderHold:
      settings.period = reader.number(hold.own_key, Range::positive("s"));
      break;
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
  settings.on_timeout = reader.choice("on_timeout", {"hold", "zero"}, "hold") == "zero"
                            ? OnTimeout::kZero
                            : OnTimeout::kHold;
  if (settings.on_timeout == OnTimeout::kZero) check("on_timeout", 0.0, "'zero'", ", or hold");
  return settings;
}

void CommandSignal::reset(const CommandInputSettings& settings) {
  it_ = {};
  it_.start = it_.target = settings.initial;
}

bool CommandSignal::command(const CommandInputSettings& settings, double time, double value,
                            double resolution) {
  const auto [present, present_rate, second_rate] = at(time);
  it_ = {};
  it_.since = time;
  it_.start = present;
  it_.target = value;
  const bool goes_on = settings.hold == Hold::kSecondOrderLag && present_rate != 0.0;
  if (value == present && !goes_on) return false;
  const double duration = setForm(settings);
  if (time + duration > time && duration > resolution) {
    // b = a + tau u' gives the rate at x = 0.
    if (it_.form == Closed::kCritical) {
      it_.linear = present - value + settings.time_constant * present_rate;
    }
    it_.end = time + duration;
    return false;
  }
  // A jump, or the remainder of a ramp shorter than the resolution of time.
  finishSegment();
  return value != present;
}

double CommandSignal::setForm(const CommandInputSettings& settings) {
  const double way = it_.target - it_.start;
  switch (settings.hold) {
    case Hold::kZeroOrder:
      break;
    case Hold::kFirstOrderLag:
    case Hold::kSecondOrderLag:
      it_.form = settings.hold == Hold::kFirstOrderLag ? Closed::kExponential : Closed::kCritical;
      it_.inverse_tau = 1.0 / settings.time_constant;
      return kSettled * settings.time_constant;
    case Hold::kRateLimit:
      it_.form = Closed::kRamp;
      it_.slope = way > 0.0 ? settings.rate : -settings.rate;
      return way / it_.slope;
    case Hold::kFirstOrderHold:
      it_.form = Closed::kRamp;
      it_.slope = way / settings.period;
      return settings.period;
  }
  return 0.0;
}

CommandSignal::Moment CommandSignal::at(double time) const {
  switch (it_.form) {
    case Closed::kConstant:
      break;
    case Closed::kExponential:  // b = 0
    case Closed::kCritical: {
      // u = target + (a + b x) exp(-x), x = (t - start) / tau
      const double x = (time - it_.since) * it_.inverse_tau;
      const double a = it_.start - it_.target;
      const double decay = std::expm1(-x);
      const double factor = 1.0 + decay;
      const double rate = factor * it_.inverse_tau;
      return {it_.start + a * decay + it_.linear * x * factor,
              (it_.linear - a - it_.linear * x) * rate,
              it_.form == Closed::kCritical
                  ? (a - 2.0 * it_.linear + it_.linear * x) * it_.inverse_tau * rate
                  : 0.0};
    }
    case Closed::kRamp: {
      const double rate = time <= it_.end ? it_.slope : 0.0;
      if (time >= it_.end) return {it_.target, rate, 0.0};
      const double u = it_.start + it_.slope * (time - it_.since);
      return {it_.slope > 0.0 ? std::min(u, it_.target) : std::max(u, it_.target), rate, 0.0};
    }
  }
  return {it_.start, 0.0, 0.0};
}

ParameterTree CommandSignal::toTree() const {
  ParameterTree::Dictionary tree{{"value", ParameterTree::real(it_.start)}};
  if (it_.form != Closed::kConstant) {
    tree["since"] = ParameterTree::real(it_.since);
    tree["target"] = ParameterTree::real(it_.target);
    tree["until"] = ParameterTree::real(it_.end);
  }
  if (it_.form == Closed::kCritical) tree["linear"] = ParameterTree::real(it_.linear);
  return ParameterTree::dictionary(std::move(tree));
}

CommandSignal CommandSignal::fromTree(ParameterReader& reader,
                                      const CommandInputSettings& settings) {
  CommandSignal signal;
  const Range limits = Range::between(settings.minimum, settings.maximum);
  const bool is_moving = settings.hold != Hold::kZeroOrder && reader.has("target");
  signal.it_.start = reader.number("value", is_moving ? Range::any() : limits);
  signal.it_.target = signal.it_.start;
  if (!is_moving) return signal;
  signal.it_.target = reader.number("target", limits);
  Range past;
  past.maximum = 0.0;
  signal.it_.since = reader.number("since", past);
  signal.it_.end = reader.number("until", Range::atLeast(signal.it_.since));
  const double way = signal.it_.target - signal.it_.start;
  const double duration = signal.setForm(settings);
  if (signal.it_.form == Closed::kCritical) signal.it_.linear = reader.number("linear");
  // Saved times are a few roundings off. A value that arrives at another time than 'until' would
  // stand still while its rate does not.
  const double end = signal.it_.since + duration;
  const double rounding = 1e-9 * (duration + std::abs(signal.it_.since));
  if (!(duration > 0.0) || !std::isfinite(way) || !(std::abs(signal.it_.end - end) <= rounding)) {
    throw reader.error(
        "until", formatNumber(signal.it_.end) +
                     " s contradicts 'value', 'target' and 'since': by this input's hold (" +
                     toString(settings.hold) + ") the way from " + formatNumber(signal.it_.start) +
                     " to " + formatNumber(signal.it_.target) + " ends at " + formatNumber(end) +
                     " s; allowed: that time, or 'value' alone for an input that stands still");
  }
  return signal;
}

void CommandSignal::moveOrigin(double by) {
  it_.since -= by;
  it_.end -= by;
}

void CommandSignal::finishSegment() {
  it_.form = Closed::kConstant;
  it_.start = it_.target;
  it_.slope = 0.0;
  it_.end = std::numeric_limits<double>::infinity();
}

}  // namespace variator_sim
