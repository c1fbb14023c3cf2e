// The orders of a motion's series as C: the statements of SeriesOrder::make with the order a
// constant of each, so that the compiler unrolls every sum.
#include <sstream>
#include <type_traits>
#include <utility>

#include "dynamics/motion_series.h"
#include "dynamics/series_lanes.h"
#include "dynamics/series_step_text.h"
#include "expression/c_code.h"
#include "expression/series_dot.h"
#include "expression/series_text.h"

namespace variator_sim {

namespace {

std::string strideOfCode() {
  return "#define VS_STRIDE " + std::to_string(expression::SeriesProgram::kStride) + "\n";
}

/// Writes sum_j k[begin + j] factor(j) as C.
template <class Factor>
std::string writeProduct(int begin, int count, const Factor& factor) {
  std::string sum = "k[" + std::to_string(begin) + "] * " + factor(0);
  for (int j = 1; j < count; ++j) {
    std::ostringstream next;
    next << "vs_fuse(k[" << begin + j << "], " << factor(j) << ", " << sum << ")";
    sum = next.str();
  }
  return sum;
}

std::string at(int row, const char* order) {
  return "r[" + std::to_string(row) + "][" + order + "]";
}

constexpr const char* kBegin = "series_begin";
std::string nameOf(int order) {
  return "series_order_" + std::to_string(order);
}

}  // namespace

/// Writes sum_{j=1..order} a_j b_{order-j}.
std::string MotionSeries::writeConvolution(int a, int b, const char* order) const {
  return "vs_convolve(r[" + std::to_string(a) + "], r[" + std::to_string(b) + "], " + order +
         ", 1, 0)";
}

/// See SeriesOrder::calcForceRest.
std::string MotionSeries::writeForceRest() const {
  std::ostringstream text;
  for (int i = 0; i < S; ++i) {
    const bool moves = hasMovingInertia(i);
    text << "  Real a" << i << " = " << at(row_of_torque_[i], "n") << ";\n";
    if (moves) {
      text << "  const Real rest" << i << " = "
           << writeConvolution(row_of_inertia_[i], row_of_acceleration_[i], "n") << ";\n  a" << i
           << " -= " << at(row_of_inertial_torque_[i], "n") << ";\n  a" << i << " -= rest" << i
           << ";\n";
    }
    std::string rest;
    for (int m = 0; m < k_; ++m) {
      if (program_.isConstant(entryRow(m, i))) continue;
      rest += (rest.empty() ? "" : " + ") + writeConvolution(entryRow(m, i), row_of_multiplier_[m],
                                                             is_classical_ ? "n" : "n - 1");
    }
    if (moves && !is_classical_) {
      rest += std::string(rest.empty() ? "" : " + ") + "vs_convolve(r[" +
              std::to_string(row_of_connection_[i]) + "], r[" +
              std::to_string(row_of_reaction_rate_[i]) + "], n - 1, 0, 0)";
    }
    if (rest.empty()) continue;
    text << "  a" << i << " = vs_fuse(" << (is_classical_ ? "vs_zero + 1.0" : "u * (1.0 / n)")
         << ", " << rest << ", a" << i << ");\n";
  }
  return text.str();
}

/// See SeriesOrder::calcConstraintRest.
std::string MotionSeries::writeConstraintRest() const {
  std::ostringstream text;
  for (int m = 0; m < k_; ++m) {
    const std::string g = "a" + std::to_string(S + m);
    if (drivetrain_.constraint(m).order() < 3) {
      text << "  const Real " << g << " = -" << at(row_of_residual_[m], "n") << ";\n";
      continue;
    }
    text << "  Real " << g << " = u * " << at(row_of_residual_[m], "n - 1") << ";\n";
    for (int i = 0; i < S; ++i) {
      text << "  " << g << " += vs_slopes(r[" << entryRow(m, i) << "], r["
           << row_of_acceleration_[i] << "], n);\n";
    }
    text << "  " << g << " = -" << g << " * (1.0 / n);\n";
  }
  return text.str();
}

/// Writes SeriesOrder::make, operation by operation.
std::string MotionSeries::writeOrder() const {
  std::ostringstream text;
  const auto set = [&](int row, const char* order, const std::string& value) {
    text << "  " << at(row, order) << " = " << value << ";\n";
  };
  for (int i = 0; i < S; ++i) set(row_of_acceleration_[i], "n", "vs_zero");
  text << "  series_given(n, r, s, c, &limit);\n  series_trial(n, r, s, c, &limit);\n"
       << writeForceRest() << writeConstraintRest();
  const int size = S + k_;
  for (int i = 0; i < size; ++i) {
    text << "  const Real x" << i << " = "
         << writeProduct(i * size, size, [](int j) { return "a" + std::to_string(j); }) << ";\n";
  }
  for (int i = 0; i < S; ++i) set(row_of_acceleration_[i], "n", "x" + std::to_string(i));
  for (int m = 0; m < k_; ++m) {
    const std::string mu = "x" + std::to_string(S + m);
    set(row_of_multiplier_[m], is_classical_ ? "n" : "n - 1",
        is_classical_ ? mu : mu + " * n * k[" + std::to_string(size * size) + "]");
  }
  for (int i = 0; i < S; ++i) {
    set(row_of_velocity_[i], "n + 1", "u * (1.0 / (n + 1)) * x" + std::to_string(i));
    set(row_of_angle_[i], "n + 1", "u * (1.0 / (n + 1)) * " + at(row_of_velocity_[i], "n"));
  }
  if (isLast(last_order_)) text << "  if (n == " << last_order_ << ") return;\n";
  text << "  series_corrected(n, r, s, c, &limit);\n  series_rest(n, r, s, c, &limit);\n";
  if (!isInertiaConstant() && !is_classical_) text << writeReaction();
  return text.str();
}

/// See SeriesOrder::noteReaction.
std::string MotionSeries::writeReaction() const {
  std::ostringstream text;
  const bool is_diagonal = drivetrain_.inertia().isDiagonal();
  const auto multiplyRow = [&](int matrix, int i, const auto& x) {
    if (!is_diagonal) return writeProduct(matrix + i * S, S, x);
    return writeProduct(matrix + i * S + i, 1, [&](int) { return x(i); });
  };
  const int J0 = placeOfInertia();
  for (int i = 0; i < S; ++i) {
    if (!hasMovingInertia(i) && is_diagonal) continue;
    text << "  const Real b" << i << " = "
         << multiplyRow(J0, i, [&](int j) { return at(row_of_acceleration_[j], "n"); });
    if (hasMovingInertia(i)) {
      text << " + " << at(row_of_inertial_torque_[i], "n") << " - " << at(row_of_torque_[i], "n")
           << " + (rest" << i << " - "
           << writeConvolution(row_of_inertia_[i], row_of_reaction_rate_[i], "n") << ");\n";
    } else {
      text << " - " << at(row_of_torque_[i], "n") << ";\n";
    }
  }
  for (int i = 0; i < S; ++i) {
    if (!hasMovingInertia(i)) continue;
    text << "  " << at(row_of_reaction_rate_[i], "n") << " = "
         << multiplyRow(J0 + S * S, i, [](int j) { return "b" + std::to_string(j); }) << ";\n";
  }
  return text.str();
}

/// Writes the coefficients of one order, and of order 0, as functions.
std::string MotionSeries::writeOrders() const {
  std::string text =
      program_.writeCode() +
      "VS_INLINE void order(int n, vs_row* restrict r, Real* restrict s,\n"
      "    const Real* restrict k, const Real* restrict c, Real u) {\n  int limit = 0;\n" +
      writeOrder() + "}\n";
  if (!program_.readsTables()) {
    text +=
        "static int begin_given(Real* r, Real* s, const Real* c) {\n  int limit = 0;\n"
        "  series_given(0, (vs_row*)r, s, c, &limit);\n  return limit;\n}\n"
        "static int begin_accelerated(Real* r, Real* s, const Real* c) {\n  int limit = 0;\n"
        "  series_trial(0, (vs_row*)r, s, c, &limit);\n"
        "  series_rest(0, (vs_row*)r, s, c, &limit);\n  return limit;\n}\n";
  }
  // Orders take the compiler the longest: they are distributed over the units.
  std::ostringstream orders;
  for (int n = 1; n <= last_order_; ++n) {
    const std::string head =
        "void " + nameOf(n) + "(Real* r, Real* s, const Real* k, const Real* c, Real u)";
    orders << head << ";\n#if " << n << " % UNITS == UNIT\n"
           << head << " {\n  order(" << n << ", (vs_row*)r, s, k, c, u);\n}\n#endif\n";
  }
  return text + orders.str();
}

std::string MotionSeries::writeLayout() const {
  // Arrays within a struct may omit their braces: the layout is the words that it is read from.
  std::string text =
      "#pragma GCC diagnostic ignored \"-Wmissing-braces\"\n"
      "static const struct SeriesLayout layout = {";
  for (const int value : layoutWords()) text += std::to_string(value) + ", ";
  return text + "};\n";
}

/// Writes the sum of what operations hide, for all orders or fewer.
std::string MotionSeries::writeHidden() const {
  const auto row = [this](int n) { return "r + " + std::to_string(program_.offset(n)); };
  return std::string(expression::kSeriesOperationText) + expression::kSeriesResolutionText +
         "static SERIES_INLINE Real seriesHiddenUpTo(const struct SeriesStep* it, int last) {\n"
         "  const Real* const r = it->rows;\n  const Real* const p = it->powers;\n"
         "  Real sum = 0.0 * it->unit;\n  (void)r, (void)p, (void)last;\n" +
         expression::writeHiding(program_.resolved(), MotionSeries::kMostOrder, row) +
         "  return sum;\n}\n" + R"c(
static __attribute__((noinline)) Real seriesHiddenOfAll(const struct SeriesStep* it) {
  return seriesHiddenUpTo(it, LAYOUT.order);
}
static __attribute__((noinline)) Real seriesHiddenOfFew(const struct SeriesStep* it, int last) {
  return seriesHiddenUpTo(it, last);
}
static inline Real seriesHidden(const struct SeriesStep* it, int last) {
  return last == LAYOUT.order ? seriesHiddenOfAll(it) : seriesHiddenOfFew(it, last);
}
)c";
}

