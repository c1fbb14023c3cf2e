// The node's parts that need no master: parameters, their text, plugins.

#include <pluginlib/class_loader.hpp>

#include "ros/checked_lists.h"
#include "ros/message_conversion.h"
#include "ros/node_settings.h"
#include "ros/plugin_loader.h"
#include "ros/xmlrpc_tree.h"
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/constraint.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/torque.h"

namespace variator_sim {
namespace {

bool equal(const ParameterTree& a, const ParameterTree& b) {
  if (a.kind() != b.kind()) return false;
  switch (a.kind()) {
    case ParameterTree::Kind::kNothing:
      return true;
    case ParameterTree::Kind::kBoolean:
      return a.asBoolean() == b.asBoolean();
    case ParameterTree::Kind::kInteger:
      return a.asInteger() == b.asInteger();
    case ParameterTree::Kind::kReal:
      return a.asReal() == b.asReal();
    case ParameterTree::Kind::kText:
      return a.asText() == b.asText();
    case ParameterTree::Kind::kList:
      if (a.asList().size() != b.asList().size()) return false;
      for (std::size_t i = 0; i < a.asList().size(); ++i) {
        if (!equal(a.asList()[i], b.asList()[i])) return false;
      }
      return true;
    case ParameterTree::Kind::kDictionary:
      if (a.asDictionary().size() != b.asDictionary().size()) return false;
      for (const auto& [key, value] : a.asDictionary()) {
        const auto other = b.asDictionary().find(key);
        if (other == b.asDictionary().end() || !equal(value, other->second)) return false;
      }
      return true;
  }
  return false;
}

TEST(YamlText, ReadsBackToTheSameTree) {
  using Tree = ParameterTree;
  const Tree tree = Tree::dictionary(
      {{"reals", Tree::list({Tree::real(0.1), Tree::real(1.0), Tree::real(-1e-9), Tree::real(1e300),
                             Tree::real(5e-324), Tree::real(2.0 / 3.0), Tree::real(1e22)})},
       {"integers", Tree::list({Tree::integer(0), Tree::integer(-7), Tree::integer(1LL << 40)})},
       {"texts",
        Tree::list({Tree::text("plain"), Tree::text(""), Tree::text("yes"), Tree::text("Null"),
                    Tree::text("1e-9"), Tree::text("tau*(e2 - u*e1): #x"), Tree::text("a\"b\\c\n"),
                    Tree::text("variator_sim/ExpressionTorque"), Tree::text("~"), Tree::text("- a"),
                    Tree::text("\xc3\xa9")})},
       {"flags", Tree::list({Tree::boolean(true), Tree::boolean(false)})},
       {"n", Tree::integer(1)},
       {"nothing", Tree()},
       {"nested",
        Tree::list({Tree::dictionary({{"a", Tree::list({Tree::list({Tree::integer(1)})})}}),
                    Tree::dictionary({{"b c", Tree::dictionary({{"d", Tree::real(1.5)}})}})})},
       {"empty_list", Tree::list()},
       {"empty_dictionary", Tree::dictionary()}});
  const std::string text = toYaml(tree);
  EXPECT_TRUE(equal(readYamlText(text, "test"), tree)) << text;
  EXPECT_EQ(toYaml(Tree::dictionary()), "{}\n");
}

TEST(XmlRpcTree, KeepsKindsAndValues) {
  XmlRpc::XmlRpcValue value;
  value["integer"] = 3;
  value["real"] = 0.1;
  value["text"] = std::string("1e-9");
  value["flag"] = true;
  value["list"][0] = 1;
  value["list"][1] = 2.5;
  value["part"]["deep"] = std::string("x");
  using Tree = ParameterTree;
  const Tree expected = Tree::dictionary({{"integer", Tree::integer(3)},
                                          {"real", Tree::real(0.1)},
                                          {"text", Tree::text("1e-9")},
                                          {"flag", Tree::boolean(true)},
                                          {"list", Tree::list({Tree::integer(1), Tree::real(2.5)})},
                                          {"part", Tree::dictionary({{"deep", Tree::text("x")}})}});
  EXPECT_TRUE(equal(toParameterTree(value), expected)) << toYaml(toParameterTree(value));
  XmlRpc::XmlRpcValue nothing;
  EXPECT_EQ(toParameterTree(nothing).kind(), ParameterTree::Kind::kDictionary);
}

TEST(XmlRpcTree, RefusesBinaryDataByItsPath) {
  char data[] = "abc";
  XmlRpc::XmlRpcValue value;
  value["motor"]["table"][0] = 1;
  value["motor"]["table"][1] = XmlRpc::XmlRpcValue(data, 3);
  EXPECT_EQ(test::messageOf([&] { toParameterTree(value); }).rfind("motor/table[1]: ", 0), 0u);
}

NodeSettings settingsFrom(const std::string& yaml) {
  return readNodeSettings(readYamlText(yaml, "test"));
}

TEST(NodeSettings, HaveDefaults) {
  const NodeSettings settings = settingsFrom("shafts: [a]\nsomething: else");
  EXPECT_EQ(settings.tick_rate, 1000.0);
  EXPECT_EQ(settings.publish_rate, 100.0);
  EXPECT_EQ(settings.real_time_factor, 1.0);
  EXPECT_FALSE(settings.publish_clock);
  EXPECT_FALSE(settings.start_paused);
  EXPECT_FALSE(settings.lock_memory);
  EXPECT_FALSE(settings.estimate_error);
  EXPECT_EQ(settings.realtime_priority, 0);
  // The default follows a tick rate below it.
  EXPECT_EQ(settingsFrom("tick_rate: 20").publish_rate, 20.0);
}

TEST(NodeSettings, BoundsBelongToThem) {
  const NodeSettings settings = settingsFrom("{tick_rate: 0.001, real_time_factor: 0.001}");
  EXPECT_EQ(settings.tick_rate, 0.001);
  EXPECT_EQ(settings.publish_rate, 0.001);
  EXPECT_EQ(settingsFrom("{tick_rate: 1e5, publish_rate: 0.001}").publish_rate, 0.001);
  EXPECT_EQ(findFaultOfPublishRate(0.001, 1000.0), "");
  EXPECT_EQ(findFaultOfPublishRate(1000.0, 1000.0), "");
  for (const double rate : {0.0, -1.0, 1e-17, 1000.1, std::nan(""), 1e300}) {
    EXPECT_NE(findFaultOfPublishRate(rate, 1000.0), "") << rate;
  }
}

TEST(NodeSettings, TakeAllValues) {
  const NodeSettings settings = settingsFrom(
      "{tick_rate: '5e3', publish_rate: 5000, real_time_factor: 0, publish_clock: true, "
      "start_paused: true, realtime_priority: 80, lock_memory: true, estimate_error: true}");
  EXPECT_TRUE(settings.estimate_error);
  EXPECT_TRUE(settings.publish_clock);
  EXPECT_TRUE(settings.lock_memory);
  EXPECT_EQ(settings.tick_rate, 5000.0);
  EXPECT_EQ(settings.publish_rate, 5000.0);
  EXPECT_EQ(settings.real_time_factor, 0.0);
  EXPECT_TRUE(settings.start_paused);
  EXPECT_EQ(settings.realtime_priority, 80);
}

TEST(NodeSettings, ReadEveryKeyThatTheNodeKeeps) {
  const std::vector<std::string> keys = nodeNames().keys;
  EXPECT_EQ(keys.size(), 10U);
  for (const std::string& key : keys) {
    if (key == "overrides") continue;  // read before all others: override_text.h
    EXPECT_THROW(settingsFrom(key + ": []"), SceneError) << key;
  }
}

TEST(NodeSettings, NameTheKeyThatIsWrong) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"tick_rate: 0", "tick_rate: "},
      {"tick_rate: -10", "tick_rate: "},
      {"tick_rate: 100001", "tick_rate: "},
      {"tick_rate: .nan", "tick_rate: "},
      {"tick_rate: fast", "tick_rate: "},
      {"publish_rate: 0", "publish_rate: "},
      {"publish_rate: 1001", "publish_rate: "},
      {"publish_rate: 1.0e-17",
       "publish_rate: 1.0e-17 Hz is not allowed: from 0.001 to tick_rate (1000"},
      {"publish_rate: 0.00099", "publish_rate: "},
      {"publish_rate: -.inf", "publish_rate: "},
      {"tick_rate: 0.00099", "tick_rate: "},
      {"tick_rate: 5.0e-324", "tick_rate: "},
      {"{tick_rate: 50, publish_rate: 51}", "publish_rate: "},
      {"real_time_factor: -1", "real_time_factor: "},
      {"real_time_factor: 1e-5", "real_time_factor: "},
      {"real_time_factor: .inf", "real_time_factor: "},
      {"publish_clock: 3", "publish_clock: "},
      {"lock_memory: 1", "lock_memory: "},
      {"estimate_error: 1", "estimate_error: "},
      {"start_paused: perhaps", "start_paused: "},
      {"realtime_priority: 100", "realtime_priority: "},
      {"realtime_priority: -1", "realtime_priority: "},
      {"realtime_priority: 1.5", "realtime_priority: "}};
  for (const auto& [yaml, start] : cases) {
    const std::string message = test::messageOf([&, text = yaml] { settingsFrom(text); });
    EXPECT_EQ(message.rfind(start, 0), 0u) << yaml << " gave: " << message;
  }
}

