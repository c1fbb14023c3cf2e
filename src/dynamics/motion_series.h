/// The motion as power series: a differential-algebraic system, solved order by order.
///
/// With s = (t - t0) / unit, and coefficients x_n of s^n, the unknowns of order n are linear in
///     n phi_n = unit omega_{n-1},   n omega_n = unit epsilon_{n-1}
///     psi_n = psi_n(epsilon_n = 0) + C_0 epsilon_n = 0
///     J epsilon + n(phi, omega) - Q = R,   R' = C^T Lambda + Gamma R omega     (generalized Gauss)
///                                          R = C^T lambda                       (Gauss)
/// that is, with the same matrix for every n,
///     J_0 epsilon_n - C_0^T mu_n = a_n,   C_0 epsilon_n = -g_n,   mu_n = unit Lambda_{n-1} / n
/// where a_n and g_n hold what is known from lower orders:
///     a_n = Q_n - n_n - sum_{j>=1} J_j epsilon_{n-j}
///           + unit/n (sum_{j=1..n-1} C_j^T Lambda_{n-1-j} + (Gamma R omega)_{n-1})
/// Under Gauss mu_n = lambda_n, the last line is sum_{j=1..n-1} C_j^T lambda_{n-j} + Ĉ_n^T
/// lambda_0, and where psi is not linear in epsilon, J_0 loses sum lambda_0 d2psi/depsilon2.
/// Constraints of order 1 are psi = f', those of order 3 have
///     g_n = 1/n (sum_{j=1..n-1} (n-j) C_j epsilon_{n-j} + unit c0_{n-1}).
/// (Pryce: Solving differential-algebraic equations by Taylor series, Numerical Algorithms 19
/// (1998) 195-211, of which this is the case of one pattern of offsets.)
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dynamics/drivetrain.h"
#include "dynamics/series_step.h"
#include "expression/series_program.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/sample.h"
#include "variator_sim/steps_together.h"

namespace variator_sim {

class SeriesLanes;
namespace series_plain {
class SeriesOrder;
}
namespace series_fused {
class SeriesOrder;
}

/// The series of one scene. Of one thread at a time.
class MotionSeries {
 public:
  static constexpr int kMostOrder = 30;

  /// The series of a scene whose elements are all formulas of its graph; nullptr of others. Of
  /// constraints of order 3 under `gauss` only isStepResolved is to be asked. `drivetrain` and
  /// `scene` have to outlive it. `like`: those of a scene with the same elements, or nullptr.
  static std::unique_ptr<MotionSeries> make(const Scene& scene, Drivetrain& drivetrain,
                                            const MotionSeries* like = nullptr);

  /// The motion stands at (t, x), x = (phi, omega, epsilon): coefficient 0. `unit`, s; at most the
  /// order `most` will be asked for, kMostOrder at the most. False where C has lost rank. [loop]
  bool begin(double t, const double* x, double unit, int most);
  // --- whole steps: series_step.inc --------------------------------------------------------------
  /// True where a step can be made in one: of generalized Gauss, without tables.
  bool makesWholeSteps() const { return makes_whole_steps_; }
  /// What is asked of steps.
  struct Aim {
    bool goes_on;     ///< the next series is begun there
    double length;    ///< that the series may have, by the step before, s
    double before;    ///< the same of that one: who begins anew here begins as who goes on, s
    double absolute;  ///< tolerance
    double relative;
    double decay;  ///< of the terms before the last one
    Reach reach;
  };
  /// Steps from (t, x), each as far as its series allow, and the next series begun at the end of
  /// the last one; inputs stand still. All that were made are good, but the last one where it was
  /// refused: then the motion does not go on from there. The series are those of the last one,
  /// whose order `last` is. [loop]
  const SeriesStep& stride(double t, const double* x, const Aim& aim);
  bool isNextBegunAt(double t) const;
  /// A sample at t inside the last step, which ends at `end`, of the stride whose series had that
  /// stamp; inputs stand still. All of it is by the series of both ends, velocities and
  /// accelerations brought onto the constraints. False where that is not to be had: of constraints
  /// of order 3, of a step that was made otherwise. [loop]
  bool calcSample(std::uint64_t stamp, double end, double t, std::uint64_t* projections,
                  Sample* sample);
  /// Steps are made with those of other motions where that may be; nullptr: alone. Its owner has to
  /// outlive this or to take it back.
  void makeStepsWith(StepsTogether* together) { together_ = together; }
  /// The coefficients of a step made with others are asked for: those of the state, or all that
  /// samples are made of. [loop]
  void fetchState() { fetchUpTo(3 * S); }
  void fetch() { fetchUpTo(layout_.sampled); }
  /// What no constraint can change of the reaction.
  void keepReaction(const KeptReaction& kept);
  /// The motion does not go on from there, or inputs have changed.
  void forgetNext() { is_next_begun_ = false; }

