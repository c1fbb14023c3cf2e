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
  std::size_t begin = skipByteOrderMark(text_);
  while (begin < text_.size()) {
    const std::size_t end = std::min(text_.find('\n', begin), text_.size());
    const std::size_t first = text_.find_first_not_of(" \t\r", begin);
    if (first < end && text_[first] != '#') header_.empty() ? readHeader(begin) : readRow(begin);
    begin = end + 1;
  }
  if (lines_.size() < 2) {
    throw error(text_.size(),
                "the file ends after " + std::to_string(lines_.size()) +
                    " rows of numbers; allowed: a line of names, then two rows at least");
  }
}

std::vector<CsvField> TableFile::split(std::size_t line) const {
  return splitFields(text_, line, std::min(text_.find('\n', line), text_.size()), separator_);
}

void TableFile::readHeader(std::size_t line) {
  separator_ = separatorOf(text_.substr(line, text_.find('\n', line) - line));
  const std::vector<CsvField> fields = split(line);
  for (const CsvField& field : fields) header_.push_back(textOf(text_, field));
  for (const Column& column : columns_) {
    const auto found = std::find(header_.begin(), header_.end(), column.name);
    const auto place = static_cast<std::size_t>(found - header_.begin());
    if (found == header_.end()) {
      throw error(line, "no column " + inQuotes(column.name) + ", which " + inQuotes(column.key) +
                            " names" + suggestAmong(column.name, header_));
    }
    if (std::find(found + 1, header_.end(), column.name) != header_.end()) {
      throw error(fields[place].begin,
                  "two columns are named " + inQuotes(column.name) + "; allowed: one");
    }
    places_.push_back(place);
  }
}

void TableFile::readRow(std::size_t line) {
  const std::vector<CsvField> fields = split(line);
  if (fields.size() != header_.size()) {
    const std::size_t at = std::min(fields.size() - 1, header_.size());
    throw error(fields[at].begin, std::to_string(fields.size()) +
                                      " fields; allowed: " + std::to_string(header_.size()) +
                                      ", as the first line has: " + joinNames(header_));
  }
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const CsvField& field = fields[places_[i]];
    const std::string given = textOf(text_, field);
    double number = 0.0;
    if (!readNumber(given, &number) || !std::isfinite(number)) {
      throw error(field.begin, (given.empty() ? "nothing" : inQuotes(given)) + " in column " +
                                   inQuotes(columns_[i].name) + " is not a finite number" +
                                   remarkOnComma(given) +
                                   "; allowed: a number such as 1500, 0.25 or 1e-3");
    }
    numbers_[i].push_back(columns_[i].unit.toSi(number));
  }
  lines_.push_back(line);
}

SceneError TableFile::error(std::size_t position, const std::string& message) const {
  const auto place = text_.begin() + static_cast<std::ptrdiff_t>(position);
  const std::size_t line_end = text_.substr(0, position).rfind('\n');
  const std::size_t line = line_end == text_.npos ? skipByteOrderMark(text_) : line_end + 1;
  return SceneError(path_, file_ + ":" +
                               std::to_string(1 + std::count(text_.begin(), place, '\n')) + ":" +
                               std::to_string(position - line + 1) + ": " + message);
}

SceneError TableFile::fault(std::size_t column, std::size_t row, const std::string& message) const {
  const std::vector<CsvField> fields = split(lines_[row]);
  return error(fields[places_[column]].begin,
               "column " + inQuotes(columns_[column].name) + ": " + message);
}

}  // namespace variator_sim
