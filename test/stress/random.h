/// Random numbers that are the same on every machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>

namespace variator_sim::test {

/// The distributions of the standard library differ from one library to the next: this is
/// splitmix64 (Steele, Lea, Flood, OOPSLA 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  /// Evenly from low to high.
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(next() >> 11) * 0x1p-53;
  }
  /// Evenly from 0 to n - 1.
  int below(int n) { return static_cast<int>(next() % static_cast<std::uint64_t>(n)); }
  bool happens(double probability) { return between(0.0, 1.0) < probability; }
  template <class Options>
  const auto& oneOf(const Options& options) {
    return options[static_cast<std::size_t>(below(static_cast<int>(std::size(options))))];
  }

 private:
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  std::uint64_t state_;
};

}  // namespace variator_sim::test
