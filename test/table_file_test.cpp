// Tables from CSV files, played inputs, and tables of straight lines and of held values.
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "support/faults.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

/// A folder of its own, with a scene that reads `table.csv`.
class Folder {
 public:
  Folder() : path_(std::filesystem::temp_directory_path() / "variator_sim_table_XXXXXX") {
    std::string name = path_.string();
    path_ = mkdtemp(name.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return (path_ / name).string();
  }
  Scene read(const std::string& keys, const std::string& csv, const std::string& more = "") const {
    write("table.csv", csv);
    const std::string scene = write(
        "scene.yaml", "shafts: [a]\na: {inertia: 1}\ntables: [it]\nit: {" + keys + "}\n" + more);
    BuiltinComponentFactory factory;
    return readScene(readYamlFile(scene), factory, nodeNames());
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

const char* const kOne = "file: table.csv, x: w, values: T, interpolation: linear";
const char* const kTwo = "file: table.csv, x: w, y: u, values: T, interpolation: linear";

TEST(TableFile, IsReadByTheNamesOfColumns) {
  const Folder folder;
  const double rpm = 3.14159265358979323846 / 30.0;
  const Scene scene = folder.read(std::string(kOne) + ", units: {w: rpm, T: kN m}",
                                  "\xef\xbb\xbf# a comment\n\n note;\"w\" ; "
                                  "T\r\nx;1000;+1e-1\r\n#\r\n;2000;0.3\n\"a;b\"; \"4000\" ;.2");
  const Table& table = *scene.symbols.tables.at("it");
  EXPECT_EQ(table.smoothness(), 1);
  EXPECT_EQ(table.points().size(), 3U);
  EXPECT_NEAR(table.value(1500.0 * rpm), 200.0, 1e-9);
  EXPECT_NEAR(table.value(3000.0 * rpm), 250.0, 1e-9);
  EXPECT_NEAR(table.slope(3000.0 * rpm), -100.0 / (2000.0 * rpm), 1e-9);
  EXPECT_EQ(table.value(9000.0 * rpm), 200.0);
  EXPECT_EQ(table.origin(), "it");
}

TEST(TableFile, OfTwoVariablesHasItsRowsInAnyOrder) {
  const Folder folder;
  const Scene scene = folder.read(kTwo, "u\tT\tw\n1\t4\t0\n0\t1\t0\n0\t2\t10\n1\t9\t10\n");
  const Table& table = *scene.symbols.tables.at("it");
  EXPECT_EQ(table.value(0.0, 0.0), 1.0);
  EXPECT_EQ(table.value(0.0, 1.0), 4.0);
  EXPECT_EQ(table.value(10.0, 0.0), 2.0);
  EXPECT_EQ(table.value(10.0, 1.0), 9.0);
  EXPECT_NEAR(table.value(5.0, 0.5), 4.0, 1e-15);
  EXPECT_NEAR(table.derivative({1, 1}, 5.0, 0.5), 0.4, 1e-15);
  EXPECT_EQ(table.derivative({2, 0}, 5.0, 0.5), 0.0);
}

TEST(TableFile, IsFoundInAPackage) {
  const Folder folder;
  std::filesystem::create_directories(folder.path() / "src/group/my_car/maps");
  folder.write("src/group/my_car/package.xml", "<package/>");
  folder.write("src/group/my_car/maps/m.csv", "w,T\n0,1\n1,2\n");
  setenv("ROS_PACKAGE_PATH", ("/nowhere::" + (folder.path() / "src").string()).c_str(), 1);
  const std::string keys = "x: w, values: T, interpolation: linear, file: 'package://";
  EXPECT_EQ(folder.read(keys + "my_car/maps/m.csv'", "").symbols.tables.at("it")->value(0.5), 1.5);
  test::expectFault({keys + "my_cart/maps/m.csv'", "it/file", {"no package 'my_cart'"}},
                    [&](const std::string& text) { folder.read(text, ""); });
  test::expectFault({keys + "my_car'", "it/file", {"package://PACKAGE/PATH"}},
                    [&](const std::string& text) { folder.read(text, ""); });
  // By the name in its package.xml, at any depth, but not below a package or what is to be ignored.
  std::filesystem::create_directories(folder.path() / "src/a/b/c/folder/below/maps");
  std::filesystem::create_directories(folder.path() / "src/old/maps");
  folder.write("src/a/b/c/folder/package.xml", "<package>\n  <name> big_car\n</name></package>");
  folder.write("src/a/b/c/folder/m.csv", "w,T\n0,3\n1,4\n");
  folder.write("src/a/b/c/folder/below/package.xml", "<package><name>lost</name></package>");
  folder.write("src/old/package.xml", "<package><name>old_car</name></package>");
  folder.write("src/old/CATKIN_IGNORE", "");
  EXPECT_EQ(folder.read(keys + "big_car/m.csv'", "").symbols.tables.at("it")->value(0.5), 3.5);
  for (const char* const name : {"lost", "old_car", "folder"}) {
    test::expectFault({keys + name + "/m.csv'", "it/file", {"there is no package"}},
                      [&](const std::string& text) { folder.read(text, ""); });
  }
  test::expectFault({keys + "bigcar/m.csv'", "it/file", {"did you mean 'big_car'"}},
                    [&](const std::string& text) { folder.read(text, ""); });
  // A build space names its source spaces.
  unsetenv("ROS_PACKAGE_PATH");
  std::filesystem::create_directories(folder.path() / "devel");
  folder.write("devel/.catkin", "/nowhere;" + (folder.path() / "src").string());
  const char* const prefixes = std::getenv("CMAKE_PREFIX_PATH");
  const std::string before = prefixes != nullptr ? prefixes : "";
  setenv("CMAKE_PREFIX_PATH", (folder.path() / "devel").c_str(), 1);
  EXPECT_EQ(folder.read(keys + "big_car/m.csv'", "").symbols.tables.at("it")->value(0.5), 3.5);
  setenv("CMAKE_PREFIX_PATH", before.c_str(), 1);
}

TEST(TableFile, TellsFaultsByFileLineAndColumn) {
  const Folder folder;
  const std::string file = (folder.path() / "table.csv").string();
  struct Row {
    const char* keys;
    const char* csv;
    const char* place;
    std::vector<std::string> words;
  };
  for (const Row& row : std::vector<Row>{
           {kOne, "", ":1:1", {"ends after 0 rows", "two rows at least"}},
           {kOne, "w,T\n1,2\n", ":3:1", {"ends after 1 rows"}},
           {kOne, "w,t\n1,2\n", ":1:1", {"no column 'T'", "'values' names", "did you mean 't'?"}},
           {kOne, "w,T,w\n1,2,3\n", ":1:1", {"two columns are named 'w'"}},
           {kOne, "w,T\n1,2\n2\n", ":3:1", {"1 fields", "allowed: 2", "w, T"}},
           {kOne, "w,T\n1,2\n\n2, 3 ,4\n", ":4:7", {"3 fields"}},
           {kOne, "w,T\n1,2\n2, x\n", ":3:4", {"'x' in column 'T'", "not a finite number"}},
           {kOne, "w,T\n1,2\n2,\n", ":3:3", {"nothing in column 'T'"}},
           {kOne, "w,T\n1,2\n2,1e999\n", ":3:3", {"'1e999'"}},
           {kOne, "w,T\n1,2\n2,nan\n", ":3:3", {"'nan'"}},
           {kOne, "w,T\n1,2\n2,\"\n", ":3:3", {"in column 'T'"}},
           {kOne, "w;T\n1;2\n2;1,5\n", ":3:3", {"'1,5'", "behind a point, not behind a comma"}},
           {kOne, "w,T\n1,2\n#\n1,3\n", ":4:1", {"column 'w'", "1.0 does not lie above 1.0"}},
           {kOne, "T,w\n1,2\n7,1.5\n", ":3:3", {"1.5 does not lie above 2.0"}},
           {kTwo,
            "w,u,T\n0,0,1\n1,0,1\n0,1,1\n",
            ":3:1",
            {"no grid", "(1, 1) in SI units has no row"}},
           {kTwo, "w,u,T\n0,0,1\n1,0,1\n0,0,1\n", ":3:1", {"no grid", "there twice"}},
           {kTwo,
            "w,u,T\n0,0,1\n1,1,1\n2,2,1\n3,3,1\n4,4,1\n5,5,1\n",
            ":3:1",
            {"no grid", "(1, 0)"}},
           {kTwo, "w,u,T\n0,0,1\n0,1,1\n", ":2:1", {"column 'w': one value in all rows"}},
           {kTwo, "w,u,T\n0,2,1\n1,2,1\n", ":2:3", {"column 'u': one value in all rows"}},
           {kTwo, "w,u,T\n0,0,1\n1e-200,0,1\n0,1,1\n1e-200,1,2\n", ":3:1", {"1e-100"}}}) {
    SCOPED_TRACE(row.csv);
    std::vector<std::string> words = row.words;
    words.push_back(file + row.place + ": ");
    test::expectFault({row.keys, "it/file", words},
                      [&](const std::string& keys) { folder.read(keys, row.csv); });
  }
  const auto read = [&](const std::string& keys) { folder.read(keys, "w,T\n1,2\n2,3\n"); };
  test::expectFaults(test::readFaults("", R"(
file: no.csv, x: w, values: T => it/file: /no.csv:1:1: cannot be read | own folder | package://
file: ., x: w, values: T => it/file: cannot be read
file: table.csv, values: T => it/x: missing
file: table.csv, x: [1, 2], values: T => it/x: expected a text
file: table.csv, x: w, values: T, units: {v: rpm} => it/units/v: unknown key | allowed: T, w
file: table.csv, x: w, values: T, units: {w: rpn} => it/units/w: did you mean 'rpm'?
file: table.csv, x: w, values: T, interpolation: cubic => it/interpolation: smooth, linear, hold
file: table.csv, x: w, values: T, interpolation: hold, beyond: linear => it/beyond: has none
x: [1, 2], values: [3, 4], units: {z: rpm} => it/units/z: unknown key
x: w, values: T => it/x: expected a list
)"),
                     read);
}

/// Files of random bytes out of those that CSV files have, and mutations of good ones, give a table
/// or an error of the file.
TEST(TableFile, TakesEveryFileOrRefusesIt) {
  const Folder folder;
  const std::string good = "w,u,T\n0,0,1\n1,0,2\n0,1,3\n1,1,4\n";
  const std::string letters = "0123.,;\t\"\n\r#-+eEwuT\xff ";
  unsigned random = 7;
  const auto next = [&](std::size_t below) {
    random = random * 1664525U + 1013904223U;
    return (random >> 12U) % below;
  };
  for (int n = 0; n < 1500; ++n) {
    std::string text = good;
    for (std::size_t i = next(6); i < 6; ++i) {
      const std::size_t at = next(text.size());
      const char letter = letters[next(letters.size())];
      if (next(3) == 0) {
        text.erase(at, 1 + next(4));
      } else {
        text.insert(text.begin() + static_cast<std::ptrdiff_t>(at), letter);
      }
      if (text.empty()) text = "w";
    }
    try {
      folder.read(n % 2 == 0 ? kOne : kTwo, text);
    } catch (const SceneError& error) {
      EXPECT_EQ(error.keyPath(), "it/file") << text;
      EXPECT_NE(error.message().find("table.csv:"), std::string::npos) << error.what();
    }
  }
}

TEST(TableFile, OfAMapOf200By200LoadsAtOnce) {
  const Folder folder;
  std::string csv = "w,u,T\n";
  for (int i = 0; i < 200; ++i) {
    for (int j = 0; j < 200; ++j) {
      csv += std::to_string(5 * i) + "," + std::to_string(0.005 * j) + "," +
             std::to_string(std::sin(0.1 * i) * j) + "\n";
    }
  }
  folder.write("table.csv", csv);
  const std::clock_t begin = std::clock();
  const Scene scene = folder.read(kTwo, csv);
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  std::printf("map of 200 by 200: loaded in %.3f s\n", seconds);
  EXPECT_LT(seconds, 2.0);  // of the processor, with sanitizers, too
  const Table& table = *scene.symbols.tables.at("it");
  EXPECT_NEAR(table.value(500.0, 0.5), std::sin(10.0) * 100.0, 1e-5);
}

TEST(PlayedInput, IsATableOverTimeByTheInputsName) {
  const Folder folder;
  const Scene scene = folder.read(
      "x: [0, 1], values: [0, 1], interpolation: linear", "time,cycle,s\n0,0,1\n10,36,1\n20,18,2\n",
      "inputs: [cycle, step]\ncycle: {file: table.csv, units: {cycle: km/h}}\n"
      "step: {file: table.csv, values: s, interpolation: hold}\n"
      "torques: [pull, law]\n"
      "pull: {type: variator_sim/ExpressionTorque, shaft: a, torque: step*cycle}\n"
      "law: {type: variator_sim/Friction, shaft: a, coulomb: 0, viscous: {input: step}}\n");
  EXPECT_EQ(scene.inputCount(), 0);
  EXPECT_EQ(scene.symbols.played.at("cycle")->value(5.0), 5.0);
  EXPECT_EQ(scene.symbols.played.at("cycle")->value(15.0), 7.5);
  EXPECT_EQ(scene.symbols.played.at("step")->value(19.9), 1.0);
  Simulation simulation(scene);
  EXPECT_TRUE(simulation.advanceTo(10.0).ok());
  // w' = t - w
  EXPECT_NEAR(simulation.sample().velocity[0], 9.0 + std::exp(-10.0), 1e-8);
  test::expectFault({"x: [0, 1], values: [0, 1]", "cycle/topic", {"unknown key"}},
                    [&](const std::string& keys) {
                      folder.read(keys, "time,cycle\n0,0\n10,36\n",
                                  "inputs: [cycle]\ncycle: {file: table.csv, topic: cycle}\n");
                    });
}

}  // namespace
}  // namespace variator_sim
