#include "machine_code/kernel_library.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include "variator_sim/interruption.h"

namespace variator_sim {
namespace {

// Every operation is to round by itself, as the interpreter's do. (GCC 12 fuses products and sums
// in vectors of straight-line code all the same.) And every function is to be the library's: what a
// compiler knows of a function it computes itself, where it finds the argument, with another last
// bit.
const char* const kOptions[] = {"-std=c11",
                                "-O3",
                                "-march=native",
                                "-ffp-contract=off",
                                "-fno-math-errno",
                                "-fno-tree-slp-vectorize",
                                "-fno-builtin",
                                "-fPIC",
                                "-fno-semantic-interposition",
                                "-fno-plt"};
// The text says what of it stands in which of `UNITS` units, which are compiled at once.
constexpr unsigned kMostUnits = 4;
// s. Whoever has not asked for machine code is not to wait for it.
constexpr int kPatience = 5;
constexpr int kLongPatience = 60;
constexpr const char* kNotYet = "it is not in the cache yet";

std::uint64_t mix(std::uint64_t hash, const std::string& text) {
  // FNV-1a
  for (const char c : text) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  }
  return hash;
}

std::string sumOf(const std::string& text) {
  char digits[40];
  std::snprintf(digits, sizeof digits, "%016llx%016llx",
                static_cast<unsigned long long>(mix(14695981039346656037ULL, text)),
                static_cast<unsigned long long>(mix(0x9e3779b97f4a7c15ULL, text)));
  return digits;
}

std::string readAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::string findCompiler() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    std::string program = folder + "/cc";
    if (!folder.empty() && folder.front() == '/' && ::access(program.c_str(), X_OK) == 0) {
      return program;
    }
  }
  return "";
}

/// What tells one compiler from the next version of it.
std::string identify(const std::string& program) {
  char resolved[PATH_MAX];
  if (::realpath(program.c_str(), resolved) == nullptr) return program;
  struct stat status = {};
  if (::stat(resolved, &status) != 0) return resolved;
  std::ostringstream text;
  text << resolved << ' ' << status.st_size << ' ' << status.st_mtime;
  return text.str();
}

/// The lines about the first processor that tell which instructions it has.
std::string identifyProcessor() {
  std::ifstream file("/proc/cpuinfo");
  std::string text;
  for (std::string line; std::getline(file, line) && !line.empty();) {
    for (const char* key : {"model name", "flags", "Features", "CPU part"}) {
      if (line.rfind(key, 0) == 0) text += line + "\n";
    }
  }
  return text;
}

std::string describeError() {
  return std::strerror(errno);
}

/// Makes the folder and those above it.
std::string makeFolder(const std::string& folder) {
  for (std::size_t end = folder.find('/', 1);; end = folder.find('/', end + 1)) {
    const std::string part = folder.substr(0, end);
    if (::mkdir(part.c_str(), 0700) != 0 && errno != EEXIST) {
      return "the folder " + part + " cannot be made: " + describeError();
    }
    if (end == std::string::npos) return "";
  }
}

