/// Machine code made at run time: C, compiled by the system's compiler for this very processor, and
/// kept for the next time.
///
/// A kernel lies in the cache as KEY.so, KEY being a hash of its C, of the compiler and its options
/// and of the processor. It is made in a folder of that compilation's own and renamed, so that
/// processes may make it at once; a sum at its end tells whether all of it is there. Compilers end
/// with the program that has started them. No shell is involved; nothing is loaded from a directory
/// that others may write to.
///
/// Where: $VARIATOR_SIM_CACHE, or $XDG_CACHE_HOME/variator_sim, or ~/.cache/variator_sim.
#pragma once

#include <functional>
#include <memory>
#include <string>

namespace variator_sim {

/// Loaded code; gone with its last owner.
class KernelLibrary {
 public:
  /// A text with this in it is compiled several times at once, as there are processors, each with
  /// another `UNIT` of `UNITS`: what is defined in all of them has to be static.
  static constexpr const char* kUnits = "#ifndef UNITS\n#define UNITS 1\n#define UNIT 0\n#endif\n";
  /// Around what is in the first of them alone.
  static constexpr const char* kFirstUnit = "#if UNIT == 0\n";
  static constexpr const char* kEndOfUnit = "#endif\n";

  ~KernelLibrary();
  KernelLibrary(const KernelLibrary&) = delete;
  KernelLibrary& operator=(const KernelLibrary&) = delete;

  /// The function of this name; null when there is none.
  void* find(const char* name) const;

  /// Whether code that is not in the cache yet is compiled.
  /// (kCompile: within 5 s, kCompilePatiently: within 10 minutes, or not at all).
  enum class Missing { kCompile, kCompilePatiently, kLeave };
  /// Whether a library does what it is for.
  using Check = std::function<bool(const std::shared_ptr<KernelLibrary>&)>;
  /// The library of `source`. Null where there is none, and `reason` then says why, as the end of
  /// a sentence ("no compiler (cc) was found"). One that fails the check is taken out of the cache
  /// and, if it has not just been compiled, made anew. Never throws; takes a second or so to
  /// compile, unless an Interruption ends that.
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
