/// How late the ticks of about the last second began.
#pragma once

#include <array>
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
  void add(std::int64_t lateness);
  void clear();
  void merge(const LatenessHistogram& other);
  std::uint64_t count() const { return count_; }
  /// The quantile (0 < fraction <= 1), as if the entries of its bin lay evenly there, never above
  /// max(); 0 when empty. ns.
  std::int64_t quantile(double fraction) const;
  std::int64_t max() const { return max_; }

 private:
  static constexpr int kPartBits = 5;
  static constexpr int kBinsPerOctave = 1 << kPartBits;
  static constexpr int kBins = (41 - kPartBits) * kBinsPerOctave;  // up to 2^40 ns = 18 minutes

  static int binOf(std::int64_t lateness);
  /// The least value of a bin; the next bin's is one above its greatest.
  static std::int64_t lowerEdge(int bin);

  std::array<std::uint32_t, kBins> bins_{};
  std::uint64_t count_ = 0;
  std::int64_t max_ = 0;
};

/// A window that slides in slices: the last kSlices complete slices count. [loop]
class LatenessWindow {
 public:
  static constexpr int kSlices = 10;

  void add(std::int64_t lateness) { slices_[static_cast<std::size_t>(current_)].add(lateness); }
  /// Ends the current slice; the oldest one is forgotten.
  void nextSlice();
  void clear();
  /// All slices, the current one included.
  LatenessHistogram total() const;

 private:
  std::array<LatenessHistogram, kSlices> slices_;
  int current_ = 0;
};

}  // namespace variator_sim
