#include "variator_sim/io/command_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <initializer_list>
#include <sstream>
#include <system_error>

#include "model/csv_fields.h"
#include "variator_sim/message_text.h"

namespace variator_sim {
namespace {

constexpr const char* kHeader = "time,topic,value";
// A file without an end (/dev/zero, a pipe) is rejected before it exhausts the memory: 5,000,000
// commands take 300 MB.
constexpr std::size_t kLongestLine = 1000;
constexpr std::size_t kMostCommands = 5000000;

bool isBlankOrComment(const std::string& line) {
  return line.find_first_not_of(" \t") == std::string::npos || line.front() == '#';
}

/// Reads lines, and knows the number of the last one for its errors.
class CommandReader {
 public:
  CommandReader(std::istream& lines, const std::string& source_name)
      : lines_(lines), source_name_(source_name) {}

  std::vector<TimedCommand> read() {
    std::vector<TimedCommand> commands;
    bool has_header = false;
    std::string line;
    while (nextLine(&line)) {
      if (line_number_ == 1) line.erase(0, skipByteOrderMark(line));
      if (isBlankOrComment(line)) continue;
      if (!has_header) {
        separator_ = separatorOf(line);
        if (join(fieldsOf(line), ",") != kHeader) {
          throw error({inQuotes(line), " is not the header; expected: ", kHeader});
        }
        has_header = true;
        continue;
      }
      if (commands.size() == kMostCommands) {
        throw error({"more than ", std::to_string(kMostCommands),
                     " commands; several runs, each from the state of the one before "
                     "(--save-state, --from-state), take them in parts"});
      }
      commands.push_back(commandOf(line));
    }
    if (lines_.bad() || (!lines_.eof() && line_number_ == 0)) {
      line_number_ = 1;
      throw error({"cannot be read: ",
                   errno != 0 ? std::generic_category().message(errno) : "unknown cause"});
    }
    if (!has_header) {
      ++line_number_;
      throw error({"the file ends before its header; expected: ", kHeader});
    }
    std::stable_sort(commands.begin(), commands.end(),
                     [](const TimedCommand& a, const TimedCommand& b) { return a.time < b.time; });
    return commands;
  }

 private:
  CommandFileError error(std::initializer_list<std::string> parts) const {
    std::string message = source_name_ + ":" + std::to_string(line_number_) + ": ";
    for (const std::string& part : parts) message += part;
    return CommandFileError(message);
  }

  bool nextLine(std::string* line) {
    lines_.getline(buffer_.data(), buffer_.size());
    if (lines_.gcount() == 0) return false;
    ++line_number_;
    const auto count = static_cast<std::size_t>(lines_.gcount());
    line->assign(buffer_.data(), count - (lines_.eof() || lines_.fail() ? 0 : 1));
    if (line->size() > kLongestLine) {
      throw error({inQuotes(*line), "..: a line of more than ", std::to_string(kLongestLine),
                   " characters; expected: ", kHeader});
    }
    if (!line->empty() && line->back() == '\r') line->pop_back();
    return true;
  }

  std::vector<std::string> fieldsOf(const std::string& line) const {
    std::vector<std::string> fields;
    for (const CsvField& field : splitFields(line, 0, line.size(), separator_)) {
      fields.push_back(textOf(line, field));
    }
    return fields;
  }

  TimedCommand commandOf(const std::string& line) const {
    const std::vector<std::string> fields = fieldsOf(line);
    if (fields.size() != 3) {
      throw error({inQuotes(line), " does not have three columns between ",
                   separator_ == '\t' ? "tabs" : inQuotes(std::string(1, separator_)),
                   "; expected: ", kHeader});
    }
    TimedCommand command;
    command.line = line_number_;
    const std::string& time = fields[0];
    command.topic = fields[1];
    const std::string& value = fields[2];
    if (!readNumber(time, &command.time) || !std::isfinite(command.time) || command.time < 0.0) {
      throw error({"time ", inQuotes(time), " in ", inQuotes(line), remarkOnComma(time),
                   "; expected: a finite number >= 0, s"});
    }
    if (command.topic.empty() || command.topic.find_first_of(" \t") != std::string::npos) {
      throw error({"topic ", inQuotes(command.topic), " in ", inQuotes(line),
                   "; expected: the topic of a commanded input, without blanks"});
    }
    if (!readNumber(value, &command.value)) {
      throw error({"value ", inQuotes(value), " in ", inQuotes(line), remarkOnComma(value),
                   "; expected: a number"});
    }
    return command;
  }

  std::istream& lines_;
  const std::string& source_name_;
  int line_number_ = 0;
  char separator_ = ',';
  std::array<char, kLongestLine + 2> buffer_{};  // and the line's end, and the text's
};

}  // namespace

std::vector<TimedCommand> readCommandText(const std::string& text, const std::string& source_name) {
  std::istringstream lines(text);
  return CommandReader(lines, source_name).read();
}

std::vector<TimedCommand> readCommandFile(const std::string& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  return CommandReader(file, path).read();
}

}  // namespace variator_sim