  /// As far as `order` of epsilon. False where one of the new orders is not finite: no coefficient
  /// is left then. [loop]
  bool extendTo(int order);
  int order() const { return own().order; }
  /// True where the series of all formulas are the formulas up to `length`, s, within what the
  /// tolerance leaves unnoticed (series_resolution.inc). [loop]
  bool isResolved(double length, double absolute, double relative,
                  const double* const* at = nullptr) const;
  /// True where a formula may hide something along a step from t to t + h, s, that another stepper
  /// has made from x = (phi, omega, epsilon) to x_end. [loop]
  bool mayHideAlong(double t, double h, const double* x, const double* x_end);
  /// As isResolved along that step, of which mayHideAlong has just been asked, over the parabolas
  /// through x, its middle and x_end. The series
  /// are those of these. [loop]
  bool isStepResolved(double t, double h, const double* x, const double* x_middle,
                      const double* x_end, double absolute, double relative);
  /// Another number after every `begin`: whose series these are.
  std::uint64_t stamp() const { return stamp_; }

  /// Coefficients: of a shaft's acceleration up to order(), of its velocity and angle up to one
  /// more.
  const double* angle(int i) const { return program_.coefficients(row_of_angle_[i]); }
  const double* velocity(int i) const { return program_.coefficients(row_of_velocity_[i]); }
  const double* acceleration(int i) const { return program_.coefficients(row_of_acceleration_[i]); }
  double unit() const { return own().unit; }
  /// That of a series whose step may be as long, s.
  static double unitFor(double length);
  /// The orders as C, and what that is made from.
  std::string writeSource() const;
  /// Whole steps of several motions at once (series_lanes.h), which stand behind `velocity_level`;
  /// empty where there are none.
  std::string writeLanesSource() const;
  void addStructure(expression::CodeStructure* structure) const;
  /// Goes over to their code, which changes no bit; false where it is not there. `constants` are
  /// those that `addStructure` has added; they have to outlive it. Not in the loop.
  bool use(const KernelLibrary& library, const double* constants, std::size_t count);
  /// Whether the code gives the interpreter's numbers. Not in the loop.
  bool agreesWithInterpreter();
  void interpret();
  /// The order with which steps of this relative tolerance do the least work.
  static int orderFor(double relative_tolerance);
  /// Coefficients of the applied torque on a shaft, up to order().
  const double* torque(int i) const { return program_.coefficients(row_of_torque_[i]); }

 private:
  MotionSeries(const Scene& scene, Drivetrain& drivetrain);
  struct Formulas {
    std::vector<expression::Node> torques;    ///< Q, of the shafts
    std::vector<expression::Node> residuals;  ///< psi or f'; c0 of order 3
    std::vector<expression::Node> rows;       ///< C, row by row
    /// Where it depends on an angle, of each shaft J_i, 1/2 J_i' omega^2 and 1/2 J_i' omega.
    std::vector<expression::Node> inertias;
  };
  Formulas listFormulas() const;
  void compile();
  /// Instead of `compile`: the program of `like`.
  void copyProgram(const MotionSeries& like);
  /// Where in the program all of it is, in the order in which it was given.
  void findRows();

