#include "model/table_file.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/text_file.h"

namespace variator_sim {
namespace {

constexpr std::size_t kLongestFile = 1U << 26U;  // bytes: a device may have no end

}  // namespace

TableFile::TableFile(const std::string& name, std::string path, std::vector<Column> columns)
    : path_(std::move(path)), columns_(std::move(columns)), numbers_(columns_.size()) {
  const std::string file = filePathOf(name, path_);
  file_ = shownPath(file);
  const std::string failure = readTextFile(file, &text_, kLongestFile);
  if (!failure.empty()) {
    throw SceneError(path_, file_ + ":1:1: cannot be read: " + failure +
                                "; allowed: a CSV file, its path from the scene's own folder, from "
                                "the root, or package://PACKAGE/PATH");
  }
  std::size_t number = 1;
  std::size_t begin = skipByteOrderMark(text_);
  for (; begin < text_.size(); ++number) {
    const std::size_t end = std::min(text_.find('\n', begin), text_.size());
    const std::size_t first = text_.find_first_not_of(" \t\r", begin);
    if (first < end && text_[first] != '#') {
      header_.empty() ? readHeader({begin, number}) : readRow({begin, number});
    }
    begin = end + 1;
  }
  if (lines_.size() < 2) {
    throw error({text_.size(), number}, text_.size(),
                "the file ends after " + std::to_string(lines_.size()) +
                    " rows of numbers; allowed: a line of names, then two rows at least");
  }
}

std::vector<CsvField> TableFile::split(const Line& line) const {
  return splitFields(text_, line.begin, std::min(text_.find('\n', line.begin), text_.size()),
                     separator_);
}

void TableFile::readHeader(const Line& line) {
  const std::size_t end = std::min(text_.find('\n', line.begin), text_.size());
  separator_ = separatorOf(text_.substr(line.begin, end - line.begin));
  const std::vector<CsvField> fields = split(line);
  for (const CsvField& field : fields) header_.push_back(textOf(text_, field));
  for (const Column& column : columns_) {
    const auto found = std::find(header_.begin(), header_.end(), column.name);
    const auto place = static_cast<std::size_t>(found - header_.begin());
    if (found == header_.end()) {
      throw error(line, line.begin,
                  "no column " + inQuotes(column.name) + ", which " + inQuotes(column.key) +
                      " names" + suggestAmong(column.name, header_));
    }
    if (std::find(found + 1, header_.end(), column.name) != header_.end()) {
      throw error(line, fields[place].begin,
                  "two columns are named " + inQuotes(column.name) + "; allowed: one");
    }
    places_.push_back(place);
  }
}

void TableFile::readRow(const Line& line) {
  const std::vector<CsvField> fields = split(line);
  if (fields.size() != header_.size()) {
    const std::size_t at = std::min(fields.size() - 1, header_.size());
    throw error(line, fields[at].begin,
                std::to_string(fields.size()) +
                    " fields; allowed: " + std::to_string(header_.size()) +
                    ", as the first line has: " + joinNames(header_));
  }
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const CsvField& field = fields[places_[i]];
    const std::string given = textOf(text_, field);
    double number = 0.0;
    if (!readNumber(given, &number) || !std::isfinite(number)) {
      throw error(line, field.begin,
                  (given.empty() ? "nothing" : inQuotes(given)) + " in column " +
                      inQuotes(columns_[i].name) + " is not a finite number" +
                      remarkOnComma(given) + "; allowed: a number such as 1500, 0.25 or 1e-3");
    }
    numbers_[i].push_back(columns_[i].unit.toSi(number));
  }
  lines_.push_back(line);
}

SceneError TableFile::error(const Line& line, std::size_t position,
                            const std::string& message) const {
  return SceneError(path_, file_ + ":" + std::to_string(line.number) + ":" +
                               std::to_string(position - line.begin + 1) + ": " + message);
}

SceneError TableFile::fault(std::size_t column, std::size_t row, const std::string& message) const {
  const std::vector<CsvField> fields = split(lines_[row]);
  return error(lines_[row], fields[places_[column]].begin,
               "column " + inQuotes(columns_[column].name) + ": " + message);
}

}  // namespace variator_sim
