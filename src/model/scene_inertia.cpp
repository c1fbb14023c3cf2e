#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "model/formula_laws.h"
#include "model/scene_readers.h"
#include "variator_sim/expression/guards.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::slotOf;
using expression::Source;

namespace {

struct ShaftInertia {
  double mean = 0.0;
  double least = 0.0;  ///< over all angles
  std::vector<InertiaHarmonic> harmonics;
};

/// Adds a harmonic to the one of its order.
void add(const InertiaHarmonic& harmonic, std::vector<InertiaHarmonic>* all) {
  const auto same = std::find_if(all->begin(), all->end(), [&](const InertiaHarmonic& other) {
    return other.order == harmonic.order;
  });
  if (same == all->end()) {
    all->push_back(harmonic);
    return;
  }
  same->cosine += harmonic.cosine;
  same->sine += harmonic.sine;
}

double calcInertia(const ShaftInertia& inertia, double angle) {
  double value = inertia.mean;
  for (const InertiaHarmonic& harmonic : inertia.harmonics) {
    value += harmonic.cosine * std::cos(harmonic.order * angle) +
             harmonic.sine * std::sin(harmonic.order * angle);
  }
  return value;
}

/// Returns the least inertia over all angles: the best of a fine grid, refined by golden sections.
double calcLeastInertia(const ShaftInertia& inertia) {
  int highest = 1;
  for (const InertiaHarmonic& harmonic : inertia.harmonics) {
    highest = std::max(highest, harmonic.order);
  }
  const int points = 64 * highest;
  const double spacing = 2.0 * 3.14159265358979323846 / points;
  // Angles of the grid times an order are angles of the grid: their cosines are tabulated.
  const auto size = static_cast<std::size_t>(points);
  std::vector<double> cosines;
  std::vector<double> sines;
  for (int n = 0; n < points; ++n) {
    cosines.push_back(std::cos(n * spacing));
    sines.push_back(std::sin(n * spacing));
  }
  std::vector<double> values(size, inertia.mean);
  for (const InertiaHarmonic& harmonic : inertia.harmonics) {
    endIfInterrupted();
    std::size_t other = 0;
    for (double& value : values) {
      value += harmonic.cosine * cosines[other] + harmonic.sine * sines[other];
      other += static_cast<std::size_t>(harmonic.order);
      if (other >= size) other -= size;
    }
  }
  if (!std::all_of(values.begin(), values.end(),
                   [](double value) { return std::isfinite(value); })) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const auto least = std::min_element(values.begin(), values.end());
  const double best = static_cast<double>(least - values.begin()) * spacing;
  double low = best - spacing;
  double high = best + spacing;
  constexpr double kGolden = 0.6180339887498949;
  for (int n = 0; n < 60; ++n) {
    const double left = high - kGolden * (high - low);
    const double right = low + kGolden * (high - low);
    (calcInertia(inertia, left) < calcInertia(inertia, right) ? high : low) =
        calcInertia(inertia, left) < calcInertia(inertia, right) ? right : left;
  }
  return std::min(calcInertia(inertia, best), calcInertia(inertia, 0.5 * (low + high)));
}

bool isFormula(const ParameterTree* value) {
  return value != nullptr && value->kind() == ParameterTree::Kind::kText &&
         !ParameterReader::isNumber(*value);
}

/// Reads a number, or {mean, harmonics: [{order, cos, sin}, ...]}; positive at every angle.
ShaftInertia readShaftInertia(ParameterReader& root, const std::string& shaft) {
  ParameterReader reader = root.section(shaft);
  reader.allow("inertia");
  ShaftInertia inertia;
  const ParameterTree* value = reader.raw("inertia");
  if (isFormula(value)) {
    reader.numberDictionary("parameters");
    reader.finish();
    inertia.mean = inertia.least = 1.0;
    return inertia;
  }
  if (value == nullptr || value->kind() != ParameterTree::Kind::kDictionary) {
    inertia.mean = inertia.least = reader.number("inertia", Range::notNegative("kg m^2"));
    reader.finish();
    return inertia;
  }
  ParameterReader parts = reader.section("inertia", {"mean", "harmonics"});
  inertia.mean = parts.number("mean", Range::positive("kg m^2"));
  std::size_t n = 0;
  for (const ParameterTree& it : parts.list("harmonics", "a list of {order, cos, sin}")) {
    ParameterReader entry(it, elementPath(parts.keyPath("harmonics"), n++));
    entry.allow({"order", "cos", "sin"});
    InertiaHarmonic harmonic;
    harmonic.order = entry.integer("order", 1, 1000);
    harmonic.cosine = entry.number("cos", Range::any("kg m^2"), 0.0);
    harmonic.sine = entry.number("sin", Range::any("kg m^2"), 0.0);
    entry.finish();
    add(harmonic, &inertia.harmonics);
  }
  parts.finish();
  reader.finish();
  inertia.least = calcLeastInertia(inertia);
  if (!(inertia.least > 0.0)) {
    throw reader.error("inertia", value->toText() + " falls to " + formatReal(inertia.least) +
                                      " kg m^2 at some angle; allowed: > 0 at every angle");
  }
  return inertia;
}

const char* const kCouplings = "inertia_coupling";
const std::string kCouplingsExpected = "a list of couplings [shaft, shaft, value in kg m^2]";

SceneError unexpectedCoupling(const std::string& path, const ParameterTree& value) {
  return SceneError(path, "expected " + kCouplingsExpected + ", got " + value.describeKind() +
                              ": " + value.toText());
}

/// Reads the two shafts of a coupling [a, b, value], in ascending order.
std::pair<int, int> readCoupledShafts(const ParameterTree& coupling, const std::string& path,
                                      const std::vector<std::string>& shafts) {
  if (coupling.kind() != ParameterTree::Kind::kList || coupling.asList().size() != 3) {
    throw unexpectedCoupling(path, coupling);
  }
  std::array<int, 2> pair{};
  for (std::size_t i = 0; i < 2; ++i) {
    const ParameterTree& name = coupling.asList()[i];
    if (name.kind() != ParameterTree::Kind::kText) throw unexpectedCoupling(path, coupling);
    pair[i] = placeOf(name.asText(), shafts, elementPath(path, i), "is not a shaft");
  }
  if (pair[0] == pair[1]) {
    throw SceneError(
        path, coupling.toText() + " couples a shaft with itself; allowed: two different shafts");
  }
  return std::minmax(pair[0], pair[1]);
}

/// Calls `use` with the shafts, the value and the path of each coupling.
template <class Use>
void forEachCoupling(ParameterReader& root, const std::vector<std::string>& shafts, Use use) {
  std::vector<std::pair<int, int>> coupled;
  for (const ParameterTree& coupling : root.list(kCouplings, kCouplingsExpected)) {
    const std::string path = elementPath(kCouplings, coupled.size());
    const std::pair<int, int> pair = readCoupledShafts(coupling, path, shafts);
    if (contains(coupled, pair)) {
      throw SceneError(path, coupling.toText() +
                                 " couples these shafts a second time; allowed: every pair once");
    }
    coupled.push_back(pair);
    use(pair.first, pair.second, coupling.asList()[2], elementPath(path, 2));
  }
}

/// Tells whether all pivots D of A = L D L^T are positive.
bool isPositiveDefinite(Eigen::MatrixXd A) {
  for (int i = 0; i < A.rows(); ++i) {
    if (!(A(i, i) > 0.0)) return false;
    for (int j = i + 1; j < A.rows(); ++j) A.row(j) -= A(j, i) / A(i, i) * A.row(i);
  }
  return true;
}

/// Returns the least lambda for which A - lambda 1 is not positive definite, by bisection. (Eigen's
/// decompositions of matrices of any size take the compiler ten seconds.)
double calcSmallestEigenvalue(const Eigen::MatrixXd& A) {
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(A.rows(), A.cols());
  double high = A.diagonal().minCoeff();
  double low = high - static_cast<double>(A.rows()) * A.cwiseAbs().maxCoeff();
  for (double middle = 0.5 * (low + high); low < middle && middle < high;
       middle = 0.5 * (low + high)) {
    (isPositiveDefinite(A - middle * unit) ? low : high) = middle;
  }
  return high;
}

/// Reads off-diagonal terms [[a, b, value], ...]. `least` holds the least inertia of every shaft: J
/// is positive definite at every angle when it is with these on its diagonal.
void readInertiaCoupling(ParameterReader& root, const std::vector<double>& least, Scene* scene) {
  Eigen::MatrixXd& J = scene->inertia;
  bool has_formulas = false;
  for (const std::string& shaft : scene->shafts) {
    has_formulas = has_formulas || isFormula(root.section(shaft).raw("inertia"));
  }
  forEachCoupling(
      root, scene->shafts, [&](int i, int j, const ParameterTree& value, const std::string& path) {
        has_formulas = has_formulas || isFormula(&value);
        if (isFormula(&value)) return;
        J(i, j) = J(j, i) = ParameterReader::toNumber(value, path, Range::any("kg m^2"));
      });
  if (J.isDiagonal(0.0)) return;

  Eigen::MatrixXd smallest = J;
  for (std::size_t i = 0; i < least.size(); ++i) {
    const auto row = static_cast<int>(i);
    smallest(row, row) = least[i];
    // tieMasslessShafts judges shafts without inertia.
    if (smallest.row(row).isZero(0.0)) smallest(row, row) = 1.0;
  }
  if (has_formulas || isPositiveDefinite(smallest)) return;
  throw SceneError(kCouplings,
                   root.raw(kCouplings)->toText() +
                       " makes the inertia matrix J indefinite: its smallest eigenvalue is " +
                       formatReal(calcSmallestEigenvalue(smallest)) +
                       " kg m^2; allowed: a positive definite J" + scene->extreme_numbers);
}

/// Returns c of a constraint f = c omega + constant with a reaction along c; none of others.
std::optional<Eigen::VectorXd> readSpeedRow(const Constraint& constraint, const Scene& scene) {
  const expression::Graph& graph = *scene.graph;
  if (constraint.order() != 1 || !constraint.direction().empty()) return {};
  for (const int n : graph.listReachable({constraint.function()})) {
    const expression::Graph::Entry& entry = graph.entry({n});
    if (entry.operation == expression::Operation::kVariable &&
        expression::sourceOf(entry.slot) != expression::Source::kVelocity) {
      return {};
    }
  }
  Eigen::VectorXd c(scene.shaftCount());
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const expression::Node entry = constraint.row()[static_cast<std::size_t>(i)];
    if (!graph.isConstant(entry)) return {};
    c(i) = graph.constantValue(entry);
  }
  return c;
}

