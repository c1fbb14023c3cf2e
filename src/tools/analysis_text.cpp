#include "tools/analysis_text.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "model/number_text.h"
#include "tools/simulate_options.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

using Eigen::MatrixXd;
using Names = std::vector<std::string>;

/// A part of a file, in order.
struct Part {
  const char* name;
  MatrixXd values;
  const Names* rows;     ///< nullptr: numbers without names
  const Names* columns;  ///< nullptr: a vector
};

std::vector<Part> numbersOf(const LinearModel& model) {
  return {{"A", model.A, &model.states, &model.states},
          {"B", model.B, &model.states, &model.inputs},
          {"C", model.C, &model.outputs, &model.states},
          {"D", model.D, &model.outputs, &model.inputs},
          {"x", model.x, &model.states, nullptr},
          {"u", model.u, &model.inputs, nullptr},
          {"y", model.y, &model.outputs, nullptr},
          {"x_rate", model.x_rate, &model.states, nullptr},
          {"time", MatrixXd::Constant(1, 1, model.time), nullptr, nullptr}};
}

std::size_t longest(const Names& names) {
  std::size_t length = 1;
  for (const std::string& name : names) length = std::max(length, name.size());
  return length;
}

std::string format(const char* pattern, double value) {
  return printed(pattern, value == 0.0 ? 0.0 : value);
}

std::string pad(const std::string& text, std::size_t width) {
  return printed("%-*s", static_cast<int>(width), text.c_str());
}

std::string padLeft(const std::string& text, std::size_t width) {
  return printed("%*s", static_cast<int>(width), text.c_str());
}

void addMatrix(const Part& part, std::string& text) {
  if (part.columns == nullptr || part.values.size() == 0) return;
  const std::size_t width = longest(*part.rows) + 2;
  text += "\n" + pad(part.name, width);
  for (const std::string& column : *part.columns) text += " " + padLeft(column, 12);
  text += "\n";
  for (int i = 0; i < part.values.rows(); ++i) {
    text += pad("  " + (*part.rows)[static_cast<std::size_t>(i)], width);
    for (int j = 0; j < part.values.cols(); ++j) {
      const std::size_t column = (*part.columns)[static_cast<std::size_t>(j)].size();
      text += " " + padLeft(format("%.5g", part.values(i, j)), std::max<std::size_t>(column, 12));
    }
    text += "\n";
  }
}

void addEigenvalues(const LinearModel& model, std::string& text) {
  text += "\neigenvalues (1/s)            frequency (rad/s)  damping  time constant (s)\n";
  int zero_index = 0;
  const auto eigenvalues = calcEigenvalues(model, &zero_index);
  for (const std::complex<double>& value : eigenvalues) {
    if (value.imag() < 0.0) continue;  // with its conjugate
    const double frequency = std::abs(value);
    if (frequency == 0.0) {
      text += pad("  0", 30) + "integrator\n";
      continue;
    }
    text += pad("  " + format("%.6g", value.real()) +
                    (value.imag() != 0.0 ? " +- " + format("%.6g", value.imag()) + " i" : ""),
                30);
    text += pad(format("%.6g", frequency), 19) + pad(format("%.4f", -value.real() / frequency), 9);
    // (They are sorted by size, and the largest sets the rounding of all.)
    const double rounding = 1e-15 * std::abs(eigenvalues.back());
    text += value.real() < -rounding  ? format("%.6g", -1.0 / value.real())
            : value.real() > rounding ? "unstable"
                                      : "-";
    text += "\n";
  }
  if (zero_index > 1) {
    text += "  (" + std::to_string(zero_index) +
            " integrators stand one behind the other: deviations may grow with the time)\n";
  }
}

}  // namespace

std::string describeModel(const LinearModel& model, bool with_matrices) {
  const std::size_t width = std::max<std::size_t>(longest(model.states), 6) + 2;
  std::string text = "linear model at " + formatNumber(model.time) +
                     " s: " + std::to_string(model.states.size()) + " states, " +
                     std::to_string(model.inputs.size()) + " inputs, " +
                     std::to_string(model.outputs.size()) + " outputs\n\n";
  text += pad("state", width) + pad("value", 14) + "rate\n";
  for (std::size_t j = 0; j < model.states.size(); ++j) {
    const int row = static_cast<int>(j);
    text += pad(model.states[j], width) + pad(format("%.6g", model.x(row)), 14) +
            format("%.6g", model.x_rate(row)) + "\n";
  }
  addEigenvalues(model, text);
  for (const Part& part : numbersOf(model)) {
    if (with_matrices) addMatrix(part, text);
  }
  for (const std::string& note : model.notes) text += "\nnote: " + note;
  return model.notes.empty() ? text : text + "\n";
}

std::string endingOfModel(const std::string& path) {
  std::string ending = endingOf(path);
  if (ending == ".csv" || ending == ".npz" || ending == ".mat") return ending;
  throw UsageError("'" + path + "' ends neither with .csv nor with .npz nor with .mat");
}

std::string writeModel(const LinearModel& model) {
  std::string text = "matrix,row,column,value\n";
  const auto name = [](const Names* names, int i) {
    return names == nullptr ? std::string() : (*names)[static_cast<std::size_t>(i)];
  };
  for (const Part& part : numbersOf(model)) {
    for (int i = 0; i < part.values.rows(); ++i) {
      for (int j = 0; j < part.values.cols(); ++j) {
        text += std::string(part.name) + "," + name(part.rows, i) + "," + name(part.columns, j) +
                "," + formatNumber(part.values(i, j)) + "\n";
      }
    }
  }
  return text;
}

MotionState makeState(const OperatingPoint& point, const Scene& scene) {
  MotionState state;
  state.time = point.time;
  std::copy(point.angle.begin(), point.angle.end(), state.angle);
  std::copy(point.velocity.begin(), point.velocity.end(), state.velocity);
  std::copy(point.acceleration.begin(), point.acceleration.end(), state.acceleration);
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) {
    CommandInputSettings input = scene.inputs[i];
    input.initial = point.input[i];
    state.signal[i].reset(input);
    state.last_command[i] = std::numeric_limits<double>::infinity();
  }
  return state;
}

std::string describeStability(const Scene& scene, const OperatingPoint& point) {
  try {
    const auto eigenvalues = calcEigenvalues(linearize(scene, point));
    double growth = 0.0;
    double fastest = 0.0;
    for (const std::complex<double>& value : eigenvalues) {
      growth = std::max(growth, value.real());
      fastest = std::max(fastest, std::abs(value));
    }
    if (growth <= 1e-7 * fastest) return "stable, integrators apart";
    return "unstable: deviations grow with " + formatNumber(growth) + " 1/s";
  } catch (const SceneError& error) {
    return std::string("no linear model: ") + error.what();
  }
}

}  // namespace variator_sim
