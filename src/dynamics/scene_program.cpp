#include "dynamics/scene_program.h"

#include <cmath>

#include "expression/c_code.h"
#include "model/formula_laws.h"
#include "variator_sim/expression/state_derivatives.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;

SceneProgram::SceneProgram(const Scene& scene, const SceneProgram* like)
    : scene_(scene), S(scene.shaftCount()) {
  if (like != nullptr) {
    copyPrograms(*like);
    return;
  }
  requireOwnFormulas(scene);
  Graph& graph = *scene.graph;
  const std::vector<Node> rate = sumTorques(scene, &Torque::rates);
  torque_ = Program(graph, sumTorques(scene, &Torque::torques));
  rate_ = Program(graph, rate);
  makeRows(rate);
  makePartials(rate);
  for (const auto& table : graph.tables()) tables_.push_back(table.get());
  for (const auto& table : graph.tables2()) tables2_.push_back(table.get());
}

void SceneProgram::copyPrograms(const SceneProgram& like) {
  for (const Part& part : parts()) {
    this->*part.program = like.*part.program;
    (this->*part.program).use(nullptr, nullptr);  // its constants belong to the other scene
  }
  tables_ = like.tables_;
  tables2_ = like.tables2_;
  partials_ = like.partials_;
  has_partials_ = like.has_partials_;
}

void SceneProgram::makeRows(const std::vector<Node>& rate) {
  Graph& graph = *scene_.graph;
  std::vector<Node> rows;
  std::vector<Node> velocities;
  std::vector<Node> accelerations;
  for (const ConstraintPtr& constraint : scene_.constraints) {
    const std::vector<Node>& row = constraint->row();
    // f or psi, and C
    const auto add_level = [&row](Node residual, std::vector<Node>& level) {
      level.push_back(residual);
      level.insert(level.end(), row.begin(), row.end() - 1);
    };
    if (constraint->order() == 1) add_level(constraint->function(), velocities);
    if (constraint->order() < 3) add_level(constraint->secondOrder(), accelerations);
    rows.insert(rows.end(), row.begin(), row.end());
  }
  std::vector<Node> rate_and_rows = rate;
  rate_and_rows.insert(rate_and_rows.end(), rows.begin(), rows.end());
  rows_ = Program(graph, rows);
  rate_and_rows_ = Program(graph, rate_and_rows);
  velocity_level_ = Program(graph, velocities);
  acceleration_level_ = Program(graph, accelerations);
  std::vector<Node> rate_and_level = rate;
  rate_and_level.insert(rate_and_level.end(), accelerations.begin(), accelerations.end());
  rate_and_level_ = Program(graph, rate_and_level);
}

void SceneProgram::makePartials(const std::vector<Node>& rate) {
  Graph& graph = *scene_.graph;
  using Kind = Partial::Kind;
  std::vector<Node> functions = rate;
  std::vector<Partial> partial_of;
  partial_of.reserve(static_cast<std::size_t>(S));
  for (int i = 0; i < S; ++i) partial_of.push_back({Kind::kRate, 0, i, 0});
  for (int m = 0; m < scene_.constraintCount(); ++m) {
    const ConstraintPtr& constraint = scene_.constraints[static_cast<std::size_t>(m)];
    if (constraint->order() == 3) return;
    functions.insert(functions.end(), constraint->row().begin(), constraint->row().end() - 1);
    functions.push_back(constraint->secondOrder());
    for (int i = 0; i < S; ++i) partial_of.push_back({Kind::kEntry, m, i, 0});
    partial_of.push_back({Kind::kResidual, m, 0, 0});
  }
  using expression::StateDerivatives;
  const auto entries = StateDerivatives::list(graph, functions, S);
  if (!entries) return;
  const std::vector<Node> outputs = StateDerivatives::nodesOf(*entries);
  if (!isWritable(graph, outputs)) return;
  partials_program_ = Program(graph, outputs);
  for (const StateDerivatives::Entry& entry : *entries) {
    partials_.push_back(partial_of[static_cast<std::size_t>(entry.node)]);
    partials_.back().q = entry.q;
  }
  has_partials_ = true;
}

bool Program::agreesWithInterpreter(const StateView& state) const {
  const double* const interpreted = tape_.evaluate(state);
  const double* const computed = evaluate(state);
  return std::equal(interpreted, interpreted + outputs_.size(), computed, areSameBits);
}

// --- machine code ----------------------------------------------------------------------------

