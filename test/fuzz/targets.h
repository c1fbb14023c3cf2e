/// The fuzz targets: each accepts any bytes and has to return, without a crash and in bounded time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace variator_sim::fuzz {

/// The text of a formula of a torque, of a constraint and of an output.
void formula(const std::string& input);
/// A scene in YAML.
void scene(const std::string& input);
/// A command file.
void commands(const std::string& input);
/// Reads the XML answer of a parameter server.
void parameters(const std::string& input);
/// A request of ~step, as it comes over the wire.
void step(const std::string& input);

/// Damage to a kernel in the cache of machine code: bytes to be changed, and where it is cut off.
void kernel(const std::string& input);

/// C that is written for a scene in YAML, and for the machine code of its formulas. A comment in
/// the first line is the scene's file name. A compiler looks at what one input in 200 becomes.
void emitted(const std::string& input);
/// The same, and a compiler looks at it.
void emittedAndCompiled(const std::string& input);

struct Target {
  const char* name;
  void (*run)(const std::string& input);
};
const std::vector<Target>& targets();

}  // namespace variator_sim::fuzz