  /// Rows that are read backwards are added to `mirrored`.
  std::string writeOrder(std::set<int>* mirrored) const;
  std::string writeCoefficient(int row, const std::string& n) const;
  std::string writeForceRest(std::set<int>* mirrored) const;
  std::string writeConstraintRest() const;
  std::string writeReaction(std::set<int>* mirrored) const;
  std::string writeOrders(std::set<int>* mirrored) const;
  std::string writeLayout() const;
  std::vector<int> layoutWords() const;
  std::string writeWholeStep() const;
  std::string writeHidden() const;
  /// States that tell code and interpreter apart.
  void setAside(int state, double* x) const;
  /// Steps from there, by `code` where that is given.
  void stepAside(int state, double limit, const std::function<void()>& code = nullptr);
  bool givesSameNumbers();
  /// Coefficients there, as far as they come.
  std::vector<double> expandAt(int state);
  /// Order 0, as `begin` makes it.
  bool beginWhole(double t, const double* x);
  void setInputs(double t, int order);
  void setState(double time, const double* x);
  /// Order 0 of all formulas.
  void beginRows();
  void beginReaction(const double* x);
  /// The inverse of [J_0 -C_0^T; C_0 0], or of what Newton's iteration has in its place. False
  /// where there is none.
  bool invert();
  template <class Count>
  void invertOneRow(Count shafts);
  bool invertCurved(const StateView& state);
  void continueTo(int n);
  /// J and its inverse, by columns.
  void copyInertia(double* J, double* J_inverse) const;
  /// Of J_0 in `inverse`.
  int placeOfInertia() const { return (S + k_) * (S + k_) + 1; }

  bool isInertiaConstant() const { return drivetrain_.inertia().isConstant(); }
  /// True where the inertia of shaft i depends on its angle.
  bool hasMovingInertia(int i) const {
    return !isInertiaConstant() && !program_.isConstant(row_of_inertia_[i]);
  }
  int entryRow(int m, int i) const { return row_of_entry_[m][i]; }

  static constexpr int kMostUnknowns = kMaxShafts + kMaxRows;
  /// Of formulas along a step of another stepper.
  static constexpr int kStepOrder = expression::SeriesProgram::kAlong;

  const Scene& scene_;
  Drivetrain& drivetrain_;
  const int S;  // shafts
  const int k_;
  const bool is_classical_;
  bool is_curved_ = false;  ///< Gauss, with some C that depends on epsilon
  expression::SeriesProgram program_;
  ConstraintSolver solver_;
  /// One order as machine code, by its number.
  using OrderCode = void (*)(double* rows, double* states, const double* inverse,
                             const double* constants, double unit);
  std::vector<OrderCode> codes_;
  /// Order 0 of all formulas; not 0 where a part has overflowed.
  using BeginCode = int (*)(double* rows, double* states, const double* constants);
  BeginCode begin_code_ = nullptr;
  const KernelLibrary* library_ = nullptr;  ///< its code
  const double* constants_ = nullptr;
  std::size_t constants_count_ = 0;
  /// What a series has beside the rows of the program.
  struct Own {
    double unit = 1.0;
    int order = 0;
    /// The inverse matrix, behind it 1 / unit, and where the inertia depends on an angle J_0 and
    /// its inverse.
    double inverse[kMostUnknowns * kMostUnknowns + 1 + 2 * kMaxShafts * kMaxShafts] = {};
  };
  Own own_[2];  ///< of the step's series and of the next one's
  int used_ = 0;
  Own& own() { return own_[used_]; }
  const Own& own() const { return own_[used_]; }
  void turn() {
    program_.turn();
    used_ = 1 - used_;
  }
  std::uint64_t stamp_ = 0;
  int most_ = 0;        ///< orders that will be asked for
  int last_order_ = 0;  ///< that steps have

