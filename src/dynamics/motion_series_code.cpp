// The orders of a motion's series as C: the statements of MotionSeries::continueTo with the order a
// constant of each, so that the compiler unrolls every sum.
#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <utility>

#include "dynamics/motion_series.h"
#include "dynamics/series_step_text.h"
#include "expression/c_code.h"

namespace variator_sim {

namespace {

using Part = expression::SeriesProgram::Part;

struct NamedPart {
  const char* name;
  Part part;
};
constexpr NamedPart kParts[] = {{"series_given", Part::kGiven},
                                {"series_trial", Part::kTrial},
                                {"series_accelerated", Part::kAccelerated}};

constexpr NamedPart kBeginnings[] = {{"begin_given", Part::kGiven},
                                     {"begin_accelerated", Part::kAccelerated}};

/// States, some near to 0, at which code has to give the interpreter's numbers.
constexpr int kStates = 6;

bool isSame(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(), [](double one, double other) {
           return one == other && std::signbit(one) == std::signbit(other);
         });
}

constexpr const char* kBegin = "series_begin";
std::string nameOf(int order) {
  return "series_order_" + std::to_string(order);
}

}  // namespace

std::string MotionSeries::writeCoefficient(int row, const std::string& n) const {
  return "r[" + std::to_string(program_.offset(row)) + " + (" + n + ")]";
}

/// See calcForceRest.
std::string MotionSeries::writeForceRest(std::set<int>* mirrored) const {
  std::ostringstream text;
  const bool moves = !isInertiaConstant();
  for (int i = 0; i < S; ++i) {
    text << "  double a" << i << " = " << writeCoefficient(row_of_torque_[i], "n") << ";\n";
    if (moves) {
      text << "  a" << i << " -= " << writeCoefficient(row_of_inertial_torque_[i], "n") << ";\n  a"
           << i << " -= "
           << program_.writeConvolution(row_of_inertia_[i], row_of_acceleration_[i], "n", mirrored)
           << ";\n";
    }
    const char* const last = is_classical_ ? "n" : "(n - 1)";
    std::string rest;
    for (int m = 0; m < k_; ++m) {
      if (program_.isConstant(entryRow(m, i))) continue;
      rest += (rest.empty() ? "0.0 + " : " + ") +
              program_.writeConvolution(entryRow(m, i), row_of_multiplier_[m], last, mirrored);
    }
    if (moves && !is_classical_) {
      rest += (rest.empty() ? "0.0 + (" : " + (") + writeCoefficient(row_of_connection_[i], "0") +
              " * " + writeCoefficient(row_of_reaction_rate_[i], "n - 1") + " + " +
              program_.writeConvolution(row_of_connection_[i], row_of_reaction_rate_[i], "(n - 1)",
                                        mirrored) +
              ")";
    }
    if (rest.empty()) continue;
    text << "  a" << i << " = a" << i << " + " << (is_classical_ ? "1.0" : "u * (1.0 / n)")
         << " * (" << rest << ");\n";
  }
  return text.str();
}

/// See calcConstraintRest.
std::string MotionSeries::writeConstraintRest() const {
  std::ostringstream text;
  for (int m = 0; m < k_; ++m) {
    const std::string g = "a" + std::to_string(S + m);
    if (drivetrain_.constraint(m).order() < 3) {
      text << "  const double " << g << " = -" << writeCoefficient(row_of_residual_[m], "n")
           << ";\n";
      continue;
    }
    text << "  double " << g << " = u * " << writeCoefficient(row_of_residual_[m], "n - 1")
         << ";\n";
    for (int i = 0; i < S; ++i) {
      text << "  for (int j = 1; j < n; ++j) " << g << " += (n - j) * "
           << writeCoefficient(entryRow(m, i), "j") << " * "
           << writeCoefficient(row_of_acceleration_[i], "n - j") << ";\n";
    }
    text << "  " << g << " = -" << g << " * (1.0 / n);\n";
  }
  return text.str();
}

