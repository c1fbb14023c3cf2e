#include "tools/output.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include "io/whole_file.h"
#include "variator_sim/io/yaml_text.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

void failedToWrite(const std::string& name) {
  const int error = errno;
  const std::string message = name + ": " + std::generic_category().message(error);
  if (error == EPIPE) throw OutputClosed(message);
  throw OutputError(message);
}

void writeOutput(const std::string& path, const std::string& text) {
  if (path.empty()) {
    if (!writeBytes(STDOUT_FILENO, text.data(), text.size())) failedToWrite("standard output");
    return;
  }
  const std::string reason = writeWholeFile(path, text);
  if (!reason.empty()) throw OutputError(path + ": cannot be written: " + reason);
}

std::string runPythonFile(const std::string& name, std::string argument, const std::string& text) {
  using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;
  const File input(std::tmpfile(), std::fclose);
  const File output(std::tmpfile(), std::fclose);
  if (!input || !output || !writeBytes(::fileno(input.get()), text.data(), text.size()) ||
      ::lseek(::fileno(input.get()), 0, SEEK_SET) != 0) {
    throw OutputError(std::string("no temporary file can be written: ") + std::strerror(errno));
  }
  const auto program = std::filesystem::read_symlink("/proc/self/exe");
  const auto prefix = program.parent_path().parent_path().parent_path();
  std::string python = "/usr/bin/python3";
  std::string file = prefix / VARIATOR_SIM_PYTHON_FOLDER / name;
  char* const words[] = {python.data(), file.data(), argument.data(), nullptr};
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(input.get()), STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(output.get()), STDOUT_FILENO);
  posix_spawnattr_t attributes;  // a group of its own: Ctrl-C ends the motion, not the writing
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t child = 0;
  const int error = ::posix_spawn(&child, words[0], &actions, &attributes, words, environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw OutputError(python + " (python3) cannot be run: " + std::strerror(error));
  int status = -1;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
  std::string content;
  std::rewind(output.get());
  char bytes[4096];
  while (const std::size_t size = std::fread(bytes, 1, sizeof bytes, output.get())) {
    content.append(bytes, size);
  }
  if (status == 0) return content;
  throw OutputError(content.empty() ? python + " " + file + " failed" : content);
}

void readStateFile(const std::string& path, Simulation& simulation) {
  const ParameterTree tree = readYamlFile(path);
  MotionState present;
  if (!simulation.saveState(&present)) throw SceneError("", simulation.describeStatus());
  const Scene& scene = simulation.scene();
  fromSource(path, [&] {
    const MotionState state = readMotionState(tree, scene, present);
    const std::string fault = simulation.setState(state, scene.initial.project);
    if (!fault.empty()) throw SceneError("", fault);
  });
}

void writeStateFile(const std::string& path, const MotionState& state,
                    const Simulation& simulation) {
  writeOutput(
      path,
      "# The state of a motion: s, rad, rad/s, rad/s^2, N m, J. What is left out when it is read "
      "is\n"
      "# as the scene has it; without 'history' the motion starts there anew.\n" +
          toYaml(toTree(state, simulation.scene())));
}

}  // namespace variator_sim
