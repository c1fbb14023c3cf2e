#include "variator_sim/inertia.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamics/dense.h"

namespace variator_sim {

Inertia::Inertia(const Eigen::MatrixXd& mean, std::vector<std::vector<InertiaHarmonic>> harmonics)
    : S(static_cast<int>(mean.rows())), harmonics_(std::move(harmonics)) {
  std::fill_n(angle_, kMaxShafts, std::numeric_limits<double>::quiet_NaN());
  for (int i = 0; i < S; ++i) {
    mean_[i] = mean(i, i);
    for (int j = 0; j < S; ++j) {
      matrix_[i][j] = mean(i, j);
      if (i != j && mean(i, j) != 0.0) diagonal_ = false;
    }
  }
  for (const auto& shaft : harmonics_) constant_ = constant_ && shaft.empty();
  invert();
}

bool Inertia::isAt(const double* phi) const {
  for (int i = 0; i < S; ++i) {
    if (!harmonics_[static_cast<std::size_t>(i)].empty() && !(phi[i] == angle_[i])) return false;
  }
  return true;
}

void Inertia::updateAll(const double* phi) {
  for (int i = 0; i < S; ++i) {
    const auto& shaft = harmonics_[static_cast<std::size_t>(i)];
    if (shaft.empty()) continue;
    angle_[i] = phi[i];
    double value = mean_[i];
    double first = 0.0;
    for (const InertiaHarmonic& harmonic : shaft) {
      const double order = harmonic.order;
      const double c = std::cos(order * phi[i]);
      const double s = std::sin(order * phi[i]);
      value += harmonic.cosine * c + harmonic.sine * s;
      first += order * (harmonic.sine * c - harmonic.cosine * s);
    }
    matrix_[i][i] = value;
    first_[i] = first;
  }
  invert();
}

void Inertia::invert() {
  if (diagonal_) {
    for (int i = 0; i < S; ++i) inverse_diagonal_[i] = 1.0 / matrix_[i][i];
    return;
  }
  invertSymmetric(S, matrix_, inverse_);
}

}  // namespace variator_sim
