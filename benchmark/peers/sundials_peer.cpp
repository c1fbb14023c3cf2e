// Peers: SUNDIALS's CVODE and ARKODE.
#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>

#include "method.h"

namespace variator_sim::benchmark {
namespace {

/// Attempts at one step; the defaults of 7 to 10 end some runs on stiff scenes that can go on.
constexpr int kMaxFails = 100;

/// What solvers are made of.
struct Parts {
  CVRhsFn rates;
  CVLsJacFn jacobian;
  SUNContext context = nullptr;
  N_Vector y = nullptr;
  SUNMatrix matrix = nullptr;
  SUNLinearSolver linear_solver = nullptr;
  SUNNonlinearSolver fixed_point = nullptr;
};

/// The functions of a solver; `scheme` is its own number of a method.
struct Solver {
  const char* name;
  void* (*create)(const Parts& parts, int scheme);
  int (*restart)(void* memory, const Parts& parts, realtype t0);
  int (*advance)(void* memory, realtype t1, N_Vector y, realtype* t, int task);
  int (*setTolerances)(void* memory, realtype relative, realtype absolute);
  int (*setUserData)(void* memory, void* data);
  int (*setErrorFile)(void* memory, std::FILE* file);
  int (*setMostSteps)(void* memory, long most);
  int (*setMostErrorFails)(void* memory, int most);
  int (*setStopTime)(void* memory, realtype t);
  int (*countSteps)(void* memory, long* steps);
  void (*release)(void** memory);
};
// Their names differ by what they begin with.
#define VARIATOR_SIM_SETTINGS(S)                                                            \
  S##SStolerances, S##SetUserData, S##SetErrFile, S##SetMaxNumSteps, S##SetMaxErrTestFails, \
      S##SetStopTime, S##GetNumSteps, S##Free

/// Adams' method iterates its equations as they stand, that of BDF solves linear ones.
void* createCvode(const Parts& parts, int scheme) {
  void* const memory = CVodeCreate(scheme, parts.context);
  CVodeInit(memory, parts.rates, 0.0, parts.y);
  CVodeSetMaxConvFails(memory, kMaxFails);
  if (scheme == CV_ADAMS) {
    CVodeSetNonlinearSolver(memory, parts.fixed_point);
  } else {
    CVodeSetLinearSolver(memory, parts.linear_solver, parts.matrix);
    CVodeSetJacFn(memory, parts.jacobian);
  }
  return memory;
}
int restartCvode(void* memory, const Parts& parts, realtype t0) {
  return CVodeReInit(memory, t0, parts.y);
}
const Solver kCvode = {"CVODE", createCvode, restartCvode, CVode, VARIATOR_SIM_SETTINGS(CVode)};

void* createErk(const Parts& parts, int scheme) {
  void* const memory = ERKStepCreate(parts.rates, 0.0, parts.y, parts.context);
  ERKStepSetTableNum(memory, static_cast<ARKODE_ERKTableID>(scheme));
  return memory;
}
int restartErk(void* memory, const Parts& parts, realtype t0) {
  return ERKStepReInit(memory, parts.rates, t0, parts.y);
}
const Solver kErk = {"ARKODE", createErk, restartErk, ERKStepEvolve,
                     VARIATOR_SIM_SETTINGS(ERKStep)};

void* createDirk(const Parts& parts, int scheme) {
  void* const memory = ARKStepCreate(nullptr, parts.rates, 0.0, parts.y, parts.context);
  ARKStepSetTableNum(memory, static_cast<ARKODE_DIRKTableID>(scheme), ARKODE_ERK_NONE);
  ARKStepSetMaxConvFails(memory, kMaxFails);
  ARKStepSetLinearSolver(memory, parts.linear_solver, parts.matrix);
  ARKStepSetJacFn(memory, parts.jacobian);
  return memory;
}
int restartDirk(void* memory, const Parts& parts, realtype t0) {
  return ARKStepReInit(memory, nullptr, parts.rates, t0, parts.y);
}
const Solver kDirk = {"ARKODE", createDirk, restartDirk, ARKStepEvolve,
                      VARIATOR_SIM_SETTINGS(ARKStep)};

template <template <class> class SceneOf>
class SundialsMethod : public PeerMethod<SceneOf> {
  using Base = PeerMethod<SceneOf>;
  using Problem = PeerProblem<SceneOf>;
  static constexpr int kState = Base::kState;

