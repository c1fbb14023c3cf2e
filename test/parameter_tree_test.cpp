// The tree, its reader and the search for the nearest name.
#include "variator_sim/parameter_tree.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "support/faults.h"

namespace variator_sim {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kNan = std::numeric_limits<double>::quiet_NaN();

using Tree = ParameterTree;

TEST(ParameterTree, ShowsValuesAsTheyAreTyped) {
  EXPECT_EQ(Tree().toText(), "~");
  EXPECT_EQ(Tree::boolean(true).toText(), "true");
  EXPECT_EQ(Tree::integer(-7).toText(), "-7");
  EXPECT_EQ(Tree::real(0.1).toText(), "0.1");
  EXPECT_EQ(Tree::real(1.0).toText(), "1.0");
  EXPECT_EQ(Tree::real(1e300).toText(), "1.0e+300");
  EXPECT_EQ(Tree::real(1.0 / 3.0).toText(), "0.3333333333333333");
  EXPECT_EQ(Tree::real(-kInfinity).toText(), "-.inf");
  EXPECT_EQ(Tree::real(kNan).toText(), ".nan");
  EXPECT_EQ(Tree::text("rk4").toText(), "rk4");
  EXPECT_EQ(Tree::text("variator_sim/CommandedTorque").toText(), "variator_sim/CommandedTorque");
  EXPECT_EQ(Tree::text("").toText(), "''");
  EXPECT_EQ(Tree::text("1e-9").toText(), "'1e-9'");
  EXPECT_EQ(Tree::text("yes").toText(), "'yes'");
  EXPECT_EQ(Tree::text("it's").toText(), "'it''s'");
  EXPECT_EQ(Tree::text("a\nb\x01").toText(), "\"a\\nb\\x01\"");
  EXPECT_EQ(Tree::list({Tree::integer(1), Tree::list(), Tree::text("a")}).toText(), "[1, [], a]");
  EXPECT_EQ(Tree::dictionary({{"b", Tree::real(2.5)}, {"a", Tree()}}).toText(), "{a: ~, b: 2.5}");
}

TEST(ParameterTree, CutsLongTextsBetweenCharacters) {
  const std::string text = Tree::list(Tree::List(1000, Tree::integer(1))).toText();
  EXPECT_LE(text.size(), kLongestQuote);
  EXPECT_EQ(text.substr(text.size() - 3), "...");
  for (std::size_t shift = 0; shift < 2; ++shift) {
    std::string greek(shift, 'a');
    for (int i = 0; i < 100; ++i) greek += "\xcf\x89";
    const std::string cut = Tree::text(greek).toText();
    EXPECT_EQ(static_cast<unsigned char>(cut[cut.size() - 4]), 0x89U) << cut;
  }
}

TEST(ParameterTree, DescribesItsKind) {
  EXPECT_EQ(Tree().describeKind(), "nothing");
  EXPECT_EQ(Tree::boolean(true).describeKind(), "a boolean");
  EXPECT_EQ(Tree::integer(1).describeKind(), "an integer");
  EXPECT_EQ(Tree::real(1.0).describeKind(), "a number");
  EXPECT_EQ(Tree::text("a").describeKind(), "a text");
  EXPECT_EQ(Tree::list().describeKind(), "a list");
  EXPECT_EQ(Tree::dictionary().describeKind(), "a dictionary");
}

TEST(Range, ContainsItsEndsAsDeclared) {
  EXPECT_FALSE(Range::positive().contains(0.0));
  EXPECT_TRUE(Range::positive().contains(1e-300));
  EXPECT_TRUE(Range::notNegative().contains(0.0));
  EXPECT_FALSE(Range::notNegative().contains(-1e-300));
  EXPECT_TRUE(Range::atLeast(2.0).contains(2.0));
  EXPECT_FALSE(Range::atLeast(2.0).contains(1.9));
  EXPECT_TRUE(Range::between(0.0, 1.0).contains(1.0));
  EXPECT_FALSE(Range::between(0.0, 1.0).contains(1.1));
  const Range open{0.0, 1.0, true, false};
  EXPECT_FALSE(open.contains(1.0));
  EXPECT_FALSE(Range::any().contains(kNan));
}

TEST(Range, SaysWhatItAllows) {
  EXPECT_EQ(Range::any().toText(), "any finite number");
  EXPECT_EQ(Range::positive().toText(), "> 0");
  EXPECT_EQ(Range::notNegative().toText(), ">= 0");
  EXPECT_EQ(Range::between(0.0, 1.0).toText(), "from 0 to 1");
  EXPECT_EQ((Range{0.0, 0.1, false, true}).toText(), "> 0 and <= 0.1");
  EXPECT_EQ((Range{-kInfinity, 3.0, true, false}).toText(), "< 3");
}

struct NumberCase {
  const char* text;
  double value;  // NaN: refused
};

TEST(ParameterReader, TakesTextsThatAreNumbers) {
  for (const NumberCase& number :
       {NumberCase{"1e-9", 1e-9},   NumberCase{"2", 2.0},         NumberCase{"-.5", -0.5},
        NumberCase{"+3.", 3.0},     NumberCase{"1.5E+3", 1500.0}, NumberCase{"", kNan},
        NumberCase{"1 ", kNan},     NumberCase{" 1", kNan},       NumberCase{"1,5", kNan},
        NumberCase{"1e", kNan},     NumberCase{"0x10", kNan},     NumberCase{"+-1", kNan},
        NumberCase{"++1", kNan},    NumberCase{"+", kNan},        NumberCase{"inf", kNan},
        NumberCase{"-inf", kNan},   NumberCase{"nan", kNan},      NumberCase{"1e400", kNan},
        NumberCase{"1e-400", kNan}, NumberCase{"1.0.0", kNan},    NumberCase{"one", kNan}}) {
    const Tree tree = Tree::text(number.text);
    if (std::isnan(number.value)) {
      EXPECT_THROW(ParameterReader::toNumber(tree, "a"), SceneError) << number.text;
    } else {
      EXPECT_EQ(ParameterReader::toNumber(tree, "a"), number.value) << number.text;
    }
  }
}

TEST(ParameterReader, ReadsEveryKindOfValue) {
  const Tree tree = Tree::dictionary(
      {{"integer", Tree::integer(3)},
       {"real", Tree::real(2.5)},
       {"whole", Tree::real(4.0)},
       {"text_number", Tree::text("1e-9")},
       {"flag", Tree::boolean(true)},
       {"word", Tree::text("rk4")},
       {"list", Tree::list({Tree::integer(1), Tree::text("2"), Tree::real(3.0)})},
       {"names", Tree::list({Tree::text("a"), Tree::text("b")})},
       {"nothing", Tree()},
       {"section", Tree::dictionary({{"x", Tree::integer(1)}, {"y", Tree::text("2.5")}})}});
  ParameterReader reader(tree, "");
  EXPECT_EQ(reader.number("integer"), 3.0);
  EXPECT_EQ(reader.number("real", Range::positive(), 9.0), 2.5);
  EXPECT_EQ(reader.number("absent", Range::positive(), 9.0), 9.0);
  EXPECT_EQ(reader.number("text_number"), 1e-9);
  EXPECT_EQ(reader.integer("integer", 0, 5), 3);
  EXPECT_EQ(reader.integer("whole", 0, 5), 4);
  EXPECT_EQ(reader.integer("absent", 0, 5, 2), 2);
  EXPECT_TRUE(reader.boolean("flag", false));
  EXPECT_TRUE(reader.boolean("absent", true));
  EXPECT_EQ(reader.text("word"), "rk4");
  EXPECT_EQ(reader.text("absent", "x"), "x");
  EXPECT_EQ(reader.formula("word"), "rk4");
  EXPECT_EQ(reader.formula("integer"), "3");
  EXPECT_EQ(reader.formula("real"), "2.5");
  EXPECT_EQ(reader.choice("word", {"auto", "rk4"}), "rk4");
  EXPECT_EQ(reader.choice("absent", {"auto", "rk4"}, "auto"), "auto");
  EXPECT_EQ(reader.numbers("list", 3), (std::vector<double>{1.0, 2.0, 3.0}));
  EXPECT_EQ(reader.names("names"), (std::vector<std::string>{"a", "b"}));
  EXPECT_TRUE(reader.names("absent").empty());
  EXPECT_TRUE(reader.names("nothing").empty());
  EXPECT_EQ(reader.numberDictionary("section"),
            (std::map<std::string, double>{{"x", 1.0}, {"y", 2.5}}));
  EXPECT_TRUE(reader.numberDictionary("absent").empty());
  EXPECT_TRUE(reader.numberDictionary("nothing").empty());
  EXPECT_NO_THROW(reader.section("nothing").finish());
  EXPECT_EQ(reader.raw("absent"), nullptr);
  ASSERT_NE(reader.raw("flag"), nullptr);
  EXPECT_NO_THROW(reader.finish());

  const Tree third = Tree::dictionary({{"f", Tree::real(1.0 / 3.0)}});
  EXPECT_EQ(std::stod(ParameterReader(third, "").formula("f")), 1.0 / 3.0);
}

struct Failure {
  std::function<void(ParameterReader&)> read;
  const char* message;
};

TEST(ParameterReader, NamesPathValueAndWhatIsAllowed) {
  const Tree tree = Tree::dictionary({{"word", Tree::text("rk5")},
                                      {"negative", Tree::real(-1.0)},
                                      {"half", Tree::real(2.5)},
                                      {"huge", Tree::integer(3000000000)},
                                      {"infinite", Tree::real(kInfinity)},
                                      {"flag", Tree::boolean(true)},
                                      {"nothing", Tree()},
                                      {"list", Tree::list({Tree::integer(1), Tree::boolean(true)})},
                                      {"mixed", Tree::list({Tree::text("a"), Tree::integer(1)})},
                                      {"section", Tree::dictionary({{"x", Tree::text("much")}})}});
  const std::vector<Failure> failures{
      {[](ParameterReader& r) { r.number("nmber"); }, "a/b/nmber: missing; expected a number"},
      {[](ParameterReader& r) { r.number("wrd", Range::positive()); },
       "a/b/wrd: missing; expected a number > 0 (is 'word' meant for 'wrd'?)"},
      {[](ParameterReader& r) { r.number("word"); },
       "a/b/word: expected a finite number, got a text: rk5"},
      {[](ParameterReader& r) { r.number("word", Range::positive()); },
       "a/b/word: expected a number > 0, got a text: rk5"},
      {[](ParameterReader& r) { r.number("negative", Range::positive(), 1.0); },
       "a/b/negative: -1.0 is out of range; allowed: a number > 0"},
      {[](ParameterReader& r) { r.number("infinite"); },
       "a/b/infinite: .inf is not a finite number; allowed: a finite number"},
      {[](ParameterReader& r) { r.number("flag"); },
       "a/b/flag: expected a finite number, got a boolean: true"},
      {[](ParameterReader& r) { r.number("nothing", Range::any(), 1.0); },
       "a/b/nothing: expected a finite number, got nothing"},
      {[](ParameterReader& r) { r.integer("half", 0, 5); },
       "a/b/half: 2.5 is not an integer; allowed: an integer from 0 to 5"},
      {[](ParameterReader& r) { r.integer("huge", 0, 5, 1); },
       "a/b/huge: 3000000000 is out of range; allowed: an integer from 0 to 5"},
      {[](ParameterReader& r) { r.integer("flag", 0, 5); },
       "a/b/flag: expected an integer from 0 to 5, got a boolean: true"},
      {[](ParameterReader& r) { r.boolean("word", false); },
       "a/b/word: expected true or false, got a text: rk5"},
      {[](ParameterReader& r) { r.text("flag"); },
       "a/b/flag: expected a text, got a boolean: true"},
      {[](ParameterReader& r) { r.formula("flag"); },
       "a/b/flag: expected a formula (a text or a number), got a boolean: true"},
      {[](ParameterReader& r) { r.formula("infinite"); },
       "a/b/infinite: .inf is not a finite number; allowed: a finite number"},
      {[](ParameterReader& r) {
         r.choice("word", {"auto", "rk4"});
       },
       "a/b/word: 'rk5' is not allowed (did you mean 'rk4'?); allowed: auto, rk4"},
      {[](ParameterReader& r) {
         r.choice("flag", {"auto", "rk4"}, "rk4");
       },
       "a/b/flag: expected one of auto, rk4, got a boolean: true"},
      {[](ParameterReader& r) { r.numbers("list", 3); },
       "a/b/list: expected a list of 3 numbers, got 2: [1, true]"},
      {[](ParameterReader& r) { r.numbers("list", 2); },
       "a/b/list[1]: expected a finite number, got a boolean: true"},
      {[](ParameterReader& r) { r.numbers("word", 1); },
       "a/b/word: expected a list of 1 number, got a text: rk5"},
      {[](ParameterReader& r) { r.names("word"); },
       "a/b/word: expected a list of names, got a text: rk5"},
      {[](ParameterReader& r) { r.names("mixed"); },
       "a/b/mixed[1]: expected a text, got an integer: 1"},
      {[](ParameterReader& r) { r.numberDictionary("word"); },
       "a/b/word: expected a dictionary of numbers, got a text: rk5"},
      {[](ParameterReader& r) { r.numberDictionary("section"); },
       "a/b/section/x: expected a finite number, got a text: much"},
      {[](ParameterReader& r) { r.section("word"); },
       "a/b/word: expected a dictionary, got a text: rk5"},
      {[](ParameterReader& r) { r.section("section").number("x"); },
       "a/b/section/x: expected a finite number, got a text: much"},
  };
  for (const Failure& failure : failures) {
    ParameterReader reader(tree, "a/b");
    try {
      failure.read(reader);
      ADD_FAILURE() << "accepted: " << failure.message;
    } catch (const SceneError& error) {
      EXPECT_STREQ(error.what(), failure.message);
      EXPECT_EQ(std::string(error.what()).rfind(error.keyPath() + ": ", 0), 0U);
    }
  }
}

TEST(ParameterReader, RefusesKeysThatAreNotRead) {
  const Tree tree = Tree::dictionary({{"steper", Tree::text("rk4")}, {"step", Tree::real(0.1)}});
  ParameterReader reader(tree, "solver");
  reader.number("step");
  reader.choice("stepper", {"rk4"}, "rk4");
  test::expectRefused(
      "solver/steper",
      {"solver/steper: unknown key (did you mean 'stepper'?); allowed: step, stepper"},
      [&] { reader.finish(); });
  reader.allow("steper");
  EXPECT_NO_THROW(reader.finish());
}

TEST(ParameterReader, NeedsADictionary) {
  const Tree tree = Tree::integer(1);
  EXPECT_THROW(ParameterReader(tree, "a"), SceneError);
}

struct Names {
  const char* name;
  const char* nearest;
};

TEST(NearestName, FindsSlipsAndNothingElse) {
  const std::vector<std::string> candidates{"stepper",
                                            "step",
                                            "relative_tolerance",
                                            "K",
                                            "w1",
                                            "variator_sim/ExpressionTorque",
                                            "variator_sim/CommandedTorque"};
  for (const Names& names :
       {Names{"steper", "stepper"}, Names{"setp", "step"}, Names{"Stepper", "stepper"},
        Names{"STEP", "step"}, Names{"relative_tolerence", "relative_tolerance"}, Names{"k", "K"},
        Names{"w2", "w1"}, Names{"ExpressionTorque", "variator_sim/ExpressionTorque"},
        Names{"ExpresionTorque", "variator_sim/ExpressionTorque"},
        Names{"variator_sim/CommandTorque", "variator_sim/CommandedTorque"}, Names{"x", ""},
        Names{"", ""}, Names{"inertia", ""}, Names{"tolerance", ""}}) {
    EXPECT_EQ(findNearestName(names.name, candidates), names.nearest) << names.name;
  }
  EXPECT_EQ(findNearestName("a", {}), "");
  EXPECT_EQ(findNearestName("drivee", {"driver", "drive"}), "driver") << "first of equals";
  EXPECT_EQ(findNearestName("Load", {"road", "load"}), "load") << "letter case costs less";
}

TEST(NearestName, WritesSuggestionsAndLists) {
  EXPECT_EQ(suggestName("steper", {"stepper"}), " (did you mean 'stepper'?)");
  EXPECT_EQ(suggestName("other", {"stepper"}), "");
  EXPECT_EQ(joinNames({"a", "b", "c"}), "a, b, c");
  EXPECT_EQ(joinNames({}), "");
}

}  // namespace
}  // namespace variator_sim
