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
#include <string>
#include <utility>

#include "method.h"

namespace variator_sim::benchmark {
namespace {

/// Attempts at one step; the defaults of 7 to 10 end some runs on stiff scenes that can go on.
constexpr int kMaxFails = 100;

/// Common base of the SUNDIALS peers: context, vectors, matrix, and the callbacks on a scene.
template <template <class> class SceneOf>
class SundialsMethod : public PeerMethod<SceneOf> {
  using Base = PeerMethod<SceneOf>;

 protected:
  using Problem = PeerProblem<SceneOf>;
  static constexpr int kState = Base::kState;

  SundialsMethod(std::string name, const SceneCase& scene) : Base(std::move(name), scene) {
    SUNContext_Create(nullptr, &context_);
    y_ = N_VNew_Serial(kState, context_);
    N_VConst(0.0, y_);
    matrix_ = SUNDenseMatrix(kState, kState, context_);
    linear_solver_ = SUNLinSol_Dense(y_, matrix_, context_);
  }
  ~SundialsMethod() override {
    SUNLinSolFree(linear_solver_);
    SUNMatDestroy(matrix_);
    N_VDestroy(y_);
    SUNContext_Free(&context_);
  }

  /// The initial state as the solver's vector, for its creation.
  void setInitial() { std::copy(this->problem_.initial(), this->problem_.initial() + kState, y()); }
  double* y() { return NV_DATA_S(y_); }
  /// Plays the problem; `advance` brings y from t0 to t1, counts its steps, and returns the
  /// solver's flag.
  template <class Advance>
  bool playWith(const char* solver, const Advance& advance) {
    this->failure_ = "ok";
    this->steps_ = 0;
    return this->problem_.play(this->x_, [&](double t0, double t1, double* x) {
      std::copy(x, x + kState, y());
      long steps = 0;
      const int flag = advance(t0, t1, &steps);
      std::copy(y(), y() + kState, x);
      this->steps_ += static_cast<std::uint64_t>(steps);
      if (flag < 0) this->failure_ = std::string(solver) + " error " + std::to_string(flag);
      return flag >= 0;
    });
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

  SUNContext context_ = nullptr;
  N_Vector y_ = nullptr;
  SUNMatrix matrix_ = nullptr;
  SUNLinearSolver linear_solver_ = nullptr;
};

enum class CvodeKind { kAdams, kBdf };

template <template <class> class SceneOf>
class Cvode : public SundialsMethod<SceneOf> {
  using Base = SundialsMethod<SceneOf>;
  using Problem = typename Base::Problem;

 public:
  Cvode(std::string name, const SceneCase& scene, CvodeKind kind)
      : Base(std::move(name), scene), kind_(kind) {}
  ~Cvode() override { release(); }

  std::string prepare(double tolerance) override {
    release();
    this->setInitial();
    memory_ = CVodeCreate(kind_ == CvodeKind::kAdams ? CV_ADAMS : CV_BDF, this->context_);
    bool good = CVodeInit(memory_, Base::evaluate, 0.0, this->y_) == CV_SUCCESS;
    CVodeSetErrFile(memory_, nullptr);
    good = good && CVodeSStolerances(memory_, tolerance, tolerance) == CV_SUCCESS;
    CVodeSetUserData(memory_, &this->problem_);
    CVodeSetMaxNumSteps(memory_, -1);
    CVodeSetMaxErrTestFails(memory_, kMaxFails);
    CVodeSetMaxConvFails(memory_, kMaxFails);
    if (kind_ == CvodeKind::kAdams) {
      nonlinear_solver_ = SUNNonlinSol_FixedPoint(this->y_, 0, this->context_);
      good = good && CVodeSetNonlinearSolver(memory_, nonlinear_solver_) == CV_SUCCESS;
    } else {
      good = good && CVodeSetLinearSolver(memory_, this->linear_solver_, this->matrix_) == 0;
      good = good && CVodeSetJacFn(memory_, Base::evaluateJacobian) == 0;
    }
    return good ? "" : "CVODE refuses its settings";
  }
  bool run() override {
    return this->playWith("CVODE", [this](double t0, double t1, long* steps) {
      CVodeReInit(memory_, t0, this->y_);
      CVodeSetStopTime(memory_, t1);
      realtype t = t0;
      const int flag = CVode(memory_, t1, this->y_, &t, CV_NORMAL);
      CVodeGetNumSteps(memory_, steps);
      return flag;
    });
  }

 private:
  void release() {
    if (memory_ != nullptr) CVodeFree(&memory_);
    if (nonlinear_solver_ != nullptr) SUNNonlinSolFree(nonlinear_solver_);
    memory_ = nullptr;
    nonlinear_solver_ = nullptr;
  }

  CvodeKind kind_;
  void* memory_ = nullptr;
  SUNNonlinearSolver nonlinear_solver_ = nullptr;
};

template <template <class> class SceneOf>
class Erk : public SundialsMethod<SceneOf> {
  using Base = SundialsMethod<SceneOf>;

 public:
  Erk(std::string name, const SceneCase& scene, ARKODE_ERKTableID table)
      : Base(std::move(name), scene), table_(table) {}
  ~Erk() override { release(); }

