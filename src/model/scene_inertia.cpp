#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <complex>
#include <limits>
#include <unsupported/Eigen/FFT>
#include <utility>

#include "model/formula_laws.h"
#include "model/scene_readers.h"
#include "variator_sim/expression/guards.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"

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

/// Returns the least inertia over all angles: the best of a fine grid, by the inverse transform of
/// the harmonics, refined.
double calcLeastInertia(const ShaftInertia& inertia) {
  int highest = 1;
  for (const InertiaHarmonic& harmonic : inertia.harmonics) {
    highest = std::max(highest, harmonic.order);
  }
  const int points = 64 * highest;
  std::vector<std::complex<double>> spectrum(static_cast<std::size_t>(points), 0.0);
  for (const InertiaHarmonic& it : inertia.harmonics) {
    spectrum[static_cast<std::size_t>(it.order)] = {it.cosine, -it.sine};
  }
  Eigen::FFT<double> transform;
  transform.SetFlag(Eigen::FFT<double>::Unscaled);
  std::vector<std::complex<double>> values;
  transform.inv(values, spectrum);
  std::size_t least = 0;
  for (std::size_t n = 0; n < values.size(); ++n) {
    if (!std::isfinite(values[n].real())) return std::numeric_limits<double>::quiet_NaN();
    if (values[n].real() < values[least].real()) least = n;
  }
  const double spacing = 2.0 * 3.14159265358979323846 / points;
  const double best = static_cast<double>(least) * spacing;
  const auto along = [&](double angle) { return calcInertia(inertia, angle); };
  return std::min(along(best),
                  boost::math::tools::brent_find_minima(along, best - spacing, best + spacing,
                                                        std::numeric_limits<double>::digits)
                      .second);
}

bool isFormula(const ParameterTree* value) {
  return value != nullptr && value->kind() == ParameterTree::Kind::kText &&
         !ParameterReader::isNumber(*value);
}

