// Values in place of a scene's: where their paths lead, what their texts mean.
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "support/faults.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

const char* const kScene =
    "shafts: [drive, load]\n"
    "drive: {inertia: 10.0}\n"
    "load: {inertia: {mean: 20.0, harmonics: [{order: 1, cosine: 0.1}]}}\n"
    "initial: {velocity: [1.0, 2.0]}\n"
    "solver:\n";

ParameterTree sceneWith(const std::string& override_text) {
  ParameterTree tree = readYamlText(kScene, "scene.yaml");
  applyOverride(tree, override_text);
  return tree;
}

/// Returns the overridden value of `key` at the root.
std::string valueOf(const std::string& key, const std::string& override_text) {
  return sceneWith(override_text).asDictionary().at(key).toText();
}

std::string faultOf(const std::string& override_text) {
  return test::messageOf([&] { sceneWith(override_text); });
}

TEST(Overrides, PathsLeadThroughDictionariesAndLists) {
  EXPECT_EQ(valueOf("drive", "drive/inertia=1.2"), "{inertia: 1.2}");
  EXPECT_EQ(valueOf("initial", "initial/velocity=[5, 2]"), "{velocity: [5, 2]}");
  EXPECT_EQ(valueOf("initial", "initial/velocity/1=5"), "{velocity: [1.0, 5]}");
  EXPECT_EQ(valueOf("initial", "initial/velocity[0]=5"), "{velocity: [5, 2.0]}");
  EXPECT_EQ(valueOf("load", "load/inertia/harmonics[0]/cosine=0.3"),
            "{inertia: {harmonics: [{cosine: 0.3, order: 1}], mean: 20.0}}");
  EXPECT_EQ(valueOf("drive", "drive={inertia: 3}"), "{inertia: 3}");
}

TEST(Overrides, MissingKeysAreMade) {
  EXPECT_EQ(valueOf("solver", "solver/step=1e-3"), "{step: '1e-3'}");
  EXPECT_EQ(valueOf("motor", "motor/parameters/k=2.0"), "{parameters: {k: 2.0}}");
  EXPECT_EQ(valueOf("initial", "initial/project=yes"), "{project: true, velocity: [1.0, 2.0]}");
}

TEST(Overrides, ValuesAreYaml) {
  EXPECT_EQ(valueOf("x", "x="), "~");
  EXPECT_EQ(valueOf("x", "x=a=b"), "'a=b'");
  EXPECT_EQ(valueOf("x", "x='1.0'"), "'1.0'");
  EXPECT_EQ(valueOf("x", "x={a: [1, true]}"), "{a: [1, true]}");
  EXPECT_EQ(faultOf("x=[1").rfind("value of 'x':1:", 0), 0U) << faultOf("x=[1");
}

TEST(Overrides, FaultsNameThePathAndTheNearestOne) {
  EXPECT_EQ(faultOf("drive/inertia/mean=1"),
            "drive/inertia/mean: 'drive/inertia' is a number: 10.0, and has no 'mean' inside; it "
            "can be set as a whole (did you mean 'drive/inertia'?)");
  EXPECT_EQ(
      faultOf("initial/velocity/2=1")
          .rfind("initial/velocity/2: 'initial/velocity' is a list and has no '2'; allowed: 0 to 1",
                 0),
      0U);
  EXPECT_EQ(faultOf("initial/velocity/-1=1")
                .rfind("initial/velocity/-1: 'initial/velocity' is a list and has no '-1'", 0),
            0U);
  EXPECT_EQ(faultOf("initial/velocity/99999999999999999999=1").find("did you mean"),
            std::string::npos);
  EXPECT_EQ(faultOf("initial/velocty/1=3"),
            "initial/velocty/1: 'initial/velocty' is not a list with an item '1'; a list that the "
            "scene leaves out can be set as a whole (did you mean 'initial/velocity/1'?)");
  EXPECT_NE(faultOf("initial/angle/0=3"), "");
  for (const char* path : {"/drive", "drive/", "a//b", "a[", "a[x]", "a[0]b", "a]", "[0]", "a[]"}) {
    EXPECT_EQ(faultOf(path + std::string("=1")).rfind("'" + std::string(path) + "' is not a path"),
              0U)
        << path;
  }
  for (const char* text : {"", "drive/inertia", "=1"}) {
    EXPECT_NE(faultOf(text).find("expected PATH=VALUE"), std::string::npos) << text;
  }
}

TEST(Overrides, APathThatLeadsNowhereChangesNothing) {
  ParameterTree tree = readYamlText(kScene, "scene.yaml");
  const std::string before = tree.toText();
  EXPECT_THROW(setValue(tree, "solver/x/0", ParameterTree::real(1.0)), SceneError);
  EXPECT_EQ(tree.toText(), before);
}

std::string treeWith(ParameterTree own) {
  ParameterTree tree = readYamlText("a: {b: 1}\n", "scene.yaml");
  tree.asDictionary()["overrides"] = std::move(own);
  applyOwnOverrides(tree);
  return tree.toText();
}

std::string treeWith(const std::string& text) {
  return treeWith(ParameterTree::text(text));
}

TEST(Overrides, OfATreeItselfStandInOneText) {
  EXPECT_EQ(treeWith("a/b=2 c=[1, 2] \n d={x: 1, y: 2}"),
            "{a: {b: 2}, c: [1, 2], d: {x: 1, y: 2}}");
  EXPECT_EQ(treeWith("a/b=2 a/b=3"), "{a: {b: 3}}");
  EXPECT_EQ(treeWith("  "), "{a: {b: 1}}");
  EXPECT_EQ(treeWith(R"(c="5 - w1" a/b='it''s so')"), "{a: {b: 'it''s so'}, c: '5 - w1'}");
  EXPECT_EQ(treeWith("c=it's d=2"), "{a: {b: 1}, c: 'it''s', d: 2}");
  EXPECT_EQ(treeWith(R"(c="a\" b" d=1)"), "{a: {b: 1}, c: 'a\" b', d: 1}");
  EXPECT_THROW(treeWith("c=5 - w1"), SceneError);
  EXPECT_THROW(treeWith("c=[1, 2"), SceneError);
}

TEST(Overrides, OfATreeItselfMayBeAList) {
  const ParameterTree text = ParameterTree::text("c=x y");
  EXPECT_EQ(treeWith(ParameterTree::list({ParameterTree::text("a/b=2"), text})),
            "{a: {b: 2}, c: 'x y'}");
  EXPECT_EQ(treeWith(ParameterTree()), "{a: {b: 1}}");
  EXPECT_THROW(treeWith(ParameterTree::integer(3)), SceneError);
  EXPECT_THROW(treeWith(ParameterTree::list({ParameterTree::integer(3)})), SceneError);
}

}  // namespace
}  // namespace variator_sim