/// Writes the functions of series_step.inc and their environment.
std::string MotionSeries::writeWholeStep() const {
  std::string text = std::string("#define LAYOUT layout\n") + kSeriesStepData + writeLayout() +
                     "static void (*const orders[])(Real*, Real*, const Real*, const Real*, Real) "
                     "= {0";
  for (int n = 1; n <= layout_.order; ++n) text += ", " + nameOf(n);
  text += "};\n";
  text += R"c(
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
static inline void seriesTurn(struct SeriesStep* it) { (void)it; }
static inline void seriesGoOn(struct SeriesStep* it) { (void)it; }
)c";
  return text + writeHidden();
}

std::string MotionSeries::writeSource() const {
  std::string text = writeOrders() + KernelLibrary::kFirstUnit;
  if (!program_.readsTables()) {
    text += std::string("int ") + kBegin +
            "(Real* r, Real* s, const Real* c) {\n"
            "  const int limit = begin_given(r, s, c);\n"
            "  return begin_accelerated(r, s, c) || limit;\n}\n";
  }
  if (makes_whole_steps_) {
    text += "#define SERIES_LANES 1\n" + writeWholeStep() + R"c(
static inline void seriesVelocityLevel(struct SeriesStep* it, double* level) {
  velocity_level(it->origin + it->end, it->x_new, it->x_new + layout.shafts,
                 it->x_new + 2 * layout.shafts, it->input[0], it->input_rate[0],
                 it->input_second_rate[0], it->tables[0], level);
}
#define SERIES_SOME 4
typedef Four Some;
static inline Some seriesSpread(double a) { return (Some){a, a, a, a}; }
static inline Some seriesLoad(const double* from) { return load(from); }
static inline Some seriesFuse(Some a, Some b, Some c) { return vs_fuse_four(a, b, c); }
static inline void seriesAccelerationLevel(struct SeriesStep* it, double* level) {
  acceleration_level(it->origin + it->end, it->x_new, it->x_new + layout.shafts,
                     it->x_new + 2 * layout.shafts, it->input[0], it->input_rate[0],
                     it->input_second_rate[0], it->tables[0], level);
}
)c" + kSeriesStepArrival +
            kSeriesStepText + kSeriesStepSample +
            "void series_step(struct SeriesStep* it) { seriesStride(it); }\n"
            "void series_arrive(struct SeriesStep* it) { seriesArrive(it, 0); }\n"
            "void series_tabulate(const struct SeriesStep* it, const Real* rows, Real theta, Real* "
            "table) {\n"
            "  seriesTabulate(it, rows, theta, table);\n}\n"
            "void series_sample(struct SeriesStep* it, const Real* table, Real part,\n"
            "                   const struct SeriesSample* to) {\n"
            "  seriesSample(it, table, part, to);\n}\n";
  }
  text += KernelLibrary::kEndOfUnit;
  return std::string(expression::arithmeticOfCode()) +
         expression::SeriesProgram::codePrelude(strideOfCode()) + text;
}

