// Machine code that cannot be had: the run goes on with the interpreter, and says why.
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <thread>

#include "machine_code/kernel_library.h"
#include "support/machine_code_folder.h"
#include "support/scenes.h"
#include "variator_sim/interruption.h"
#include "variator_sim/torque.h"

namespace variator_sim {
namespace {

namespace fs = std::filesystem;

const std::string kScene =
    test::sceneText("drive 0.5, load 1.2",
                    {"drag on load: -0.3*w2*abs(w2) + sin(phi1)",
                     "variator = SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6"},
                    "initial: {velocity: [10, 6]}");

class MachineCodeFaults : public test::MachineCodeFolder {
 protected:
  /// The motion of the interpreter goes on; what runs the formulas.
  static std::string run(bool compile = true, const std::string& rest = "") {
    Simulation interpreted(test::sceneFromText(kScene));
    interpreted.advanceTo(1.0);
    Simulation simulation(test::sceneFromText(kScene + rest));
    const bool is_loaded = simulation.loadMachineCode(compile);
    EXPECT_EQ(is_loaded, simulation.hasMachineCode());
    EXPECT_TRUE(simulation.advanceTo(1.0).ok()) << simulation.describeStatus();
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(simulation.sample().velocity[i], interpreted.sample().velocity[i]);
      EXPECT_EQ(simulation.sample().angle[i], interpreted.sample().angle[i]);
    }
    return simulation.machineCode();
  }
  /// (`always` waits for a busy compiler.)
  static void expectCompiled() {
    const std::string sentence = run(true, "solver: {machine_code: always}\n");
    EXPECT_EQ(sentence.rfind("machine code, compiled in ", 0), 0U) << sentence;
  }
  static void expectCached() { EXPECT_EQ(run(), "machine code, from the cache"); }

  /// From now on the compiler's work is done by children, as that of gcc's driver is, and has no
  /// end.
  void compileWithoutEnd() {
    compileBy("sleep 1000 & echo $! > " + (folder() / "worker").string() + ".$$; wait");
  }
  std::vector<pid_t> workers() const {
    std::vector<pid_t> found;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder())) {
      pid_t worker = 0;
      if (entry.path().stem() == "worker" && std::ifstream(entry.path()) >> worker) {
        found.push_back(worker);
      }
    }
    return found;
  }
  bool hasWorkers() const { return !workers().empty(); }
  /// A process that has ended and is not reaped yet has no command line.
  static bool isWorking(pid_t worker) {
    std::string command;
    return static_cast<bool>(std::ifstream("/proc/" + std::to_string(worker) + "/cmdline") >>
                             command);
  }
  static ::testing::AssertionResult happensSoon(const std::function<bool()>& is_so) {
    for (int look = 0; look < 1000; ++look) {
      if (is_so()) return ::testing::AssertionSuccess();
      ::usleep(10000);
    }
    return ::testing::AssertionFailure() << "not within 10 s";
  }
  void expectNoWorkersLeft() const {
    ASSERT_TRUE(hasWorkers());
    for (const pid_t worker : workers()) {
      EXPECT_TRUE(happensSoon([worker] { return !isWorking(worker); })) << "its parent has ended";
    }
  }
};

TEST_F(MachineCodeFaults, NoneOnceCompiledItIsInTheCache) {
  EXPECT_EQ(run(false), "the interpreter: it is not in the cache yet");
  EXPECT_FALSE(fs::exists(cache())) << "made for nothing";
  expectCompiled();
  ASSERT_EQ(kernels().size(), 1U) << "something is left over";
  EXPECT_EQ(kernels()[0].extension(), ".so");
  EXPECT_EQ(run(false), "machine code, from the cache");
  expectCached();
}

TEST_F(MachineCodeFaults, NeverIsNever) {
  expectCompiled();
  EXPECT_EQ(run(true, "solver: {machine_code: never}"),
            "the interpreter: 'solver/machine_code' is 'never'");
}

TEST_F(MachineCodeFaults, ACacheHasItsPlace) {
  const auto expectIn = [](const fs::path& place) {
    expectCompiled();
    EXPECT_TRUE(fs::is_directory(place)) << place;
  };
  set("HOME", (folder() / "home").c_str());
  set("XDG_CACHE_HOME", (folder() / "xdg").c_str());
  set("VARIATOR_SIM_CACHE", nullptr);
  expectIn(folder() / "xdg" / "variator_sim");
  set("XDG_CACHE_HOME", nullptr);
  expectIn(folder() / "home" / ".cache" / "variator_sim");
  set("HOME", nullptr);
  EXPECT_EQ(run(),
            "the interpreter: there is no place for it: neither VARIATOR_SIM_CACHE nor HOME is "
            "set");
}