const std::array<SceneProgram::Part, 8>& SceneProgram::parts() {
  static const std::array<Part, 8> parts = {
      {{"torque", &SceneProgram::torque_},
       {"rate", &SceneProgram::rate_},
       {"rows", &SceneProgram::rows_},
       {"rate_and_rows", &SceneProgram::rate_and_rows_},
       {"velocity_level", &SceneProgram::velocity_level_},
       {"acceleration_level", &SceneProgram::acceleration_level_},
       {"rate_and_level", &SceneProgram::rate_and_level_},
       {"partials", &SceneProgram::partials_program_}}};
  return parts;
}

template <class IsWanted>
void SceneProgram::writeParts(const IsWanted& is_wanted, std::string* source) const {
  const Graph& graph = *scene_.graph;
  expression::CodeStructure before;
  for (const Part& part : parts()) {
    const std::vector<Node>& outputs = (this->*part.program).outputs();
    if (is_wanted(part)) {
      *source += writeFunction(graph, part.name, outputs, before.constants.size());
    }
    addStructure(graph, outputs, &before);
  }
}

std::string SceneProgram::writeSource(const MoreCode& more) const {
  const Graph& graph = *scene_.graph;
  if (!isWritable(graph, rate_and_rows_.outputs()) || !isWritable(graph, torque_.outputs())) {
    return "";
  }
  std::string source = expression::prelude();
  source += std::string(KernelLibrary::kUnits) + KernelLibrary::kFirstUnit;
  writeParts([](const Part& /*part*/) { return true; }, &source);
  source += KernelLibrary::kEndOfUnit;
  return source + more.source;
}

void SceneProgram::noteStructure() {
  structure_ = {};
  for (const Part& part : parts()) {
    addStructure(*scene_.graph, (this->*part.program).outputs(), &structure_);
  }
}

bool SceneProgram::use(const std::shared_ptr<KernelLibrary>& library) {
  host_ = {structure_.constants.data(), tables_.data(), tables2_.data(),
           [](const void* table, int order, double x) {
             return static_cast<const Table*>(table)->derivative(order, x);
           },
           [](const void* table, int order_x, int order_y, double x, double y) {
             return static_cast<const Table2*>(table)->derivative({order_x, order_y}, x, y);
           }};
  bool is_there = true;
  for (const Part& part : parts()) {
    const auto kernel = reinterpret_cast<Kernel>(library->find(part.name));
    (this->*part.program).use(kernel, &host_);
    is_there = is_there && kernel != nullptr;
  }
  library_ = library;
  if (!is_there) interpret();
  return is_there;
}

void SceneProgram::interpret() {
  for (const Part& part : parts()) (this->*part.program).use(nullptr, nullptr);
  library_ = nullptr;
}

bool SceneProgram::agreesWithInterpreter() {
  // Unrelated states, some of them near 0.
  for (int n = 0; n < 16; ++n) {
    constexpr int kMost = std::max(kMaxShafts, kMaxInputs);
    double values[6][kMost];
    for (int i = 0; i < kMost; ++i) {
      for (int part = 0; part < 6; ++part) {
        values[part][i] =
            (n % 4 == 3 ? 1e-3 : 20.0) * std::sin(1.0 + 7.3 * n + 3.1 * part + 1.7 * i);
      }
    }
    const StateView state{0.37 * n,  values[0], values[1], values[2],
                          values[3], values[4], values[5]};
    for (const Part& part : parts()) {
      if (!(this->*part.program).agreesWithInterpreter(state)) return false;
    }
  }
  return true;
}

std::string SceneProgram::loadMachineCode(const MoreCode& more, KernelLibrary::Missing missing,
                                          bool* compiled) {
  const std::string source = writeSource(more);
  if (source.empty()) return "a law reads a function that is not a formula";
  std::string reason;
  noteStructure();
  const auto library = KernelLibrary::load(source, missing, &reason, [&](const auto& made) {
    const bool is_right =
        use(made) && agreesWithInterpreter() && (more.source.empty() || more.use(made));
    if (!is_right) interpret();
    return is_right;
  });
  *compiled = library != nullptr && library->wasCompiled();
  return reason;
}

bool SceneProgram::shareMachineCode(const SceneProgram& other) {
  if (other.library_ == nullptr) return false;
  noteStructure();
  return structure_.words == other.structure_.words && use(other.library_);
}

}  // namespace variator_sim
