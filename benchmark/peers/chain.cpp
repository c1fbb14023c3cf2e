// The variators' second shafts are eliminated, the rest is in a band. (Compiled for the machine, as
// kernels are.)
#include "peers/chain.h"

#ifdef VARIATOR_SIM_WITH_SUNDIALS
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>
#endif

#include <boost/numeric/odeint.hpp>

namespace variator_sim::benchmark {
namespace {

/// The chain by hand: (w, twist behind it) of each shaft; a driven shaft has no w, and the one
/// before it no twist.
class ByHand {
 public:
  explicit ByHand(const Chain& chain)
      : chain_(chain),
        w_(size()),
        torque_(size()),
        ratio_(size()),
        inertia_(size()),
        speed_(size()) {
    int next = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const int n = static_cast<int>(i);
      inertia_[i] = Chain::inertia(n);
      speed_[i] = Chain::isDriven(n) ? -1 : next++;
      twist_.push_back(n + 1 < chain.shafts && !Chain::isDriven(n + 1) ? next++ : -1);
    }
    states_ = next;
  }
  State initial() const {
    State x(static_cast<std::size_t>(states_), 0.0);
    double w = 1.0;
    for (std::size_t i = 0; i < size(); ++i) {
      if (speed_[i] < 0) w *= Chain::ratio(static_cast<int>(i), 0.0);
      if (speed_[i] >= 0) x[static_cast<std::size_t>(speed_[i])] = w;
    }
    return x;
  }
  void rates(const double* x, double* dxdt, double t) {
    for (std::size_t i = 0; i < size(); ++i) {
      if (speed_[i] < 0) ratio_[i] = Chain::ratio(static_cast<int>(i), t);
      w_[i] = speed_[i] >= 0 ? x[speed_[i]] : w_[i - 1] * ratio_[i];
      torque_[i] = 0.0;
    }
    torque_.front() = 20.0 * (1.0 + 0.3 * std::sin(3.0 * t));
    torque_.back() -= 0.3 * w_.back();
    for (std::size_t i = 0; i + 1 < size(); ++i) {
      if (twist_[i] < 0) continue;
      const double slip = w_[i] - w_[i + 1];
      const double torque = chain_.stiffness * x[twist_[i]] + chain_.damping * slip;
      dxdt[twist_[i]] = slip;
      torque_[i] -= torque;
      torque_[i + 1] += torque;
    }
    for (std::size_t i = 0; i < size(); ++i) {
      const int n = static_cast<int>(i);
      if (speed_[i] < 0) continue;
      double force = torque_[i];
      double inertia = inertia_[i];
      if (i + 1 < size() && speed_[i + 1] < 0) {
        const double r = ratio_[i + 1];
        const double driven = inertia_[i + 1];
        force += r * (torque_[i + 1] - driven * Chain::ratioRate(n + 1, t) * w_[i]);
        inertia += r * r * driven;
      }
      dxdt[speed_[i]] = force / inertia;
    }
  }
  State speeds(const State& x) const {
    State w;
    for (std::size_t i = 0; i < size(); ++i) {
      w.push_back(speed_[i] >= 0 ? x[static_cast<std::size_t>(speed_[i])]
                                 : w.back() * Chain::ratio(static_cast<int>(i), kEnd));
    }
    return w;
  }

 private:
  std::size_t size() const { return static_cast<std::size_t>(chain_.shafts); }

  const Chain chain_;
  State w_, torque_, ratio_, inertia_;
  std::vector<int> speed_, twist_;
  int states_ = 0;
};

template <class Stepper>
State playOdeint(const Chain& chain, double tolerance) {
  namespace odeint = boost::numeric::odeint;
  ByHand machine(chain);
  State x = machine.initial();
  const auto system = [&](const State& y, State& dydt, double t) {
    machine.rates(y.data(), dydt.data(), t);
  };
  odeint::integrate_adaptive(odeint::make_controlled<Stepper>(tolerance, tolerance), system, x, 0.0,
                             kEnd, 0.01);
  return machine.speeds(x);
}

}  // namespace

State playDopri5(const Chain& chain, double tolerance) {
  return playOdeint<boost::numeric::odeint::runge_kutta_dopri5<State>>(chain, tolerance);
}

State playFehlberg78(const Chain& chain, double tolerance) {
  return playOdeint<boost::numeric::odeint::runge_kutta_fehlberg78<State>>(chain, tolerance);
}

#ifdef VARIATOR_SIM_WITH_SUNDIALS
State playCvode(const Chain& chain, double tolerance) {
  constexpr int kBand = 4;
  ByHand machine(chain);
  State x = machine.initial();
  const auto n = static_cast<sunindextype>(x.size());
  SUNContext context = nullptr;
  SUNContext_Create(nullptr, &context);
  N_Vector y = N_VMake_Serial(n, x.data(), context);
  SUNMatrix matrix = SUNBandMatrix(n, kBand, kBand, context);
  SUNLinearSolver solver = SUNLinSol_Band(y, matrix, context);
  void* const cvode = CVodeCreate(CV_BDF, context);
  const auto rates = [](realtype t, N_Vector at, N_Vector dxdt, void* of) {
    static_cast<ByHand*>(of)->rates(NV_DATA_S(at), NV_DATA_S(dxdt), t);
    return 0;
  };
  CVodeInit(cvode, rates, 0.0, y);
  CVodeSetUserData(cvode, &machine);
  CVodeSStolerances(cvode, tolerance, tolerance);
  CVodeSetLinearSolver(cvode, solver, matrix);
  CVodeSetMaxNumSteps(cvode, 1000000);
  CVodeSetStopTime(cvode, kEnd);
  double reached = 0.0;
  const int flag = CVode(cvode, kEnd, y, &reached, CV_NORMAL);
  void* closed = cvode;
  CVodeFree(&closed);
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  N_VDestroy(y);
  SUNContext_Free(&context);
  return flag < 0 ? State(static_cast<std::size_t>(chain.shafts), NAN) : machine.speeds(x);
}
#else
State playCvode(const Chain& chain, double /*tolerance*/) {
  return State(static_cast<std::size_t>(chain.shafts), NAN);
}
#endif

}  // namespace variator_sim::benchmark