/// Returns the largest inertia that a shaft of `row` has as seen through it, J_i/c_i^2; 0 if none.
double findReflectedInertia(const Eigen::VectorXd& row, const Eigen::MatrixXd& J) {
  double largest = 0.0;
  for (int i = 0; i < row.size(); ++i) {
    if (row(i) != 0.0) largest = std::max(largest, J(i, i) / (row(i) * row(i)));
  }
  return largest;
}

}  // namespace

void tieMasslessShafts(Scene* scene) {
  const Eigen::MatrixXd J = scene->inertia;
  scene->lent_inertia = Eigen::MatrixXd::Zero(J.rows(), J.cols());
  const auto is_massless = [&J](int i) { return J(i, i) == 0.0; };
  for (const ConstraintPtr& constraint : scene->constraints) {
    const std::optional<Eigen::VectorXd> c = readSpeedRow(*constraint, *scene);
    bool ties = false;
    for (int i = 0; i < J.rows() && c; ++i) ties = ties || ((*c)(i) != 0.0 && is_massless(i));
    if (!ties) continue;
    const double reflected = findReflectedInertia(*c, J);
    const double w = reflected > 0.0 ? reflected : J.maxCoeff() / c->cwiseAbs2().maxCoeff();
    scene->lent_inertia += w * *c * c->transpose();
  }
  scene->inertia += scene->lent_inertia;
  Eigen::MatrixXd left = scene->inertia;  // by elimination, massless shafts last
  std::vector<int> order;
  for (const bool massless : {false, true}) {
    for (int i = 0; i < J.rows(); ++i) {
      if (is_massless(i) == massless) order.push_back(i);
    }
  }
  for (const int i : order) {
    if (is_massless(i) && !(left(i, i) > 1e-12 * scene->inertia(i, i))) {
      throw SceneError(scene->shafts[static_cast<std::size_t>(i)] + "/inertia",
                       "is 0, but no constraint with constant coefficients, as a KinematicRatio, "
                       "ties the shaft to the inertia of others; allowed: a number > 0, or such a "
                       "constraint");
    }
    const Eigen::VectorXd column = left.col(i) / left(i, i);
    left -= column * Eigen::VectorXd(left.row(i)).transpose();
  }
}