 public:
  SundialsMethod(std::string name, const SceneCase& scene, const Solver& solver, int scheme)
      : Base(std::move(name), scene), solver_(solver), scheme_(scheme) {
    SUNContext_Create(nullptr, &parts_.context);
    parts_.y = N_VNew_Serial(kState, parts_.context);
    N_VConst(0.0, parts_.y);
    parts_.matrix = SUNDenseMatrix(kState, kState, parts_.context);
    parts_.linear_solver = SUNLinSol_Dense(parts_.y, parts_.matrix, parts_.context);
    parts_.fixed_point = SUNNonlinSol_FixedPoint(parts_.y, 0, parts_.context);
  }
  ~SundialsMethod() override {
    release();
    SUNNonlinSolFree(parts_.fixed_point);
    SUNLinSolFree(parts_.linear_solver);
    SUNMatDestroy(parts_.matrix);
    N_VDestroy(parts_.y);
    SUNContext_Free(&parts_.context);
  }

  std::string prepare(double tolerance) override {
    release();
    std::copy(this->problem_.initial(), this->problem_.initial() + kState, y());
    memory_ = solver_.create(parts_, scheme_);
    solver_.setErrorFile(memory_, nullptr);
    solver_.setUserData(memory_, &this->problem_);
    solver_.setMostSteps(memory_, -1);
    solver_.setMostErrorFails(memory_, kMaxFails);
    const bool good = solver_.setTolerances(memory_, tolerance, tolerance) == 0;
    return good ? "" : std::string(solver_.name) + " refuses its settings";
  }
  bool run() override {
    this->failure_ = "ok";
    this->steps_ = 0;
    return this->problem_.play(this->x_, [this](double t0, double t1, double* x) {
      std::copy(x, x + kState, y());
      solver_.restart(memory_, parts_, t0);
      solver_.setStopTime(memory_, t1);
      realtype t = t0;
      long steps = 0;
      const int flag = solver_.advance(memory_, t1, parts_.y, &t, CV_NORMAL);  // as ARK_NORMAL
      solver_.countSteps(memory_, &steps);
      std::copy(y(), y() + kState, x);
      this->steps_ += static_cast<std::uint64_t>(steps);
      if (flag < 0) this->failure_ = std::string(solver_.name) + " error " + std::to_string(flag);
      return flag >= 0;
    });
  }

 private:
  double* y() { return NV_DATA_S(parts_.y); }
  void release() {
    if (memory_ != nullptr) solver_.release(&memory_);
    memory_ = nullptr;
  }
  static int evaluate(realtype t, N_Vector x, N_Vector dxdt, void* problem) {
    return (*static_cast<Problem*>(problem))(t, NV_DATA_S(x), NV_DATA_S(dxdt)) ? 0 : -1;
  }
  static int evaluateJacobian(realtype t, N_Vector x, N_Vector /*dxdt*/, SUNMatrix jacobian,
                              void* problem, N_Vector /*a*/, N_Vector /*b*/, N_Vector /*c*/) {
    double dfdt[kState];
    static_cast<Problem*>(problem)->jacobian(t, NV_DATA_S(x), SM_DATA_D(jacobian), dfdt);
    return 0;
  }

  const Solver& solver_;
  int scheme_;
  Parts parts_{evaluate, evaluateJacobian};
  void* memory_ = nullptr;
};

template <template <class> class SceneOf>
void addMethods(const SceneCase& scene, Methods& methods, SceneTag<SceneOf> /*tag*/) {
  const auto add = [&](const char* name, const Solver& solver, int scheme) {
    methods.push_back(std::make_unique<SundialsMethod<SceneOf>>(name, scene, solver, scheme));
  };
  add("sundials cvode adams", kCvode, CV_ADAMS);
  add("sundials cvode bdf", kCvode, CV_BDF);
  add("sundials erk dormand-prince 4-5", kErk, ARKODE_DORMAND_PRINCE_7_4_5);
  add("sundials erk fehlberg 7-8", kErk, ARKODE_FEHLBERG_13_7_8);
  if (!scene.stiff) return;
  add("sundials dirk sdirk 3-4", kDirk, ARKODE_SDIRK_5_3_4);
  add("sundials dirk kvaerno 4-5", kDirk, ARKODE_KVAERNO_7_4_5);
  add("sundials dirk esdirk 4-5", kDirk, ARKODE_ESDIRK547L2SA_7_4_5);
}

}  // namespace

void addSundialsMethods(const SceneCase& scene, Methods& methods) {
  visitScene(scene, [&](auto tag) { addMethods(scene, methods, tag); });
}

}  // namespace variator_sim::benchmark