std::string MotionSeries::writeLanesSource() const {
  if (!makes_whole_steps_ || program_.hasBranches()) return "";
  const std::string lanes = std::to_string(SeriesLanes::kLanes);
  return std::string(expression::arithmeticOfCode()) +
         "#define SERIES_IN_LANES\n#define VS_LANES " + lanes + "\n#define SERIES_LANES " + lanes +
         "\n" + expression::SeriesProgram::codePrelude(strideOfCode(), kSeriesStepLanes) +
         writeOrders() + KernelLibrary::kFirstUnit + writeWholeStep() +
         R"c(
static inline void seriesVelocityLevel(struct SeriesStep* it, Real* level) {
  for (int j = 0; j < SERIES_LANES; ++j) {
    double x[24], here[64];
    for (int n = 0; n < 3 * layout.shafts; ++n) x[n] = it->x_new[n][j];
    velocity_level((it->origin + it->end)[j], x, x + layout.shafts, x + 2 * layout.shafts,
                   it->input[j], it->input_rate[j], it->input_second_rate[j], it->tables[j], here);
    for (int n = 0; n < layout.velocity_rows * (layout.shafts + 1); ++n) level[n][j] = here[n];
  }
}
)c" + kSeriesStepArrival +
         kSeriesStepText + "void series_step(struct SeriesStep* it) { seriesStride(it); }\n" +
         KernelLibrary::kEndOfUnit;
}

