// Every key of every scene, with every fault: refused with a message that names it, or run.

#include <ctime>
#include <filesystem>
#include <set>

#include "support/scenes.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

using Tree = ParameterTree;

/// The keys that are known while `tree` is read, as paths.
std::set<std::string> keysOf(const Tree& tree) {
  std::set<std::string> paths;
  BuiltinComponentFactory factory;
  ParameterReader::noteKeys(&paths);
  const Scene scene = readScene(tree, factory, {});
  ParameterReader::noteKeys(nullptr);
  return paths;
}

/// "b/inertia/harmonics[0]/order" as its steps, an index as "0".
std::vector<std::string> stepsOf(const std::string& path) {
  std::vector<std::string> steps(1);
  for (const char c : path) {
    if (c == '/' || c == '[') {
      steps.emplace_back();
    } else if (c != ']') {
      steps.back() += c;
    }
  }
  return steps;
}

/// Returns the dictionary that holds the last key of `path`, or nullptr.
Tree* holderOf(Tree& tree, const std::vector<std::string>& steps) {
  Tree* here = &tree;
  for (std::size_t i = 0; i + 1 < steps.size(); ++i) {
    if (here->kind() == Tree::Kind::kList) {
      here = &here->asList().at(static_cast<std::size_t>(std::stoi(steps[i])));
      continue;
    }
    const auto found = here->asDictionary().find(steps[i]);
    if (found == here->asDictionary().end()) return nullptr;
    here = &found->second;
  }
  return here->kind() == Tree::Kind::kDictionary ? here : nullptr;
}

Tree nested(int depth) {
  Tree tree = Tree::list({Tree::real(1.0)});
  for (int i = 0; i < depth; ++i) tree = Tree::list({tree});
  return tree;
}