/// See continueTo, which it has to equal operation by operation.
std::string MotionSeries::writeOrder(std::set<int>* mirrored) const {
  std::ostringstream text;
  const auto set = [&](int row, const std::string& n, const std::string& value) {
    text << "  { const double y = " << value << "; " << writeCoefficient(row, n) << " = y; "
         << expression::SeriesProgram::writeMirror(row) << " r[" << program_.backwardOffset(row)
         << " - (" << n << ")] = y; }\n";
  };
  for (int i = 0; i < S; ++i) set(row_of_acceleration_[i], "n", "0.0");
  text << "  series_given(n, r, s, c);\n  series_trial(n, r, s, c);\n";
  text << writeForceRest(mirrored);
  text << writeConstraintRest();
  const int size = S + k_;
  for (int i = 0; i < size; ++i) {
    text << "  const double x" << i << " = ";
    for (int j = 0; j < size; ++j) {
      text << (j > 0 ? " + " : "") << "k[" << i * size + j << "] * a" << j;
    }
    text << ";\n";
  }
  for (int i = 0; i < S; ++i) set(row_of_acceleration_[i], "n", "x" + std::to_string(i));
  for (int m = 0; m < k_; ++m) {
    const std::string mu = "x" + std::to_string(S + m);
    set(row_of_multiplier_[m], is_classical_ ? "n" : "n - 1",
        is_classical_ ? mu : mu + " * n * k[" + std::to_string(size * size) + "]");
  }
  for (int i = 0; i < S; ++i) {
    set(row_of_velocity_[i], "n + 1", "u * (1.0 / (n + 1)) * x" + std::to_string(i));
    set(row_of_angle_[i], "n + 1",
        "u * (1.0 / (n + 1)) * " + writeCoefficient(row_of_velocity_[i], "n"));
  }
  text << "  series_accelerated(n, r, s, c);\n";
  if (!isInertiaConstant() && !is_classical_) text << writeReaction(mirrored);
  return text.str();
}

/// See noteReaction.
std::string MotionSeries::writeReaction(std::set<int>* mirrored) const {
  std::ostringstream text;
  const auto product = [&](int begin, int i, const auto& factor) {
    text << "0.0";
    for (int j = 0; j < S; ++j) {
      text << " + k[" << begin + i * S + j << "] * ";
      factor(j);
    }
  };
  const auto coefficient = [&](int row) { text << "r[" << program_.offset(row) << " + n]"; };
  const int J0 = placeOfInertia();
  for (int i = 0; i < S; ++i) {
    text << "  const double b" << i << " = (";
    product(J0, i, [&](int j) { coefficient(row_of_acceleration_[j]); });
    text << ") + ";
    coefficient(row_of_inertial_torque_[i]);
    text << " - ";
    coefficient(row_of_torque_[i]);
    text << " + ("
         << program_.writeConvolution(row_of_inertia_[i], row_of_acceleration_[i], "n", mirrored)
         << " - "
         << program_.writeConvolution(row_of_inertia_[i], row_of_reaction_rate_[i], "n", mirrored)
         << ");\n";
  }
  for (int i = 0; i < S; ++i) {
    const int row = row_of_reaction_rate_[i];
    text << "  { const double y = ";
    product(J0 + S * S, i, [&](int j) { text << "b" << j; });
    text << "; r[" << program_.offset(row) << " + n] = y; "
         << expression::SeriesProgram::writeMirror(row) << " r[" << program_.backwardOffset(row)
         << " - n] = y; }\n";
  }
  return text.str();
}

