/// Commands for the offline tool: a CSV with the header `time,topic,value`.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/errors.h"

namespace variator_sim {

/// A command file that cannot be used. what() names file:line, the text and what is expected.
class CommandFileError : public Error {
 public:
  using Error::Error;
};

struct TimedCommand {
  double time = 0.0;   ///< s, >= 0
  std::string topic;   ///< of the input, which a file need not have
  double value = 0.0;  ///< unit of the input; may be NaN or infinite: the simulation rejects those
  int line = 0;        ///< in the file, from 1, for messages
  int input = -1;      ///< index into Scene::inputs, once it is found by the topic
};

/// Returns the commands in order of time; at equal times in the order of the file. Fields are those
/// of tables (model/csv_fields.h). Blank lines and lines that start with # are skipped. Lines have
/// at most 1000 characters, a file 5,000,000 commands. Throws CommandFileError.
std::vector<TimedCommand> readCommandFile(const std::string& path);

/// Reads `text` as readCommandFile does; `source_name` stands for the file in messages.
std::vector<TimedCommand> readCommandText(const std::string& text, const std::string& source_name);

}  // namespace variator_sim
