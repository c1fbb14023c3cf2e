/// Explicit Runge-Kutta steps: one kernel for every tableau.
///
/// The stages of the angles are left out where nothing reads angles: they are a quadrature then,
/// taken once at the end of the step. Sums are unrolled when compiled and coefficients that are
/// zero cost nothing.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "dynamics/shaft_count.h"
#include "integrate/stepper.h"
#include "integrate/tableaus.h"

namespace variator_sim {
namespace {

template <class Tableau>
class ExplicitStepper final : public Stepper {
 public:
  ExplicitStepper(const System& system, Tolerance tolerance)
      : Stepper(system, tolerance),
        size_(system.size()),
        first_(system.readsAngles() ? 0 : system.shafts()),
        integrates_torque_(system.integratesTorque()),
        y_(size_),
        k_(makeStates(size_, std::make_index_sequence<kSlopes>{})),
        term_(makeStates(size_, std::make_index_sequence<kTerms>{})),
        torque_rates_(Tableau::kStages, ShaftVector(system.shafts())),
        refined_(makeStates(size_, std::make_index_sequence<kRefined>{})),
        slope_(Tableau::kExtraStages == 0 ? 0 : 7, y_) {}

  const char* name() const override { return Tableau::kName; }
  int errorOrder() const override { return Tableau::kErrorOrder; }
  double work() const override { return Tableau::kStages; }
  bool projects() const override { return Tableau::kEndsInStage; }
  bool hasDenseOutput() const override { return true; }
  bool checksDenseOutput() const override { return Tableau::kExtraStages > 0; }

  double step(System& system, const StepNode& from, double h, State& x_new,
              State& dxdt_new) override {
    from_ = &from;
    h_ = h;
    is_prepared_ = false;
    k_[0] = from.dxdt;
    y_ = from.x;
    takeStages(system, std::make_index_sequence<Tableau::kStages - 1>{});
    combineEnd(std::make_index_sequence<Tableau::kStages>{}, x_new);
    if constexpr (!Tableau::kEndsInStage) {
      return calcError(from.x, x_new);
    } else {
      if (!takeEndStage(system, from.time + h, x_new, dxdt_new)) {
        return std::numeric_limits<double>::quiet_NaN();
      }
      return calcError(from.x, x_new, dxdt_new);
    }
  }

  void calcTorqueGain(System& /*system*/, const StepNode& from, const StepNode& to,
                      TorqueGain& gain) override {
    torque_rates_[0] = from.torque_rate;
    gain.addStages(to.time - from.time, Tableau::b, torque_rates_);
  }

  double stiffness(const State& x_new, const State& dxdt_new) const override {
    // |h lambda| from the two derivatives at the end of the step (Solving ODE II, IV.2).
    const State& slope = k_[Tableau::kStages - 1];
    double distance = 0.0;
    double change = 0.0;
    for (int n = first_; n < size_; ++n) {
      const double allowance = tolerance_.of(x_new[n]);
      distance = std::max(distance, std::abs(x_new[n] - y_[n]) / allowance);
      change = std::max(change, std::abs(dxdt_new[n] - slope[n]) / allowance);
    }
    return distance > 0.0 ? h_ * change / distance / Tableau::kStabilityBound : 0.0;
  }

  bool interpolate(System& system, double time, const StepNode& from, const StepNode& to,
                   State& x) override {
    if (!is_prepared_) prepare(system, from, to);
    if (!is_trusted_) return false;
    const double theta = (time - from.time) / (to.time - from.time);
    if constexpr (Tableau::kExtraStages == 0) {
      evaluate(from, theta, x);
    } else {
      for (int n = 0; n < size_; ++n) {
        double sum = 0.0;
        for (std::size_t p = 8; p-- > 0;) sum = (sum + refined_[p][n]) * theta;
        x[n] = from.x[n] + sum;
      }
    }
    return true;
  }

