#include "dynamics/inertia.h"

#include <cmath>

namespace variator_sim {
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
}

}  // namespace variator_sim