/// The functions of series_step.inc, and what stands around them.
std::string MotionSeries::writeWholeStep() const {
  std::ostringstream text;
  text << "#define LAYOUT layout\ntypedef double Real;\n"
       << kSeriesStepData << "static const struct SeriesLayout layout = {";
  const auto one = [&text](int value) { text << value << ", "; };
  const auto array = [&text](const auto& values) {
    text << "{";
    for (const int value : values) text << value << ", ";
    text << "}, ";
  };
  const SeriesLayout& it = layout_;
  for (const int value :
       {it.shafts, it.rows, it.velocity_rows, it.order, it.least, it.is_inertia_constant,
        it.is_inertia_diagonal, it.is_row_constant, it.has_residuals, it.time_at, it.time_back}) {
    one(value);
  }
  array(it.component_at);
  array(it.component_back);
  array(it.torque_at);
  array(it.residual_at);
  array(it.entry_at);
  array(it.inertia_at);
  array(it.inertial_torque_at);
  array(it.reaction_at);
  array(it.reaction_back);
  one(it.flats);
  array(it.flat_at);
  array(it.flat_divides);
  text << "};\nstatic void (*const orders[])(double*, double*, const double*, const double*, "
          "double) = {0";
  for (int n = 1; n <= layout_.order; ++n) text << ", " << nameOf(n);
  text << "};\n"
       << R"c(
static inline void seriesOrder(struct SeriesStep* it, int next, int n) {
  orders[n](next ? it->next_rows : it->rows, next ? it->next_states : it->states,
            next ? it->next_inverse : it->inverse, it->constants, next ? it->next_unit : it->unit);
}
static inline void seriesBeginGiven(struct SeriesStep* it) {
  it->limits |= begin_given(it->next_rows, it->next_states, it->constants);
}
static inline void seriesBeginAccelerated(struct SeriesStep* it) {
  it->limits |= begin_accelerated(it->next_rows, it->next_states, it->constants);
}
static inline void seriesVelocityLevel(struct SeriesStep* it, double* level) {
  velocity_level(it->origin + it->end, it->x_new, it->x_new + layout.shafts,
                 it->x_new + 2 * layout.shafts, it->input, it->input_rate, it->input_second_rate,
                 it->tables, level);
}
static inline void seriesTurn(struct SeriesStep* it) { (void)it; }
static inline __attribute__((always_inline)) double seriesDot(const double* a, const double* b, int count) {
  return dot(a, b, count);
}
)c" << kSeriesStepText
       << "void series_step(struct SeriesStep* it) { seriesStep(it); }\n"
          "void series_arrive(struct SeriesStep* it) { seriesArrive(it, 0); }\n";
  return text.str();
}

std::string MotionSeries::writeSource() const {
  std::set<int> mirrored;
  std::string text;
  for (const auto& [name, part] : kParts) {
    text += std::string("static inline __attribute__((always_inline)) void ") + name +
            "(int n, double* restrict r, double* restrict s, const double* restrict c) {\n" +
            "  (void)c;\n" + program_.writeCode(part, &mirrored) + "}\n";
  }
  text +=
      "static inline __attribute__((always_inline)) void order(int n, double* restrict r,\n"
      "    double* restrict s, const double* restrict k, const double* restrict c, double u) {\n" +
      writeOrder(&mirrored) + "}\n";
  if (!program_.readsTables()) {
    for (const auto& [name, part] : kBeginnings) {
      text += std::string("static int ") + name +
              "(double* restrict r, double* restrict s, const double* restrict c) {\n"
              "  const int n = 0;\n  int limit = 0;\n  (void)n, (void)s, (void)c;\n" +
              program_.writeBegin(part) + "  return limit;\n}\n";
    }
    text += std::string("int ") + kBegin +
            "(double* restrict r, double* restrict s, const double* restrict c) {\n"
            "  const int limit = begin_given(r, s, c);\n"
            "  return begin_accelerated(r, s, c) || limit;\n}\n";
  }
  for (int n = 1; n <= orderFor(scene_.solver.relative_tolerance); ++n) {
    text += "void " + nameOf(n) +
            "(double* restrict r, double* restrict s, const double* restrict k,\n"
            "    const double* restrict c, double u) {\n  order(" +
            std::to_string(n) + ", r, s, k, c, u);\n}\n";
  }
  if (makes_whole_steps_) text += writeWholeStep();
  return expression::SeriesProgram::codePrelude() + program_.writeMirrors(mirrored) + text;
}

