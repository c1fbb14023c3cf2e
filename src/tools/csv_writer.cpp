#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <limits>
#include <system_error>

#include "tools/sample_writer.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

// The longest double that std::to_chars writes has 24 characters ("-2.2250738585072014e-308").
constexpr std::size_t kLongestNumber = 24;

void addStateHeader(const Scene& scene, std::string& header) {
  for (const std::string& shaft : scene.shafts) {
    for (const char* column : {"angle", "velocity", "acceleration", "applied_torque",
                               "reaction_torque", "reaction_torque_rate"}) {
      header += "," + shaft + "/" + column;
    }
  }
  for (const ConstraintPtr& constraint : scene.constraints) {
    header += "," + constraint->name() + "/residual," + constraint->name() + "/multiplier";
  }
}

void addQuantityHeader(const Simulation& simulation, QuantityGroup group, std::string& header) {
  // Elements have names of their own in the scene; of inputs and outputs the group is part.
  const std::string prefix =
      group == QuantityGroup::kElements ? "," : std::string(",") + toString(group) + "/";
  for (const std::string& name : simulation.quantityNames(group)) header += prefix + name;
}

std::string makeHeader(const Simulation& simulation, const ColumnGroups& columns) {
  std::string header = "time";
  if (columns.state) addStateHeader(simulation.scene(), header);
  for (const QuantityGroup group : columns.quantities) {
    addQuantityHeader(simulation, group, header);
  }
  if (columns.energy) {
    header += ",energy/kinetic,energy/applied,energy/reactions,power/applied,power/reactions";
  }
  return header + "\n";
}

std::size_t countQuantities(const Simulation& simulation, const ColumnGroups& columns) {
  std::size_t count = 0;
  for (const QuantityGroup group : columns.quantities) {
    count += simulation.quantityNames(group).size();
  }
  return count;
}

class CsvWriter : public SampleWriter {
 public:
  CsvWriter(const std::string& path, const Simulation& simulation, const ColumnGroups& columns)
      : name_(path.empty() ? "standard output" : path),
        columns_(columns),
        shaft_count_(simulation.scene().shaftCount()),
        constraint_count_(simulation.scene().constraintCount()),
        quantity_count_(countQuantities(simulation, columns)),
        column_count_(1 + 6 * simulation.scene().shafts.size() +
                      2 * simulation.scene().constraints.size() + quantity_count_ + 5) {
    if (path.empty()) {
      file_ = STDOUT_FILENO;
    } else {
      file_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
      if (file_ < 0) fail();
      owns_file_ = true;
    }
    const std::string header = makeHeader(simulation, columns);
    writeAll(header.data(), header.size());
  }
  ~CsvWriter() override {
    if (owns_file_) ::close(file_);
  }

  void write(const SampleBlock& block) override {
    buffer_.resize(block.samples.size() * column_count_ * (kLongestNumber + 1));
    char* end = buffer_.data();
    const double* quantities = block.quantities.data();
    for (const Sample& sample : block.samples) {
      end = writeRow(sample, quantities, end);
      quantities += quantity_count_;
    }
    writeAll(buffer_.data(), static_cast<std::size_t>(end - buffer_.data()));
  }

  void close() override {
    if (!owns_file_) return;
    owns_file_ = false;
    // Some file systems tell only now that the disk is full.
    if (::close(file_) != 0) fail();
  }

 private:
  char* writeNumber(double value, char* end) {
    // The sign of a NaN is the processor's and means nothing.
    if (std::isnan(value)) value = std::numeric_limits<double>::quiet_NaN();
    end = std::to_chars(end, end + kLongestNumber, value).ptr;
    *end++ = ',';
    return end;
  }

  char* writeRow(const Sample& sample, const double* quantities, char* end) {
    end = writeNumber(sample.time, end);
    if (columns_.state) end = writeState(sample, end);
    for (std::size_t i = 0; i < quantity_count_; ++i) end = writeNumber(quantities[i], end);
    if (columns_.energy) {
      const Energy& energy = sample.energy;
      for (double value : {energy.kinetic, energy.applied, energy.reactions, energy.applied_power,
                           energy.reaction_power}) {
        end = writeNumber(value, end);
      }
    }
    end[-1] = '\n';
    return end;
  }

  char* writeState(const Sample& sample, char* end) {
    for (int i = 0; i < shaft_count_; ++i) {
      for (const double* column :
           {sample.angle, sample.velocity, sample.acceleration, sample.applied_torque,
            sample.reaction_torque, sample.reaction_torque_rate}) {
        end = writeNumber(column[i], end);
      }
    }
    for (int i = 0; i < constraint_count_; ++i) {
      end = writeNumber(sample.residual[i], end);
      end = writeNumber(sample.multiplier[i], end);
    }
    return end;
  }

  void writeAll(const char* data, std::size_t size) {
    while (size > 0) {
      const ssize_t written = ::write(file_, data, size);
      if (written < 0) {
        if (errno == EINTR) continue;
        fail();
      }
      data += written;
      size -= static_cast<std::size_t>(written);
    }
  }

  [[noreturn]] void fail() const {
    const int error = errno;
    const std::string message = name_ + ": " + std::generic_category().message(error);
    if (error == EPIPE) throw OutputClosed(message);
    throw OutputError(message);
  }

  std::string name_;
  ColumnGroups columns_;
  int shaft_count_;
  int constraint_count_;
  std::size_t quantity_count_;
  std::size_t column_count_;  // at most
  int file_ = -1;
  bool owns_file_ = false;
  std::vector<char> buffer_;
};

}  // namespace

std::unique_ptr<SampleWriter> makeCsvWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns) {
  return std::make_unique<CsvWriter>(path, simulation, columns);
}

}  // namespace variator_sim
