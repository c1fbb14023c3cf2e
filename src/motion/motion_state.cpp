#include "variator_sim/motion_state.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/scene.h"

namespace variator_sim {
namespace {

constexpr int kVersion = 1;

ParameterTree listOf(const double* values, int count) {
  ParameterTree::List list;
  for (int i = 0; i < count; ++i) list.push_back(ParameterTree::real(values[i]));
  return ParameterTree::list(std::move(list));
}

template <class Values, class Make>
ParameterTree listOf(const Values& values, Make make) {
  ParameterTree::List list;
  for (const auto& value : values) list.push_back(make(value));
  return ParameterTree::list(std::move(list));
}

/// Reads the pieces of the past of each delayed formula.
void readPast(ParameterReader& reader, const Scene& scene, MotionState::History* history) {
  reader.allow("past");
  if (scene.firstDelay() < 0 || !reader.has("past")) return;
  const std::string path = reader.keyPath("past");
  const auto each = [](const ParameterTree& list, const std::string& at, const auto& read) {
    for (std::size_t n = 0; n < list.asList().size(); ++n)
      read(list.asList()[n], elementPath(at, n));
  };
  each(reader.require("past", "a list"), path, [&](const ParameterTree& pieces, const auto& of) {
    history->past.emplace_back();
    each(pieces, of, [&](const ParameterTree& piece, const auto& at) {
      history->past.back().emplace_back();
      each(piece, at, [&](const ParameterTree& value, const auto& number) {
        history->past.back().back().push_back(ParameterReader::toNumber(value, number));
      });
    });
  });
}

void readList(ParameterReader& reader, const std::string& key, int count, double* values) {
  const std::vector<double> list = reader.numbers(key, static_cast<std::size_t>(count));
  std::copy(list.begin(), list.end(), values);
}

ParameterTree toTree(const MotionState::History& history, const Scene& scene) {
  const int S = scene.shaftCount();
  const EnergyAccount& energy = history.energy;
  ParameterTree::Dictionary rows;
  ParameterTree::Dictionary directions;
  for (int m = 0; m < scene.constraintCount(); ++m) {
    const std::string& name = scene.constraints[static_cast<std::size_t>(m)]->name();
    rows[name] = ParameterTree::real(history.longest_row[m]);
    directions[name] = listOf(energy.directions[m], S);
  }
  ParameterTree::Dictionary tree{
      {"start", ParameterTree::boolean(history.is_start)},
      {"implicit_steps", ParameterTree::boolean(history.is_implicit)},
      {"longest_rows", ParameterTree::dictionary(std::move(rows))},
      {"energy", ParameterTree::dictionary(
                     {{"kinetic_at_start", ParameterTree::real(energy.start_kinetic)},
                      {"applied", ParameterTree::real(energy.applied)},
                      {"throughput", ParameterTree::real(energy.throughput)},
                      {"reactions", ParameterTree::real(energy.reactions)},
                      {"doubt_since", ParameterTree::real(energy.doubt_since)},
                      {"has_turned", ParameterTree::boolean(energy.has_turned)},
                      {"directions", ParameterTree::dictionary(std::move(directions))}})}};
  tree["multipliers"] = listOf(history.multiplier, scene.constraintCount());
  tree["kept_reaction"] = listOf(history.kept_reaction, S);
  ParameterTree::Dictionary holding;
  const std::vector<std::string> names = scene.holdNames();
  for (std::size_t h = 0; h < names.size(); ++h) {
    const HeldState& it = history.held[h];
    const std::size_t row = scene.constraints.size() + h;
    const double values[] = {1.0 * it.mode, 1.0 * it.counts,         it.side,
                             it.heat,       history.multiplier[row], history.longest_row[row]};
    holding[names[h]] = listOf(values, 6);
  }
  if (!names.empty()) tree["holding"] = ParameterTree::dictionary(std::move(holding));
  ParameterTree::Dictionary armed;
  for (std::size_t e = 0; e < scene.events.size(); ++e) {
    armed[scene.events[e].name] = ParameterTree::integer(history.armed[e]);
  }
  if (!armed.empty()) tree["events"] = ParameterTree::dictionary(std::move(armed));
  if (!history.past.empty()) {
    tree["past"] = listOf(history.past, [](const auto& pieces) {
      return listOf(pieces, [](const auto& piece) { return listOf(piece, ParameterTree::real); });
    });
  }
  return ParameterTree::dictionary(std::move(tree));
}

EnergyAccount readEnergy(ParameterReader& history, const Scene& scene) {
  EnergyAccount energy;
  ParameterReader reader = history.section("energy");
  energy.start_kinetic = reader.number("kinetic_at_start", Range::notNegative());
  energy.applied = reader.number("applied");
  energy.throughput = reader.number("throughput", Range::notNegative());
  energy.reactions = reader.number("reactions");
  energy.doubt_since = reader.number("doubt_since");
  energy.has_turned = reader.boolean("has_turned", false);
  ParameterReader directions = reader.section("directions");
  for (int m = 0; m < scene.constraintCount(); ++m) {
    readList(directions, scene.constraints[static_cast<std::size_t>(m)]->name(), scene.shaftCount(),
             energy.directions[m]);
  }
  directions.finish();
  reader.finish();
  return energy;
}

void readHolding(ParameterReader& from, const Scene& scene, MotionState::History* history) {
  const std::vector<std::string> names = scene.holdNames();
  if (names.empty()) return;
  ParameterReader reader = from.section("holding");
  HeldState* held = history->held;
  int row = scene.constraintCount();
  for (const std::string& name : names) {
    double values[6];
    readList(reader, name, 6, values);
    const auto mode = static_cast<int>(values[0]);
    if (mode < -3 || mode > 3 || mode == -2 || mode != values[0]) {
      throw SceneError(reader.keyPath(name),
                       "begins with no mode; allowed: -1, 0, 1 or 2, and of losses 3 and -3");
    }
    *held++ = {mode, values[1] != 0.0 ? 1 : 0, values[2], values[3]};
    history->multiplier[row] = values[4];
    history->longest_row[row++] = values[5];
  }
  reader.finish();
}

MotionState::History readHistory(ParameterReader& root, const Scene& scene) {
  MotionState::History history;
  if (!root.has("history")) return history;
  ParameterReader reader = root.section("history");
  history.exists = true;
  history.is_start = reader.boolean("start", false);
  history.is_implicit = reader.boolean("implicit_steps", false);
  ParameterReader rows = reader.section("longest_rows");
  for (int m = 0; m < scene.constraintCount(); ++m) {
    history.longest_row[m] =
        rows.number(scene.constraints[static_cast<std::size_t>(m)]->name(), Range::notNegative());
  }
  rows.finish();
  history.energy = readEnergy(reader, scene);
  readList(reader, "multipliers", scene.constraintCount(), history.multiplier);
  readHolding(reader, scene, &history);
  if (!scene.events.empty()) {
    ParameterReader events = reader.section("events");
    for (std::size_t e = 0; e < scene.events.size(); ++e)
      history.armed[e] = events.integer(scene.events[e].name, -1, 1);
    events.finish();
  }
  readPast(reader, scene, &history);
  readList(reader, "kept_reaction", scene.shaftCount(), history.kept_reaction);
  reader.finish();
  return history;
}

/// Reads the shafts' values; all of them are required if `needs_all`.
void readShafts(ParameterReader& root, const Scene& scene, bool needs_all, MotionState* state) {
  if (!needs_all && !root.has("shafts")) return;
  ParameterReader shafts = root.section("shafts");
  for (const std::string& name : scene.shafts) shafts.allow(name);
  shafts.finish();
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const std::string& name = scene.shafts[static_cast<std::size_t>(i)];
    if (!needs_all && !shafts.has(name)) continue;
    ParameterReader shaft = shafts.section(name);
    const auto read = [&](const char* key, double* value) {
      shaft.allow(key);
      const bool is_there = needs_all || shaft.has(key);
      if (is_there) *value = shaft.number(key);
      return is_there;
    };
    read("angle", &state->angle[i]);
    read("velocity", &state->velocity[i]);
    if (read("acceleration", &state->acceleration[i])) state->is_acceleration_given = true;
    shaft.finish();
  }
}

void readInputs(ParameterReader& root, const Scene& scene, bool needs_all, MotionState* state) {
  const bool has_none =  // (those of delays are in the past)
      std::all_of(scene.inputs.begin(), scene.inputs.end(),
                  [](const auto& it) { return it.kind == InputKind::kDelayed; });
  if (!root.has("inputs") && (has_none || !needs_all)) return;
  ParameterReader inputs = root.section("inputs");
  for (const CommandInputSettings& input : scene.inputs) {
    if (input.kind != InputKind::kDelayed) inputs.allow(input.topic);
  }
  inputs.finish();
  int next = 0;
  for (const CommandInputSettings& settings : scene.inputs) {
    const int i = next++;
    if (settings.kind == InputKind::kDelayed) continue;
    if (!needs_all && !inputs.has(settings.topic)) continue;
    ParameterReader input = inputs.section(settings.topic);
    state->signal[i] = CommandSignal::fromTree(input, settings);
    state->last_command[i] = std::numeric_limits<double>::infinity();
    input.allow("last_command");
    if (input.has("last_command")) {
      state->last_command[i] =
          input.number("last_command", Range::between(state->time - settings.timeout, state->time));
    }
    input.finish();
  }
}

}  // namespace

