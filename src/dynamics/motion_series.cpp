#include "dynamics/motion_series.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "dynamics/formula_laws.h"
#include "variator_sim/expression/state_derivatives.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::slotOf;
using expression::Source;
using Part = expression::SeriesProgram::Part;

namespace {

/// The slots of all variables that occur in `nodes`.
std::set<int> slotsOf(const Graph& graph, const std::vector<Node>& nodes) {
  const std::vector<bool> reachable = graph.findReachable(nodes);
  std::set<int> slots;
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    const Graph::Entry& entry = graph.entry({static_cast<int>(i)});
    const bool is_variable = entry.operation == expression::Operation::kVariable;
    if (reachable[i] && is_variable) slots.insert(entry.slot);
  }
  return slots;
}

}  // namespace

std::unique_ptr<MotionSeries> MotionSeries::make(const Scene& scene, Drivetrain& drivetrain,
                                                 const MotionSeries* like) {
  // (An inertia that depends on an angle is one of the formulas.)
  if (like != nullptr && scene.principle == like->scene_.principle &&
      scene.inertia_harmonics.empty() && like->scene_.inertia_harmonics.empty()) {
    std::unique_ptr<MotionSeries> series(new MotionSeries(scene, drivetrain));
    series->copyProgram(*like);
    return series;
  }
  std::vector<Node> nodes;
  for (const TorquePtr& element : scene.torques) {
    for (const auto& [shaft, torque] : element->torques()) nodes.push_back(torque);
  }
  for (const ConstraintPtr& constraint : scene.constraints) {
    nodes.push_back(constraint->function());
  }
  if (!expression::SeriesProgram::hasSeries(*scene.graph, nodes)) return nullptr;
  std::unique_ptr<MotionSeries> series(new MotionSeries(scene, drivetrain));
  try {
    series->compile();
  } catch (const std::invalid_argument&) {
    return nullptr;
  }
  return series;
}

MotionSeries::MotionSeries(const Scene& scene, Drivetrain& drivetrain)
    : scene_(scene),
      drivetrain_(drivetrain),
      S(scene.shaftCount()),
      k_(scene.constraintCount()),
      is_classical_(scene.principle == Principle::kGauss),
      solver_(S, k_) {}

MotionSeries::Formulas MotionSeries::listFormulas() const {
  Graph& graph = *scene_.graph;
  Formulas made;
  made.torques = sumTorques(scene_, &Torque::torques);
  for (const ConstraintPtr& constraint : scene_.constraints) {
    made.residuals.push_back(residualOf(*constraint));
    made.rows.insert(made.rows.end(), constraint->row().begin(), constraint->row().end() - 1);
  }
  for (int i = 0; i < S && !isInertiaConstant(); ++i) {
    // The mean comes last: scenes that differ in it alone sum the rest in the same order.
    const Node harmonics = addHarmonics(graph, scene_, i, graph.constant(0.0));
    const Node inertia = graph.add(graph.constant(scene_.inertia(i, i)), harmonics);
    const Node omega = graph.variable(slotOf(Source::kVelocity, i));
    const Node connection = connectionOf(graph, inertia, i);
    made.inertias.insert(made.inertias.end(),
                         {inertia, graph.multiply(connection, omega), connection});
  }
  return made;
}

