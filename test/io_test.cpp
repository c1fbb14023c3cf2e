// YAML and CSV files: what their texts mean and where their faults are.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>

#include "support/faults.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim {
namespace {

/// A file that lives as long as the test.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text)
      : path_(testing::TempDir() + "variator_sim_io_test_" +
              testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::ofstream(path_, std::ios::binary) << text;
  }
  ~TemporaryFile() { std::remove(path_.c_str()); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

struct Scalar {
  const char* yaml;
  const char* kind;
  const char* text;
};

// As PyYAML's safe_load, hence rosparam, has them.
TEST(YamlTree, PlainScalarsMeanWhatTheyMeanToRosparam) {
  for (const Scalar& scalar : {Scalar{"~", "nothing", "~"},
                               Scalar{"", "nothing", "~"},
                               Scalar{"Null", "nothing", "~"},
                               Scalar{"true", "a boolean", "true"},
                               Scalar{"Yes", "a boolean", "true"},
                               Scalar{"on", "a boolean", "true"},
                               Scalar{"FALSE", "a boolean", "false"},
                               Scalar{"no", "a boolean", "false"},
                               Scalar{"Off", "a boolean", "false"},
                               Scalar{"y", "a text", "y"},
                               Scalar{"0", "an integer", "0"},
                               Scalar{"-12", "an integer", "-12"},
                               Scalar{"+1", "an integer", "1"},
                               Scalar{"1_000", "an integer", "1000"},
                               Scalar{"010", "an integer", "8"},
                               Scalar{"08", "a text", "'08'"},
                               Scalar{"0x1F", "an integer", "31"},
                               Scalar{"-0x10", "an integer", "-16"},
                               Scalar{"0b101", "an integer", "5"},
                               Scalar{"1:30", "an integer", "90"},
                               Scalar{"-9223372036854775808", "an integer", "-9223372036854775808"},
                               Scalar{"99999999999999999999", "a number", "1.0e+20"},
                               Scalar{"2.0", "a number", "2.0"},
                               Scalar{"1.", "a number", "1.0"},
                               Scalar{".5", "a number", "0.5"},
                               Scalar{"-.5", "a text", "'-.5'"},
                               Scalar{"1.5e+3", "a number", "1500.0"},
                               Scalar{"1.5e3", "a text", "'1.5e3'"},
                               Scalar{"1e-9", "a text", "'1e-9'"},
                               Scalar{"1:30.5", "a number", "90.5"},
                               Scalar{".inf", "a number", ".inf"},
                               Scalar{"-.Inf", "a number", "-.inf"},
                               Scalar{".nan", "a number", ".nan"},
                               Scalar{"deg(90)", "a text", "deg(90)"},
                               Scalar{"'1'", "a text", "'1'"},
                               Scalar{"\"yes\"", "a text", "'yes'"},
                               Scalar{"''", "a text", "''"},
                               Scalar{"!!str 1", "a text", "'1'"},
                               Scalar{"!!float 1", "a number", "1.0"},
                               Scalar{"!!float 1e3", "a number", "1000.0"},
                               Scalar{"!!int 7", "an integer", "7"},
                               Scalar{"[1, a, {b: 2.5}]", "a list", "[1, a, {b: 2.5}]"}}) {
    const ParameterTree tree = readYamlText(std::string("key: ") + scalar.yaml, "test");
    const ParameterTree& value = tree.asDictionary().at("key");
    EXPECT_EQ(value.describeKind(), scalar.kind) << scalar.yaml;
    EXPECT_EQ(value.toText(), scalar.text) << scalar.yaml;
  }
}

TEST(YamlTree, AnchorsAliasesAndMergeKeysWork) {
  const ParameterTree tree = readYamlText(R"(
base: &base {inertia: 1, cos: 2}
other: &other {cos: 3, sin: 4}
copy: *base
one: {<<: *base, inertia: 5}
two:
  cos: 9
  <<: [*other, *base]
quoted: {'<<': 1}
)",
                                          "test");
  const ParameterTree::Dictionary& root = tree.asDictionary();
  EXPECT_EQ(root.at("copy").toText(), "{cos: 2, inertia: 1}");
  EXPECT_EQ(root.at("one").toText(), "{cos: 2, inertia: 5}");
  EXPECT_EQ(root.at("two").toText(), "{cos: 9, inertia: 1, sin: 4}");
  EXPECT_EQ(root.at("quoted").toText(), "{'<<': 1}");
  EXPECT_EQ(readYamlText("a: &x {b: 1, c: 2}\nd: {<<: [*x, {c: 3, e: 4}]}\n", "test")
                .asDictionary()
                .at("d")
                .toText(),
            "{b: 1, c: 2, e: 4}")
      << "earlier mappings win";
}

std::string bombText() {
  std::string text = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 12; ++i) {
    const std::string name = "a" + std::to_string(i);
    const std::string alias = "*a" + std::to_string(i - 1);
    text += name + ": &" + name + " [" + alias;
    for (int j = 1; j < 10; ++j) text += ", " + alias;
    text += "]\n";
  }
  return text;
}

