// The orders of a motion's series as C: the statements of MotionSeries::continueTo with the order a
// constant of each, so that the compiler unrolls every sum.
#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <utility>

#include "dynamics/motion_series.h"
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
    text += std::string("int ") + kBegin +
            "(double* restrict r, double* restrict s, const double* restrict c) {\n"
            "  const int n = 0;\n  int limit = 0;\n  (void)n, (void)s, (void)c;\n" +
            program_.writeBegin() + "  return limit;\n}\n";
  }
  for (int n = 1; n <= orderFor(scene_.solver.relative_tolerance); ++n) {
    text += "void " + nameOf(n) +
            "(double* restrict r, double* restrict s, const double* restrict k,\n"
            "    const double* restrict c, double u) {\n  order(" +
            std::to_string(n) + ", r, s, k, c, u);\n}\n";
  }
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
    const bool is_same = isSame(expandAt(n), computed);
    codes_.swap(codes);
    begin_code_ = begin_code;
    if (!is_same) return false;
  }
  return true;
}

void MotionSeries::interpret() {
  codes_.clear();
  begin_code_ = nullptr;
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
  return coefficients;
}

}  // namespace variator_sim
