#include "machine_code/kernel_library.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include "io/text_file.h"
#include "variator_sim/interruption.h"

namespace variator_sim {
namespace {

// Every operation must round separately, as the interpreter's do. (GCC 12 nevertheless fuses
// products and sums in vectors of straight-line code.) And every function must be the library's: a
// compiler evaluates known functions of constant arguments itself, with another last bit.
const char* const kOptions[] = {"-std=c11",        "-O2",
                                "-march=native",   "-ffp-contract=off",
                                "-fno-math-errno", "-fno-tree-slp-vectorize",
                                "-funroll-loops",  "-fno-builtin",
                                "-fPIC",           "-fno-semantic-interposition",
                                "-fno-plt"};
// The text assigns its parts to `UNITS` units, which are compiled in parallel.
constexpr unsigned kMostUnits = 4;
// s. A user who did not request machine code does not wait longer; one who did can interrupt it.
constexpr int kPatience = 5;
constexpr int kLongPatience = 600;
constexpr const char* kNotYet = "it is not in the cache yet";

std::string sumOf(const std::string& text) {
  return checksumOf(text) + checksumOf(text, 0x9e3779b97f4a7c15ULL);
}

std::string readAll(const std::string& path) {
  std::string text;
  readTextFile(path, &text);
  return text;
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

/// Returns a text that differs between versions of a compiler.
std::string identify(const std::string& program) {
  char resolved[PATH_MAX];
  if (::realpath(program.c_str(), resolved) == nullptr) return program;
  struct stat status = {};
  if (::stat(resolved, &status) != 0) return resolved;
  std::ostringstream text;
  text << resolved << ' ' << status.st_size << ' ' << status.st_mtime;
  return text.str();
}

/// Returns the lines about the first processor that list its instructions.
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

/// Makes the folder and its parents.
std::string makeFolder(const std::string& folder) {
  for (std::size_t end = folder.find('/', 1);; end = folder.find('/', end + 1)) {
    const std::string part = folder.substr(0, end);
    if (::mkdir(part.c_str(), 0700) != 0 && errno != EEXIST) {
      return "the folder " + part + " cannot be made: " + describeError();
    }
    if (end == std::string::npos) return "";
  }
}

/// Returns an empty reason when the folder exists and only the current user can write to it.
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

/// The files of one compilation, in a folder of its own within the cache. Its name is unique even
/// if processes of several machines or containers, with equal process numbers, share a cache.
class Workshop {
 public:
  explicit Workshop(const std::string& path) : folder_(path + ".XXXXXX") {
    if (::mkdtemp(folder_.data()) == nullptr) folder_.clear();
    for (const char* name :
         {"/kernel.so", "/kernel.c", "/0.o", "/1.o", "/2.o", "/3.o", "/messages"}) {
      files_.push_back(folder_ + name);
    }
  }
  ~Workshop() { remove(); }
  Workshop(const Workshop&) = delete;
  Workshop& operator=(const Workshop&) = delete;

  bool exists() const { return !folder_.empty(); }
  const std::string& output() const { return files_[0]; }
  const std::string& source() const { return files_[1]; }
  const std::string& object(unsigned unit) const { return files_[2 + unit]; }
  /// Returns the file of the compiler's messages.
  const std::string& messages() const { return files_.back(); }
  /// (Calls nothing that a forked process must not call.)
  void remove() const {
    if (!exists()) return;
    for (const std::string& file : files_) ::unlink(file.c_str());
    ::rmdir(folder_.c_str());
  }

 private:
  std::string folder_;
  std::vector<std::string> files_;
};

/// The words of a command line, and a null pointer behind them.
using CommandLine = std::vector<char*>;

CommandLine commandLineOf(std::vector<std::string>& words) {
  CommandLine line;
  for (std::string& word : words) line.push_back(word.data());
  line.push_back(nullptr);
  return line;
}

/// A process between this one and its compilers, which ends them and all that they have started
/// when it is told to (SIGTERM) or when this process ends, for any reason. Its code runs after a
/// fork of a program with threads: it calls no function that allocates or locks.
class Foreman {
 public:
  /// Runs the foreman; `parent` has all signals blocked.
  [[noreturn]] static void run(pid_t parent, const std::vector<CommandLine>& units,
                               const CommandLine& link, const Workshop& workshop) {
    ::setpgid(0, 0);  // Ctrl-C is meant for the parent
    std::signal(SIGCHLD, SIG_DFL);
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    ::close_range(0, ~0U, 0);  // the parent's outputs must not stay open
    for (int stream = 0; stream < 3; ++stream) {
      if (::open("/dev/null", O_RDWR) != stream) ::_exit(1);
    }
    const int messages = ::open(workshop.messages().c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    if (messages >= 0) ::dup2(messages, STDERR_FILENO);
    const bool is_made =
        ::getppid() == parent && makeAll(units.data(), units.size()) && makeAll(&link, 1);
    if (::getppid() != parent) workshop.remove();
    ::_exit(is_made ? 0 : 1);
  }

 private:
  static pid_t start(const CommandLine& command) {
    const pid_t child = ::fork();
    if (child != 0) return child;
    // A compiler's driver has children: one group ends together.
    ::setpgid(0, 0);
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    ::execve(command[0], command.data(), environ);
    ::_exit(127);
  }

  /// Runs commands in parallel; ends all and returns false when one fails.
  static bool makeAll(const CommandLine* commands, std::size_t count) {
    pid_t groups[kMostUnits] = {};
    bool is_good = true;
    std::size_t left = 0;
    for (std::size_t n = 0; n < count && is_good; ++n) {
      const pid_t child = start(commands[n]);
      is_good = child > 0;
      if (!is_good) break;
      ::setpgid(child, child);
      groups[left++] = child;
    }
    sigset_t awaited;
    ::sigemptyset(&awaited);
    ::sigaddset(&awaited, SIGCHLD);
    ::sigaddset(&awaited, SIGTERM);
    for (int order = SIGTERM; left > 0;) {
      if (!is_good) endAll(groups, std::exchange(order, SIGKILL));
      const timespec patience{is_good ? 3600 : 0, 100000000};
      if (::sigtimedwait(&awaited, nullptr, &patience) == SIGTERM) is_good = false;
      int status = 0;
      for (pid_t ended = 0; (ended = ::waitpid(-1, &status, WNOHANG)) > 0; --left) {
        is_good = is_good && WIFEXITED(status) && WEXITSTATUS(status) == 0;
        if (is_good) std::replace(std::begin(groups), std::end(groups), ended, pid_t{0});
      }
    }
    if (!is_good) endAll(groups, SIGKILL);
    return is_good;
  }

  /// A compiler that receives SIGTERM deletes its files in /tmp.
  static void endAll(const pid_t (&groups)[kMostUnits], int order) {
    for (const pid_t group : groups) {
      if (group > 0) ::kill(-group, order);
    }
  }
};

/// Returns ": " and the first error of the compiler, or its first line; "" if it has said nothing.
std::string firstComplaint(const std::string& messages) {
  std::istringstream lines(messages);
  std::string first;
  for (std::string line; std::getline(lines, line);) {
    const bool is_error = line.find("error: ") != line.npos;
    if (is_error || first.empty()) first = line;
    if (is_error) break;
  }
  return first.empty() ? "" : ": " + escaped(first, 300);
}

/// Runs the compiler, units in parallel; returns an empty reason when it made `workshop.output()`.
std::string compile(const std::string& program, unsigned units, const Workshop& workshop,
                    int patience) {
  std::vector<std::vector<std::string>> commands(units);
  std::vector<CommandLine> arguments;
  std::vector<std::string> link{program, "-shared", "-o", workshop.output()};
  for (unsigned unit = 0; unit < units; ++unit) {
    std::vector<std::string>& words = commands[unit];
    words = {program};
    words.insert(words.end(), std::begin(kOptions), std::end(kOptions));
    words.insert(words.end(), {"-DUNITS=" + std::to_string(units), "-DUNIT=" + std::to_string(unit),
                               "-c", "-o", workshop.object(unit), workshop.source()});
    arguments.push_back(commandLineOf(words));
    link.push_back(workshop.object(unit));
  }
  link.emplace_back("-lm");
  const CommandLine of_link = commandLineOf(link);

  const pid_t parent = ::getpid();
  sigset_t all;
  sigset_t before;
  ::sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);  // handlers run in this program only
  const pid_t foreman = ::fork();
  if (foreman == 0) Foreman::run(parent, arguments, of_link, workshop);
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  if (foreman < 0) return program + " cannot be run: " + describeError();

  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(patience);
  std::string reason;
  int status = 0;
  for (pid_t ended = 0; (ended = ::waitpid(foreman, &status, WNOHANG)) != foreman;) {
    if (ended < 0 && errno != EINTR) return program + " got lost: " + describeError();
    if (reason.empty()) {
      if (Interruption::isWanted()) reason = "it was interrupted";
      if (std::chrono::steady_clock::now() > give_up) {
        reason = program + " took more than " + std::to_string(patience) + " s";
      }
      if (!reason.empty()) ::kill(foreman, SIGTERM);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (!reason.empty()) return reason;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
  return program + " failed" + firstComplaint(readAll(workshop.messages()));
}

bool writeAll(const std::string& path, const std::string& text, std::ios::openmode mode) {
  std::ofstream file(path, mode | std::ios::binary);
  file << text;
  file.close();
  return file.good();
}

/// Compiles into `path`; returns an empty reason when it exists afterwards.
std::string makeKernel(const std::string& compiler, const std::string& source,
                       const std::string& path, int patience) {
  const Workshop workshop(path);
  if (!workshop.exists()) return path + " cannot be written: " + describeError();
  if (!writeAll(workshop.source(), source, std::ios::trunc)) {
    return workshop.source() + " cannot be written: " + describeError();
  }
  const bool has_units = source.find(KernelLibrary::kUnits) != std::string::npos;
  const unsigned most = has_units ? kMostUnits : 1;
  const unsigned units = std::clamp(std::thread::hardware_concurrency(), 1U, most);
  std::string reason = compile(compiler, units, workshop, patience);
  if (!reason.empty()) return reason;
  // The loader ignores bytes after an object's end.
  const std::string& output = workshop.output();
  const bool is_whole = writeAll(output, sumOf(readAll(output)), std::ios::app);
  if (is_whole && ::rename(output.c_str(), path.c_str()) == 0) return "";
  return path + " cannot be written: " + describeError();
}

/// True when `path` is a kernel of this user, written completely.
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
                                                   std::string* reason, const Check& is_right) {
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
  if (missing != Missing::kLeave) *reason = makeFolder(folder);
  if (reason->empty()) *reason = checkFolder(folder);
  if (!reason->empty()) return nullptr;
  for (bool was_compiled = false; !was_compiled;) {
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
    if (void* handle = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL); handle == nullptr) {
      *reason = "it cannot be loaded: " + std::string(::dlerror());
    } else {
      std::shared_ptr<KernelLibrary> library(new KernelLibrary(handle, was_compiled));
      if (!is_right || is_right(library)) return library;
      *reason = "it does not give the interpreter's numbers";
    }
    // If kept, it would be rejected by every later run. One from the cache is compiled again.
    ::unlink(path.c_str());
    if (missing == Missing::kLeave) return nullptr;
    if (!was_compiled) reason->clear();
  }
  return nullptr;
}

}  // namespace variator_sim
