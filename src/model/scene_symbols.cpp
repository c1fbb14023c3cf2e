#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "model/scene_readers.h"
#include "model/table_file.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim {

void checkFormulaNames(const SceneNames& scene, const char* list,
                       const std::vector<std::string>& names) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string taken = expression::describeTakenName(names[i], scene.shafts);
    if (taken.empty()) continue;
    throw SceneError(elementPath(list, i),
                     inQuotes(names[i]) + " is " + taken + " in formulas; choose another");
  }
}

namespace {

/// Reads `units`: of each of `columns`, by its name, SI where none is stated.
std::vector<Unit> readUnits(ParameterReader& reader, const std::vector<std::string>& columns) {
  std::vector<Unit> units(columns.size());
  if (!reader.has("units")) return units;
  ParameterReader section = reader.section("units");
  for (std::size_t i = 0; i < columns.size(); ++i) {
    section.allow(columns[i]);
    if (!section.has(columns[i])) continue;
    units[i] = requireUnit(section.text(columns[i]), section.keyPath(columns[i]));
  }
  section.finish();
  return units;
}

Table::Shape readShape(ParameterReader& reader, const char* preset) {
  Table::Shape shape(Table::Beyond::kConstant);
  shape.interpolation = reader.choice<Interpolation>("interpolation",
                                                     {{"smooth", Interpolation::kSmooth},
                                                      {"linear", Interpolation::kLinear},
                                                      {"hold", Interpolation::kHold}},
                                                     preset);
  shape.beyond = reader.choice("beyond", Table::beyondWords(), "constant");
  if (shape.beyond == Table::Beyond::kConstant || shape.interpolation != Interpolation::kHold) {
    return shape;
  }
  throw reader.error("beyond",
                     "'linear' continues the slope at the ends, and a table that holds its values "
                     "has none; allowed: constant, or interpolation linear or smooth");
}

/// Returns the values of a grid from the rows (x, y, value) of a file, in any order.
Table::Points gridOf(const TableFile& file) {
  const std::vector<double>& x = file.numbers(0);
  const std::vector<double>& y = file.numbers(1);
  std::vector<std::size_t> rows(x.size());
  std::iota(rows.begin(), rows.end(), 0);
  std::stable_sort(rows.begin(), rows.end(), [&](std::size_t a, std::size_t b) {
    return x[a] < x[b] || (x[a] == x[b] && y[a] < y[b]);
  });
  const auto columns = static_cast<std::size_t>(
      std::find_if(rows.begin(), rows.end(), [&](std::size_t n) { return x[n] > x[rows[0]]; }) -
      rows.begin());
  Table::Points grid;
  if (columns == 0) return grid;  // (of no rows)
  for (std::size_t n = 0; n < rows.size(); ++n) {
    const std::size_t row = rows[n];
    if (n < columns) grid.y.push_back(y[row]);
    if (n % columns == 0) grid.x.push_back(x[row]);
    grid.values.push_back(file.numbers(2)[row]);
    const bool ends = n + 1 == rows.size() && rows.size() % columns != 0;
    if (x[row] == grid.x.back() && y[row] == grid.y[n % columns] && !ends) continue;
    throw file.fault(
        0, row,
        "the rows make no grid: by " + file.name(0) + " and " + file.name(1) + ", (" +
            formatNumber(grid.x.back()) + ", " +
            formatNumber(grid.y[(ends ? n + 1 : n) % columns]) +
            ") in SI units has no row, or one before it is there twice; allowed: each pair of "
            "their values once, in any order");
  }
  for (const auto& [axis, points] : {std::pair{0U, &grid.x}, {1U, &grid.y}}) {
    if (points->size() > 1) continue;
    throw file.fault(axis, 0, "one value in all rows; allowed: two different ones at least");
  }
  grid.fault = [&file, rows, columns](const char* column, std::size_t index,
                                      const std::string& message) {
    const bool is_x = column[0] == 'x';
    return file.fault(is_x ? 0 : 1, rows[is_x ? index * columns : index], message);
  };
  return grid;
}

/// Reads a table of the columns that the keys of `names` name, by default those, in the file at
/// `file`.
Table readFileTable(ParameterReader& reader, const Table::Shape& shape,
                    const std::vector<std::pair<const char*, std::string>>& names) {
  std::vector<TableFile::Column> columns;
  std::vector<std::string> named;
  for (const auto& [key, preset] : names) {
    named.push_back(preset.empty() || reader.has(key) ? reader.text(key) : preset);
    columns.push_back({key, named.back(), {}});
  }
  const std::vector<Unit> units = readUnits(reader, named);
  for (std::size_t i = 0; i < columns.size(); ++i) columns[i].unit = units[i];
  const TableFile file(reader.text("file"), reader.keyPath("file"), columns);
  if (columns.size() == 3) return Table::make(gridOf(file), shape, reader.path());
  Table::Points points{file.numbers(0), {}, file.numbers(1), {}};
  points.fault = [&file](const char* column, std::size_t index, const std::string& message) {
    return file.fault(column[0] == 'x' ? 0 : 1, index, message);
  };
  return Table::make(std::move(points), shape, reader.path());
}

/// Returns the largest distance of a table from the straight lines between its points, along both
/// axes, as a part of the range of its values.
double calcCoarseness(const Table& table) {
  constexpr int kParts = 4;
  const bool has_two = table.argumentCount() == 2;
  const auto valueAt = [&](double x, double y) {
    return has_two ? table.value(x, y) : table.value(x);
  };
  const std::vector<double> X = table.points();
  const std::vector<double> Y = has_two ? table.points(1) : std::vector<double>{0.0};
  double low = valueAt(X[0], Y[0]);
  double high = low;
  double off = 0.0;
  const auto alongLine = [&](double from, double to, const auto& value) {
    const double first = value(from);
    const double last = value(to);
    low = std::min({low, first, last});
    high = std::max({high, first, last});
    for (int n = 1; n < kParts; ++n) {
      const double part = static_cast<double>(n) / kParts;
      const double straight = first + part * (last - first);
      off = std::max(off, std::abs(value(from + part * (to - from)) - straight));
    }
  };
  for (std::size_t i = 0; i < X.size(); ++i) {
    for (std::size_t j = 0; j < Y.size(); ++j) {
      if (i > 0) alongLine(X[i - 1], X[i], [&](double x) { return valueAt(x, Y[j]); });
      if (j > 0) alongLine(Y[j - 1], Y[j], [&](double y) { return valueAt(X[i], y); });
    }
  }
  return high > low ? off / (high - low) : 0.0;
}

/// Reads an input that is played from a file, a drive cycle, say.
Table readPlayed(ParameterReader& reader, const std::string& name) {
  reader.allow({"file", "x", "values", "units"});
  return readFileTable(reader, readShape(reader, "linear"), {{"x", "time"}, {"values", name}});
}

Table readTable(ParameterReader& reader, std::vector<std::string>* warnings) {
  reader.allow({"file", "x", "y", "values", "units"});
  const Table::Shape shape = readShape(reader, "smooth");
  std::vector<std::pair<const char*, std::string>> keys{{"x", ""}, {"y", ""}, {"values", ""}};
  if (!reader.has("y")) keys.erase(keys.begin() + 1);
  Table table;
  if (reader.has("file")) {
    table = readFileTable(reader, shape, keys);
  } else {
    std::vector<std::string> names;
    names.reserve(keys.size());
    for (const auto& key : keys) names.emplace_back(key.first);
    const std::vector<Unit> units = readUnits(reader, names);
    std::vector<Table::Column> columns;
    for (std::size_t i = 0; i < keys.size(); ++i) columns.push_back({keys[i].first, {}, units[i]});
    table = Table::read(reader, columns, shape);
  }
  constexpr double kCoarse = 0.05;
  const double coarseness = reader.has("interpolation") ? 0.0 : calcCoarseness(table);
  if (coarseness > kCoarse) {
    warnings->push_back(
        "the table " + inQuotes(reader.path()) + " is a smooth curve that lies up to " +
        std::to_string(std::lround(100.0 * coarseness)) +
        " % of its range off the straight lines between its points; for these lines give it "
        "'interpolation: linear', or more points, or 'interpolation: smooth' if that is meant");
  }
  return table;
}

}  // namespace

SceneSymbols readSceneSymbols(ParameterReader& root, const SceneNames& names,
                              std::vector<CommandInputSettings>& inputs,
                              std::vector<std::string>* warnings) {
  checkFormulaNames(names, "inputs", names.inputs);
  checkFormulaNames(names, "tables", names.tables);
  SceneSymbols symbols;
  for (const std::string& name : names.inputs) {
    ParameterReader reader = root.section(name);
    if (reader.has("file")) {
      symbols.played[name] = std::make_shared<const Table>(readPlayed(reader, name));
      reader.finish();
      continue;
    }
    ComponentContext context(name, reader, names.shafts, inputs);
    symbols.inputs[name] = context.addInput(readCommandInput(reader, name));
    reader.finish();
  }
  for (const std::string& name : names.tables) {
    ParameterReader reader = root.section(name);
    symbols.tables[name] = std::make_shared<const Table>(readTable(reader, warnings));
    reader.finish();
  }
  return symbols;
}

}  // namespace variator_sim
