/// A test's own cache of machine code, and compilers that misbehave.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace variator_sim::test {

/// Keeps the environment as it was, and what it writes in a folder that goes with it.
class MachineCodeFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "machine_code_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    set("VARIATOR_SIM_CACHE", cache().c_str());
  }
  void TearDown() override {
    for (const auto& [name, value] : before_) put(name, value ? value->c_str() : nullptr);
    std::filesystem::remove_all(folder_);
  }

  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path cache() const { return folder_ / "cache"; }

  /// An environment variable for the time of the test; none for null.
  void set(const char* name, const char* value) {
    const char* const old = std::getenv(name);
    before_.emplace(name, old != nullptr ? std::optional<std::string>(old) : std::nullopt);
    put(name, value);
  }

  /// `cc` is this shell script from now on; $OUTPUT is what it has to make of the last .c file,
  /// $SOURCE.
  void compileBy(const std::string& script) {
    const std::filesystem::path program = folder_ / "bin" / "cc";
    std::filesystem::create_directories(program.parent_path());
    std::ofstream(program) << "#!/bin/sh\nPATH=/usr/bin:/bin\n"
                              "for word; do\n"
                              "  case \"$last\" in -o) OUTPUT=$word ;; esac\n"
                              "  case \"$word\" in *.c) SOURCE=$word ;; esac\n"
                              "  last=$word\n"
                              "done\n"
                           << script << "\n";
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
    set("PATH", program.parent_path().c_str());
  }

  /// The names in the cache.
  std::vector<std::filesystem::path> kernels() const {
    if (!std::filesystem::is_directory(cache())) return {};
    return {std::filesystem::directory_iterator(cache()), std::filesystem::directory_iterator()};
  }
  static std::string read(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  /// A new file of this name: what is loaded from the old one stays.
  static void replace(const std::filesystem::path& path, const std::string& text) {
    std::filesystem::remove(path);
    std::ofstream(path, std::ios::binary) << text;
  }

 private:
  static void put(const std::string& name, const char* value) {
    if (value != nullptr) {
      ::setenv(name.c_str(), value, 1);
    } else {
      ::unsetenv(name.c_str());
    }
  }
  std::filesystem::path folder_;
  std::map<std::string, std::optional<std::string>> before_;
};

}  // namespace variator_sim::test
