// Checks which times and angles the laws of this package, and formulas, read
// (test/dependences.txt).

#include <fstream>
#include <set>

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/torque.h"

namespace variator_sim {
namespace {

/// "time angle", or a part of it.
std::string whatIsRead(const expression::Graph& graph, const std::vector<expression::Node>& nodes) {
  const bool time = reads(graph, nodes, expression::Source::kTime);
  const bool angle = reads(graph, nodes, expression::Source::kAngle);
  if (!time && !angle) return "nothing";
  return std::string(time ? "time" : "") + (time && angle ? " " : "") + (angle ? "angle" : "");
}

std::string typeOf(const std::string& element) {
  return "variator_sim/" + element.substr(0, element.find(','));
}

Scene sceneOf(const std::string& element) {
  return test::sceneFromText("drive 0.8, load 2, third 1", {"it = " + element});
}

/// The rows of a section, and whether they have all types but `others`.
std::vector<test::Fault> rowsOf(std::size_t section, const std::vector<std::string>& all,
                                const std::vector<std::string>& others) {
  const auto rows =
      test::readFaults("", test::readFaultSections("../dependences").at(section).second);
  std::set<std::string> types;
  for (const std::string& other : others) types.insert("variator_sim/" + other);
  for (const test::Fault& row : rows) types.insert(typeOf(row.text));
  EXPECT_EQ(types, std::set<std::string>(all.begin(), all.end()));
  return rows;
}

TEST(Torques, DependOnWhatTheyState) {
  // (Those that hold have a torque only with a mode.)
  for (const test::Fault& row :
       rowsOf(0, BuiltinComponentFactory().torqueTypes(),
              {"Brake", "Clutch", "DogClutch", "EndStop", "OneWayClutch"})) {
    SCOPED_TRACE(row.text);
    const Scene scene = sceneOf(row.text);
    const Torque& torque = *scene.torques.at(0);
    std::vector<expression::Node> rates;
    for (const auto& rate : torque.rates()) rates.push_back(rate.second);
    EXPECT_EQ(whatIsRead(torque.graph(), torque.formulas()), row.path);
    EXPECT_EQ(whatIsRead(torque.graph(), rates), row.words.at(0));
  }
}

TEST(Constraints, DependOnWhatTheyState) {
  for (const test::Fault& row : rowsOf(1, BuiltinComponentFactory().constraintTypes(), {})) {
    SCOPED_TRACE(row.text);
    const Scene scene = sceneOf(row.text);
    const Constraint& constraint = *scene.constraints.at(0);
    EXPECT_EQ(whatIsRead(constraint.graph(), constraint.formulas()), row.path);
    EXPECT_EQ(constraint.hasConstantJacobian() ? "constant" : "varies", row.words.at(0));
  }
}

}  // namespace
}  // namespace variator_sim