void MotionSeries::compile() {
  Graph& graph = *scene_.graph;
  const Formulas formulas = listFormulas();
  // Order 3 needs no trial: its c0 has no accelerations of the order to be solved for.
  std::vector<Node> trial = formulas.residuals;
  std::vector<Node> others;
  std::vector<Node>& with_rows = is_classical_ ? trial : others;
  with_rows.insert(with_rows.end(), formulas.rows.begin(), formulas.rows.end());
  others.insert(others.end(), formulas.torques.begin(), formulas.torques.end());
  others.insert(others.end(), formulas.inertias.begin(), formulas.inertias.end());

  std::vector<int> slots = {slotOf(Source::kTime)};
  for (int i = 0; i < S; ++i) {
    for (const Source part : {Source::kAngle, Source::kVelocity, Source::kAcceleration}) {
      slots.push_back(slotOf(part, i));
    }
  }
  // Lambda or lambda, J^-1 R: these rows are read by no formula.
  for (int m = 0; m < k_ + S; ++m) slots.push_back(slotOf(Source::kJerk, m));
  std::vector<Node> all = trial;
  all.insert(all.end(), others.begin(), others.end());
  const std::size_t known = slots.size();
  for (const int slot : slotsOf(graph, all)) {
    const Source source = expression::sourceOf(slot);
    if (source == Source::kInput || source == Source::kInputRate ||
        source == Source::kInputSecondRate) {
      slots.push_back(slot);
    }
  }
  program_ = expression::SeriesProgram(graph, trial, others, slots, kMostOrder + 1);
  for (std::size_t n = known; n < slots.size(); ++n) {
    const Source source = expression::sourceOf(slots[n]);
    const int derivative = source == Source::kInput ? 0 : source == Source::kInputRate ? 1 : 2;
    input_rows_.push_back(
        {expression::indexOf(slots[n]), derivative, program_.variable(static_cast<int>(n))});
  }
  findRows();
}

void MotionSeries::copyProgram(const MotionSeries& like) {
  program_ = like.program_;
  program_.clear();
  input_rows_ = like.input_rows_;
  findRows();
}

void MotionSeries::findRows() {
  int next = 0;
  row_of_time_ = program_.variable(next++);
  for (int i = 0; i < S; ++i) {
    row_of_angle_[i] = program_.variable(next++);
    row_of_velocity_[i] = program_.variable(next++);
    row_of_acceleration_[i] = program_.variable(next++);
  }
  for (int m = 0; m < k_; ++m) row_of_multiplier_[m] = program_.variable(next++);
  for (int i = 0; i < S; ++i) row_of_reaction_rate_[i] = program_.variable(next++);
  next = 0;
  for (int m = 0; m < k_; ++m) row_of_residual_[m] = program_.output(next++);
  for (int m = 0; m < k_; ++m) {
    for (int i = 0; i < S; ++i) {
      row_of_entry_[m][i] = program_.output(next++);
      is_curved_ = is_curved_ || (is_classical_ && program_.isAccelerated(row_of_entry_[m][i]));
    }
  }
  for (int i = 0; i < S; ++i) row_of_torque_[i] = program_.output(next++);
  for (int i = 0; i < S && !isInertiaConstant(); ++i) {
    row_of_inertia_[i] = program_.output(next++);
    row_of_inertial_torque_[i] = program_.output(next++);
    row_of_connection_[i] = program_.output(next++);
  }
  last_order_ = orderFor(scene_.solver.relative_tolerance);
  for (std::vector<double>& rows : rows_along_) {
    rows.resize(static_cast<std::size_t>(program_.rowCount()));
  }
  findLayout();
  if (!isInertiaConstant()) return;
  copyInertia(step_.inertia, step_.inertia_inverse);
  copyInertia(sample_.inertia, sample_.inertia_inverse);
}

int MotionSeries::orderFor(double relative_tolerance) {
  // Measured: each step has a cost that does not depend on the order, so that more than the 0.5 of
  // the theory is optimal.
  constexpr double kOrdersPerDigit = 0.7;  // of the natural logarithm
  constexpr double kFirst = 2.5;
  const double digits = -std::log(std::max(relative_tolerance, 1e-16));
  return static_cast<int>(std::clamp(std::ceil(kFirst + kOrdersPerDigit * digits), 4.0,
                                     static_cast<double>(kMostOrder)));
}

void MotionSeries::setInputs(double t, int order) {
  int last = -1;
  for (const InputRow& it : input_rows_) {
    double* const u = input_[it.input];
    if (it.input != last) drivetrain_.signal(it.input).calcSeries(t, own().unit, order + 2, u);
    last = it.input;
    for (int n = 0; n <= order; ++n) {
      const double rate = (n + 1) * u[n + 1] / own().unit;
      const double second = (n + 2) * (n + 1) * u[n + 2] / (own().unit * own().unit);
      program_.set(it.row, n, it.derivative == 0 ? u[n] : it.derivative == 1 ? rate : second);
    }
  }
}

