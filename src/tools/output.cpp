#include "tools/output.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>
#include <thread>

#include "io/text_file.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/message_text.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

void tell(const std::string& message) {
  std::fprintf(stderr, "simulate: %s\n", message.c_str());
}

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

void checkWritable(const std::string& path) {
  namespace fs = std::filesystem;
  const auto fail = [&path](const std::string& reason) {
    throw OutputError(path + ": cannot be written: " + reason);
  };
  std::error_code error;
  const fs::file_status file = fs::status(path, error);
  if (fs::is_directory(file)) fail(std::generic_category().message(EISDIR));
  if (fs::exists(file) && !fs::is_regular_file(file)) return;  // a device
  const fs::path folder = fs::path(path).parent_path();
  // The new file is written beside an old one.
  if (::access(folder.empty() ? "." : folder.c_str(), W_OK | X_OK) != 0) {
    fail(std::generic_category().message(errno) + ": folder " +
         inQuotes(folder.empty() ? "." : folder.string()));
  }
}

namespace {

using TemporaryFile = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

std::string readAll(const TemporaryFile& file) {
  std::string content;
  readTextFile("/proc/self/fd/" + std::to_string(::fileno(file.get())), &content);
  return content;
}

/// Waits for the end of a group's leader; returns its status. On an Interruption it ends the group:
/// by SIGINT, so that the leader removes its files, and soon by SIGKILL.
int waitFor(pid_t child) {
  constexpr int kLooks = 35;  // of 20 ms after an Interruption
  int status = -1;
  int looks = 0;
  for (;;) {
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child || (ended < 0 && errno != EINTR)) return status;
    if (Interruption::isWanted() && looks++ % kLooks == 0) {
      ::kill(-child, looks == 1 ? SIGINT : SIGKILL);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace

std::string runPythonFile(const std::string& name, std::string argument, const std::string& text) {
  const TemporaryFile input(std::tmpfile(), std::fclose);
  const TemporaryFile output(std::tmpfile(), std::fclose);
  const TemporaryFile errors(std::tmpfile(), std::fclose);
  if (!input || !output || !errors ||
      !writeBytes(::fileno(input.get()), text.data(), text.size()) ||
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
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(errors.get()), STDERR_FILENO);
  posix_spawnattr_t attributes;  // a group of its own: Ctrl-C ends the motion, not the writing
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t child = 0;
  const int error = ::posix_spawn(&child, words[0], &actions, &attributes, words, environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw OutputError(python + " (python3) cannot be run: " + std::strerror(error));
  const int status = waitFor(child);
  std::string content = readAll(output);
  if (status != 0) endIfInterrupted();
  const std::string complaint = readAll(errors);
  if (status == 0) {
    writeBytes(STDERR_FILENO, complaint.data(), complaint.size());
    return content;
  }
  throw OutputError(content.empty() ? python + " " + file + " failed: " + complaint : content);
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
  writeOutput(path,
              "# The state of a motion: s, rad, rad/s, rad/s^2, N m, J. What is left out when it "
              "is read is\n"
              "# as the scene has it; without 'history' the motion starts there anew.\n" +
                  toYaml(toTree(state, simulation.scene())));
}

}  // namespace variator_sim