TEST(MessageConversion, StampsAreExactAndSaturate) {
  EXPECT_EQ(toStamp(0), ros::Time(0, 0));
  EXPECT_EQ(toStamp(3000000), ros::Time(0, 3000000));
  EXPECT_EQ(toStamp(7000000001), ros::Time(7, 1));
  EXPECT_EQ(toStamp(std::numeric_limits<std::int64_t>::max()), ros::TIME_MAX);
}

TEST(PluginLoader, BuiltInTypesAreExportedUnderTheirNames) {
  BuiltinComponentFactory builtin;
  pluginlib::ClassLoader<Constraint> constraints("variator_sim", "variator_sim::Constraint");
  for (const std::string& type : builtin.constraintTypes()) {
    ASSERT_TRUE(constraints.isClassAvailable(type)) << type;
    EXPECT_TRUE(constraints.createUniqueInstance(type) != nullptr) << type;
  }
  pluginlib::ClassLoader<Torque> torques("variator_sim", "variator_sim::Torque");
  for (const std::string& type : builtin.torqueTypes()) {
    ASSERT_TRUE(torques.isClassAvailable(type)) << type;
    EXPECT_TRUE(torques.createUniqueInstance(type) != nullptr) << type;
  }
}

TEST(PluginLoader, UnknownTypesAreRefused) {
  const auto factory = makePluginFactory();
  EXPECT_EQ(factory->createConstraint("variator_sim/ExpresionConstraint"), nullptr);
  EXPECT_EQ(factory->createTorque("no_such_package/Torque"), nullptr);
  EXPECT_NE(factory->createConstraint("variator_sim/ExpressionConstraint"), nullptr);
  EXPECT_EQ(factory->constraintTypes().size(), BuiltinComponentFactory().constraintTypes().size());
}

