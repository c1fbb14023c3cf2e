/// Columns of numbers from CSV files.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "model/csv_fields.h"
#include "variator_sim/errors.h"
#include "variator_sim/units.h"

namespace variator_sim {

/// Returns the path of a file: `name` itself, or of package://PACKAGE/PATH the file of a package,
/// found by the name in its package.xml as rospack does: in the folders of ROS_PACKAGE_PATH and
/// below, then in source and install spaces of CMAKE_PREFIX_PATH. Throws SceneError at `key`.
std::string filePathOf(const std::string& name, const std::string& key);

/// Some columns of a CSV file (csv_fields.h), by their names in its first line. Blank lines and
/// lines that begin with # are skipped. Errors tell file:line:column.
class TableFile {
 public:
  /// A column that is wanted: `key` of the scene names it.
  struct Column {
    std::string key;
    std::string name;
    Unit unit;
  };

  /// Reads the file that the scene names at `path`: absolute, from the working folder (readYamlFile
  /// has put the scene's folder before it), or package://PACKAGE/PATH. Throws SceneError.
  TableFile(const std::string& name, std::string path, std::vector<Column> columns);

  /// Returns the numbers of a wanted column, by its index, in SI units.
  const std::vector<double>& numbers(std::size_t column) const { return numbers_[column]; }
  const std::string& name(std::size_t column) const { return columns_[column].name; }
  /// Returns the error that tells of a row's number in a wanted column.
  SceneError fault(std::size_t column, std::size_t row, const std::string& message) const;

 private:
  // (Lines are given by the places where they begin.)
  void readHeader(std::size_t line);
  void readRow(std::size_t line);
  std::vector<CsvField> split(std::size_t line) const;
  SceneError error(std::size_t position, const std::string& message) const;

  std::string file_;  ///< its name in messages
  std::string path_;
  std::vector<Column> columns_;
  std::string text_;
  char separator_ = ',';
  std::vector<std::string> header_;
  std::vector<std::size_t> places_;  ///< of the wanted columns in a line
  std::vector<std::size_t> lines_;   ///< of the rows
  std::vector<std::vector<double>> numbers_;
};

}  // namespace variator_sim
