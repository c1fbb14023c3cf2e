#include "dynamics/inertia.h"

#include <cmath>
#include <utility>

namespace variator_sim {
namespace {

void invert(const SquareMatrix& J, bool is_diagonal, SquareMatrix* inverse) {
  if (is_diagonal) {
    *inverse = J.diagonal().cwiseInverse().asDiagonal();
  } else {
    *inverse = invertSymmetric(J);
  }
}

}  // namespace

Inertia::Inertia(const Eigen::MatrixXd& mean, std::vector<std::vector<InertiaHarmonic>> harmonics)
    : harmonics_(std::move(harmonics)),
      mean_(mean.diagonal()),
      is_diagonal_(mean.isDiagonal(0.0)),
      J_(mean),
      first_(Vector::Zero(mean.rows())) {
  invert(J_, is_diagonal_, &inverse_);
}

void Inertia::update(const double* phi) {
  if (isConstant()) return;
  for (int i = 0; i < J_.rows(); ++i) {
    double value = mean_(i);
    double first = 0.0;
    for (const InertiaHarmonic& harmonic : harmonics_[static_cast<std::size_t>(i)]) {
      const double order = harmonic.order;
      const double c = std::cos(order * phi[i]);
      const double s = std::sin(order * phi[i]);
      value += harmonic.cosine * c + harmonic.sine * s;
      first += order * (harmonic.sine * c - harmonic.cosine * s);
    }
    J_(i, i) = value;
    first_(i) = first;
  }
  invert(J_, is_diagonal_, &inverse_);
}

}  // namespace variator_sim
