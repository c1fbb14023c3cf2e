/// The motion as power series: a differential-algebraic system, solved order by order.
///
/// With s = (t - t0) / unit, and coefficients x_n of s^n, the unknowns of order n are linear in
///     n phi_n = unit omega_{n-1},   n omega_n = unit epsilon_{n-1}
///     psi_n = psi_n(epsilon_n = 0) + C_0 epsilon_n = 0
///     J epsilon + n(phi, omega) - Q = R,   R' = C^T Lambda + Gamma R omega     (generalized Gauss)
///                                          R = C^T lambda                       (Gauss)
/// that is, with the same matrix for every n,
///     J_0 epsilon_n - C_0^T mu_n = a_n,   C_0 epsilon_n = -g_n,   mu_n = unit Lambda_{n-1} / n
/// where a_n and g_n are known from lower orders:
///     a_n = Q_n - n_n - sum_{j>=1} J_j epsilon_{n-j}
///           + unit/n (sum_{j=1..n-1} C_j^T Lambda_{n-1-j} + (Gamma R omega)_{n-1})
/// Under Gauss mu_n = lambda_n, the last line is sum_{j=1..n-1} C_j^T lambda_{n-j} + Ĉ_n^T
/// lambda_0, and where psi is not linear in epsilon, J_0 loses sum lambda_0 d2psi/depsilon2.
/// Constraints of order 1 are psi = f', those of order 3 have
///     g_n = 1/n (sum_{j=1..n-1} (n-j) C_j epsilon_{n-j} + unit c0_{n-1}).
/// (Pryce: Solving differential-algebraic equations by Taylor series, Numerical Algorithms 19
/// (1998) 195-211, special case of one pattern of offsets.)
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

/// The series of one scene. One thread may use it at a time.
class MotionSeries {
 public:
  static constexpr int kMostOrder = 30;

  /// Makes the series of a scene whose elements are all formulas of its graph; returns nullptr for
  /// others. With constraints of order 3 under `gauss` only isStepResolved may be called.
  /// `drivetrain` and `scene` have to outlive it. `like`: the series of a scene with the same
  /// elements, or nullptr.
  static std::unique_ptr<MotionSeries> make(const Scene& scene, Drivetrain& drivetrain,
                                            const MotionSeries* like = nullptr);

  /// Begins a series at (t, x), x = (phi, omega, epsilon): coefficient 0. `unit`, s; `most`: the
  /// highest order to come, at most kMostOrder. Returns false if C has lost rank. [loop]
  bool begin(double t, const double* x, double unit, int most);
  // --- steps in one: series_step.inc -----------------------------------------------------------
  /// True if a step can be made in one: under generalized Gauss, without tables.
  bool makesWholeSteps() const { return makes_whole_steps_; }
  /// The requirements on steps.
  struct Aim {
    bool goes_on;     ///< the next series is begun at the step end
    double length;    ///< predicted step length, by the step before, s
    double before;    ///< predicted length of that step, s: a restart uses it as well
    double absolute;  ///< tolerance
    double relative;
    double decay;  ///< of the terms before the last one
    Reach reach;
  };
  /// Makes a batch of steps from (t, x), each as long as its series allow, and begins the next
  /// series at the end of the last one; inputs are constant. All steps made are accepted, except a
  /// last one marked as rejected, from which the motion does not continue. Afterwards the series
  /// are those of the last step, of order `last`. [loop]
  const SeriesStep& stride(double t, const double* x, const Aim& aim);
  bool isNextBegunAt(double t) const;
  /// Computes a sample at t inside the last step, which ends at `end`, of the batch whose series
  /// had that stamp; inputs are constant. The series of both ends give all of it, velocities and
  /// accelerations being projected onto the constraints. Returns false with constraints of order 3
  /// and for a step of another method. [loop]
  bool calcSample(std::uint64_t stamp, double end, double t, std::uint64_t* projections,
                  Sample* sample);
  /// Steps are made together with other motions if possible; nullptr: alone. The owner of
  /// `together` has to outlive this or to reset it.
  void makeStepsWith(StepsTogether* together) { together_ = together; }
  /// Fetch the coefficients of a step made with others: those of the state, or all that samples
  /// need. [loop]
  void fetchState() { fetchUpTo(3 * S); }
  void fetch() { fetchUpTo(layout_.sampled); }
  /// Sets the null-space component of the reaction.
  void keepReaction(const KeptReaction& kept);
  /// Discards the next series: the motion does not continue from it, or inputs have changed.
  void forgetNext() { is_next_begun_ = false; }