void MotionSeries::setState(double time, const double* x) {
  program_.set(row_of_time_, 0, time);
  for (int i = 0; i < S; ++i) {
    program_.set(row_of_angle_[i], 0, x[i]);
    program_.set(row_of_velocity_[i], 0, x[S + i]);
    program_.set(row_of_acceleration_[i], 0, x[2 * S + i]);
  }
}

void MotionSeries::beginRows() {
  if (begin_code_ != nullptr) {
    program_.noteLimit(begin_code_(program_.rows(), program_.states(), constants_) != 0);
  } else {
    program_.begin(Part::kGiven);
    program_.begin(Part::kAccelerated);
  }
}

bool MotionSeries::begin(double t, const double* x, double unit, int most) {
  ++stamp_;
  most_ = most;
  is_next_begun_ = false;
  fetched_ = kMostSampled;
  own().unit = unit;
  own().inverse[(S + k_) * (S + k_)] = 1.0 / unit;  // exact: a power of 2
  own().order = 0;
  if (makes_whole_steps_) {
    setInputs(t, most);
    if (beginWhole(t, x)) return true;
  }
  const StateView state = drivetrain_.view(t, x, x + S, x + 2 * S);
  setInputs(t, most);
  setState(state.time, x);
  program_.set(row_of_time_, 1, unit);
  beginRows();
  for (int m = 0; m < k_; ++m) {
    for (int i = 0; i < S; ++i) solver_.row(m)[i] = program_.coefficients(entryRow(m, i))[0];
  }
  const bool is_regular = k_ == 0 || withShaftCount(S, [this](auto shafts) {
                            return solver_.factor(shafts, drivetrain_.inertia());
                          });
  if (!is_regular) return false;
  if (is_classical_ || !isInertiaConstant()) beginReaction(x);
  if (!isInertiaConstant()) {
    double* const J0 = own().inverse + placeOfInertia();
    copyInertia(J0, J0 + S * S);
  }
  for (int i = 0; i < S; ++i) {
    program_.set(row_of_velocity_[i], 1, unit * x[2 * S + i]);
    program_.set(row_of_angle_[i], 1, unit * x[S + i]);
  }
  return is_curved_ ? invertCurved(state) : invert();
}

bool MotionSeries::invert() {
  if (k_ == 1) {
    withShaftCount(S, [this](auto shafts) { invertOneRow(shafts); });
    return true;
  }
  const int size = S + k_;
  for (int column = 0; column < size; ++column) {
    double right[kMaxShafts] = {};
    double g[kMaxRows] = {};
    double epsilon[kMaxShafts] = {};
    double mu[kMaxRows] = {};
    if (column < S) {
      right[column] = 1.0;
      drivetrain_.inertia().solve(right, epsilon);
    } else {
      g[column - S] = -1.0;
    }
    if (k_ > 0) solver_.constrain(g, epsilon, mu);
    for (int i = 0; i < S; ++i) own().inverse[i * size + column] = epsilon[i];
    for (int m = 0; m < k_; ++m) own().inverse[(S + m) * size + column] = mu[m];
  }
  return true;
}

template <class Count>
void MotionSeries::invertOneRow(Count shafts) {
  // With w = J^-1 C^T and A = C w:  [J^-1 - w w^T / A, w / A; -w^T / A, 1 / A], times (a, -g)
  const Inertia& inertia = drivetrain_.inertia();
  const double* const C = solver_.row(0);
  double* const last = own().inverse + shafts * (shafts + 1);
  double w[kMaxShafts];
  inertia.solve(shafts, C, w);
  double A = 0.0;
  for (int i = 0; i < shafts; ++i) A += C[i] * w[i];
  const double part = 1.0 / A;
  for (int j = 0; j < shafts; ++j) {
    double unit[kMaxShafts] = {};
    double column[kMaxShafts];
    unit[j] = 1.0;
    inertia.solve(shafts, unit, column);
    for (int i = 0; i < shafts; ++i) {
      own().inverse[i * (shafts + 1) + j] = column[i] - w[i] * (part * w[j]);
    }
    last[j] = -part * w[j];
    own().inverse[j * (shafts + 1) + shafts] = part * w[j];
  }
  last[shafts] = part;
}