 private:
  static constexpr std::size_t kTerms = Tableau::kExtraStages == 0 ? 4 : 7;
  static constexpr std::size_t kSlopes = Tableau::kStages + (Tableau::kExtraStages == 0 ? 1 : 4);
  static constexpr std::size_t kRefined = Tableau::kExtraStages == 0 ? 0 : 8;
  /// In place: the compiler knows then that sums of slopes do not write to them.
  template <std::size_t... J>
  static std::array<State, sizeof...(J)> makeStates([[maybe_unused]] int size,
                                                    std::index_sequence<J...>) {
    return {(static_cast<void>(J), State(size))...};
  }
  /// x = (phi, omega), under the classical principle.
  bool followsAccelerations() const { return !integrates_torque_; }

  using Terms = std::make_index_sequence<Tableau::kStages>;

  /// sum_j coefficient[j] k_j of component n; a coefficient that is zero is no operation.
  template <const auto& kCoefficients, std::size_t... J>
  double sumStages(int n, std::index_sequence<J...>) const {
    double sum = 0.0;
    ((kCoefficients[J] != 0.0 ? void(sum += kCoefficients[J] * k_[J][n]) : void()), ...);
    return sum;
  }
  /// x_new = x + h sum_j b_j k_j.
  template <std::size_t... J>
  void combineEnd(std::index_sequence<J...> terms, State& x_new) const {
    forEachComponent(0, size_,
                     [&](int n) { x_new[n] = from_->x[n] + h_ * sumStages<Tableau::b>(n, terms); });
  }
  /// y = x + h sum_j a_ij k_j, j < i.
  template <std::size_t I, std::size_t... J>
  void combineStage(std::index_sequence<J...>) {
    const double* x = from_->x.data();
    const double h = h_;
    forEachComponent(first_, size_, [&](int n) {
      double sum = 0.0;
      ((Tableau::a[I][J] != 0.0 ? void(sum += Tableau::a[I][J] * k_[J][n]) : void()), ...);
      y_[n] = x[n] + h * sum;
    });
  }
  template <std::size_t I>
  void takeStage(System& system) {
    combineStage<I>(std::make_index_sequence<I>{});
    system(y_, k_[I], from_->time + Tableau::c[I] * h_);
    if constexpr (I < Tableau::kStages) {
      if (integrates_torque_) torque_rates_[I].assign(system.torqueRate());
    }
  }
  template <std::size_t... I>
  void takeStages(System& system, std::index_sequence<I...>) {
    (takeStage<I + 1>(system), ...);
  }

  /// The stage at the projected end of the step. False when the projection failed.
  bool takeEndStage(System& system, double t, State& x_new, State& dxdt_new) {
    StepProjection& projection = projection_;
    projection.iterations = 0;
    for (int n = 0; n < size_; ++n) {
      if (!std::isfinite(x_new[n])) return false;
    }
    projection.result = system.project(t, x_new, projection.moved, &projection.iterations);
    if (projection.result != ProjectionResult::kConverged) return false;
    system(x_new, dxdt_new, t);
    return true;
  }

  /// The error of a scheme with one estimate, e = h sum_j e_j k_j, in units of the tolerance.
  double calcError(const State& x, const State& x_new, const State& dxdt_new) {
    double largest = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    forEachComponent(0, size_, [&](int n) {
      const double error =
          h_ * (sumStages<Tableau::e>(n, Terms{}) + Tableau::e[Tableau::kStages] * dxdt_new[n]);
      error_[n] = error;
      largest = std::max(largest, std::abs(error) / tolerance_.of(x[n], x_new[n]));
      poison += 0.0 * (error + x_new[n]);
    });
    // Where the torques themselves are integrated nothing else looks at the step (checkTorque).
    if (!integrates_torque_) {
      if (largest <= 1.0 && !isResolved(x, x_new, dxdt_new)) largest = kUnresolved;
    }
    return largest + poison;
  }