  /// Extends the series to `order` of epsilon. Returns false, without coefficients, if a new order
  /// is not finite. [loop]
  bool extendTo(int order);
  int order() const { return own().order; }
  /// True if the series of all formulas resolve the formulas up to `length`, s, within the
  /// tolerance (series_resolution.inc). [loop]
  bool isResolved(double length, double absolute, double relative,
                  const double* const* at = nullptr) const;
  /// True if a formula may have unresolved features along a step from t to t + h, s, of another
  /// stepper from x = (phi, omega, epsilon) to x_end. [loop]
  bool mayHideAlong(double t, double h, const double* x, const double* x_end);
  /// As isResolved along the step of the preceding mayHideAlong, over the parabolas through x, its
  /// middle and x_end. The series become those of the parabolas. [loop]
  bool isStepResolved(double t, double h, const double* x, const double* x_middle,
                      const double* x_end, double absolute, double relative);
  /// Identifies the series: another number after every `begin`.
  std::uint64_t stamp() const { return stamp_; }

  /// Coefficients of a shaft's acceleration up to order(), of its velocity and angle up to one
  /// more.
  const double* angle(int i) const { return program_.coefficients(row_of_angle_[i]); }
  const double* velocity(int i) const { return program_.coefficients(row_of_velocity_[i]); }
  const double* acceleration(int i) const { return program_.coefficients(row_of_acceleration_[i]); }
  double unit() const { return own().unit; }
  /// The unit of a series whose step may have this length, s.
  static double unitFor(double length);
  /// Writes the orders as C, and lists the structure of the code.
  std::string writeSource() const;
  /// Writes steps of several motions at once (series_lanes.h), behind `velocity_level`; empty if
  /// there are none.
  std::string writeLanesSource() const;
  void addStructure(expression::CodeStructure* structure) const;
  /// Switches to their code, which changes no bit; returns false if it is missing. `constants` are
  /// those that `addStructure` has added; they have to outlive it. Not in the loop.
  bool use(const KernelLibrary& library, const double* constants, std::size_t count);
  /// Returns true if the code gives the interpreter's numbers. Not in the loop.
  bool agreesWithInterpreter();
  void interpret();
  /// Returns the order of least work for this relative tolerance.
  static int orderFor(double relative_tolerance);
  /// Coefficients of the applied torque on a shaft, up to order().
  const double* torque(int i) const { return program_.coefficients(row_of_torque_[i]); }

 private:
  MotionSeries(const Scene& scene, Drivetrain& drivetrain);
  struct Formulas {
    std::vector<expression::Node> torques;    ///< Q, of the shafts
    std::vector<expression::Node> residuals;  ///< psi or f'; c0 of order 3
    std::vector<expression::Node> rows;       ///< C, row by row
    /// J_i, 1/2 J_i' omega^2 and 1/2 J_i' omega of each shaft whose inertia depends on an angle.
    std::vector<expression::Node> inertias;
  };
  Formulas listFormulas() const;
  void compile();
  /// Copies the program of `like`, in place of `compile`.
  void copyProgram(const MotionSeries& like);
  /// Finds the rows of all formulas in the program, in the order in which they were added.
  void findRows();

