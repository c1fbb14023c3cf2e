/// Vectors of a scene's size, known at load: numbers in place, without allocation.
#pragma once

#include <algorithm>
#include <cstddef>

#include "variator_sim/types.h"

namespace variator_sim {

/// Holds up to `kCapacity` doubles and their number. Copies copy just these.
template <int kCapacity>
class SmallVector {
 public:
  /// `size` zeros, at most kCapacity.
  explicit SmallVector(int size) : size_(size) { fill(0.0); }
  SmallVector(const SmallVector& other) : size_(other.size_) { copy(other); }
  SmallVector& operator=(const SmallVector& other) {
    if (this == &other) return *this;
    size_ = other.size_;
    copy(other);
    return *this;
  }
  ~SmallVector() = default;

  int size() const { return size_; }
  bool isFinite() const {
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int i = 0; i < size_; ++i) poison += 0.0 * values_[i];
    return poison == 0.0;
  }
  double& operator[](int i) { return values_[i]; }
  double operator[](int i) const { return values_[i]; }
  double* data() { return values_; }
  const double* data() const { return values_; }
  double* begin() { return values_; }
  const double* begin() const { return values_; }
  double* end() { return values_ + size_; }
  const double* end() const { return values_ + size_; }
  void fill(double value) { std::fill_n(values_, size_, value); }

 private:
  void copy(const SmallVector& other) { std::copy_n(other.values_, size_, values_); }
  int size_;
  double values_[kCapacity];
};

/// x of a system: (phi, omega, epsilon), or (phi, omega).
using State = SmallVector<3 * kMaxShafts>;

}  // namespace variator_sim