struct BadYaml {
  std::string text;
  const char* place;  // what the message starts with
  const char* words;
};

TEST(YamlTree, FaultsNameFileLineAndColumn) {
  const std::string deep = "a: " + std::string(100, '[') + std::string(100, ']');
  for (const BadYaml& bad :
       {BadYaml{"a: 1\nb: 2\na: 3\n", "s.yaml:3:1: ", "'a' stands twice"},
        BadYaml{"a:\n  b: {c: 1, c: 2}\n", "s.yaml:2:13: ", "'c' stands twice"},
        BadYaml{"a: [1, 2\nb: 3\n", "s.yaml:", "not valid YAML"},
        BadYaml{"a: 1\n b: 2\n", "s.yaml:2:", "not valid YAML"},
        BadYaml{"a:\n\tb: 2\n", "s.yaml:2:", "line 2 is indented by a tab"},
        BadYaml{"a: *nothing\n", "s.yaml:1:4: ", "not valid YAML"},
        BadYaml{"", "s.yaml:1:1: ", "expected a mapping"},
        BadYaml{"# nothing\n", "s.yaml:", "expected a mapping"},
        BadYaml{"- 1\n- 2\n", "s.yaml:1:1: ", "got a list: [1, 2]"},
        BadYaml{"text\n", "s.yaml:1:1: ", "got a text: text"},
        BadYaml{"a: 1\n---\nb: 2\n", "s.yaml:3:1: ", "second document"},
        // yaml-cpp's own loop over documents never ends on these.
        BadYaml{",", "s.yaml:1:1: ", "no value can begin here"},
        BadYaml{"# scene\n\n  ,n", "s.yaml:3:3: ", "no value can begin here"},
        BadYaml{"---\n,\n", "s.yaml:2:1: ", "no value can begin here"},
        BadYaml{"]", "s.yaml:1:1: ", "YAML"}, BadYaml{"}", "s.yaml:1:1: ", "YAML"},
        BadYaml{"a: 1\nyes: 2\n", "s.yaml:2:1: ", "got a boolean: true"},
        BadYaml{"a: {1: 2}\n", "s.yaml:1:5: ", "needs quotes"},
        BadYaml{"a: !degrees 90\n", "s.yaml:1:4: ", "'!degrees' is not supported"},
        BadYaml{"a: !!int x\n", "s.yaml:1:4: ", "not supported"},
        BadYaml{"a: !set {b}\n", "s.yaml:1:4: ", "'!set' is not supported"},
        BadYaml{"a: {<<: 1}\n", "s.yaml:1:9: ", "merge"},
        BadYaml{"a: {<<: [1]}\n", "s.yaml:1:10: ", "merge"},
        BadYaml{"a: &a [*a]\n", "s.yaml:1:", "deep"},
        BadYaml{"a: &a {<<: *a}\n", "s.yaml:1:", "deep"}, BadYaml{deep, "s.yaml:1:", "deep"},
        BadYaml{bombText(), "s.yaml:", "more than 100000 values"}}) {
    const std::string message = test::messageOf([&] { readYamlText(bad.text, "s.yaml"); });
    EXPECT_EQ(message.rfind(bad.place, 0), 0U) << bad.text << "\n" << message;
    EXPECT_NE(message.find(bad.words), std::string::npos) << bad.text << "\n" << message;
  }
}

TEST(YamlTree, ReadsFiles) {
  const TemporaryFile file("a: 1\nb: [x\n");
  const std::string fault = test::messageOf([&] { readYamlFile(file.path()); });
  EXPECT_EQ(fault.rfind(file.path() + ":", 0), 0U) << fault;
  std::ofstream(file.path(), std::ios::binary) << "a: 1\r\nb: x\r\n";
  EXPECT_EQ(readYamlFile(file.path()).toText(), "{a: 1, b: x}");
}