  /// Writes one order as C.
  std::string writeOrder() const;
  std::string writeConvolution(int a, int b, const char* order) const;
  std::string writeForceRest() const;
  std::string writeConstraintRest() const;
  std::string writeReaction() const;
  std::string writeOrders() const;
  std::string writeLayout() const;
  std::vector<int> layoutWords() const;
  std::string writeWholeStep() const;
  std::string writeHidden() const;
  /// Sets states that distinguish code and interpreter.
  void setAside(int state, double* x) const;
  /// Makes steps from such a state, by `code` if that is given.
  void stepAside(int state, double limit, const std::function<void()>& code = nullptr);
  bool givesSameNumbers();
  /// Returns the coefficients at such a state, as far as they are finite.
  std::vector<double> expandAt(int state);
  /// Begins order 0, as `begin` does.
  bool beginWhole(double t, const double* x);
  void setInputs(double t, int order);
  void setState(double time, const double* x);
  /// Begins order 0 of all formulas.
  void beginRows();
  /// Begins order 0 of what noteArguments reads, at least.
  void beginArguments();
  void beginReaction(const double* x);
  /// Computes the inverse of [J_0 -C_0^T; C_0 0], or of its replacement in Newton's iteration.
  /// Returns false if it is singular.
  bool invert();
  template <class Count>
  void invertOneRow(Count shafts);
  bool invertCurved(const StateView& state);
  void continueTo(int n);
  /// Copies J and its inverse, by columns.
  void copyInertia(double* J, double* J_inverse) const;
  /// Offset of J_0 in `inverse`.
  int placeOfInertia() const { return (S + k_) * (S + k_) + 1; }

  bool isInertiaConstant() const { return drivetrain_.inertia().isConstant(); }
  /// True if the inertia of shaft i depends on its angle.
  bool hasMovingInertia(int i) const {
    return !isInertiaConstant() && !program_.isConstant(row_of_inertia_[i]);
  }
  int entryRow(int m, int i) const { return row_of_entry_[m][i]; }

  static constexpr int kMostUnknowns = kMaxShafts + kMaxRows;
  /// Order of formulas along a step of another stepper.
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
  /// Order 0 of all formulas; returns a number other than 0 if a part has overflowed.
  using BeginCode = int (*)(double* rows, double* states, const double* constants);
  BeginCode begin_code_ = nullptr;
  const KernelLibrary* library_ = nullptr;  ///< its code
  const double* constants_ = nullptr;
  std::size_t constants_count_ = 0;
  /// The data of a series beside the rows of the program.
  struct Own {
    double unit = 1.0;
    int order = 0;
    /// The inverse matrix, behind it 1 / unit, and J_0 and its inverse if the inertia depends on an
    /// angle.
    double inverse[kMostUnknowns * kMostUnknowns + 1 + 2 * kMaxShafts * kMaxShafts] = {};
  };
  Own own_[2];  ///< the step's series and the next one's
  int used_ = 0;
  Own& own() { return own_[used_]; }
  const Own& own() const { return own_[used_]; }
  void turn() {
    program_.turn();
    used_ = 1 - used_;
  }
  std::uint64_t stamp_ = 0;
  int most_ = 0;        ///< highest order to come
  int last_order_ = 0;  ///< order of steps

  /// True for the last order: its accelerations need not be inserted into the formulas.
  bool isLast(int order) const { return order == last_order_; }
  void findLayout();
  void findSampled();
  void prepare(SeriesStep* step);
  /// Tabulates coefficients of the step's components: see series_step_sample.inc.
  void tabulate();
  /// Keeps the sample table before the step's series are replaced.
  void keepSamples() {
    if (makes_samples_ && strode_ == stamp_ && table_.stamp != stamp_) tabulate();
  }
  /// Begins orders 0 and 1 of a series that no step has begun.
  bool beginStep(double t, const double* x, double unit);
  void pointAtRows();
  /// Notes the units of this series and of the next one.
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
  std::uint64_t strode_ = 0;  ///< the stamp of the series of an accepted step batch
  /// The data for samples of a step, whose series may have been replaced.
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
  const SeriesLanes* lanes_ = nullptr;  ///< lanes that begin the next series; nullptr: this object
  int fetched_ = kMostSampled;          ///< entries of layout_.sampled_at with coefficients here
  void fetchUpTo(int count) {
    if (fetched_ >= count) return;
    together_->fetch(*this, fetched_, count);
    fetched_ = count;
  }
  /// The functions of series_step.inc and series_step_sample.inc, interpreted or as machine code.
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
  /// Machine code, if there is some.
  StepCodes step_codes_;

  /// Sets variables of the program at a part of a step of length h from t, at the state x.
  void setVariables(double t, double h, double part, const double* x);
  /// Coefficients 0 of all rows at a step's start, middle and end.
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
  int row_of_reaction_rate_[kMaxShafts] = {};    ///< J^-1 R, in Gamma R omega

  static constexpr int kRoom = kMostOrder + 1;
  double input_[kMaxInputs][kRoom + 3] = {};
};

}  // namespace variator_sim
