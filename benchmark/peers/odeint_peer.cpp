// Peer: the plain Boost.Odeint program that one would write for one scene.
#include <algorithm>
#include <array>
#include <boost/numeric/odeint.hpp>
#include <boost/numeric/ublas/matrix.hpp>
#include <boost/numeric/ublas/vector.hpp>
#include <exception>
#include <string>
#include <utility>

#include "method.h"

// Odeint copies its steppers with arrays that have no values yet; inlined, that is warned of here.
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"

namespace variator_sim::benchmark {
namespace {

namespace odeint = boost::numeric::odeint;
namespace ublas = boost::numeric::ublas;

struct TimeOut : std::exception {};

/// The first step that the program tries: Odeint asks its user for one.
double chooseFirstStep(const SceneCase& scene) {
  return scene.tau > 0.0 ? std::clamp(0.1 * scene.tau, 1e-9, 1e-3) : 1e-3;
}

/// integrate_adaptive over a vector of this type.
template <template <class> class SceneOf, class State>
class OdeintMethod : public PeerMethod<SceneOf> {
 protected:
  using Base = PeerMethod<SceneOf>;

  OdeintMethod(std::string name, const SceneCase& scene, double first_step)
      : Base(std::move(name), scene), first_step_(first_step) {}

  /// Plays the problem with the stepper of `make(tolerance)`; `jacobian`: nothing, or what the
  /// system needs beside its right-hand sides.
  template <class MakeStepper, class... Jacobian>
  bool playWith(const MakeStepper& make, const Jacobian&... jacobian) {
    this->failure_ = "ok";
    this->steps_ = 0;
    auto& problem = this->problem_;
    const auto rates = [&problem](const State& x, State& dxdt, double t) {
      if (!problem(t, &x[0], &dxdt[0])) throw TimeOut();
    };
    State state{};
    if constexpr (sizeof...(Jacobian) > 0) state.resize(Base::kState);
    try {
      return problem.play(this->x_, [&](double t0, double t1, double* x) {
        std::copy(x, x + Base::kState, state.begin());
        const auto advance = [&](const auto& system) {
          return odeint::integrate_adaptive(make(tolerance_), system, state, t0, t1, first_step_);
        };
        if constexpr (sizeof...(Jacobian) > 0) {
          this->steps_ += advance(std::make_pair(rates, jacobian...));
        } else {
          this->steps_ += advance(rates);
        }
        std::copy(state.begin(), state.end(), x);
        return true;
      });
    } catch (const std::exception&) {
      this->failure_ = "step adjustment failed";
      return false;
    }
  }

 private:
  std::string prepare(double tolerance) override {
    tolerance_ = tolerance;
    return "";
  }

  double tolerance_ = 0.0;
  double first_step_;
};

template <template <class> class SceneOf>
using Array = std::array<double, PeerMethod<SceneOf>::kState>;

/// A controlled stepper over std::array.
template <template <class> class SceneOf, template <class...> class Stepper>
class ControlledOdeint : public OdeintMethod<SceneOf, Array<SceneOf>> {
 public:
  ControlledOdeint(std::string name, const SceneCase& scene)
      : OdeintMethod<SceneOf, Array<SceneOf>>(std::move(name), scene, chooseFirstStep(scene)) {}
  bool run() override {
    return this->playWith([](double tolerance) {
      return odeint::make_controlled<Stepper<Array<SceneOf>>>(tolerance, tolerance);
    });
  }
};

template <class State>
using Dopri5 = odeint::runge_kutta_dopri5<State>;
template <class State>
using Fehlberg78 = odeint::runge_kutta_fehlberg78<State>;

/// The extrapolation method is a controlled stepper by itself.
template <template <class> class SceneOf>
class BulirschStoerOdeint : public OdeintMethod<SceneOf, Array<SceneOf>> {
 public:
  BulirschStoerOdeint(std::string name, const SceneCase& scene)
      : OdeintMethod<SceneOf, Array<SceneOf>>(std::move(name), scene,
                                              10.0 * chooseFirstStep(scene)) {}
  bool run() override {
    return this->playWith([](double tolerance) {
      return odeint::bulirsch_stoer<Array<SceneOf>>(tolerance, tolerance);
    });
  }
};

/// rosenbrock4 with exact Jacobians; it works on uBLAS types only.
template <template <class> class SceneOf>
class RosenbrockOdeint : public OdeintMethod<SceneOf, ublas::vector<double>> {
  using State = ublas::vector<double>;
  using Matrix = ublas::matrix<double>;

 public:
  RosenbrockOdeint(std::string name, const SceneCase& scene)
      : OdeintMethod<SceneOf, State>(std::move(name), scene, chooseFirstStep(scene)) {}
  bool run() override {
    const auto make = [](double tolerance) {
      return odeint::make_controlled<odeint::rosenbrock4<double>>(tolerance, tolerance);
    };
    const auto jacobian = [this](const State& x, Matrix& entries, const double& t, State& dfdt) {
      constexpr int N = PeerMethod<SceneOf>::kState;
      double columns[N * N];
      this->problem_.jacobian(t, &x[0], columns, &dfdt[0]);
      for (int i = 0; i < N; ++i) {
        for (int j = 0; j < N; ++j) {
          entries(static_cast<std::size_t>(i), static_cast<std::size_t>(j)) = columns[i + N * j];
        }
      }
    };
    return this->playWith(make, jacobian);
  }
};

template <template <class> class SceneOf>
void addMethods(const SceneCase& scene, Methods& methods, SceneTag<SceneOf> /*tag*/) {
  methods.push_back(std::make_unique<ControlledOdeint<SceneOf, Dopri5>>("odeint dopri5", scene));
  methods.push_back(
      std::make_unique<ControlledOdeint<SceneOf, Fehlberg78>>("odeint fehlberg78", scene));
  methods.push_back(std::make_unique<BulirschStoerOdeint<SceneOf>>("odeint bulirsch_stoer", scene));
  if (scene.stiff) {
    methods.push_back(std::make_unique<RosenbrockOdeint<SceneOf>>("odeint rosenbrock4", scene));
  }
}

}  // namespace

void addOdeintMethods(const SceneCase& scene, Methods& methods) {
  visitScene(scene, [&](auto tag) { addMethods(scene, methods, tag); });
}

}  // namespace variator_sim::benchmark