std::vector<int> MotionSeries::layoutWords() const {
  const auto* const words = reinterpret_cast<const int*>(&layout_);
  return {words, words + sizeof layout_ / sizeof *words};
}

void MotionSeries::addStructure(expression::CodeStructure* structure) const {
  std::vector<int>& words = structure->words;
  const std::vector<int> layout = layoutWords();
  words.insert(words.end(), layout.begin(), layout.end());
  words.insert(words.end(), {is_classical_ ? 1 : 0, makes_whole_steps_ ? 1 : 0});
  words.insert(words.end(), row_of_connection_, row_of_connection_ + S);
  program_.addStructure(structure);
}

bool MotionSeries::use(const KernelLibrary& library, const double* constants, std::size_t count) {
  std::vector<OrderCode> codes(1, nullptr);
  for (int n = 1; n <= last_order_; ++n) {
    codes.push_back(reinterpret_cast<OrderCode>(library.find(nameOf(n).c_str())));
    if (codes.back() == nullptr) return false;
  }
  const auto begin = reinterpret_cast<BeginCode>(library.find(kBegin));
  if (begin == nullptr && !program_.readsTables()) return false;
  if (makes_whole_steps_) {
    StepCodes found;
    const auto find = [&library](const char* name, auto* code) {
      *code = reinterpret_cast<std::remove_pointer_t<decltype(code)>>(library.find(name));
      return *code != nullptr;
    };
    if (!find("series_step", &found.step) || !find("series_arrive", &found.arrive) ||
        !find("series_tabulate", &found.tabulate) || !find("series_sample", &found.sample)) {
      return false;
    }
    step_codes_ = found;
  }
  codes_ = std::move(codes);
  begin_code_ = begin;
  constants_ = constants;
  constants_count_ = count;
  library_ = &library;
  return true;
}

}  // namespace variator_sim