void readInertia(ParameterReader& root, Scene* scene) {
  scene->inertia = Eigen::MatrixXd::Zero(scene->shaftCount(), scene->shaftCount());
  std::vector<double> least;
  bool constant = true;
  for (int i = 0; i < scene->shaftCount(); ++i) {
    ShaftInertia inertia = readShaftInertia(root, scene->shafts[static_cast<std::size_t>(i)]);
    scene->inertia(i, i) = inertia.mean;
    least.push_back(inertia.least);
    constant = constant && inertia.harmonics.empty();
    scene->inertia_harmonics.push_back(std::move(inertia.harmonics));
  }
  if (constant) scene->inertia_harmonics.clear();
  readInertiaCoupling(root, least, scene);
}

namespace {

/// Sets J, whose values at the start are checked.
void takeFormulas(std::vector<Node> J, bool are_constant, Scene* scene) {
  const int S = scene->shaftCount();
  std::vector<double> angle = scene->initial.angle;
  angle.resize(static_cast<std::size_t>(S), 0.0);
  std::vector<double> input;
  for (const CommandInputSettings& it : scene->inputs) input.push_back(it.initial);
  StateView state{};
  state.angle = angle.data();
  state.input = input.data();
  const expression::Tape tape(*scene->graph, J);
  const double* const value = tape.evaluate(state);
  for (int n = 0; n < S * S; ++n) scene->inertia(n / S, n % S) = value[n];
  if (!isPositiveDefinite(scene->inertia)) {
    throw SceneError("shafts",
                     "the inertia matrix J is not positive definite at the start: its smallest "
                     "eigenvalue is " +
                         formatReal(calcSmallestEigenvalue(scene->inertia)) + " kg m^2");
  }
  if (!are_constant) scene->inertia_formulas = std::move(J);
}

/// Reads one formula of J.
Node readEntry(ParameterReader& reader, const std::string& name, const std::string& key,
               Scene* scene) {
  Graph& graph = *scene->graph;
  const std::string path = reader.keyPath(key);
  reader.allow(key);
  ComponentContext context = contextOf(name, reader, scene);
  const Node entry = readFormula(context, key, expression::FormulaKind::kQuantity, graph);
  reader.finish();
  if (expression::reads(graph, {entry}, Source::kVelocity)) {
    throw SceneError(path,
                     "reads a velocity; allowed: angles, t, inputs and tables, for T = 1/2 "
                     "omega^T J omega has J(phi, t)");
  }
  for (const int n : expression::inputsIn(graph, {entry})) {
    const CommandInputSettings& input = scene->inputs[static_cast<std::size_t>(n)];
    if (input.kind == InputKind::kCommanded && input.hold == Hold::kSecondOrderLag) continue;
    throw SceneError(path, "reads " + inQuotes(input.name) +
                               ", and where it or its rate jumps the velocities would; allowed: "
                               "commanded inputs with 'hold: second_order_lag'");
  }
  bool bends = !expression::findBranches(graph, {entry}).empty();
  for (const expression::Passage& it : expression::findPassages(graph, {entry})) {
    bends = bends || it.smoothness < 3;
  }
  if (!bends) return entry;
  throw SceneError(path,
                   "is bent by abs, min, max, if or a table that is not smooth; allowed: "
                   "formulas with two derivatives");
}

}  // namespace