TEST_F(MachineCodeFaults, NoCompiler) {
  set("PATH", folder().c_str());
  EXPECT_EQ(run(), "the interpreter: no compiler (cc) was found");
  set("PATH", nullptr);
  EXPECT_EQ(run(), "the interpreter: no compiler (cc) was found");
}

TEST_F(MachineCodeFaults, ACompilerThatFails) {
  const std::string cc = (folder() / "bin" / "cc").string();
  compileBy("exit 1");
  EXPECT_EQ(run(), "the interpreter: " + cc + " failed");
  compileBy("kill -9 $$");
  EXPECT_EQ(run(), "the interpreter: " + cc + " failed");
  compileBy("echo 'a warning' >&2; echo 'kernel.c:1: error: no space' >&2; echo more >&2; exit 1");
  EXPECT_EQ(run(), "the interpreter: " + cc + " failed: kernel.c:1: error: no space");
  compileBy("echo 'no licence' >&2; exit 1");
  EXPECT_EQ(run(), "the interpreter: " + cc + " failed: no licence");
  EXPECT_TRUE(kernels().empty());
  std::ofstream(cc) << "no program";
  EXPECT_EQ(run().rfind("the interpreter: " + cc, 0), 0U) << run();
}

TEST_F(MachineCodeFaults, ACompilerThatDoesNotEnd) {
  compileWithoutEnd();
  const std::string sentence = run();
  EXPECT_NE(sentence.find(" took more than 5 s"), std::string::npos) << sentence;
  expectNoWorkersLeft();
}

TEST_F(MachineCodeFaults, AnInterruptedCompilation) {
  compileWithoutEnd();
  Simulation simulation(test::sceneFromText(kScene + "solver: {machine_code: always}\n"));
  {
    const Interruption interruption([this] { return hasWorkers(); });
    EXPECT_FALSE(simulation.loadMachineCode(true));
  }
  EXPECT_EQ(simulation.machineCode(), "the interpreter: it was interrupted");
  expectNoWorkersLeft();
  EXPECT_TRUE(kernels().empty()) << "something is left over";
}

TEST_F(MachineCodeFaults, CompilersEndWithTheProgramThatStartedThem) {
  compileWithoutEnd();
  const pid_t program = ::fork();
  ASSERT_GE(program, 0);
  if (program == 0) {
    Simulation simulation(test::sceneFromText(kScene + "solver: {machine_code: always}\n"));
    ::_exit(simulation.loadMachineCode(true) ? 0 : 1);
  }
  EXPECT_TRUE(happensSoon([this] { return hasWorkers(); })) << "the compiler does not begin";
  ::kill(program, SIGKILL);
  int status = 0;
  ASSERT_EQ(::waitpid(program, &status, 0), program);
  expectNoWorkersLeft();
  EXPECT_TRUE(happensSoon([this] { return kernels().empty(); })) << "something is left over";
}

TEST_F(MachineCodeFaults, ACompilerThatMakesSomethingElse) {
  for (const char* script : {"exit 0", "echo nothing > $OUTPUT", "cat $SOURCE > $OUTPUT"}) {
    SCOPED_TRACE(script);
    compileBy(script);
    EXPECT_EQ(run().rfind("the interpreter: it cannot be loaded: ", 0), 0U) << run();
    EXPECT_TRUE(kernels().empty()) << "kept though it is of no use";
  }
  // An object without the functions, and one of other functions. (Units are compiled at once.)
  for (const char* script :
       {"[ -z $SOURCE ] || echo 'static int other;' > $SOURCE; exec cc \"$@\"",
        "[ -z $SOURCE ] || { sed 's/\\([^_-]\\)fabs(/\\1-fabs(/' $SOURCE > $SOURCE.$$; "
        "mv $SOURCE.$$ $SOURCE; }; exec cc \"$@\""}) {
    SCOPED_TRACE(script);
    compileBy(script);
    // (`always` waits for a busy compiler.)
    EXPECT_EQ(run(true, "solver: {machine_code: always}\n"),
              "the interpreter: it does not give the interpreter's numbers");
  }
}

