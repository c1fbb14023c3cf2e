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

/// integrate_adaptive with a controlled stepper over std::array.
template <template <class> class SceneOf, template <class...> class Stepper>
class ControlledOdeint : public PeerMethod<SceneOf> {
  using Base = PeerMethod<SceneOf>;
  using State = std::array<double, Base::kState>;

 public:
  ControlledOdeint(std::string name, const SceneCase& scene)
      : Base(std::move(name), scene), first_step_(chooseFirstStep(scene)) {}

  std::string prepare(double tolerance) override {
    tolerance_ = tolerance;
    return "";
  }
  bool run() override {
    this->failure_ = "ok";
    this->steps_ = 0;
    auto& problem = this->problem_;
    const auto system = [&problem](const State& x, State& dxdt, double t) {
      if (!problem(t, x.data(), dxdt.data())) throw TimeOut();
    };
    try {
      return problem.play(this->x_, [&](double t0, double t1, double* x) {
        State state;
        std::copy(x, x + Base::kState, state.begin());
        this->steps_ += odeint::integrate_adaptive(
            odeint::make_controlled<Stepper<State>>(tolerance_, tolerance_), system, state, t0, t1,
            first_step_);
        std::copy(state.begin(), state.end(), x);
        return true;
      });
    } catch (const std::exception&) {
      this->failure_ = "step adjustment failed";
      return false;
    }
  }

 private:
  double tolerance_ = 0.0;
  double first_step_;
};

template <class State>
using Dopri5 = odeint::runge_kutta_dopri5<State>;
template <class State>
using Fehlberg78 = odeint::runge_kutta_fehlberg78<State>;

/// The extrapolation method is a controlled stepper by itself.
template <template <class> class SceneOf>
class BulirschStoerOdeint : public PeerMethod<SceneOf> {
  using Base = PeerMethod<SceneOf>;
  using State = std::array<double, Base::kState>;

 public:
  BulirschStoerOdeint(std::string name, const SceneCase& scene)
      : Base(std::move(name), scene), first_step_(10.0 * chooseFirstStep(scene)) {}

  std::string prepare(double tolerance) override {
    tolerance_ = tolerance;
    return "";
  }
  bool run() override {
    this->failure_ = "ok";
    this->steps_ = 0;
    auto& problem = this->problem_;
    const auto system = [&problem](const State& x, State& dxdt, double t) {
      if (!problem(t, x.data(), dxdt.data())) throw TimeOut();
    };
    try {
      return problem.play(this->x_, [&](double t0, double t1, double* x) {
        State state;
        std::copy(x, x + Base::kState, state.begin());
        this->steps_ +=
            odeint::integrate_adaptive(odeint::bulirsch_stoer<State>(tolerance_, tolerance_),
                                       system, state, t0, t1, first_step_);
        std::copy(state.begin(), state.end(), x);
        return true;
      });
    } catch (const std::exception&) {
      this->failure_ = "step adjustment failed";
      return false;
    }
  }

 private:
  double tolerance_ = 0.0;
  double first_step_;
};

/// rosenbrock4 with exact Jacobians; it works on uBLAS types only.
template <template <class> class SceneOf>
class RosenbrockOdeint : public PeerMethod<SceneOf> {
  using Base = PeerMethod<SceneOf>;
  using State = ublas::vector<double>;
  using Matrix = ublas::matrix<double>;

 public:
  RosenbrockOdeint(std::string name, const SceneCase& scene)
      : Base(std::move(name), scene), first_step_(chooseFirstStep(scene)) {}

  std::string prepare(double tolerance) override {
    tolerance_ = tolerance;
    return "";
  }
  bool run() override {
    constexpr int N = Base::kState;
    this->failure_ = "ok";
    this->steps_ = 0;
    auto& problem = this->problem_;
    const auto system = [&problem](const State& x, State& dxdt, double t) {
      if (!problem(t, &x[0], &dxdt[0])) throw TimeOut();
    };
    const auto jacobian = [&problem](const State& x, Matrix& entries, const double& t,
                                     State& dfdt) {
      double columns[N * N];
      problem.jacobian(t, &x[0], columns, &dfdt[0]);
      for (int i = 0; i < N; ++i) {
        for (int j = 0; j < N; ++j) {
          entries(static_cast<std::size_t>(i), static_cast<std::size_t>(j)) = columns[i + N * j];
        }
      }
    };
    try {
      return problem.play(this->x_, [&](double t0, double t1, double* x) {
        State state(N);
        std::copy(x, x + N, state.begin());
        this->steps_ += odeint::integrate_adaptive(
            odeint::make_controlled<odeint::rosenbrock4<double>>(tolerance_, tolerance_),
            std::make_pair(system, jacobian), state, t0, t1, first_step_);
        std::copy(state.begin(), state.end(), x);
        return true;
      });
    } catch (const std::exception&) {
      this->failure_ = "step adjustment failed";
      return false;
    }
  }

 private:
  double tolerance_ = 0.0;
  double first_step_;
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
