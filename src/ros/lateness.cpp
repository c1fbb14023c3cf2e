#include "ros/lateness.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

// Bin of x >= 32: octave o = floor(log2 x), then the five bits after the leading one, so
// bin = 32 (o - 4) + those bits. Below 32 ns every value has its own bin.
int LatenessHistogram::binOf(std::int64_t lateness) {
  if (lateness < kBinsPerOctave) return static_cast<int>(std::max<std::int64_t>(lateness, 0));
  const auto value = static_cast<std::uint64_t>(lateness);
  const int octave = 63 - __builtin_clzll(value);
  const int part = static_cast<int>((value >> (octave - kPartBits)) % kBinsPerOctave);
  return std::min(kBinsPerOctave * (octave - kPartBits + 1) + part, kBins - 1);
}

std::int64_t LatenessHistogram::lowerEdge(int bin) {
  if (bin < kBinsPerOctave) return bin;
  const int octave = bin / kBinsPerOctave + kPartBits - 1;
  const std::int64_t part = bin % kBinsPerOctave;
  return (kBinsPerOctave + part) << (octave - kPartBits);
}

void LatenessHistogram::add(std::int64_t lateness) {
  ++bins_[static_cast<std::size_t>(binOf(lateness))];
  ++count_;
  max_ = std::max(max_, lateness);
}

void LatenessHistogram::clear() {
  bins_.fill(0);
  count_ = 0;
  max_ = 0;
}

void LatenessHistogram::merge(const LatenessHistogram& other) {
  for (std::size_t i = 0; i < bins_.size(); ++i) bins_[i] += other.bins_[i];
  count_ += other.count_;
  max_ = std::max(max_, other.max_);
}

std::int64_t LatenessHistogram::quantile(double fraction) const {
  if (count_ == 0) return 0;
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

void LatenessWindow::nextSlice() {
  current_ = (current_ + 1) % kSlices;
  slices_[static_cast<std::size_t>(current_)].clear();
}

void LatenessWindow::clear() {
  for (LatenessHistogram& slice : slices_) slice.clear();
  current_ = 0;
}

LatenessHistogram LatenessWindow::total() const {
  LatenessHistogram sum;
  for (const LatenessHistogram& slice : slices_) sum.merge(slice);
  return sum;
}

}  // namespace variator_sim