/// Tells where values of shafts stand in a state: not as in `initial` of a scene.
static void refuseShaftsAtTheRoot(const ParameterTree& tree, const Scene& scene) {
  for (const auto& [key, value] : tree.asDictionary()) {
    const bool is_quantity = key == "angle" || key == "velocity" || key == "acceleration";
    if (!is_quantity && !contains(scene.shafts, key)) continue;
    throw SceneError(key, "stands below 'shafts' and the shaft in a state: shafts: {" +
                              (is_quantity ? scene.shafts.front() : key) + ": {" +
                              (is_quantity ? key : "velocity") + ": 1.5}}");
  }
}

ParameterTree toTree(const MotionState& state, const Scene& scene) {
  ParameterTree::Dictionary shafts;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    shafts[scene.shafts[static_cast<std::size_t>(i)]] =
        ParameterTree::dictionary({{"angle", ParameterTree::real(state.angle[i])},
                                   {"velocity", ParameterTree::real(state.velocity[i])},
                                   {"acceleration", ParameterTree::real(state.acceleration[i])}});
  }
  ParameterTree::Dictionary inputs;
  int next = 0;
  for (const CommandInputSettings& settings : scene.inputs) {
    const int i = next++;
    if (settings.kind == InputKind::kDelayed) continue;
    ParameterTree input = state.signal[i].toTree();
    if (settings.timeout > 0.0 && state.last_command[i] < std::numeric_limits<double>::infinity()) {
      input.asDictionary()["last_command"] = ParameterTree::real(state.last_command[i]);
    }
    inputs[settings.topic] = std::move(input);
  }
  ParameterTree::Dictionary tree{{"variator_sim_state", ParameterTree::integer(kVersion)},
                                 {"time", ParameterTree::real(state.time)},
                                 {"shafts", ParameterTree::dictionary(std::move(shafts))}};
  if (!inputs.empty()) tree["inputs"] = ParameterTree::dictionary(std::move(inputs));
  if (state.history.exists) tree["history"] = toTree(state.history, scene);
  return ParameterTree::dictionary(std::move(tree));
}

MotionState readMotionState(const ParameterTree& tree, const Scene& scene,
                            const MotionState& otherwise) {
  ParameterReader root(tree, "");
  for (const char* key : {"variator_sim_state", "time", "shafts", "inputs", "history"}) {
    root.allow(key);
  }
  refuseShaftsAtTheRoot(tree, scene);
  root.finish();
  const bool needs_all = root.has("history");
  MotionState state = otherwise;
  state.is_acceleration_given = false;
  root.integer("variator_sim_state", kVersion, kVersion, kVersion);
  state.time = needs_all ? root.number("time", Range::notNegative())
                         : root.number("time", Range::notNegative(), otherwise.time);
  // Timeouts move with the time.
  for (double& last : state.last_command) last += state.time - otherwise.time;
  readShafts(root, scene, needs_all, &state);
  readInputs(root, scene, needs_all, &state);
  state.history = readHistory(root, scene);
  return state;
}

}  // namespace variator_sim