void MotionSeries::addStructure(expression::CodeStructure* structure) const {
  std::vector<int>& words = structure->words;
  words.insert(words.end(), {S, k_, is_classical_ ? 1 : 0, isInertiaConstant() ? 1 : 0,
                             orderFor(scene_.solver.relative_tolerance)});
  for (int m = 0; m < k_; ++m) {
    words.push_back(drivetrain_.constraint(m).order());
    words.push_back(row_of_multiplier_[m]);
    words.push_back(row_of_residual_[m]);
    for (int i = 0; i < S; ++i) words.push_back(entryRow(m, i));
  }
  for (int i = 0; i < S; ++i) {
    words.insert(words.end(), {row_of_angle_[i], row_of_velocity_[i], row_of_acceleration_[i],
                               row_of_torque_[i], row_of_inertia_[i], row_of_inertial_torque_[i],
                               row_of_connection_[i], row_of_reaction_rate_[i]});
  }
  const auto* const layout = reinterpret_cast<const int*>(&layout_);
  words.push_back(makes_whole_steps_ ? 1 : 0);
  words.insert(words.end(), layout, layout + sizeof layout_ / sizeof *layout);
  program_.addStructure(structure);
}

bool MotionSeries::use(const KernelLibrary& library, const double* constants) {
  std::vector<OrderCode> codes(1, nullptr);
  for (int n = 1; n <= orderFor(scene_.solver.relative_tolerance); ++n) {
    codes.push_back(reinterpret_cast<OrderCode>(library.find(nameOf(n).c_str())));
    if (codes.back() == nullptr) return false;
  }
  const auto begin = reinterpret_cast<BeginCode>(library.find(kBegin));
  if (begin == nullptr && !program_.readsTables()) return false;
  if (makes_whole_steps_) {
    const auto step = reinterpret_cast<StepCode>(library.find("series_step"));
    const auto arrive = reinterpret_cast<StepCode>(library.find("series_arrive"));
    if (step == nullptr || arrive == nullptr) return false;
    step_code_ = step;
    arrive_code_ = arrive;
  }
  codes_ = std::move(codes);
  begin_code_ = begin;
  constants_ = constants;
  return true;
}

bool MotionSeries::agreesWithInterpreter() {
  for (int n = 0; n < kStates; ++n) {
    const std::vector<double> computed = expandAt(n);
    std::vector<OrderCode> codes;
    codes.swap(codes_);
    const BeginCode begin_code = std::exchange(begin_code_, nullptr);
    const StepCode step_code = std::exchange(step_code_, interpretStep);
    const StepCode arrive_code = std::exchange(arrive_code_, interpretArrival);
    const bool is_same = isSame(expandAt(n), computed);
    codes_.swap(codes);
    begin_code_ = begin_code;
    step_code_ = step_code;
    arrive_code_ = arrive_code;
    if (!is_same) return false;
  }
  return true;
}

void MotionSeries::interpret() {
  codes_.clear();
  begin_code_ = nullptr;
  step_code_ = interpretStep;
  arrive_code_ = interpretArrival;
}

std::vector<double> MotionSeries::expandAt(int state) {
  double x[3 * kMaxShafts];
  for (int i = 0; i < 3 * S; ++i) {
    x[i] = (state % 2 == 0 ? 20.0 : 0.5) * std::abs(std::sin(1.0 + 7.3 * state + 3.1 * i));
  }
  std::vector<double> coefficients;
  const int order = orderFor(scene_.solver.relative_tolerance);
  if (!begin(0.37 * state, x, 0.0625, order)) return coefficients;
  while (this->order() < order && extendTo(this->order() + 1)) {
    for (int i = 0; i < S; ++i) {
      coefficients.push_back(acceleration(i)[this->order()]);
      coefficients.push_back(torque(i)[this->order()]);
    }
  }
  if (makes_whole_steps_ && this->order() == order) {
    const double relative = scene_.solver.relative_tolerance;
    const double limit = state % 3 == 2 ? 0.001 : 1.0;
    forgetNext();
    const SeriesStep& made =
        step(0.37 * state, x,
             {limit, 0.37 * state + limit, 0.01 * (1 + state), relative, relative, 0.5});
    if (made.doubt == 0.0) {
      coefficients.insert(coefficients.end(), made.x_new, made.x_new + 3 * S);
      coefficients.insert(coefficients.end(), made.eta, made.eta + S);
      coefficients.push_back(made.taken);
      coefficients.push_back(made.error);
    }
    refuseStep();
  }
  return coefficients;
}

}  // namespace variator_sim