TEST(YamlTree, RefusesFilesThatCannotBeRead) {
  for (const std::string& path : {testing::TempDir(), std::string("no/such/scene.yaml")}) {
    const std::string fault = test::messageOf([&] { readYamlFile(path); });
    EXPECT_NE(fault.find(path + ":1:1: cannot be read: "), std::string::npos) << fault;
  }
}

TEST(CommandFile, ReadsAndSortsByTimeWithoutMixingEqualTimes) {
  const std::vector<TimedCommand> commands = readCommandText(
      "# a comment\n\ntime,topic,value\r\n2,a,1\r\n  \n0.5,arm/b,-1e-3\n# 1,a,1\n2,b,nan\n"
      "0,a,inf\n2,a,3",
      "c.csv");
  ASSERT_EQ(commands.size(), 5U);
  EXPECT_EQ(commands[0].time, 0.0);
  EXPECT_EQ(commands[0].value, std::numeric_limits<double>::infinity());
  EXPECT_EQ(commands[0].line, 9);
  EXPECT_EQ(commands[1].time, 0.5);
  EXPECT_EQ(commands[1].topic, "arm/b");
  EXPECT_EQ(commands[1].value, -1e-3);
  EXPECT_EQ(commands[1].line, 6);
  EXPECT_EQ(commands[2].value, 1.0);
  EXPECT_EQ(commands[2].line, 4);
  EXPECT_TRUE(std::isnan(commands[3].value));
  EXPECT_EQ(commands[4].value, 3.0);
  EXPECT_TRUE(readCommandText("time,topic,value\n", "c.csv").empty());
}

struct BadCsv {
  const char* text;
  const char* message;
};

TEST(CommandFile, FaultsNameFileAndLineAndWhatIsExpected) {
  for (const BadCsv& bad : {
           BadCsv{"", "c.csv:1: the file ends before its header; expected: time,topic,value"},
           BadCsv{"# only\n", "c.csv:2: the file ends before its header"},
           BadCsv{"time, topic, values\n", "c.csv:1: 'time, topic, values' is not the header"},
           BadCsv{"time;topic,value\n", "c.csv:1: 'time;topic,value' is not the header"},
           BadCsv{"time;topic;value\n0,a,1\n",
                  "c.csv:2: '0,a,1' does not have three columns between ';'; expected: time,topic"},
           BadCsv{"time;topic;value\n0,5;a;1\n",
                  "c.csv:2: time '0,5' in '0,5;a;1': decimals stand behind a point, not behind a "
                  "comma; expected: a finite number"},
           BadCsv{"time\ttopic\tvalue\n0\ta\n",
                  "c.csv:2: '0\\ta' does not have three columns between tabs"},
           BadCsv{"\n0,a,1\n", "c.csv:2: '0,a,1' is not the header; expected: time,topic,value"},
           BadCsv{"time,topic,value\n0,a\n", "c.csv:2: '0,a' does not have three columns"},
           BadCsv{"time,topic,value\n0\n", "c.csv:2: '0' does not have three columns"},
           BadCsv{"time,topic,value\n0,a,1,2\n", "c.csv:2: '0,a,1,2' does not have three columns"},
           BadCsv{"time,topic,value\n-1,a,1\n",
                  "c.csv:2: time '-1' in '-1,a,1'; expected: a finite"},
           BadCsv{"time,topic,value\ninf,a,1\n", "c.csv:2: time 'inf'"},
           BadCsv{"time,topic,value\nnan,a,1\n", "c.csv:2: time 'nan'"},
           BadCsv{"time,topic,value\n1s,a,1\n", "c.csv:2: time '1s'"},
           BadCsv{"time,topic,value\n,a,1\n", "c.csv:2: time ''"},
           BadCsv{"time,topic,value\n0,,1\n", "c.csv:2: topic ''"},
           BadCsv{"time,topic,value\n0, a b,1\n", "c.csv:2: topic 'a b'"},
           BadCsv{"time,topic,value\n0,a,\n", "c.csv:2: value ''"},
           BadCsv{"time,topic,value\n0,a,1 2\n", "c.csv:2: value '1 2'"},
           BadCsv{"time,topic,value\n0,a,+-1\n", "c.csv:2: value '+-1'"},
           BadCsv{"time,topic,value\n0,a,1e999\n", "c.csv:2: value '1e999'"},
           BadCsv{"time,topic,value\n0,a,1\n\n1,a,x\n",
                  "c.csv:4: value 'x' in '1,a,x'; expected: a number"},
       }) {
    const std::string fault = test::messageOf([&] { readCommandText(bad.text, "c.csv"); });
    EXPECT_EQ(fault.rfind(bad.message, 0), 0U) << bad.text << "\n" << fault;
  }
}