/// Reads a number, or {mean, harmonics: [{order, cos, sin}, ...]}; positive at every angle.
ShaftInertia readShaftInertia(ParameterReader& reader) {
  ShaftInertia inertia;
  const ParameterTree* value = reader.raw("inertia");
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

/// Calls `use` with the shafts, in ascending order, the value and the path of each coupling
/// [a, b, value].
template <class Use>
void forEachCoupling(ParameterReader& root, const std::vector<std::string>& shafts, Use use) {
  const std::string expected = "a list of couplings [shaft, shaft, value in kg m^2]";
  std::vector<std::pair<int, int>> coupled;
  for (const ParameterTree& coupling : root.list(kCouplings, expected)) {
    const std::string path = elementPath(kCouplings, coupled.size());
    const ParameterTree::List& its = coupling.asList();
    bool is_coupling = its.size() == 3;
    for (std::size_t i = 0; i < 2 && is_coupling; ++i) {
      is_coupling = its[i].kind() == ParameterTree::Kind::kText;
    }
    if (!is_coupling) {
      throw SceneError(path, "expected " + expected + ", got " + coupling.describeKind() + ": " +
                                 coupling.toText());
    }
    const auto place = [&](std::size_t i) {
      return placeOf(its[i].asText(), shafts, elementPath(path, i), "is not a shaft");
    };
    const int a = place(0);
    const int b = place(1);
    if (a == b) {
      throw SceneError(
          path, coupling.toText() + " couples a shaft with itself; allowed: two different shafts");
    }
    const std::pair<int, int> pair = std::minmax(a, b);
    if (contains(coupled, pair)) {
      throw SceneError(path, coupling.toText() +
                                 " couples these shafts a second time; allowed: every pair once");
    }
    coupled.push_back(pair);
    use(pair.first, pair.second, its[2], elementPath(path, 2));
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

/// Throws SceneError unless J is positive definite with the least inertia of every shaft on its
/// diagonal: then it is at every angle.
void checkCouplings(ParameterReader& root, const std::vector<double>& least, const Scene& scene) {
  Eigen::MatrixXd smallest = scene.inertia;
  if (smallest.isDiagonal(0.0)) return;
  for (std::size_t i = 0; i < least.size(); ++i) {
    const auto row = static_cast<int>(i);
    smallest(row, row) = least[i];
    // tieMasslessShafts judges shafts without inertia.
    if (smallest.row(row).isZero(0.0)) smallest(row, row) = 1.0;
  }
  if (isPositiveDefinite(smallest)) return;
  throw SceneError(kCouplings,
                   root.raw(kCouplings)->toText() +
                       " makes the inertia matrix J indefinite: its smallest eigenvalue is " +
                       formatReal(calcSmallestEigenvalue(smallest)) +
                       " kg m^2; allowed: a positive definite J" + scene.extreme_numbers);
}

/// Returns c of a constraint f = c omega + constant with a reaction along c; none of others.
std::optional<Eigen::VectorXd> readSpeedRow(const Constraint& constraint, const Scene& scene) {
  const Graph& graph = *scene.graph;
  if (constraint.order() != 1 || !constraint.direction().empty()) return {};
  for (const Source other : {Source::kTime, Source::kAngle, Source::kInput}) {
    if (expression::reads(graph, {constraint.function()}, other)) return {};
  }
  Eigen::VectorXd c(scene.shaftCount());
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const expression::Node entry = constraint.row()[static_cast<std::size_t>(i)];
    if (!graph.isConstant(entry)) return {};
    c(i) = graph.constantValue(entry);
  }
  return c;
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
    double reflected = 0.0;  // the largest inertia of a shaft as seen through the row, J_i/c_i^2
    for (int i = 0; i < J.rows(); ++i) {
      if ((*c)(i) != 0.0) reflected = std::max(reflected, J(i, i) / ((*c)(i) * (*c)(i)));
    }
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

namespace {

/// Puts formulas into J, whose values at the start are checked.
void takeFormulas(const std::vector<std::pair<int, Node>>& formulas, Scene* scene) {
  const int S = scene->shaftCount();
  std::vector<Node> J = inertiaOf(*scene->graph, *scene);
  bool are_constant = true;
  for (const auto& [place, entry] : formulas) {
    J.data()[place] = entry;
    are_constant = are_constant && scene->graph->isConstant(entry);
  }
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

bool readInertia(ParameterReader& root, bool knows_names, Scene* scene) {
  const int S = scene->shaftCount();
  Eigen::MatrixXd& numbers = scene->inertia = Eigen::MatrixXd::Identity(S, S);
  scene->inertia_harmonics.assign(static_cast<std::size_t>(S), {});
  std::vector<double> least(static_cast<std::size_t>(S), 1.0);
  bool has_formulas = false;
  bool is_constant = true;
  std::vector<std::pair<int, Node>> formulas;  // by their places in J
  const auto takeFormula = [&](ParameterReader& reader, const std::string& name,
                               const std::string& key, int i, int j) {
    has_formulas = true;
    if (!knows_names) return;
    const Node entry = readEntry(reader, name, key, scene);
    formulas.emplace_back(S * i + j, entry);
    formulas.emplace_back(S * j + i, entry);
  };
  for (int i = 0; i < S; ++i) {
    const auto n = static_cast<std::size_t>(i);
    ParameterReader reader = root.section(scene->shafts[n], {"inertia"});
    if (isFormula(reader.raw("inertia"))) {
      reader.numberDictionary("parameters");
      reader.finish();
      takeFormula(reader, scene->shafts[n], "inertia", i, i);
      continue;
    }
    ShaftInertia inertia = readShaftInertia(reader);
    numbers(i, i) = inertia.mean;
    least[n] = inertia.least;
    is_constant = is_constant && inertia.harmonics.empty();
    scene->inertia_harmonics[n] = std::move(inertia.harmonics);
  }
  if (is_constant) scene->inertia_harmonics.clear();
  forEachCoupling(root, scene->shafts,
                  [&](int i, int j, const ParameterTree& value, const std::string& path) {
                    if (!isFormula(&value)) {
                      numbers(i, j) = numbers(j, i) =
                          ParameterReader::toNumber(value, path, Range::any("kg m^2"));
                      return;
                    }
                    const ParameterTree tree = ParameterTree::dictionary({{"value", value}});
                    ParameterReader reader(tree, "");
                    try {
                      takeFormula(reader, path, "value", i, j);
                    } catch (const SceneError& error) {
                      throw SceneError(path, error.message());
                    }
                  });
  if (!has_formulas) checkCouplings(root, least, *scene);
  // (Numbers come into the graph only beside formulas, whose constants they would be.)
  if (!formulas.empty()) takeFormulas(formulas, scene);
  return has_formulas;
}

}  // namespace variator_sim
