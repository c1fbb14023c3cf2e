// The corpora of the fuzzers, and what they have found, without a fuzzer: each input comes back in
// bounded time.
#include <gtest/gtest.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "fuzz/targets.h"

namespace variator_sim {
namespace {

class FuzzReplay : public testing::TestWithParam<fuzz::Target> {};

TEST_P(FuzzReplay, EveryInputComesBack) {
  const std::filesystem::path folder =
      std::filesystem::path(VARIATOR_SIM_TEST_DIR) / "fuzz" / "corpus" / GetParam().name;
  int count = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    std::ifstream stream(file.path(), std::ios::binary);
    const std::string input{std::istreambuf_iterator<char>(stream), {}};
    const std::clock_t begin = std::clock();
    GetParam().run(input);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    EXPECT_LT(seconds, 5.0) << file.path();
    ++count;
  }
  EXPECT_GT(count, 0) << folder;
  RecordProperty("tried", count);
}

// Inputs of any length, cut off anywhere and with any byte wrong.
TEST_P(FuzzReplay, EveryInputComesBackDamaged) {
  const std::filesystem::path folder =
      std::filesystem::path(VARIATOR_SIM_TEST_DIR) / "fuzz" / "corpus" / GetParam().name;
  int tried = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    std::ifstream stream(file.path(), std::ios::binary);
    const std::string input{std::istreambuf_iterator<char>(stream), {}};
    if (input.size() > 2000) continue;
    const std::size_t stride = 1 + input.size() / 8;
    for (std::size_t i = 0; i < input.size(); i += stride) {
      GetParam().run(input.substr(0, i));
      std::string damaged = input;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << (i % 8)));
      GetParam().run(damaged);
      tried += 2;
    }
  }
  RecordProperty("tried", tried);
}

// Among them scenes and file names that make one name of C twice.
TEST(FuzzReplay, EmittedProgramsCompileWithoutAWarning) {
  const std::filesystem::path folder =
      std::filesystem::path(VARIATOR_SIM_TEST_DIR) / "fuzz" / "corpus" / "emitted";
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    std::ifstream stream(file.path(), std::ios::binary);
    fuzz::emittedAndCompiled({std::istreambuf_iterator<char>(stream), {}});
  }
}

INSTANTIATE_TEST_SUITE_P(AllTargets, FuzzReplay, testing::ValuesIn(fuzz::targets()),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace
}  // namespace variator_sim
