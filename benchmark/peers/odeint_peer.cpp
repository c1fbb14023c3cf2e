// Peer: the plain Boost.Odeint program that one would write for one scene.
#include <array>
#include <exception>
#include <string>
#include <type_traits>
#include <utility>

#include "method.h"
#include "odeint.h"

namespace variator_sim::benchmark {
namespace {

using Vector = ublas::vector<double>;

struct TimeOut : std::exception {};

/// integrate_adaptive over a vector of this type, by the stepper of `make(tolerance)`. uBLAS types
/// are those of rosenbrock4, which takes an exact Jacobian.
template <template <class> class SceneOf, class State, class Make>
class OdeintMethod : public PeerMethod<SceneOf> {
  using Base = PeerMethod<SceneOf>;
  static constexpr bool kIsImplicit = std::is_same_v<State, Vector>;

 public:
  OdeintMethod(std::string name, const SceneCase& scene, double first_step, Make make)
      : Base(std::move(name), scene), make_(make), first_step_(first_step) {}

  std::string prepare(double tolerance) override {
    tolerance_ = tolerance;
    return "";
  }
  bool run() override {
    this->failure_ = "ok";
    this->steps_ = 0;
    State state{};
    if constexpr (kIsImplicit) state.resize(Base::kState);
    try {
      return this->problem_.play(this->x_, [&](double t0, double t1, double* x) {
        std::copy(x, x + Base::kState, state.begin());
        this->steps_ +=
            odeint::integrate_adaptive(make_(tolerance_), makeSystem(), state, t0, t1, first_step_);
        std::copy(state.begin(), state.end(), x);
        return true;
      });
    } catch (const std::exception&) {
      this->failure_ = "step adjustment failed";
      return false;
    }
  }

 private:
  auto makeSystem() {
    const auto rates = [this](const State& x, State& dxdt, double t) {
      if (!this->problem_(t, &x[0], &dxdt[0])) throw TimeOut();
    };
    if constexpr (kIsImplicit) {
      const auto jacobian = [this](const Vector& x, ublas::matrix<double>& entries, const double& t,
                                   Vector& dfdt) {
        constexpr std::size_t N = Base::kState;
        double columns[N * N];
        this->problem_.jacobian(t, &x[0], columns, &dfdt[0]);
        for (std::size_t n = 0; n < N * N; ++n) entries(n % N, n / N) = columns[n];
      };
      return std::make_pair(rates, jacobian);
    } else {
      return rates;
    }
  }

  Make make_;
  double first_step_;
  double tolerance_ = 0.0;
};

template <template <class> class SceneOf>
void addMethods(const SceneCase& scene, Methods& methods, SceneTag<SceneOf> /*tag*/) {
  using Array = std::array<double, PeerMethod<SceneOf>::kState>;
  const double first_step = chooseFirstStep(scene);
  const auto add = [&](const char* name, auto state, double step, auto make) {
    methods.push_back(std::make_unique<OdeintMethod<SceneOf, decltype(state), decltype(make)>>(
        name, scene, step, make));
  };
  add("odeint dopri5", Array(), first_step, [](double tolerance) {
    return odeint::make_controlled<odeint::runge_kutta_dopri5<Array>>(tolerance, tolerance);
  });
  add("odeint fehlberg78", Array(), first_step, [](double tolerance) {
    return odeint::make_controlled<odeint::runge_kutta_fehlberg78<Array>>(tolerance, tolerance);
  });
  // The extrapolation method is a controlled stepper by itself.
  add("odeint bulirsch_stoer", Array(), 10.0 * first_step,
      [](double tolerance) { return odeint::bulirsch_stoer<Array>(tolerance, tolerance); });
  if (!scene.stiff) return;
  add("odeint rosenbrock4", Vector(), first_step, [](double tolerance) {
    return odeint::make_controlled<odeint::rosenbrock4<double>>(tolerance, tolerance);
  });
}

}  // namespace

void addOdeintMethods(const SceneCase& scene, Methods& methods) {
  visitScene(scene, [&](auto tag) { addMethods(scene, methods, tag); });
}

}  // namespace variator_sim::benchmark
