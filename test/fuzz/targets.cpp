#include "fuzz/targets.h"

#include <ros/serialization.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <new>
#include <optional>
#include <stdexcept>
#include <utility>

#include "fuzz/checks.h"
#include "machine_code/kernel_library.h"
#include "ros/checked_lists.h"
#include "ros/loop_messages.h"
#include "ros/node_settings.h"
#include "ros/xmlrpc_tree.h"
#include "variator_sim/component_factory.h"
#include "variator_sim/errors.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/node_names.h"
#include "variator_sim/scene.h"
#include "variator_sim/simulation.h"

namespace variator_sim::fuzz {
namespace {

/// Reads `tree` as a scene and moves it a little.
void run(ParameterTree tree) {
  try {
    applyOwnOverrides(tree);
    readNodeSettings(tree);
    BuiltinComponentFactory factory;
    Scene read = readScene(tree, factory, nodeNames());
    // So that no input takes its time by steps.
    read.solver.maximum_steps = 20;
    read.solver.machine_code = MachineCode::kNever;
    Simulation simulation(std::move(read));
    simulation.sample();
    simulation.advanceTo(1e-4);
    simulation.sample();
    check(simulation.describeStatus());
  } catch (const Error& error) {
    check(error.what());
  }
}

ParameterTree text(const char* value) {
  return ParameterTree::text(value);
}
ParameterTree::Dictionary twoShafts() {
  const ParameterTree shaft = ParameterTree::dictionary({{"inertia", ParameterTree::real(1.5)}});
  return {{"shafts", ParameterTree::list({text("a"), text("b")})}, {"a", shaft}, {"b", shaft}};
}

}  // namespace

void formula(const std::string& input) {
  ParameterTree::Dictionary torque = twoShafts();
  torque["torques"] = ParameterTree::list({text("m")});
  torque["m"] = ParameterTree::dictionary({{"type", text("variator_sim/ExpressionTorque")},
                                           {"shaft", text("a")},
                                           {"torque", ParameterTree::text(input)}});
  run(ParameterTree::dictionary(torque));
  for (int order = 1; order <= 3; ++order) {
    ParameterTree::Dictionary constraint = twoShafts();
    constraint["constraints"] = ParameterTree::list({text("v")});
    constraint["v"] =
        ParameterTree::dictionary({{"type", text("variator_sim/ExpressionConstraint")},
                                   {"order", ParameterTree::integer(order)},
                                   {"expression", ParameterTree::text(input)}});
    run(ParameterTree::dictionary(constraint));
  }
}

void scene(const std::string& input) {
  try {
    run(readYamlText(input, "scene.yaml"));
  } catch (const Error& error) {
    check(error.what());
  }
}

void commands(const std::string& input) {
  static const Scene scene = [] {
    BuiltinComponentFactory factory;
    return readScene(
        readYamlText("shafts: [a]\na: {inertia: 1}\ntorques: [m]\n"
                     "m: {type: variator_sim/CommandedTorque, shaft: a, topic: drive_torque}\n",
                     "scene.yaml"),
        factory, nodeNames());
  }();
  try {
    const std::vector<TimedCommand> read = readCommandText(input, "commands.csv");
    Simulation simulation(scene);
    for (const TimedCommand& command : read) {
      if (command.topic == "drive_torque") simulation.command(0, command.value);
    }
    simulation.sample();
  } catch (const Error& error) {
    check(error.what());
  }
}

void parameters(const std::string& input) {
  int offset = 0;
  XmlRpc::XmlRpcValue value;
  if (!value.fromXml(input, &offset)) return;
  try {
    run(toParameterTree(value));
  } catch (const Error& error) {
    check(error.what());
  }
}

void step(const std::string& input) {
  Step::Request request;
  std::vector<std::uint8_t> bytes;
  bytes.reserve(input.size() + 1);  // roscpp's buffer of an empty request is one, too
  bytes.assign(input.begin(), input.end());
  try {
    ros::serialization::IStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    ros::serialization::deserialize(stream, request);
  } catch (const ros::Exception&) {
    return;  // roscpp refuses it
  } catch (const std::length_error&) {
    return;
  } catch (const std::bad_alloc&) {
    return;
  }
  std::vector<CommandInputSettings> inputs(3);
  inputs[0].topic = "drive_torque";
  inputs[1].topic = "throttle";
  inputs[2].topic = "ratio";
  std::vector<InputCommand> commands;
  const std::string fault =
      readCommands(inputs, request.command_topics, request.command_values, commands);
  check(fault);
  for (const InputCommand& command : commands) {
    if (fault.empty() && !std::isfinite(command.value)) std::abort();
  }
}

namespace {

/// A cache of this process alone, with one kernel in it.
class KernelCache {
 public:
  KernelCache() {
    std::string folder = (std::filesystem::temp_directory_path() / "fuzz_kernel_XXXXXX").string();
    if (::mkdtemp(folder.data()) == nullptr) std::abort();
    folder_ = folder;
    ::setenv("VARIATOR_SIM_CACHE", folder.c_str(), 1);
    std::string reason;
    if (KernelLibrary::load(kSource, KernelLibrary::Missing::kCompilePatiently, &reason)) {
      for (const auto& file : std::filesystem::directory_iterator(folder_)) {
        if (file.path().extension() == ".so") kernel_ = file.path();
      }
      std::ifstream stream(kernel_, std::ios::binary);
      bytes_.assign(std::istreambuf_iterator<char>(stream), {});
    }
  }
  KernelCache(const KernelCache&) = delete;
  KernelCache& operator=(const KernelCache&) = delete;
  ~KernelCache() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  /// The kernel as it was written; empty where there is no compiler.
  const std::string& bytes() const { return bytes_; }
  /// Whether `bytes` are loaded in its place.
  bool isLoaded(const std::string& bytes, std::string* reason) const {
    std::ofstream(kernel_, std::ios::binary | std::ios::trunc) << bytes;
    return KernelLibrary::load(kSource, KernelLibrary::Missing::kLeave, reason) != nullptr;
  }

 private:
  static constexpr const char* kSource = "double kernel(double x) { return x + 1; }\n";
  std::filesystem::path folder_;
  std::filesystem::path kernel_;
  std::string bytes_;
};

}  // namespace

void kernel(const std::string& input) {
  static const KernelCache cache;
  if (cache.bytes().empty()) return;
  // Three bytes an edit: where, and by what. The last one cuts.
  std::string bytes = cache.bytes();
  for (std::size_t i = 0; i + 3 <= input.size(); i += 3) {
    const std::size_t where =
        static_cast<unsigned char>(input[i]) * 256U + static_cast<unsigned char>(input[i + 1]);
    bytes[where % bytes.size()] ^= input[i + 2];
  }
  if (input.size() % 3 == 1)
    bytes.resize(static_cast<unsigned char>(input.back()) * bytes.size() / 256);
  std::string reason;
  const bool is_loaded = cache.isLoaded(bytes, &reason);
  if (is_loaded != (bytes == cache.bytes())) std::abort();
  check(reason);
}

const std::vector<Target>& targets() {
  static const std::vector<Target> all{
      {"formula", formula}, {"scene", scene},   {"commands", commands}, {"parameters", parameters},
      {"step", step},       {"kernel", kernel}, {"emitted", emitted}};
  return all;
}

}  // namespace variator_sim::fuzz
