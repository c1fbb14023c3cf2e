#include "tools/linear_model_file.h"

#include <algorithm>
#include <boost/crc.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <utility>
#include <vector>

#include "model/number_text.h"
#include "tools/simulate_options.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

using Eigen::MatrixXd;
using Names = std::vector<std::string>;

bool hasEnding(const std::string& text, const std::string& ending) {
  return text.size() >= ending.size() &&
         text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

/// What a file has, in order.
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

std::vector<std::pair<const char*, const Names*>> namesOf(const LinearModel& model) {
  return {{"states", &model.states}, {"inputs", &model.inputs}, {"outputs", &model.outputs}};
}

std::size_t longest(const Names& names) {
  std::size_t length = 1;
  for (const std::string& name : names) length = std::max(length, name.size());
  return length;
}

// --- CSV -----------------------------------------------------------------------------------------

std::string writeCsv(const LinearModel& model) {
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

// --- binary files --------------------------------------------------------------------------------

/// Little endian.
template <class Number>
void append(std::string& bytes, Number value) {
  static_assert(sizeof(Number) <= 8);
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof(Number));
  for (std::size_t n = 0; n < sizeof(Number); ++n) {
    bytes.push_back(static_cast<char>(bits >> (8 * n) & 0xFFU));
  }
}

/// NumPy's format 1.0: the head is padded to a multiple of 64 bytes.
std::string writeNpy(const std::string& type, const std::string& shape, const std::string& data) {
  std::string head = "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape + ", }";
  while ((10 + head.size() + 1) % 64 != 0) head += ' ';
  head += '\n';
  std::string bytes = "\x93NUMPY";
  bytes += '\x01';
  bytes += '\0';
  append(bytes, static_cast<std::uint16_t>(head.size()));
  return bytes + head + data;
}

std::string writeNpy(const Part& part) {
  std::string data;
  for (int i = 0; i < part.values.rows(); ++i) {
    for (int j = 0; j < part.values.cols(); ++j) append(data, part.values(i, j));
  }
  std::string shape = "()";
  if (part.rows != nullptr) {
    shape = "(" + std::to_string(part.values.rows()) + ",";
    if (part.columns != nullptr) shape += " " + std::to_string(part.values.cols());
    shape += ")";
  }
  return writeNpy("<f8", shape, data);
}

/// Names have letters, digits and signs of ASCII only.
std::string writeNpy(const Names& names) {
  const std::size_t length = longest(names);
  std::string data;
  for (const std::string& name : names) {
    for (std::size_t n = 0; n < length; ++n) {
      append(data, static_cast<std::uint32_t>(n < name.size() ? static_cast<unsigned char>(name[n])
                                                              : 0U));
    }
  }
  return writeNpy("<U" + std::to_string(length), "(" + std::to_string(names.size()) + ",)", data);
}

/// A zip archive without compression.
class ZipWriter {
 public:
  void add(const std::string& name, const std::string& data) {
    boost::crc_32_type crc;
    crc.process_bytes(data.data(), data.size());
    std::string head;
    append(head, std::uint16_t{20});  // version
    append(head, std::uint16_t{0});   // flags
    append(head, std::uint16_t{0});   // stored
    append(head, std::uint16_t{0});   // time
    append(head, std::uint16_t{33});  // 1980-01-01: the same model gives the same bytes
    append(head, static_cast<std::uint32_t>(crc.checksum()));
    append(head, static_cast<std::uint32_t>(data.size()));
    append(head, static_cast<std::uint32_t>(data.size()));
    append(head, static_cast<std::uint16_t>(name.size()));
    append(head, std::uint16_t{0});  // extra field
    directory_ += "PK\x01\x02";
    append(directory_, std::uint16_t{20});  // made by
    directory_ += head;
    append(directory_, std::uint16_t{0});  // comment
    append(directory_, std::uint16_t{0});  // disk
    append(directory_, std::uint16_t{0});  // attributes
    append(directory_, std::uint32_t{0});
    append(directory_, static_cast<std::uint32_t>(bytes_.size()));
    directory_ += name;
    bytes_ += "PK\x03\x04" + head + name + data;
    ++count_;
  }
  std::string finish() const {
    std::string end = "PK\x05\x06";
    append(end, std::uint32_t{0});  // disks
    append(end, count_);
    append(end, count_);
    append(end, static_cast<std::uint32_t>(directory_.size()));
    append(end, static_cast<std::uint32_t>(bytes_.size()));
    append(end, std::uint16_t{0});  // comment
    return bytes_ + directory_ + end;
  }

 private:
  std::string bytes_;
  std::string directory_;
  std::uint16_t count_ = 0;
};

std::string writeNpz(const LinearModel& model) {
  ZipWriter zip;
  for (const Part& part : numbersOf(model))
    zip.add(std::string(part.name) + ".npy", writeNpy(part));
  for (const auto& [name, names] : namesOf(model)) {
    zip.add(std::string(name) + ".npy", writeNpy(*names));
  }
  return zip.finish();
}

/// Level 4: five numbers, the name, the entries column by column. Type 0: doubles, 1: characters.
void appendMat(std::string& bytes, const std::string& name, std::uint32_t type,
               const MatrixXd& values) {
  append(bytes, type);
  append(bytes, static_cast<std::uint32_t>(values.rows()));
  append(bytes, static_cast<std::uint32_t>(values.cols()));
  append(bytes, std::uint32_t{0});  // real
  append(bytes, static_cast<std::uint32_t>(name.size() + 1));
  bytes += name + '\0';
  for (int j = 0; j < values.cols(); ++j) {
    for (int i = 0; i < values.rows(); ++i) append(bytes, values(i, j));
  }
}

std::string writeMat(const LinearModel& model) {
  std::string bytes;
  for (const Part& part : numbersOf(model)) appendMat(bytes, part.name, 0, part.values);
  for (const auto& [name, names] : namesOf(model)) {
    MatrixXd letters =
        MatrixXd::Constant(static_cast<int>(names->size()), static_cast<int>(longest(*names)), ' ');
    for (std::size_t i = 0; i < names->size(); ++i) {
      for (std::size_t j = 0; j < (*names)[i].size(); ++j) {
        letters(static_cast<int>(i), static_cast<int>(j)) = (*names)[i][j];
      }
    }
    appendMat(bytes, name, 1, letters);
  }
  return bytes;
}

// --- text ----------------------------------------------------------------------------------------

std::string format(const char* pattern, double value) {
  const DotLocale dot;
  char text[64];
  std::snprintf(text, sizeof text, pattern, value == 0.0 ? 0.0 : value);
  return text;
}

std::string pad(std::string text, std::size_t width) {
  if (text.size() < width) text.resize(width, ' ');
  return text;
}

std::string padLeft(const std::string& text, std::size_t width) {
  return text.size() < width ? std::string(width - text.size(), ' ') + text : text;
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
    // (Sorted by size: rounding of the others is of the last one's.)
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

void checkModelPath(const std::string& path) {
  for (const char* const ending : {".csv", ".npz", ".mat"}) {
    if (hasEnding(path, ending)) return;
  }
  throw UsageError("'" + path + "' ends neither with .csv nor with .npz nor with .mat");
}

std::string writeModel(const LinearModel& model, const std::string& path) {
  if (hasEnding(path, ".npz")) return writeNpz(model);
  return hasEnding(path, ".mat") ? writeMat(model) : writeCsv(model);
}

}  // namespace variator_sim