TEST_F(MachineCodeFaults, APlaceThatIsNone) {
  std::ofstream(cache()) << "a file";
  EXPECT_EQ(run(), "the interpreter: " + cache().string() + " is no folder");
  set("VARIATOR_SIM_CACHE", (cache() / "deeper").c_str());
  EXPECT_EQ(run(), "the interpreter: the folder " + (cache() / "deeper").string() +
                       " cannot be made: Not a directory");
  set("VARIATOR_SIM_CACHE", "/proc/variator_sim");
  EXPECT_EQ(run(),
            "the interpreter: the folder /proc/variator_sim cannot be made: No such file or "
            "directory");
}

TEST_F(MachineCodeFaults, APlaceThatOthersWriteTo) {
  expectCompiled();
  const std::string refusal =
      "the interpreter: the folder " + cache().string() + " is not ours alone to write to";
  for (const auto bit : {fs::perms::group_write, fs::perms::others_write}) {
    fs::permissions(cache(), bit, fs::perm_options::add);
    EXPECT_EQ(run(), refusal);
    fs::permissions(cache(), bit, fs::perm_options::remove);
    expectCached();
  }
  // A link, which another user could redirect, is rejected, too.
  fs::rename(cache(), folder() / "elsewhere");
  fs::create_directory_symlink(folder() / "elsewhere", cache());
  EXPECT_EQ(run(), "the interpreter: " + cache().string() + " is no folder");
}

TEST_F(MachineCodeFaults, AFullDisk) {
  ASSERT_NE(std::signal(SIGXFSZ, SIG_IGN), SIG_ERR);
  rlimit before = {};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small = {100, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string sentence = run();
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_TRUE(kernels().empty()) << "something is left over";
  std::signal(SIGXFSZ, SIG_DFL);
  EXPECT_NE(sentence.find(".c cannot be written: File too large"), std::string::npos) << sentence;
  // The compiler's own files, in units of 512 bytes.
  compileBy("ulimit -f 8; exec cc \"$@\"");
  const std::string of_compiler = run();
  EXPECT_NE(of_compiler.find("/cc failed"), std::string::npos) << of_compiler;
  EXPECT_TRUE(kernels().empty()) << "something is left over";
  compileBy("exec cc \"$@\"");
  expectCompiled();
}

TEST_F(MachineCodeFaults, ADamagedFileIsMadeAnew) {
  // The compiler of one source, which makes each of its files once.
  compileBy("kept=" + folder().string() +
            "/kept_${OUTPUT##*/}; [ -f $kept ] || { cc \"$@\" && mv $OUTPUT $kept; } && cp $kept "
            "$OUTPUT");
  expectCompiled();
  ASSERT_EQ(kernels().size(), 1U);
  const fs::path kernel = kernels()[0];
  const std::string whole = read(kernel);
  std::vector<std::string> damaged = {"",
                                      "x",
                                      whole.substr(0, 100),
                                      whole.substr(0, 5000),
                                      whole.substr(0, whole.size() - 1),
                                      whole.substr(0, whole.size() - 32),
                                      whole + "x"};
  for (const std::size_t place : {std::size_t{0}, whole.size() / 3, whole.size() - 1}) {
    damaged.push_back(whole);
    damaged.back()[place] = static_cast<char>(damaged.back()[place] ^ 1);
  }
  for (const std::string& text : damaged) {
    SCOPED_TRACE(text.size());
    replace(kernel, text);
    EXPECT_EQ(run(false), "the interpreter: it is not in the cache yet");
    expectCompiled();
    expectCached();
    EXPECT_EQ(kernels().size(), 1U);
  }
  replace(kernel, "");
  fs::remove(kernel);
  fs::create_directory(kernel);
  EXPECT_NE(run().find(" cannot be written: "), std::string::npos) << run();
}

TEST_F(MachineCodeFaults, AKernelThatIsWrongIsMadeAnew) {
  expectCompiled();
  ASSERT_EQ(kernels().size(), 1U);
  const fs::path kernel = kernels()[0];
  // Written to its end, but of another scene.
  Simulation other(
      test::sceneFromText("a 1", {"it on a: -w1*w1+cos(t)"}, "solver: {machine_code: always}"));
  ASSERT_TRUE(other.loadMachineCode(true)) << other.machineCode();
  ASSERT_EQ(kernels().size(), 2U);
  const fs::path strange = kernels()[kernels()[0] == kernel ? 1 : 0];
  replace(kernel, read(strange));
  EXPECT_EQ(run(false), "the interpreter: it does not give the interpreter's numbers");
  EXPECT_EQ(run(false), "the interpreter: it is not in the cache yet");
  replace(kernel, read(strange));
  expectCompiled();
  expectCached();
}

TEST_F(MachineCodeFaults, AnotherCompilerMakesItAnew) {
  expectCompiled();
  compileBy("exec cc \"$@\"");
  expectCompiled();
  EXPECT_EQ(kernels().size(), 2U);
}

const char* const kSource = "double one(void) { return 1.0; }\n";

bool loadsOne() {
  std::string reason;
  const auto library = KernelLibrary::load(kSource, KernelLibrary::Missing::kCompile, &reason);
  if (library == nullptr || library->find("none") != nullptr) return false;
  const auto one = reinterpret_cast<double (*)()>(library->find("one"));
  return one != nullptr && one() == 1.0;
}

TEST_F(MachineCodeFaults, ManyProcessesAtOnce) {
  std::vector<pid_t> children;
  for (int n = 0; n < 4; ++n) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) ::_exit(loadsOne() ? 0 : 1);
    children.push_back(child);
  }
  for (const pid_t child : children) {
    int status = -1;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_EQ(status, 0);
  }
  EXPECT_EQ(kernels().size(), 1U) << "something is left over";
}