/// An empty reason when the folder is there, ours and nobody else's.
std::string checkFolder(const std::string& folder) {
  struct stat status = {};
  if (::lstat(folder.c_str(), &status) != 0) {
    return errno == ENOENT ? kNotYet : folder + " cannot be read: " + describeError();
  }
  if (!S_ISDIR(status.st_mode)) return folder + " is no folder";
  if (status.st_uid != ::geteuid() || (status.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    return "the folder " + folder + " is not ours alone to write to";
  }
  return "";
}

std::string findFolder() {
  const auto variable = [](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value != nullptr && value[0] == '/' ? value : "";
  };
  if (std::string own = variable("VARIATOR_SIM_CACHE"); !own.empty()) return own;
  if (const std::string cache = variable("XDG_CACHE_HOME"); !cache.empty()) {
    return cache + "/variator_sim";
  }
  if (const std::string home = variable("HOME"); !home.empty()) {
    return home + "/.cache/variator_sim";
  }
  return "";
}

/// One run of the compiler.
class CompilerRun {
 public:
  /// An empty reason when it has begun.
  std::string start(std::vector<std::string> arguments) {
    program_ = arguments.front();
    std::vector<char*> pointers;
    pointers.reserve(arguments.size() + 1);
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);

    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
      ::posix_spawn_file_actions_addopen(&actions, stream, "/dev/null", O_RDWR, 0);
    }
    // What runs is the compiler's driver, and the work is done by its children: a group of their
    // own, for all of them to end together.
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    ::posix_spawnattr_setpgroup(&attributes, 0);
    const int error =
        ::posix_spawn(&child_, program_.c_str(), &actions, &attributes, pointers.data(), environ);
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&actions);
    if (error == 0) return "";
    child_ = 0;
    return program_ + " cannot be run: " + std::strerror(error);
  }

  /// An empty reason when it ended well.
  std::string finish(std::chrono::steady_clock::time_point give_up, int patience) {
    int status = 0;
    while (child_ != 0) {
      const pid_t ended = ::waitpid(child_, &status, WNOHANG);
      if (ended == child_) {
        child_ = 0;
      } else if (ended < 0 && errno != EINTR) {
        child_ = 0;
        return program_ + " got lost: " + describeError();
      } else if (Interruption::isWanted()) {
        end();
        return "it was interrupted";
      } else if (std::chrono::steady_clock::now() > give_up) {
        end();
        return program_ + " took more than " + std::to_string(patience) + " s";
      } else {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? "" : program_ + " failed";
  }

  CompilerRun() = default;
  CompilerRun(const CompilerRun&) = delete;
  CompilerRun& operator=(const CompilerRun&) = delete;
  ~CompilerRun() { end(); }

 private:
  void end() {
    if (child_ == 0) return;
    int status = 0;
    ::kill(-child_, SIGKILL);
    ::waitpid(child_, &status, 0);
    child_ = 0;
  }

  std::string program_;
  pid_t child_ = 0;  ///< 0: none
};

/// Runs the compiler, units at once; an empty reason when it made `output`.
std::string compile(const std::string& program, const std::string& source, unsigned units,
                    const std::string& output, int patience) {
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(patience);
  std::vector<std::string> objects;
  std::string reason;
  {
    std::vector<CompilerRun> runs(units);
    for (unsigned unit = 0; unit < units && reason.empty(); ++unit) {
      objects.push_back(output + "." + std::to_string(unit) + ".o");
      std::vector<std::string> arguments{program};
      arguments.insert(arguments.end(), std::begin(kOptions), std::end(kOptions));
      arguments.insert(arguments.end(),
                       {"-DUNITS=" + std::to_string(units), "-DUNIT=" + std::to_string(unit), "-c",
                        "-o", objects.back(), source});
      reason = runs[unit].start(std::move(arguments));
    }
    for (CompilerRun& run : runs) {
      if (reason.empty()) reason = run.finish(give_up, patience);
    }
  }
  if (reason.empty()) {
    std::vector<std::string> arguments{program, "-shared", "-o", output};
    arguments.insert(arguments.end(), objects.begin(), objects.end());
    arguments.emplace_back("-lm");
    CompilerRun link;
    reason = link.start(std::move(arguments));
    if (reason.empty()) reason = link.finish(give_up, patience);
  }
  for (const std::string& object : objects) ::unlink(object.c_str());
  return reason;
}

bool writeAll(const std::string& path, const std::string& text, std::ios::openmode mode) {
  std::ofstream file(path, mode | std::ios::binary);
  file << text;
  file.close();
  return file.good();
}

/// Compiles into `path`; an empty reason when that is there afterwards.
std::string makeKernel(const std::string& compiler, const std::string& source,
                       const std::string& path, int patience) {
  // Of this process and this call: the nodelets of a manager may compile at once.
  static std::atomic<int> calls{0};
  const std::string beside =
      path + "." + std::to_string(::getpid()) + "." + std::to_string(++calls);
  const std::string text = beside + ".c";
  std::string reason;
  if (!writeAll(text, source, std::ios::trunc)) {
    reason = text + " cannot be written: " + describeError();
  } else {
    const bool has_units = source.find(KernelLibrary::kUnits) != std::string::npos;
    const unsigned most = has_units ? kMostUnits : 1;
    const unsigned units = std::clamp(std::thread::hardware_concurrency(), 1U, most);
    reason = compile(compiler, text, units, beside, patience);
  }
  if (reason.empty()) {
    // What follows an object's own end is nothing to the loader.
    const bool is_whole = writeAll(beside, sumOf(readAll(beside)), std::ios::app);
    if (!is_whole || ::rename(beside.c_str(), path.c_str()) != 0) {
      reason = path + " cannot be written: " + describeError();
    }
  }
  ::unlink(text.c_str());
  ::unlink(beside.c_str());
  return reason;
}

/// True when `path` is a kernel that was written to its end, by us.
bool isWhole(const std::string& path) {
  struct stat status = {};
  if (::lstat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode) ||
      status.st_uid != ::geteuid()) {
    return false;
  }
  const std::string all = readAll(path);
  constexpr std::size_t kSum = 32;
  if (all.size() <= kSum) return false;
  return all.substr(all.size() - kSum) == sumOf(all.substr(0, all.size() - kSum));
}

}  // namespace

KernelLibrary::~KernelLibrary() {
  ::dlclose(handle_);
}

void* KernelLibrary::find(const char* name) const {
  return ::dlsym(handle_, name);
}

std::shared_ptr<KernelLibrary> KernelLibrary::load(const std::string& source, Missing missing,
                                                   std::string* reason) {
  reason->clear();
  const std::string folder = findFolder();
  if (folder.empty()) {
    *reason = "there is no place for it: neither VARIATOR_SIM_CACHE nor HOME is set";
    return nullptr;
  }
  const std::string compiler = findCompiler();
  std::string key = source + "\n" + identify(compiler) + "\n" + identifyProcessor();
  for (const char* option : kOptions) key += option;
  const std::string path = folder + "/" + sumOf(key) + ".so";
  bool was_compiled = false;
  if (missing != Missing::kLeave) *reason = makeFolder(folder);
  if (reason->empty()) *reason = checkFolder(folder);
  if (!reason->empty()) return nullptr;
  if (!isWhole(path)) {
    if (missing == Missing::kLeave) {
      *reason = kNotYet;
    } else if (compiler.empty()) {
      *reason = "no compiler (cc) was found";
    } else {
      const bool is_patient = missing == Missing::kCompilePatiently;
      *reason = makeKernel(compiler, source, path, is_patient ? kLongPatience : kPatience);
      was_compiled = true;
    }
    if (!reason->empty()) return nullptr;
  }
  void* handle = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    *reason = "it cannot be loaded: " + std::string(::dlerror());
    ::unlink(path.c_str());  // no use to anybody
    return nullptr;
  }
  return std::shared_ptr<KernelLibrary>(new KernelLibrary(handle, was_compiled));
}

}  // namespace variator_sim
