/// How late the ticks of about the last second began.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace variator_sim {

/// Quantiles and the maximum, ns.
struct Lateness {
  std::int64_t p50 = 0;
  std::int64_t p99 = 0;
  std::int64_t max = 0;
};

/// A histogram of durations in ns: 32 bins per factor of two, so that a quantile is known to 3.1 %,
/// and mostly far better; nothing is allocated. [loop]
class LatenessHistogram {
 public:
  void add(std::int64_t lateness) {
    ++bins_[static_cast<std::size_t>(binOf(lateness))];
    ++count_;
    max_ = std::max(max_, lateness);
  }
  void merge(const LatenessHistogram& other) {
    for (std::size_t i = 0; i < bins_.size(); ++i) bins_[i] += other.bins_[i];
    count_ += other.count_;
    max_ = std::max(max_, other.max_);
  }
  std::uint64_t count() const { return count_; }
  std::int64_t max() const { return max_; }

  /// The quantile (0 < fraction <= 1), as if the entries of its bin lay evenly there, never above
  /// max(); 0 when empty. ns.
  std::int64_t quantile(double fraction) const {
    const double wanted = std::max(1.0, std::ceil(fraction * static_cast<double>(count_)));
    double seen = 0.0;
    for (int bin = 0; bin < kBins; ++bin) {
      const double here = bins_[static_cast<std::size_t>(bin)];
      if (seen + here < wanted) {
        seen += here;
        continue;
      }
      // Entry i of n in a bin stands at (i - 1/2) / n of it.
      const auto width = static_cast<double>(lowerEdge(bin + 1) - lowerEdge(bin));
      const auto inside = static_cast<std::int64_t>(width * (wanted - seen - 0.5) / here);
      return std::min(lowerEdge(bin) + inside, max_);
    }
    return max_;
  }

 private:
  static constexpr int kPartBits = 5;
  static constexpr int kBinsPerOctave = 1 << kPartBits;
  static constexpr int kBins = (41 - kPartBits) * kBinsPerOctave;  // up to 2^40 ns = 18 minutes

  /// Bin of x >= 32: octave o = floor(log2 x), then the five bits after the leading one, so
  /// bin = 32 (o - 4) + those bits. Below 32 ns every value has its own bin.
  static int binOf(std::int64_t lateness) {
    if (lateness < kBinsPerOctave) return static_cast<int>(std::max<std::int64_t>(lateness, 0));
    const auto value = static_cast<std::uint64_t>(lateness);
    const int octave = 63 - __builtin_clzll(value);
    const int part = static_cast<int>((value >> (octave - kPartBits)) % kBinsPerOctave);
    return std::min(kBinsPerOctave * (octave - kPartBits + 1) + part, kBins - 1);
  }
  /// The least value of a bin; the next bin's is one above its greatest.
  static std::int64_t lowerEdge(int bin) {
    if (bin < kBinsPerOctave) return bin;
    const int octave = bin / kBinsPerOctave + kPartBits - 1;
    const std::int64_t part = bin % kBinsPerOctave;
    return (kBinsPerOctave + part) << (octave - kPartBits);
  }

  std::array<std::uint32_t, kBins> bins_{};
  std::uint64_t count_ = 0;
  std::int64_t max_ = 0;
};

/// A window that slides in slices: the last kSlices complete slices count. [loop]
class LatenessWindow {
 public:
  static constexpr int kSlices = 10;

  void add(std::int64_t lateness) { slices_[current_].add(lateness); }
  /// Ends the current slice; the oldest one is forgotten.
  void nextSlice() {
    current_ = (current_ + 1) % kSlices;
    slices_[current_] = {};
  }
  void clear() { *this = {}; }
  /// All slices, the current one included.
  LatenessHistogram total() const {
    LatenessHistogram sum;
    for (const LatenessHistogram& slice : slices_) sum.merge(slice);
    return sum;
  }

 private:
  std::array<LatenessHistogram, kSlices> slices_;
  std::size_t current_ = 0;
};

}  // namespace variator_sim
