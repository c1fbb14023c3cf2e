// C that is written for scenes: by `simulate --emit-c`, and for the machine code of kernels.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "emit_c/emit_c.h"
#include "fuzz/c_check.h"
#include "fuzz/checks.h"
#include "fuzz/targets.h"
#include "ros/node_settings.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/errors.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/node_names.h"
#include "variator_sim/scene.h"
#include "variator_sim/simulation.h"

namespace variator_sim::fuzz {
namespace {

/// Largest C program emitted for 4 kB of a scene.
constexpr std::size_t kLongestC = 8U << 20U;

void require(const std::string& fault, const char* where) {
  if (fault.empty()) return;
  std::fprintf(stderr, "bad C, %s: %s\n", where, fault.c_str());
  std::abort();
}

/// FNV-1a: whether a compiler looks at what becomes of an input is the same in every run.
bool isOneOf(unsigned share, const std::string& input) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char c : input) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return (hash >> 20U) % share == 0;
}

/// The file's name: a comment in the first line, for it to be fuzzed as well.
std::string titleOf(const std::string& input) {
  if (input.empty() || input.front() != '#') return "scene.yaml";
  std::string line = input.substr(1, input.find('\n') - 1).substr(0, 255);
  if (!line.empty() && line.front() == ' ') line.erase(0, 1);
  line = line.substr(line.rfind('/') + 1);
  return line.substr(0, line.find('\0'));
}

void checkProgram(Simulation& simulation, const std::string& title, bool is_compiled) {
  const EmittedScene made = emitScene(simulation, nameForC(title), title);
  for (const std::string* text : {&made.header, &made.source, &made.main}) {
    if (text->size() > kLongestC) require(std::to_string(text->size()) + " bytes", "its length");
    require(findFaultOfC(*text, made.name), title.c_str());
  }
  for (const std::string* text : {&made.readme, &made.makefile}) {
    require(isPresentable(*text, "\n\t") ? "" : *text, "README.md or Makefile");
  }
  if (!is_compiled) return;
  require(compileC(made.source, {"-std=c99"}, made.name, made.header), title.c_str());
  require(compileC(made.main, {"-std=c99"}, made.name, made.header), title.c_str());
}

void write(const std::string& input, bool is_compiled) {
  const std::string title = titleOf(input);
  try {
    ParameterTree tree = readYamlText(input, "scene.yaml");
    applyOwnOverrides(tree);
    readNodeSettings(tree);
    BuiltinComponentFactory factory;
    Scene scene = readScene(tree, factory, nodeNames());
    scene.solver.machine_code = MachineCode::kNever;
    Simulation simulation(std::move(scene));
    checkProgram(simulation, title, is_compiled);
  } catch (const Error& error) {
    check(error.what());
  }
}

}  // namespace

void emitted(const std::string& input) {
  write(input, isOneOf(200, input));
}

void emittedAndCompiled(const std::string& input) {
  write(input, true);
}

}  // namespace variator_sim::fuzz