void readInertiaFormulas(ParameterReader& root, Scene* scene) {
  Graph& graph = *scene->graph;
  const int S = scene->shaftCount();
  std::vector<Node> J;
  bool are_constant = true;
  const auto set = [&](int i, int j, Node entry) {
    // (Numbers come into the graph only beside formulas, whose constants they would be.)
    if (J.empty()) J = inertiaOf(graph, *scene);
    J.data()[S * i + j] = J.data()[S * j + i] = entry;
    are_constant = are_constant && graph.isConstant(entry);
  };
  for (int i = 0; i < S; ++i) {
    const std::string& shaft = scene->shafts[static_cast<std::size_t>(i)];
    ParameterReader reader = root.section(shaft);
    if (isFormula(reader.raw("inertia"))) set(i, i, readEntry(reader, shaft, "inertia", scene));
  }
  forEachCoupling(root, scene->shafts,
                  [&](int i, int j, const ParameterTree& value, const std::string& path) {
                    if (!isFormula(&value)) return;
                    const ParameterTree tree = ParameterTree::dictionary({{"value", value}});
                    ParameterReader reader(tree, "");
                    try {
                      set(i, j, readEntry(reader, path, "value", scene));
                    } catch (const SceneError& error) {
                      throw SceneError(path, error.message());
                    }
                  });
  if (!J.empty()) takeFormulas(std::move(J), are_constant, scene);
}

}  // namespace variator_sim