  /// Behind the last order nobody asks what the accelerations of that order make of the formulas.
  bool isLast(int order) const { return order == last_order_; }
  void findLayout();
  void findSampled();
  void prepare(SeriesStep* step);
  /// Coefficients of the step's components: see series_step_sample.inc.
  void tabulate();
  /// Before its series are given up.
  void keepSamples() {
    if (makes_samples_ && strode_ == stamp_ && table_.stamp != stamp_) tabulate();
  }
  /// Orders 0 and 1 of a series that no step has begun.
  bool beginStep(double t, const double* x, double unit);
  void pointAtRows();
  /// The units of this series and of the next one.
  void noteUnits();
  friend struct SeriesInterpreter;
  friend class series_plain::SeriesOrder;
  friend class series_fused::SeriesOrder;
  friend class SeriesLanes;
  bool makes_whole_steps_ = false;
  SeriesLayout layout_ = {};
  SeriesStep step_ = {};
  bool makes_samples_ = false;
  static constexpr int kMostSampled = sizeof(SeriesLayout::sampled_at) / sizeof(int);
  std::uint64_t strode_ = 0;  ///< the stamp of the series that a good stride has left
  /// What samples of a step are made of: its series may be gone then.
  struct SampleTable {
    std::uint64_t stamp = 0;
    int last = 0;
    double end = 0.0;
    double per_step = 0.0;  ///< 1/s
    double rows[(kMostOrder + 5) * kMostSampled] = {};
  };
  SampleTable table_;
  SeriesStep sample_ = {};
  bool is_next_begun_ = false;
  StepsTogether* together_ = nullptr;
  const SeriesLanes* lanes_ = nullptr;  ///< where the next series is begun; nullptr: here
  int fetched_ = kMostSampled;          ///< of layout_.sampled_at: whose coefficients are here
  void fetchUpTo(int count) {
    if (fetched_ >= count) return;
    together_->fetch(*this, fetched_, count);
    fetched_ = count;
  }
  /// What series_step.inc and series_step_sample.inc are, interpreted or as machine code.
  struct StepCodes {
    void (*step)(SeriesStep* step) = nullptr;
    void (*arrive)(SeriesStep* step) = nullptr;
    void (*tabulate)(const SeriesStep* step, const double* rows, double theta,
                     double* table) = nullptr;
    void (*sample)(SeriesStep* step, const double* table, double part,
                   const SeriesSample* to) = nullptr;
  };
  static const StepCodes& interpretedCodes();
  const StepCodes& stepCodes() const {
    return step_codes_.step != nullptr ? step_codes_ : interpretedCodes();
  }
  /// Machine code, where there is some.
  StepCodes step_codes_;

  /// Variables of the program at a part of a step of length h from t, where the state is x.
  void setVariables(double t, double h, double part, const double* x);
  /// Coefficients 0 of all rows at a step's beginning, in its middle and at its end.
  std::vector<double> rows_along_[3];
  // Rows of the program.
  int row_of_time_ = -1;
  int row_of_angle_[kMaxShafts] = {};
  int row_of_velocity_[kMaxShafts] = {};
  int row_of_acceleration_[kMaxShafts] = {};
  struct InputRow {
    int input;
    int derivative;  ///< 0: u, 1: u', 2: u''
    int row;
  };
  std::vector<InputRow> input_rows_;
  int row_of_multiplier_[kMaxRows] = {};  ///< Lambda, or lambda under Gauss
  int row_of_residual_[kMaxRows] = {};    ///< psi or f', c0 of order 3
  int row_of_entry_[kMaxRows][kMaxShafts] = {};
  int row_of_torque_[kMaxShafts] = {};
  int row_of_inertia_[kMaxShafts] = {};          ///< J_ii
  int row_of_inertial_torque_[kMaxShafts] = {};  ///< 1/2 J_i' omega^2
  int row_of_connection_[kMaxShafts] = {};       ///< 1/2 J_i' omega
  int row_of_reaction_rate_[kMaxShafts] = {};    ///< J^-1 R, of Gamma R omega

  static constexpr int kRoom = kMostOrder + 1;
  double input_[kMaxInputs][kRoom + 3] = {};
};

}  // namespace variator_sim