// As tables do, and as spreadsheets write them.
TEST(CommandFile, ReadsOtherSeparatorsQuotesBlanksAndSigns) {
  for (const char* text :
       {"\xef\xbb\xbftime,topic,value\n0.5,a,2\n", "time;topic;value\r\n0.5;a;2\r\n",
        "time\ttopic\tvalue\n0.5\ta\t2", "\"time\",\"topic\",\"value\"\n\"0.5\",\"a\",\"2\"\n",
        "time, topic, value\n 0.5 , a,2 \n", "time,topic,value\n+0.5,a,+2\n",
        "\xef\xbb\xbf# a comment\n\"time\";topic; value\n+0.5;\"a\" ; +2\n"}) {
    SCOPED_TRACE(text);
    const std::vector<TimedCommand> commands = readCommandText(text, "c.csv");
    ASSERT_EQ(commands.size(), 1U);
    EXPECT_EQ(commands[0].time, 0.5);
    EXPECT_EQ(commands[0].topic, "a");
    EXPECT_EQ(commands[0].value, 2.0);
  }
}

TEST(CommandFile, ReadsFiles) {
  const TemporaryFile file("time,topic,value\n1,a,2\n");
  const std::vector<TimedCommand> commands = readCommandFile(file.path());
  ASSERT_EQ(commands.size(), 1U);
  EXPECT_EQ(commands[0].value, 2.0);
  for (const char* unreadable : {"no/such/commands.csv", "/"}) {
    const std::string fault = test::messageOf([&] { readCommandFile(unreadable); });
    EXPECT_EQ(fault.rfind(std::string(unreadable) + ":1: cannot be read: ", 0), 0U) << fault;
  }
  EXPECT_THROW(readCommandFile(testing::TempDir()), CommandFileError);
}

TEST(CommandFile, ACommandFileHasBounds) {
  const auto faultOf = [](const std::string& text) {
    return test::messageOf([&] { readCommandText(text, "test"); });
  };
  const std::string line = "1,a," + std::string(995, '0') + "1";
  EXPECT_EQ(faultOf("time,topic,value\n" + line + "\n" + line), "");
  for (const char* end : {"", "\n", "0\n"}) {
    const std::string fault = faultOf("time,topic,value\n" + line + "0" + end);
    EXPECT_EQ(fault.rfind("test:2: '1,a,000", 0), 0U) << fault;
    EXPECT_NE(fault.find("a line of more than 1000 characters"), std::string::npos) << fault;
  }
  std::string many = "time,topic,value\n";
  for (int n = 0; n < 5000001; ++n) many += "0,a,1\n";
  EXPECT_EQ(faultOf(many).rfind("test:5000002: more than 5000000 commands", 0), 0U);
}

TEST(CommandFile, ADeviceWithoutAnEndIsRefused) {
  EXPECT_THROW(readCommandFile("/dev/zero"), CommandFileError);
  EXPECT_THROW(readYamlFile("/dev/zero"), SceneError);
  EXPECT_THROW(readYamlText("a: " + std::string(1U << 24U, ' ') + "1", "test"), SceneError);
}

// rosparam evaluates the first two as Python: what passes here is safe to load there.
TEST(YamlTree, RefusesTagsThatOthersRun) {
  for (const std::string value :
       {"!radians \"__import__('os').system('id')\"", "!degrees 180",
        "!!binary aGk=", "!!python/object/apply:os.system ['id']", "!<tag:a,b:c> 1"}) {
    const std::string fault = test::messageOf(
        [&] { readYamlText("shafts: [a]\nsolver: {step: " + value + "}\n", "scene.yaml"); });
    EXPECT_NE(fault.find("is not supported"), std::string::npos) << value << ": " << fault;
  }
}

}  // namespace
}  // namespace variator_sim