  std::string prepare(double tolerance) override {
    release();
    this->setInitial();
    memory_ = ERKStepCreate(Base::evaluate, 0.0, this->y_, this->context_);
    ERKStepSetErrFile(memory_, nullptr);
    bool good = ERKStepSStolerances(memory_, tolerance, tolerance) == ARK_SUCCESS;
    good = good && ERKStepSetTableNum(memory_, table_) == ARK_SUCCESS;
    ERKStepSetUserData(memory_, &this->problem_);
    ERKStepSetMaxNumSteps(memory_, -1);
    ERKStepSetMaxErrTestFails(memory_, kMaxFails);
    return good ? "" : "ARKODE refuses its settings";
  }
  bool run() override {
    return this->playWith("ARKODE", [this](double t0, double t1, long* steps) {
      ERKStepReInit(memory_, Base::evaluate, t0, this->y_);
      ERKStepSetStopTime(memory_, t1);
      realtype t = t0;
      const int flag = ERKStepEvolve(memory_, t1, this->y_, &t, ARK_NORMAL);
      ERKStepGetNumSteps(memory_, steps);
      return flag;
    });
  }

 private:
  void release() {
    if (memory_ != nullptr) ERKStepFree(&memory_);
    memory_ = nullptr;
  }

  ARKODE_ERKTableID table_;
  void* memory_ = nullptr;
};

template <template <class> class SceneOf>
class Dirk : public SundialsMethod<SceneOf> {
  using Base = SundialsMethod<SceneOf>;

 public:
  Dirk(std::string name, const SceneCase& scene, ARKODE_DIRKTableID table)
      : Base(std::move(name), scene), table_(table) {}
  ~Dirk() override { release(); }

  std::string prepare(double tolerance) override {
    release();
    this->setInitial();
    memory_ = ARKStepCreate(nullptr, Base::evaluate, 0.0, this->y_, this->context_);
    ARKStepSetErrFile(memory_, nullptr);
    bool good = ARKStepSStolerances(memory_, tolerance, tolerance) == ARK_SUCCESS;
    good = good && ARKStepSetTableNum(memory_, table_, ARKODE_ERK_NONE) == ARK_SUCCESS;
    good = good && ARKStepSetLinearSolver(memory_, this->linear_solver_, this->matrix_) == 0;
    good = good && ARKStepSetJacFn(memory_, Base::evaluateJacobian) == 0;
    ARKStepSetUserData(memory_, &this->problem_);
    ARKStepSetMaxNumSteps(memory_, -1);
    ARKStepSetMaxErrTestFails(memory_, kMaxFails);
    ARKStepSetMaxConvFails(memory_, kMaxFails);
    return good ? "" : "ARKODE refuses its settings";
  }
  bool run() override {
    return this->playWith("ARKODE", [this](double t0, double t1, long* steps) {
      ARKStepReInit(memory_, nullptr, Base::evaluate, t0, this->y_);
      ARKStepSetStopTime(memory_, t1);
      realtype t = t0;
      const int flag = ARKStepEvolve(memory_, t1, this->y_, &t, ARK_NORMAL);
      ARKStepGetNumSteps(memory_, steps);
      return flag;
    });
  }

 private:
  void release() {
    if (memory_ != nullptr) ARKStepFree(&memory_);
    memory_ = nullptr;
  }

  ARKODE_DIRKTableID table_;
  void* memory_ = nullptr;
};

template <template <class> class SceneOf>
void addMethods(const SceneCase& scene, Methods& methods, SceneTag<SceneOf> /*tag*/) {
  const auto add_cvode = [&](const char* name, CvodeKind kind) {
    methods.push_back(std::make_unique<Cvode<SceneOf>>(name, scene, kind));
  };
  const auto add_erk = [&](const char* name, ARKODE_ERKTableID table) {
    methods.push_back(std::make_unique<Erk<SceneOf>>(name, scene, table));
  };
  const auto add_dirk = [&](const char* name, ARKODE_DIRKTableID table) {
    methods.push_back(std::make_unique<Dirk<SceneOf>>(name, scene, table));
  };
  add_cvode("sundials cvode adams", CvodeKind::kAdams);
  add_cvode("sundials cvode bdf", CvodeKind::kBdf);
  add_erk("sundials erk dormand-prince 4-5", ARKODE_DORMAND_PRINCE_7_4_5);
  add_erk("sundials erk fehlberg 7-8", ARKODE_FEHLBERG_13_7_8);
  if (scene.stiff) {
    add_dirk("sundials dirk sdirk 3-4", ARKODE_SDIRK_5_3_4);
    add_dirk("sundials dirk kvaerno 4-5", ARKODE_KVAERNO_7_4_5);
    add_dirk("sundials dirk esdirk 4-5", ARKODE_ESDIRK547L2SA_7_4_5);
  }
}

}  // namespace

void addSundialsMethods(const SceneCase& scene, Methods& methods) {
  visitScene(scene, [&](auto tag) { addMethods(scene, methods, tag); });
}

}  // namespace variator_sim::benchmark
