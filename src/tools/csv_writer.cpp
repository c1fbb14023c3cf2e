#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "io/text_file.h"
#include "tools/sample_writer.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

// The longest double that std::to_chars writes has 24 characters ("-2.2250738585072014e-308").
constexpr std::size_t kLongestNumber = 24;

/// Returns the names with the units that outputs state: "outputs/speed [rpm]".
std::vector<std::string> columnTitles(const Columns& columns, const Scene& scene) {
  std::vector<std::string> titles = columns.names();
  for (const Output& output : scene.outputs) {
    const auto found = std::find(titles.begin(), titles.end(), "outputs/" + output.name);
    if (found != titles.end() && !output.unit.empty()) *found += " [" + output.unit + "]";
  }
  return titles;
}

class CsvWriter : public SampleWriter {
 public:
  CsvWriter(const std::string& path, const Simulation& simulation, const ColumnGroups& columns)
      : name_(path.empty() ? "standard output" : path), columns_(simulation, columns) {
    constexpr int kHow = O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC;
    file_ = path.empty() ? ::dup(STDOUT_FILENO) : ::open(path.c_str(), kHow, 0666);
    if (file_ < 0) failedToWrite(name_);
    const std::string header = join(columnTitles(columns_, simulation.scene()), ",") + "\n";
    writeAll(header.data(), header.size());
  }
  ~CsvWriter() override {
    if (file_ >= 0) ::close(file_);
  }

  void write(const SampleBlock& block) override {
    rows_.clear();
    columns_.append(block, &rows_);
    buffer_.resize(rows_.size() * (kLongestNumber + 1));
    const std::size_t width = columns_.names().size();
    char* end = buffer_.data();
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      end = writeNumber(rows_[i], end);
      *end++ = (i + 1) % width == 0 ? '\n' : ',';
    }
    writeAll(buffer_.data(), static_cast<std::size_t>(end - buffer_.data()));
  }

  void close() override {
    // Some file systems report a full disk only on close.
    if (::close(std::exchange(file_, -1)) != 0) failedToWrite(name_);
  }

 private:
  static char* writeNumber(double value, char* end) {
    // The sign of a NaN depends on the processor and has no meaning.
    if (std::isnan(value)) value = std::numeric_limits<double>::quiet_NaN();
    return std::to_chars(end, end + kLongestNumber, value).ptr;
  }

  void writeAll(const char* data, std::size_t size) {
    if (!writeBytes(file_, data, size)) failedToWrite(name_);
  }

  std::string name_;
  Columns columns_;
  std::vector<double> rows_;
  int file_ = -1;
  std::vector<char> buffer_;
};

}  // namespace

std::unique_ptr<SampleWriter> makeCsvWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns) {
  return std::make_unique<CsvWriter>(path, simulation, columns);
}

}  // namespace variator_sim
