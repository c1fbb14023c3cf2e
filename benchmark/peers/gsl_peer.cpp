// Peer: the GNU Scientific Library's odeiv2.
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>

#include <string>
#include <utility>

#include "method.h"

namespace variator_sim::benchmark {
namespace {

template <template <class> class SceneOf>
class GslMethod : public PeerMethod<SceneOf> {
  using Base = PeerMethod<SceneOf>;
  using Problem = PeerProblem<SceneOf>;

 public:
  GslMethod(std::string name, const SceneCase& scene, const gsl_odeiv2_step_type* type)
      : Base(std::move(name), scene), type_(type), first_step_(chooseFirstStep(scene)) {}
  ~GslMethod() override { release(); }

  std::string prepare(double tolerance) override {
    release();
    system_ = {evaluate, evaluateJacobian, Base::kState, &this->problem_};
    driver_ = gsl_odeiv2_driver_alloc_y_new(&system_, type_, first_step_, tolerance, tolerance);
    return driver_ != nullptr ? "" : "no driver";
  }
  bool run() override {
    this->failure_ = "ok";
    this->steps_ = 0;
    return this->problem_.play(this->x_, [this](double t0, double t1, double* x) {
      gsl_odeiv2_driver_reset_hstart(driver_, first_step_);
      double t = t0;
      const int status = gsl_odeiv2_driver_apply(driver_, &t, t1, x);
      this->steps_ += driver_->n;
      if (status != GSL_SUCCESS) this->failure_ = gsl_strerror(status);
      return status == GSL_SUCCESS;
    });
  }

 private:
  void release() {
    if (driver_ != nullptr) gsl_odeiv2_driver_free(driver_);
    driver_ = nullptr;
  }
  static int evaluate(double t, const double* x, double* dxdt, void* problem) {
    return (*static_cast<Problem*>(problem))(t, x, dxdt) ? GSL_SUCCESS : GSL_EBADFUNC;
  }
  /// GSL's Jacobian lies row by row.
  static int evaluateJacobian(double t, const double* x, double* dfdx, double* dfdt,
                              void* problem) {
    constexpr int kState = Base::kState;
    double columns[kState * kState];
    static_cast<Problem*>(problem)->jacobian(t, x, columns, dfdt);
    for (int i = 0; i < kState; ++i) {
      for (int j = 0; j < kState; ++j) dfdx[i * kState + j] = columns[i + kState * j];
    }
    return GSL_SUCCESS;
  }

  const gsl_odeiv2_step_type* type_;
  double first_step_;
  gsl_odeiv2_system system_{};
  gsl_odeiv2_driver* driver_ = nullptr;
};

template <template <class> class SceneOf>
void addMethods(const SceneCase& scene, Methods& methods, SceneTag<SceneOf> /*tag*/) {
  const auto add = [&](const char* name, const gsl_odeiv2_step_type* type) {
    methods.push_back(std::make_unique<GslMethod<SceneOf>>(name, scene, type));
  };
  add("gsl rk8pd", gsl_odeiv2_step_rk8pd);
  add("gsl msadams", gsl_odeiv2_step_msadams);
  add("gsl msbdf", gsl_odeiv2_step_msbdf);
  if (scene.stiff) add("gsl bsimp", gsl_odeiv2_step_bsimp);
}

}  // namespace

void addGslMethods(const SceneCase& scene, Methods& methods) {
  gsl_set_error_handler_off();
  visitScene(scene, [&](auto tag) { addMethods(scene, methods, tag); });
}

}  // namespace variator_sim::benchmark