// --- messages ------------------------------------------------------------------------------------

template <class Message>
std::vector<std::uint8_t> bytesOf(const Message& message) {
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return bytes;
}
template <class Message>
Message messageOf(std::vector<std::uint8_t> bytes) {
  Message message;
  ros::serialization::IStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::deserialize(stream, message);
  return message;
}
/// The 4 bytes at `place` tell how many entries a list has.
template <class Message>
void expectNoRoomForLies(const std::vector<std::uint8_t>& bytes, std::size_t place) {
  for (const std::uint32_t count : {50U, 100000000U, 0xffffffffU}) {
    std::vector<std::uint8_t> lie = bytes;
    std::memcpy(lie.data() + place, &count, sizeof count);
    EXPECT_THROW(messageOf<Message>(lie), ros::serialization::StreamOverrunException)
        << place << ' ' << count;
  }
}

TEST(Messages, ListsAreAsLongAsTheirBytesAllow) {
  Step::Request step;
  step.duration = 0.5;
  step.command_topics = {"a", "bc"};
  step.command_values = {1.0, 2.0};
  const std::vector<std::uint8_t> bytes = bytesOf(step);
  EXPECT_EQ(messageOf<Step::Request>(bytes).command_topics, step.command_topics);
  EXPECT_EQ(messageOf<Step::Request>(bytes).command_values, step.command_values);
  expectNoRoomForLies<Step::Request>(bytes, 8);
  expectNoRoomForLies<Step::Request>(bytes, 8 + 4 + 4 + 1 + 4 + 2);

  Commands commands;
  commands.topics = {"abc"};
  commands.values = {3.0};
  EXPECT_EQ(messageOf<Commands>(bytesOf(commands)).topics, commands.topics);
  EXPECT_EQ(messageOf<Commands>(bytesOf(commands)).values, commands.values);
  expectNoRoomForLies<Commands>(bytesOf(commands), 16);

  SetState::Request state;
  state.text = "text";
  state.velocity = {1.0, 2.0};
  state.project = 1;
  EXPECT_EQ(messageOf<SetState::Request>(bytesOf(state)).text, state.text);
  EXPECT_EQ(messageOf<SetState::Request>(bytesOf(state)).velocity, state.velocity);
  EXPECT_EQ(messageOf<SetState::Request>(bytesOf(state)).project, state.project);
  for (const std::size_t place : {8U, 12U, 32U}) {
    expectNoRoomForLies<SetState::Request>(bytesOf(state), place);
  }

  dynamic_reconfigure::Config config;
  config.doubles.resize(1);
  config.doubles[0].name = "real_time_factor";
  config.doubles[0].value = 2.0;
  EXPECT_EQ(messageOf<dynamic_reconfigure::Config>(bytesOf(config)).doubles[0].value, 2.0);
  for (const std::size_t place : {0U, 4U, 8U, 12U}) {
    expectNoRoomForLies<dynamic_reconfigure::Config>(bytesOf(config), place);
  }
}

}  // namespace
}  // namespace variator_sim
