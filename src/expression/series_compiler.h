/// Chooses the rows of a SeriesProgram: sums, differences and constant factors of nodes are
/// gathered into one linear form, which gets a row only if a nonlinear operation or an output reads
/// it. Constant factors are moved out of products of nodes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <map>
#include <utility>
#include <vector>

#include "expression/series_program.h"

namespace variator_sim::expression {

class SeriesCompiler {
 public:
  SeriesCompiler(const Graph& graph, SeriesProgram& program) : graph_(graph), made_(program) {}

  void compile(const std::vector<Node>& trial, const std::vector<Node>& others,
               const std::vector<int>& slots);

 private:
  using Code = SeriesProgram::Code;
  using Instruction = SeriesProgram::Instruction;
  using Term = SeriesProgram::Term;
  /// constant + sum factor row
  struct Form {
    double constant = 0.0;
    std::vector<Term> terms;
  };
  /// Forms with more terms get a row, so that their readers do not repeat them.
  static constexpr std::size_t kMostTerms = 6;

  int addRow(int degree, bool is_accelerated);
  int degree(int row) const { return made_.degree(row); }

  static Instruction instruction(Code code, std::initializer_list<int> operands) {
    Instruction it;
    it.code = code;
    std::copy(operands.begin(), operands.end(), it.operands);
    return it;
  }
  /// Appends an instruction; the kind of its result follows from its operands.
  int append(Instruction it, int degree);
  bool mayHavePole(const Instruction& it) const;

  int constantRow(double value);
  /// Returns the row of a form; `form` becomes that row.
  int rowOf(Form& form);
  int rowOf(int node) { return rowOf(forms_[static_cast<std::size_t>(node)]); }

  /// Returns ka a + kb b.
  static Form combine(const Form& a, double ka, const Form& b, double kb);
  static Form scaled(const Form& form, double by) { return combine(form, by, Form{}, 0.0); }
  static Form single(int row, double factor = 1.0) { return Form{0.0, {{row, factor}}}; }
  /// Removes and returns the factor of a form of one term; returns 1 for others.
  double takeFactor(Form& form, int* row);

  Form makeForm(const Graph::Entry& entry);
  Form multiply(Form& a, Form& b);
  int product(int x, int y);
  Form divide(Form& a, Form& b);

  /// The recurrence of other powers divides by x, which may be 0.
  static constexpr double kMostMultiplied = 1000.0;

  /// Returns the row of x^n by the same products as powerOf.
  int multipliedPower(int x, int n);
  Form power(const Graph::Entry& entry);

  // series_compiler_functions.cpp

  /// Returns D of x: its rate, j x_j at j - 1.
  int rate(int x);
  int exponential(int x);
  /// Appends an instruction with a second result, whose row is its aux[0] then.
  int withSecond(const Instruction& it);
  /// Returns sine or, with `second`, cosine of one argument.
  int pair(Code code, int x, bool second);
  /// Returns log x, atan x, asin x, acos x or atan2(x, y).
  int primitive(Code code, int x, int y);
  int root(int x);

  Form function(const Graph::Entry& entry);
  int branch(Code code, const Graph::Entry& entry, int a);
  int table(const Graph::Entry& entry, int a);
  int opaque(const Graph::Entry& entry, int a);

  /// Resolves the rows of the instructions.
  void findPlaces();

  const Graph& graph_;
  SeriesProgram& made_;
  std::vector<Form> forms_;  ///< of the nodes
  std::map<int, int> row_of_slot_;
  std::map<double, int> row_of_constant_;
  std::map<std::pair<int, int>, int> product_of_;
  std::map<std::pair<int, int>, int> quotient_of_;
  std::map<int, int> rate_of_;
  std::map<std::pair<Code, int>, std::pair<int, int>> pair_of_;
};

}  // namespace variator_sim::expression