TEST_F(MachineCodeFaults, ProcessesOfOneNumberAtOnce) {
  // Containers that share a cache. Each process is number 1 of its own namespace.
  compileBy("cc \"$@\" && sleep 0.3");
  std::vector<pid_t> containers;
  for (int n = 0; n < 3; ++n) {
    const pid_t container = ::fork();
    ASSERT_GE(container, 0);
    if (container == 0) {
      if (::unshare(CLONE_NEWPID) != 0) ::_exit(2);
      const pid_t first = ::fork();
      if (first == 0) ::_exit(loadsOne() ? 0 : 1);
      int status = -1;
      ::_exit(::waitpid(first, &status, 0) == first && status == 0 ? 0 : 1);
    }
    containers.push_back(container);
  }
  std::vector<int> ends;
  for (const pid_t container : containers) {
    int status = -1;
    ASSERT_EQ(::waitpid(container, &status, 0), container);
    ends.push_back(WEXITSTATUS(status));
  }
  if (ends[0] == 2) GTEST_SKIP() << "only root makes namespaces";
  EXPECT_EQ(ends, std::vector<int>(3, 0));
  EXPECT_EQ(kernels().size(), 1U) << "something is left over";
  EXPECT_TRUE(loadsOne());
}

TEST_F(MachineCodeFaults, ManyThreadsAtOnce) {
  // All of them compile before one is done: the nodelets of one manager.
  compileBy("cc \"$@\" && sleep 0.3");
  bool has_one[4] = {};
  std::vector<std::thread> threads;
  for (bool& it : has_one) threads.emplace_back([&it] { it = loadsOne(); });
  for (std::thread& thread : threads) thread.join();
  for (const bool it : has_one) EXPECT_TRUE(it);
  EXPECT_EQ(kernels().size(), 1U) << "something is left over";
}

// --- what has no formula ---------------------------------------------------------------------

class Drag : public OpaqueFunction {
 public:
  Drag() : OpaqueFunction(1) {}
  double value(const double* x) const override { return -0.3 * x[0]; }
  void calcGradient(const double* /*x*/, double* gradient) const override { gradient[0] = -0.3; }
};

class OpaqueTorque : public Torque {
  void build(LawContext& scene) override {
    scene.apply(scene.shaftAt(0),
                scene.function(std::make_shared<Drag>(), {scene.shaftAt(0).velocity}));
  }
};

class Factory : public BuiltinComponentFactory {
 public:
  TorquePtr createTorque(const std::string& /*type*/) override {
    return std::make_shared<OpaqueTorque>();
  }
};

TEST_F(MachineCodeFaults, AFunctionThatIsNoFormula) {
  Factory factory;
  Simulation simulation(
      readScene(readYamlText("shafts: [a]\na: {inertia: 1}\ntorques: [it]\nit: {type: test/It}\n"
                             "initial: {velocity: [3]}\nsolver: {machine_code: always}\n",
                             "test"),
                factory));
  EXPECT_FALSE(simulation.loadMachineCode(true));
  EXPECT_EQ(simulation.machineCode(),
            "the interpreter: a law reads a function that is not a formula");
  EXPECT_TRUE(simulation.advanceTo(1.0).ok());
  EXPECT_NEAR(simulation.sample().velocity[0], 3.0 * std::exp(-0.3), 1e-8);
  EXPECT_FALSE(fs::exists(cache()));
}

}  // namespace
}  // namespace variator_sim
