/// Machine code made at run time: C, compiled by the system's compiler for this very processor, and
/// kept for the next time.
///
/// A kernel lies in the cache as KEY.so, KEY being a hash of its C, of the compiler and its options
/// and of the processor. It is made in a separate folder per compilation and renamed, so that
/// processes may make it at once; a checksum at its end shows that it is complete. Compilers end
/// with the program that has started them. No shell is involved; no file is loaded from a directory
/// that others may write to.
///
/// Location: $VARIATOR_SIM_CACHE, or $XDG_CACHE_HOME/variator_sim, or ~/.cache/variator_sim.
#pragma once

#include <functional>
#include <memory>
#include <string>

namespace variator_sim {

/// Loaded code, unloaded with its last owner.
class KernelLibrary {
 public:
  /// A text that contains this is compiled in several units in parallel, one per processor, each
  /// with another `UNIT` of `UNITS`: definitions common to all of them have to be static.
  static constexpr const char* kUnits = "#ifndef UNITS\n#define UNITS 1\n#define UNIT 0\n#endif\n";
  /// Enclose text of the last unit alone.
  static constexpr const char* kLastUnit = "#if UNIT == UNITS - 1\n";
  static constexpr const char* kEndOfUnit = "#endif\n";

  ~KernelLibrary();
  KernelLibrary(const KernelLibrary&) = delete;
  KernelLibrary& operator=(const KernelLibrary&) = delete;

  /// Returns the function of this name; null when there is none.
  void* find(const char* name) const;

  /// Tells whether code missing in the cache is compiled (kCompile: within 5 s,
  /// kCompilePatiently: within 10 minutes, or not at all).
  enum class Missing { kCompile, kCompilePatiently, kLeave };
  /// Checks that a library gives the expected results.
  using Check = std::function<bool(const std::shared_ptr<KernelLibrary>&)>;
  /// Returns the library of `source`, or null and the `reason`, as the end of a sentence ("no
  /// compiler (cc) was found"). One that fails the check is removed from the cache and, unless it
  /// has just been compiled, compiled again. Never throws; takes a second or so to compile, unless
  /// an Interruption ends that.
  static std::shared_ptr<KernelLibrary> load(const std::string& source, Missing missing,
                                             std::string* reason, const Check& is_right = nullptr);
  /// True when the last `load` of this object compiled it.
  bool wasCompiled() const { return was_compiled_; }

 private:
  KernelLibrary(void* handle, bool was_compiled) : handle_(handle), was_compiled_(was_compiled) {}
  void* handle_;
  bool was_compiled_;
};

}  // namespace variator_sim