const std::string& longText() {
  static const std::string text(2000000, 'x');
  return text;
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Values that stand in the place of what is right.
const std::vector<std::pair<const char*, Tree>>& faultyValues() {
  static const std::vector<std::pair<const char*, Tree>> values{
      {"nothing", Tree()},
      {"true", Tree::boolean(true)},
      {"0", Tree::integer(0)},
      {"-1", Tree::integer(-1)},
      {"largest integer", Tree::integer(std::numeric_limits<std::int64_t>::max())},
      {"NaN", Tree::real(kNan)},
      {"NaN as a text", Tree::text("nan")},
      {"infinite", Tree::real(kInfinity)},
      {"-infinite", Tree::real(-kInfinity)},
      {"beyond a double", Tree::text("1e999")},
      {"huge", Tree::real(1.7e308)},
      {"-huge", Tree::real(-1.7e308)},
      {"denormal", Tree::real(5e-324)},
      {"empty text", Tree::text("")},
      {"a word", Tree::text("nonsense")},
      {"a formula cut off", Tree::text("w1*(")},
      {"control characters", Tree::text(std::string("\x1b[2J\0\r\x7f\xff", 8))},
      {"2 MB", Tree::text(longText())},
      {"empty list", Tree::list()},
      {"nested list", nested(60)},
      {"long list", Tree::list(Tree::List(10000, Tree::real(1.0)))},
      {"list of lists", Tree::list(Tree::List(3, Tree::list(Tree::List(3, Tree::real(kNan)))))},
      {"empty dictionary", Tree::dictionary()},
      {"dictionary of a stranger", Tree::dictionary({{"stranger", Tree::integer(1)}})},
  };
  return values;
}

/// The type of a key's value, by the key's name; kSeveral: it depends on the place.
enum class Takes { kNumber, kQuantity, kText, kBoolean, kList, kDictionary, kSeveral };

const std::map<std::string, Takes>& table() {
  static const std::map<std::string, Takes> rows = [] {
    const std::pair<const char*, Takes> kinds[] = {
        {"number", Takes::kNumber},   {"quantity", Takes::kQuantity},
        {"text", Takes::kText},       {"boolean", Takes::kBoolean},
        {"list", Takes::kList},       {"dictionary", Takes::kDictionary},
        {"several", Takes::kSeveral},
    };
    const Tree file = readYamlFile(VARIATOR_SIM_TEST_DIR "/key_faults/keys.table");
    std::map<std::string, Takes> keys;
    for (const auto& [name, takes] : kinds) {
      for (const Tree& key : file.asDictionary().at(name).asList()) keys[key.asText()] = takes;
    }
    return keys;
  }();
  return rows;
}

/// Whether `value` can never stand where `takes` is wanted.
bool isRefused(Takes takes, const Tree& value) {
  using Kind = Tree::Kind;
  const Kind kind = value.kind();
  const bool is_number = kind == Kind::kInteger || kind == Kind::kReal;
  const bool is_finite = kind != Kind::kReal || std::isfinite(value.asReal());
  switch (takes) {
    case Takes::kNumber:
      return !is_number || !is_finite;
    case Takes::kQuantity:
      return !is_number || !is_finite;
    case Takes::kText:
      return kind != Kind::kText;
    case Takes::kBoolean:
      return kind != Kind::kBoolean;
    case Takes::kList:
      return kind != Kind::kList && kind != Kind::kNothing;
    case Takes::kDictionary:
      return kind != Kind::kDictionary && kind != Kind::kNothing;
    case Takes::kSeveral:
      return false;
  }
  return false;
}

struct Outcome {
  bool is_refused = false;
  bool is_finite = true;  ///< the motion, as far as it came
  std::string message;
  double seconds = 0.0;
};

Outcome load(const Tree& tree) {
  Outcome outcome;
  const std::clock_t begin = std::clock();
  try {
    BuiltinComponentFactory factory;
    Simulation simulation(readScene(tree, factory, nodeNames()));
    simulation.sample();
    simulation.advanceTo(1e-3);
    const Sample& sample = simulation.sample();
    for (int i = 0; i < simulation.scene().shaftCount(); ++i) {
      outcome.is_finite = outcome.is_finite && std::isfinite(sample.angle[i]) &&
                          std::isfinite(sample.velocity[i]) &&
                          std::isfinite(sample.acceleration[i]);
    }
    outcome.message = simulation.describeStatus();
  } catch (const SceneError& error) {
    outcome.is_refused = true;
    outcome.message = error.what();
  }
  outcome.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return outcome;
}

void expectPresentable(const Outcome& outcome, const std::string& what) {
  EXPECT_LE(outcome.message.size(), kLongestMessage) << what;
  const bool has_control = std::any_of(outcome.message.begin(), outcome.message.end(), [](char c) {
    return (c >= 0 && c < ' ' && c != '\n') || c == 0x7f;
  });
  EXPECT_FALSE(has_control) << what;
  EXPECT_LT(outcome.seconds, 5.0) << what;
}

/// Whether the message tells where to look. (A start that extreme numbers leave without a solution
/// is told as such.)
bool names(const std::string& message, const std::vector<std::string>& steps) {
  if (message.rfind("initial/acceleration: no accelerations", 0) == 0) return true;
  for (const std::string& step : steps) {
    if (message.find(step) != std::string::npos) return true;
  }
  return false;
}

// A sanitizer makes loading twenty times as slow: it sees one input in so many, of every key and of
// every fault some (no number of faults has a divisor in common with it).
#ifdef __SANITIZE_ADDRESS__
constexpr int kShare = 11;
#else
constexpr int kShare = 1;
#endif

class KeyFaults : public testing::TestWithParam<std::string> {
 protected:
  /// Whether the next input is one of those that are tried.
  bool takesTurn() {
    const bool is_tried = turn_++ % kShare == 0;
    tried_ += static_cast<int>(is_tried);
    return is_tried;
  }
  /// Calls `visit(path, steps)` for each key that may stand in the scene.
  void forEachKey(
      const std::function<void(const std::string&, const std::vector<std::string>&)>& visit) {
    tree_ = readYamlFile(GetParam());
    for (const std::string& path : keysOf(tree_)) {
      const std::vector<std::string> steps = stepsOf(path);
      if (holderOf(tree_, steps) != nullptr) visit(path, steps);
    }
  }
  void TearDown() override { RecordProperty("tried", tried_); }
  Tree tree_;

 private:
  int turn_ = 0;
  int tried_ = 0;
};

TEST_P(KeyFaults, TheSceneItselfRuns) {
  const Outcome outcome = load(readYamlFile(GetParam()));
  EXPECT_FALSE(outcome.is_refused) << outcome.message;
}

TEST_P(KeyFaults, EveryKeyHasItsRow) {
  forEachKey([&](const std::string& path, const std::vector<std::string>& steps) {
    const Tree::Dictionary& root = tree_.asDictionary();
    const bool is_name = steps.size() == 1 && root.count(path) != 0 &&
                         root.at(path).kind() == Tree::Kind::kDictionary;
    if (is_name && table().count(path) == 0) return;  // of a shaft, a torque, ...
    EXPECT_EQ(table().count(steps.back()), 1U)
        << path << ": a new key needs its row in test/key_faults/keys.table";
  });
}

TEST_P(KeyFaults, FaultyValuesAreRefusedOrRun) {
  forEachKey([&](const std::string& path, const std::vector<std::string>& steps) {
    for (const auto& [name, value] : faultyValues()) {
      if (!takesTurn()) continue;
      Tree tree = tree_;
      holderOf(tree, steps)->asDictionary()[steps.back()] = value;
      const Outcome outcome = load(tree);
      const std::string what = path + ": " + name + ": " + outcome.message.substr(0, 300);
      expectPresentable(outcome, what);
      const auto row = table().find(steps.back());
      if (row != table().end() && isRefused(row->second, value)) {
        EXPECT_TRUE(outcome.is_refused) << what;
      }
      if (outcome.is_refused) {
        EXPECT_TRUE(names(outcome.message, steps)) << what;
      }
    }
  });
}

/// Calls `visit(path, number)` for each number in `tree`, wherever it stands.
void forEachNumber(Tree& tree, const std::string& path,
                   const std::function<void(const std::string&, Tree&)>& visit) {
  if (tree.kind() == Tree::Kind::kList) {
    for (std::size_t n = 0; n < tree.asList().size(); ++n) {
      forEachNumber(tree.asList()[n], path + "[" + std::to_string(n) + "]", visit);
    }
  } else if (tree.kind() == Tree::Kind::kDictionary) {
    for (auto& [key, value] : tree.asDictionary()) {
      forEachNumber(value, path.empty() ? key : path + "/" + key, visit);
    }
  } else if (tree.kind() == Tree::Kind::kInteger || tree.kind() == Tree::Kind::kReal) {
    visit(path, tree);
  }
}

// Sums and products overflow, or vanish, with them, often where another key is at fault by then.
TEST_P(KeyFaults, NumbersFarFromOneAreNamedOrRun) {
  tree_ = readYamlFile(GetParam());
  std::vector<std::string> paths;
  forEachNumber(tree_, "", [&](const std::string& path, Tree&) { paths.push_back(path); });
  EXPECT_GT(paths.size(), 5U);
  for (const std::string& path : paths) {
    for (const double value : {1.7e308, -1.7e308, 1e300, 1e160, 9e18, 1e-160, 5e-324, -5e-324}) {
      if (!takesTurn()) continue;
      Tree tree = tree_;
      forEachNumber(tree, "", [&](const std::string& here, Tree& number) {
        if (here == path) number = Tree::real(value);
      });
      const Outcome outcome = load(tree);
      const std::string what =
          path + ": " + formatNumber(value) + ": " + outcome.message.substr(0, 400);
      expectPresentable(outcome, what);
      EXPECT_TRUE(outcome.is_finite) << what;
      if (outcome.message.empty()) continue;
      // (Beside another key of the same element the element's name is enough.)
      const std::string element = path.substr(0, path.find_first_of("/["));
      EXPECT_NE(outcome.message.find(element), std::string::npos) << what;
      EXPECT_TRUE(outcome.message.find(formatNumber(value)) != std::string::npos ||
                  outcome.message.find(Tree::real(value).toText()) != std::string::npos)
          << what;
      if (!outcome.is_refused) {
        EXPECT_NE(outcome.message.find(path + " = "), std::string::npos) << what;
      }
    }
  }
}

TEST_P(KeyFaults, MissingAndMisspeltKeys) {
  forEachKey([&](const std::string& path, const std::vector<std::string>& steps) {
    for (const std::string& misspelt :
         {std::string(), steps.back() + "x", "\x1b" + steps.back(), longText()}) {
      Tree tree = tree_;
      Tree::Dictionary& holder = holderOf(tree, steps)->asDictionary();
      const auto found = holder.find(steps.back());
      if (found == holder.end() || !takesTurn()) continue;
      const Tree value = found->second;
      holder.erase(found);
      if (!misspelt.empty()) holder[misspelt] = value;
      const Outcome outcome = load(tree);
      const std::string what =
          path + " as '" + escaped(misspelt) + "': " + outcome.message.substr(0, 300);
      expectPresentable(outcome, what);
      const bool is_free = steps.size() > 1 && steps[steps.size() - 2] == "parameters";
      if (!misspelt.empty() && !is_free) {
        EXPECT_TRUE(outcome.is_refused) << what;
      }
      if (outcome.is_refused && misspelt.size() < 100) {
        EXPECT_TRUE(names(outcome.message, steps)) << what;
      }
    }
  });
}

std::vector<std::string> allScenes() {
  std::vector<std::string> paths;
  for (const auto& file :
       std::filesystem::directory_iterator(VARIATOR_SIM_TEST_DIR "/key_faults")) {
    if (file.path().extension() == ".yaml") paths.push_back(file.path().string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

INSTANTIATE_TEST_SUITE_P(AllScenes, KeyFaults, testing::ValuesIn(allScenes()),
                         [](const auto& path) {
                           return std::filesystem::path(path.param).stem().string();
                         });

}  // namespace
}  // namespace variator_sim