  /// False where the slopes vary so wildly over a step that its error estimate, one number, may be
  /// small by chance, as on both sides of a pole: where the term of degree 4 of the motion (that of
  /// the dense output, of order h^4) is more than half a step with the largest slope, and counts.
  bool isResolved(const State& x, const State& x_new, const State& dxdt_new) const {
    for (int n = 0; n < size_; ++n) {
      const double last = Tableau::d[Tableau::kStages] * dxdt_new[n];
      const double term = std::abs(h_ * (sumStages<Tableau::d>(n, Terms{}) + last));
      if (!(term > 10.0 * tolerance_.of(x[n], x_new[n]))) continue;
      double steepest = std::abs(dxdt_new[n]);
      for (std::size_t j = 0; j < Tableau::kStages; ++j) {
        if (Tableau::d[j] != 0.0) steepest = std::max(steepest, std::abs(k_[j][n]));
      }
      if (term > 0.5 * h_ * steepest) return false;
    }
    return true;
  }

  /// Of one with two estimates, e5 of order h^6 and e3 of order h^4: |e5|^2 / sqrt(|e5|^2 +
  /// |e3|^2 / 100), which is of order h^8 (Solving ODE I, II.10).
  double calcError(const State& x, const State& x_new) {
    double size5 = 0.0;
    double size3 = 0.0;
    double poison = 0.0;
    forEachComponent(0, size_, [&](int n) {
      const double scale = h_ / tolerance_.of(x[n], x_new[n]);
      const double e5 = sumStages<Tableau::e5>(n, Terms{});
      error_[n] = h_ * e5;
      size5 = std::max(size5, std::abs(scale * e5));
      size3 = std::max(size3, std::abs(scale * sumStages<Tableau::e3>(n, Terms{})));
      poison += 0.0 * x_new[n];
    });
    if (!(size5 > 0.0)) return poison;
    // By the quotient, as squares of commands that fade away underflow.
    const double quotient = size3 / size5;
    const double part = 1.0 / std::sqrt(1.0 + 0.01 * quotient * quotient);
    for (double& error : error_) error *= part;
    return size5 * part + poison;
  }

  /// The scheme's own dense output.
  void evaluate(const StepNode& from, double theta, State& x) const {
    const double rest = 1.0 - theta;
    for (int n = 0; n < size_; ++n) {
      // Horner's rule in theta and 1 - theta in turn
      double sum = 0.0;
      for (std::size_t p = kTerms; p-- > 0;)
        sum = (sum + term_[p][n]) * (p % 2 == 0 ? theta : rest);
      x[n] = from.x[n] + sum;
    }
  }

  /// The dense output of order 7 of DOP853 is worse than its steps of order 8 by up to some hundred
  /// times (measured: test/stepper_test.cpp). Five more derivatives taken on it, which err by one
  /// order of h less than it does once integrated, give a polynomial of order 8: the one of degree
  /// 8 through both ends with the slopes there and at the five points.
  void refine(System& system, const StepNode& from, const StepNode& to, double h) {
    std::vector<State>& slope = slope_;
    slope[0] = from.dxdt;
    slope[6] = to.dxdt;
    for (std::size_t i = 0; i < 5; ++i) {
      evaluate(from, Tableau::refined_c[i], y_);
      system(y_, slope[i + 1], from.time + Tableau::refined_c[i] * h);
    }
    for (int n = 0; n < size_; ++n) {
      const double change = to.x[n] - from.x[n];
      for (std::size_t p = 0; p < 8; ++p) {
        double sum = 0.0;
        for (std::size_t i = 0; i < 7; ++i) sum += Tableau::refined_slope[p][i] * slope[i][n];
        refined_[p][n] = h * sum + Tableau::refined_change[p] * change;
      }
    }
  }

