/// The fields of a line of a CSV file, by the rules that all files of tables and commands have:
/// between commas, semicolons or tabs, whichever the header has, blanks around them left aside,
/// bare or in double quotes; numbers with a decimal point, which may begin with a plus.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "model/number_text.h"

namespace variator_sim {

/// The place of a field in its text, without the blanks around it.
struct CsvField {
  std::size_t begin;
  std::size_t end;
};

/// Returns the place behind a byte order mark, which spreadsheets put first.
inline std::size_t skipByteOrderMark(const std::string& text) {
  return text.rfind("\xef\xbb\xbf", 0) == 0 ? 3 : 0;
}

/// Returns what separates the fields of a file with this header.
inline char separatorOf(const std::string& header) {
  for (const char separator : {',', ';', '\t'}) {
    if (header.find(separator) != std::string::npos) return separator;
  }
  return ',';
}

/// Splits the line from `begin` to `end`.
inline std::vector<CsvField> splitFields(const std::string& text, std::size_t begin,
                                         std::size_t end, char separator) {
  const auto is_blank = [&text](std::size_t at) {
    return text[at] == ' ' || text[at] == '\t' || text[at] == '\r';
  };
  std::vector<CsvField> fields;
  for (;; ++begin) {
    std::size_t next = begin;
    bool is_quoted = false;
    while (next < end && (is_quoted || text[next] != separator)) {
      if (text[next] == '"') is_quoted = !is_quoted;
      ++next;
    }
    CsvField field{begin, next};
    while (field.begin < field.end && is_blank(field.begin)) ++field.begin;
    while (field.end > field.begin && is_blank(field.end - 1)) --field.end;
    fields.push_back(field);
    if (next == end) return fields;
    begin = next;
  }
}

/// Returns the field's text without its quotes.
inline std::string textOf(const std::string& text, const CsvField& field) {
  const bool is_quoted =
      field.end - field.begin > 1 && text[field.begin] == '"' && text[field.end - 1] == '"';
  const std::size_t edge = is_quoted ? 1 : 0;
  return text.substr(field.begin + edge, field.end - field.begin - 2 * edge);
}

/// Reads a field that is a number, finite or not. Returns false for others.
inline bool readNumber(const std::string& field, double* number) {
  const bool has_sign = field.size() > 1 && field[0] == '+' && field[1] != '-';
  return readWhole(field.substr(has_sign ? 1 : 0), number);
}

/// Returns a remark on a field that is no number for its decimal comma; "" for others.
inline const char* remarkOnComma(const std::string& field) {
  const bool has_comma = field.find(',') != field.npos && field.find('.') == field.npos;
  return has_comma ? ": decimals stand behind a point, not behind a comma" : "";
}

}  // namespace variator_sim