bool MotionSeries::invertCurved(const StateView& state) {
  const int size = S + k_;
  DenseMatrix matrix = DenseMatrix::Zero(size, size);
  for (int i = 0; i < S; ++i) {
    for (int j = 0; j < S; ++j) matrix(i, j) = drivetrain_.inertia().entry(i, j);
  }
  for (int m = 0; m < k_; ++m) {
    double H[kMaxShafts * kMaxShafts];
    drivetrain_.constraint(m).calcHessian(state, H);
    const double lambda = program_.coefficients(row_of_multiplier_[m])[0];
    for (int i = 0; i < S; ++i) {
      for (int j = 0; j < S; ++j) matrix(i, j) -= lambda * H[i * S + j];
      matrix(i, S + m) = -solver_.row(m)[i];
      matrix(S + m, i) = solver_.row(m)[i];
    }
  }
  for (int column = 0; column < size; ++column) {
    DenseMatrix scaled = matrix;
    DenseVector right = DenseVector::Zero(size);
    right(column) = 1.0;
    DenseVector solution;
    if (!solveScaled(scaled, right, 1, &solution)) return false;
    for (int i = 0; i < size; ++i) own().inverse[i * size + column] = solution(i);
  }
  return true;
}

void MotionSeries::beginReaction(const double* x) {
  // R = J epsilon + n - Q
  double reaction[kMaxShafts];
  double b[kMaxShafts];
  drivetrain_.inertia().multiply(x + 2 * S, reaction);
  for (int i = 0; i < S; ++i) {
    reaction[i] -= program_.coefficients(row_of_torque_[i])[0];
    if (isInertiaConstant()) continue;
    reaction[i] += program_.coefficients(row_of_inertial_torque_[i])[0];
  }
  drivetrain_.inertia().solve(reaction, b);
  for (int i = 0; i < S; ++i) program_.set(row_of_reaction_rate_[i], 0, b[i]);
  if (!is_classical_) return;
  // C^T lambda = R: A lambda = C J^-1 R
  double lambda[kMaxRows] = {};
  solver_.multiply(b, lambda);
  solver_.solve(lambda, lambda);
  for (int m = 0; m < k_; ++m) program_.set(row_of_multiplier_[m], 0, lambda[m]);
}

bool MotionSeries::extendTo(int order) {
  const int before = own().order;
  const bool has_code = most_ < static_cast<int>(codes_.size());
  for (int n = before + 1; n <= order; ++n) {
    if (has_code && program_.isDecided()) {
      const OrderCode* const codes = codes_.data();
      for (; n <= order; ++n)
        codes[n](program_.rows(), program_.states(), own().inverse, constants_, own().unit);
    } else {
      continueTo(n);
    }
  }
  // Numbers that are not finite have no difference of 0 with themselves.
  double remains = 0.0;
  for (int i = 0; i < S; ++i) {
    const double* const epsilon = acceleration(i);
    for (int n = before + 1; n <= order; ++n) remains += epsilon[n] - epsilon[n];
  }
  if (remains != 0.0) {
    program_.clear();
    is_next_begun_ = false;
    return false;
  }
  own().order = order;
  return true;
}

void MotionSeries::copyInertia(double* J, double* J_inverse) const {
  const Inertia& inertia = drivetrain_.inertia();
  for (int j = 0; j < S; ++j) {
    double unit[kMaxShafts] = {};
    double column[kMaxShafts];
    unit[j] = 1.0;
    inertia.solve(unit, column);
    for (int i = 0; i < S; ++i) J[i * S + j] = inertia.entry(i, j);
    for (int i = 0; i < S; ++i) J_inverse[i * S + j] = column[i];
  }
}

}  // namespace variator_sim