  /// The largest defect h |p' - f(t, p)| of the finer dense output p, in units of the tolerance, at
  /// points between those it was made from: what p errs by is about the integral of that. Where a
  /// step is as long as its fastest component allows, its end may be right and its inside not.
  double calcDefect(System& system, const StepNode& from, const StepNode& to, double h) {
    double largest = 0.0;
    State slope(size_);
    for (double theta : Tableau::probes) {
      for (int n = 0; n < size_; ++n) {
        double sum = 0.0;
        double rate = 0.0;
        for (std::size_t p = 8; p-- > 0;) {
          sum = (sum + refined_[p][n]) * theta;
          rate = rate * theta + static_cast<double>(p + 1) * refined_[p][n];
        }
        y_[n] = from.x[n] + sum;
        k_[Tableau::kStages][n] = rate;
      }
      system(y_, slope, from.time + theta * h);
      for (int n = first_; n < size_; ++n) {
        const double defect =
            std::abs(k_[Tableau::kStages][n] - h * slope[n]) / tolerance_.of(from.x[n], to.x[n]);
        if (!(defect <= largest)) largest = defect;  // keeps a NaN
        if (defect != defect) return defect;
        // Accelerations that are no state are published as f(t, p).
        if (followsAccelerations()) {
          if (n < size_ / 2) continue;
          const double error = std::abs(k_[Tableau::kStages][n] / h - slope[n]);
          largest = std::max(largest, error / tolerance_.of(slope[n]));
        }
      }
    }
    return largest;
  }

  /// The terms of the dense output between the two ends of the last step.
  void prepare(System& system, const StepNode& from, const StepNode& to) {
    const double h = to.time - from.time;
    for (int n = 0; n < size_; ++n) {
      const double change = to.x[n] - from.x[n];
      term_[0][n] = change;
      term_[1][n] = h * from.dxdt[n] - change;
      term_[2][n] = 2.0 * change - h * (to.dxdt[n] + from.dxdt[n]);
    }
    if constexpr (Tableau::kExtraStages == 0) {
      for (int n = 0; n < size_; ++n) {
        term_[3][n] =
            h * (sumStages<Tableau::d>(n, Terms{}) + Tableau::d[Tableau::kStages] * to.dxdt[n]);
      }
    } else {
      from_ = &from;
      h_ = h;
      k_[Tableau::kStages] = to.dxdt;
      y_ = from.x;
      takeStage<Tableau::kStages + 1>(system);
      takeStage<Tableau::kStages + 2>(system);
      takeStage<Tableau::kStages + 3>(system);
      prepareHighTerms(h, std::make_index_sequence<Tableau::kStages + 4>{});
      refine(system, from, to, h);
      is_trusted_ = calcDefect(system, from, to, h) <= kTrusted;
    }
    is_prepared_ = true;
  }
  template <std::size_t... J>
  void prepareHighTerms(double h, std::index_sequence<J...> all) {
    for (int n = 0; n < size_; ++n) {
      term_[3][n] = h * sumStages<Tableau::d0>(n, all);
      term_[4][n] = h * sumStages<Tableau::d1>(n, all);
      term_[5][n] = h * sumStages<Tableau::d2>(n, all);
      term_[6][n] = h * sumStages<Tableau::d3>(n, all);
    }
  }

  /// What stands for the error of a step that is too long to have one.
  static constexpr double kUnresolved = 4.0;
  /// Tolerances that the defect of a dense output may be.
  static constexpr double kTrusted = 10.0;

  const int size_;
  const int first_;  // component that the stages need
  const bool integrates_torque_;
  const StepNode* from_ = nullptr;
  double h_ = 0.0;
  State y_;
  std::array<State, kSlopes> k_;
  std::array<State, kTerms> term_;
  std::vector<ShaftVector> torque_rates_;
  std::array<State, kRefined> refined_;
  std::vector<State> slope_;  // at the points that `refine` takes
  bool is_prepared_ = false;
  bool is_trusted_ = true;
};

}  // namespace

std::unique_ptr<Stepper> makeDopri5Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<ExplicitStepper<Dopri5Tableau>>(system, tolerance);
}
std::unique_ptr<Stepper> makeDop853Stepper(const System& system, Tolerance tolerance) {
  return std::make_unique<ExplicitStepper<Dop853Tableau>>(system, tolerance);
}

}  // namespace variator_sim
