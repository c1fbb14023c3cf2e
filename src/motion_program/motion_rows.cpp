#include "motion_program/motion_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

using expression::SeriesProgram;

namespace {

std::size_t index(int n) {
  return static_cast<std::size_t>(n);
}

constexpr double kFactorial[] = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0};

/// Calls `use` with the point from which each piece is counted: the lower one of its two, for the
/// lowest piece the first; third derivatives are taken slightly inside of the piece.
template <class Use>
void forEachPiece(const std::vector<double>& points, Use use) {
  for (std::size_t k = 0; k <= points.size(); ++k) {
    const double x = k == 0 ? points.front() : points[k - 1];
    use(x, k == 0 ? std::nextafter(x, -std::numeric_limits<double>::infinity()) : x);
  }
}

}  // namespace

MotionRows::MotionRows(const SeriesProgram& program, int series)
    : program_(program), rows_(program.rowCount()) {
  const std::vector<bool> in_series =
      program.findNeeded({program.outputs_.begin(), program.outputs_.begin() + series});
  for (std::size_t n = 0; n < program.instructions_.size(); ++n) {
    const Instruction& it = program.instructions_[n];
    const bool is_series = in_series[n];
    if (is_series) in_series_.insert(it.result);
    noteGrowth(it);
    const Part part = !is_series                          ? Part::kAtOnce
                      : !program.isAccelerated(it.result) ? Part::kGiven
                      : it.is_tried                       ? Part::kTried
                                                          : Part::kRest;
    statements_[static_cast<std::size_t>(part)].push_back(make(it));
  }
}

void MotionRows::noteGrowth(const Instruction& it) {
  bool grows = it.code == Code::kExp || it.code == Code::kSinhCosh;
  if (it.code == Code::kLinear) {
    for (int n = 0; n < it.aux[1]; ++n) {
      grows = grows || grows_.count(program_.terms_[index(it.aux[0] + n)].row) > 0;
    }
  }
  for (const int operand : it.operands) grows = grows || grows_.count(operand) > 0;
  if (!grows) return;
  grows_.insert(it.result);
  if (it.code == Code::kSinhCosh) grows_.insert(it.aux[0]);
}

int MotionRows::limitOf(const Instruction& it) const {
  const bool has_limit = it.code == Code::kDivide || it.code == Code::kTanh ||
                         it.code == Code::kExp ||
                         (it.code >= Code::kLog && it.code <= Code::kAtan2);
  const int of = it.operands[it.code == Code::kDivide ? 1 : 0];
  const bool may_stay = has_limit && it.ends >= SeriesProgram::kNoDegree && grows_.count(of) > 0 &&
                        !program_.has_pole_[index(of)];
  return may_stay ? of : -1;
}

MotionRows::Statement MotionRows::make(const Instruction& it) {
  Statement made;
  made.it = &it;
  if (it.code == Code::kTable || it.code == Code::kTable2) {
    const bool has_two = it.code == Code::kTable2;
    const Piece& piece = program_.pieces_[index(it.state)];
    made.table = add(has_two ? cutTwo(piece) : cut(piece));
    made.rows = rows_;
    made.mode = modes_;
    made.piece = piece_of_row_[it.result] = pieces_;
    rows_ += has_two ? 11 : 3;
    modes_ += has_two ? 4 : 3;
    pieces_ += has_two ? (Table::kDegree + 1) * (Table::kDegree + 1) : Table::kDegree + 1;
    return made;
  }
  if (it.code == Code::kOpaque) {
    made.function = program_.pieces_[index(it.state)].function.get();
    made.piece = piece_of_row_[it.result] = pieces_;
    pieces_ += 1 + OpaqueFunction::kMostArguments;
    return made;
  }
  made.limit = limitOf(it);
  if (it.code == Code::kAbs || (it.code >= Code::kMin && it.code <= Code::kSelect)) {
    const auto [place, is_new] = mode_of_state_.try_emplace(it.state, modes_);
    modes_ += is_new ? 1 : 0;
    made.mode = place->second;
  }
  return made;
}

int MotionRows::add(DenseTable table) {
  const auto same = std::find_if(tables_.begin(), tables_.end(), [&](const DenseTable& other) {
    return other.points == table.points && other.pieces == table.pieces;
  });
  if (same != tables_.end()) return static_cast<int>(same - tables_.begin());
  tables_.push_back(std::move(table));
  return static_cast<int>(tables_.size()) - 1;
}

MotionRows::DenseTable MotionRows::cut(const Piece& piece) {
  const Table& table = *piece.table;
  DenseTable made = {table.origin(), {table.points()}, {}};
  forEachPiece(table.points(), [&](double x, double inside) {
    for (int i = 0; i <= Table::kDegree; ++i) {
      const int n = piece.order[0] + i;
      const bool is_none = n > Table::kDegree;
      made.pieces.push_back(
          (is_none ? 0.0 : table.derivative(n, n < table.smoothness() ? x : inside)) /
          kFactorial[i]);
    }
  });
  return made;
}

MotionRows::DenseTable MotionRows::cutTwo(const Piece& piece) {
  const Table& table = *piece.table;
  DenseTable made = {table.origin(), {table.points(0), table.points(1)}, {}};
  forEachPiece(made.points[0], [&](double /*x*/, double inside_x) {
    forEachPiece(made.points[1], [&](double /*y*/, double inside_y) {
      for (int i = 0; i <= Table::kDegree; ++i) {
        for (int j = 0; j <= Table::kDegree; ++j) {
          const int m = piece.order[0] + i;
          const int n = piece.order[1] + j;
          const bool is_none = std::max(m, n) > Table::kDegree;
          made.pieces.push_back((is_none ? 0.0 : table.derivative({m, n}, inside_x, inside_y)) /
                                (kFactorial[i] * kFactorial[j]));
        }
      }
    });
  });
  return made;
}

std::vector<expression::SeriesOperation> MotionRows::resolved() const {
  std::vector<expression::SeriesOperation> list;
  for (expression::SeriesOperation it : program_.resolved()) {
    if (in_series_.count(it.result) == 0) continue;
    if (it.kind == expression::kSeriesTable) {
      it.state = piece_of_row_.at(it.result);
      if (it.b < 0) it.f = 1.0;  // the piece's six coefficients lie next to each other here
    } else if (it.kind == expression::kSeriesOpaque) {
      it.state += piece_of_row_.at(it.result) + 1;
    } else if (it.kind == expression::kSeriesEither || it.kind == expression::kSeriesOther) {
      it.state = mode_of_state_.at(it.state);
    }
    list.push_back(it);
  }
  return list;
}

}  // namespace variator_sim
