#include <fcntl.h>
#include <unistd.h>

#include <charconv>
#include <cmath>
#include <limits>

#include "io/whole_file.h"
#include "tools/sample_writer.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

// The longest double that std::to_chars writes has 24 characters ("-2.2250738585072014e-308").
constexpr std::size_t kLongestNumber = 24;

class CsvWriter : public SampleWriter {
 public:
  CsvWriter(const std::string& path, const Simulation& simulation, const ColumnGroups& columns)
      : name_(path.empty() ? "standard output" : path),
        rows_(simulation, columns),
        row_(rows_.columnCount()) {
    if (path.empty()) {
      file_ = STDOUT_FILENO;
    } else {
      file_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
      if (file_ < 0) failedToWrite(name_);
      owns_file_ = true;
    }
    const std::string header = join(columnTitles(simulation, columns), ",") + "\n";
    writeAll(header.data(), header.size());
  }
  ~CsvWriter() override {
    if (owns_file_) ::close(file_);
  }

  void write(const SampleBlock& block) override {
    buffer_.resize(block.samples.size() * row_.size() * (kLongestNumber + 1));
    char* end = buffer_.data();
    const double* quantities = block.quantities.data();
    for (const Sample& sample : block.samples) {
      rows_.write(sample, quantities, row_.data());
      end = writeRow(end);
      quantities += rows_.quantityCount();
    }
    writeAll(buffer_.data(), static_cast<std::size_t>(end - buffer_.data()));
  }

  void close() override {
    if (!owns_file_) return;
    owns_file_ = false;
    // Some file systems report a full disk only on close.
    if (::close(file_) != 0) failedToWrite(name_);
  }

 private:
  char* writeNumber(double value, char* end) {
    // The sign of a NaN depends on the processor and has no meaning.
    if (std::isnan(value)) value = std::numeric_limits<double>::quiet_NaN();
    end = std::to_chars(end, end + kLongestNumber, value).ptr;
    *end++ = ',';
    return end;
  }

  char* writeRow(char* end) {
    for (const double value : row_) end = writeNumber(value, end);
    end[-1] = '\n';
    return end;
  }

  void writeAll(const char* data, std::size_t size) {
    if (!writeBytes(file_, data, size)) failedToWrite(name_);
  }

  std::string name_;
  RowMaker rows_;
  std::vector<double> row_;
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
