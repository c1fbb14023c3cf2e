#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <system_error>

#include "tools/sample_writer.h"
#include "variator_sim/scene.h"

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

std::string makeHeader(const Scene& scene, const ColumnGroups& columns) {
  std::string header = "time";
  if (columns.state) addStateHeader(scene, header);
  if (columns.energy) {
    header += ",energy/kinetic,energy/applied,energy/reactions,power/applied,power/reactions";
  }
  return header + "\n";
}

class CsvWriter : public SampleWriter {
 public:
  CsvWriter(const std::string& path, const Scene& scene, const ColumnGroups& columns)
      : name_(path.empty() ? "standard output" : path),
        columns_(columns),
        shaft_count_(scene.shaftCount()),
        constraint_count_(scene.constraintCount()),
        column_count_(1 + 6 * scene.shafts.size() + 2 * scene.constraints.size() + 5) {
    if (path.empty()) {
      file_ = STDOUT_FILENO;
    } else {
      file_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
      if (file_ < 0) fail();
      owns_file_ = true;
    }
    const std::string header = makeHeader(scene, columns);
    writeAll(header.data(), header.size());
  }
  ~CsvWriter() override {
    if (owns_file_) ::close(file_);
  }

  void write(const std::vector<Sample>& samples) override {
    buffer_.resize(samples.size() * column_count_ * (kLongestNumber + 1));
    char* end = buffer_.data();
    for (const Sample& sample : samples) end = writeRow(sample, end);
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
    end = std::to_chars(end, end + kLongestNumber, value).ptr;
    *end++ = ',';
    return end;
  }

  char* writeRow(const Sample& sample, char* end) {
    end = writeNumber(sample.time, end);
    if (columns_.state) end = writeState(sample, end);
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
  std::size_t column_count_;  // at most
  int file_ = -1;
  bool owns_file_ = false;
  std::vector<char> buffer_;
};

}  // namespace

std::unique_ptr<SampleWriter> makeCsvWriter(const std::string& path, const Scene& scene,
                                            const ColumnGroups& columns) {
  return std::make_unique<CsvWriter>(path, scene, columns);
}

}  // namespace variator_sim
