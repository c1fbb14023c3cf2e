/// A scene as the texts of src/runtime step it: the rows of its formulas, and what else they read.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "expression/series_program.h"
#include "motion_program/motion_data.h"
#include "motion_program/scene_formulas.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Returns what `make` returns; the SceneErrors of a MotionProgram in it begin with `fault`.
template <class Make>
auto orRefuse(const std::string& fault, Make make) {
  try {
    return make();
  } catch (const SceneError& error) {
    throw SceneError(error.keyPath(), fault + ": " + error.message());
  }
}

/// The reason for which a scene with a delay is no program of its own.
inline constexpr const char* kNoPast = "programs of their own keep no past";

class MotionProgram : public MotionData {
 public:
  /// kByStepper: the stepper that the scene names makes the steps. kBySeries: power series make
  /// them, whatever stepper the scene names; with `auto`, implicit steps may take their place.
  enum class Steps { kByStepper, kBySeries };

  /// `shown`: further formulas, with a row at order 0. Throws SceneError, with the element and the
  /// reason, for what has no series.
  explicit MotionProgram(const Scene& scene, std::vector<expression::Node> shown = {},
                         Steps steps = Steps::kBySeries);

  const StepperKind stepper;  ///< auto, or by which all steps are made
  const double fixed_step;    ///< s, of steppers of fixed steps; 0 of others

  /// True where an explicit scheme makes all steps.
  bool isExplicit() const {
    return stepper == StepperKind::kDopri5 || stepper == StepperKind::kFehlberg78 ||
           stepper == StepperKind::kRk4;
  }
  /// Throws SceneError where the formulas cannot be written as text or carry
  /// derivatives.
  void requireText() const {
    if (formulas_.no_text) throw SceneError(*formulas_.no_text);
  }
  const expression::SeriesProgram& rows() const { return program_; }
  /// Returns the switching functions, in the order of SIGNS.
  const std::vector<expression::Branch>& branches() const { return formulas_.signs; }
  /// Returns the names of elements that hold, in the order of HOLDS: the part behind a slash.
  const std::vector<std::string>& holdNames() const { return formulas_.hold_names; }

  /// Returns the rows of formulas of the program.
  MotionList<int> rowsOf(const std::vector<expression::Node>& nodes) const;
  MotionList<int> shownRows() const { return rowsOf(shown_); }

  /// Returns what differs between the texts of kernels.
  std::string structure() const;
  /// Returns the numbers of formulas, tables and lists, in an order that the structure determines.
  std::vector<double> numbers() const;
  /// Returns the lists that are among these, at their end.
  std::vector<const MotionList<double>*> numberLists() const;
  /// Returns all numbers of the program that are not among these, nor of its structure.
  std::vector<double> otherNumbers() const;
  /// Writes the integers of an initializer of a SeriesOperation, each with a comma behind it.
  static std::string integersOf(const expression::SeriesOperation& it);
  /// Writes the C of a library that steps the motion: the functions of host_kernel.h.
  std::string writeKernel() const;
  /// Writes the sizes of a series as enumerators.
  std::string writeExtents() const;
  /// Writes all that comes behind the declarations of scene.h to calls.h: sizes, lists, operations,
  /// tables, formulas, and the motion; `shares`: as a program that reads all numbers from
  /// vs_numbers.
  std::string writeMotion(bool shares) const;

 private:
  expression::SeriesProgram compile(const Scene& scene);
  std::vector<int> listSlots(const Scene& scene);
  void setSizes(const Scene& scene);
  void setStages(const Scene& scene);
  /// Throws SceneError where the stepper makes series of formulas that have none.
  void requireSeries() const;
  void listShown();
  void setLists(const Scene& scene);
  void listEntries(const expression::Graph& graph);
  bool areCoupled(const Scene& scene, int i, int j) const;
  void listBlocks(const Scene& scene);
  /// For each unknown of a stage the residuals that it moves; slots of the variables in these.
  struct Links {
    std::vector<std::set<int>> moved;
    std::set<int> read;
  };
  void linkFormulas(const Scene& scene, const std::vector<expression::Node>& nodes,
                    const std::vector<int>& residuals, Links* links) const;
  Links findLinks(const Scene& scene) const;
  std::vector<std::size_t> orderUnknowns(const Links& links) const;
  void listPlaces(const Links& links);
  void listGroups(const Links& links);
  void setInputs(const Scene& scene);
  void setHolds(const expression::Graph& graph);
  void setMemory(const Scene& scene);
  std::vector<int> findNeutral(const Scene& scene) const;
  /// True where one of these rows depends on an acceleration.
  bool areAccelerated(const MotionList<int>& rows) const;
  int rowOf(expression::Node node) const { return program_.rowOf(node); }
  /// Writes the functions of all rows, with the tables before them, or for a program that reads
  /// these and all numbers from vs_numbers.
  std::string writeRows(bool shares) const;
  std::string writeLists(bool shares) const;
  std::string writeSharedLists() const;
  std::string writeResolution(bool shares) const;
  std::string writeHiding() const;
  /// Writes the list of orders, and which of them a unit of a kernel compiles.
  std::string writeOrders(bool in_units) const;

  const SceneFormulas formulas_;
  const std::vector<expression::Node> shown_;
  std::vector<expression::Node> outputs_;
  std::size_t series_ = 0;  ///< outputs that are needed as series
  const expression::SeriesProgram program_;
};

}  // namespace variator_sim
