/// Sums and residuals of a scene's laws as formulas of its graph.
#pragma once

#include <cstddef>
#include <vector>

#include "variator_sim/errors.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Throws SceneError where a law was configured with another graph than the scene's.
inline void requireOwnFormulas(const Scene& scene) {
  for (const Law* law : scene.laws()) {
    if (&law->graph() == scene.graph.get()) continue;
    throw SceneError(law->name(), "is an element of another scene");
  }
}

/// The sums of Q over all torques, by shaft.
inline std::vector<expression::Node> sumTorques(const Scene& scene) {
  expression::Graph& graph = *scene.graph;
  std::vector<expression::Node> sums(scene.shafts.size(), graph.constant(0.0));
  for (const TorquePtr& element : scene.torques) {
    for (const auto& [shaft, term] : element->torques()) {
      expression::Node& sum = sums[static_cast<std::size_t>(shaft)];
      sum = graph.isConstant(sum, 0.0) ? term : graph.add(sum, term);
    }
  }
  return sums;
}

/// The rates of all variables but accelerations.
inline std::vector<expression::Graph::Rate> ratesOfAll(expression::Graph& graph,
                                                       const Scene& scene) {
  std::set<int> inputs;
  for (int i = 0; i < scene.inputCount(); ++i) inputs.insert(i);
  return expression::ratesOf(graph, scene.shaftCount(), inputs);
}

/// A way in which an element holds. Losses of constraint `load` are one, too: while they slide to
/// the side s = 1 or -1 their torque is
///     T = slope[k] lambda + s base[k],  that of the larger s T.
struct SceneHold {
  const Law* element = nullptr;
  Holding law;
  expression::Node slip;
  expression::Node torque;
  expression::Node side;
  expression::Node upper, lower, level, gap;  ///< 0 where there is none
  int load = -1;
  expression::Node slope[2], base[2];  ///< of losses
};

/// Returns them in the order of Scene::holdNames.
inline std::vector<SceneHold> collectHolds(const Scene& scene) {
  expression::Graph& graph = *scene.graph;
  const auto nodeOf = [&](const std::optional<Expression>& it) {
    return it ? it->in(graph) : graph.constant(0.0);
  };
  std::vector<SceneHold> holds;
  int load = -static_cast<int>(scene.torques.size());
  for (const Law* element : scene.laws()) {
    for (const Holding& law : element->holdings()) {
      holds.push_back({element,
                       law,
                       law.slip.in(graph),
                       law.torque.in(graph),
                       law.side.in(graph),
                       nodeOf(law.upper),
                       nodeOf(law.lower),
                       nodeOf(law.level),
                       nodeOf(law.gap),
                       std::max(load, -1),
                       {},
                       {}});
      for (int k = 0; k < 2 && law.losses; ++k) {
        holds.back().slope[k] = law.losses->slope[k].in(graph);
        holds.back().base[k] = law.losses->base[k].in(graph);
      }
    }
    ++load;
  }
  return holds;
}

/// first + sum cosine cos(order phi_i) + sine sin(order phi_i): J_i(phi_i) if `first` is the mean.
inline expression::Node addHarmonics(expression::Graph& graph, const Scene& scene, int i,
                                     expression::Node first) {
  if (scene.inertia_harmonics.empty()) return first;
  const Expression angle(graph, graph.variable(slotOf(expression::Source::kAngle, i)));
  Expression sum(graph, first);
  for (const InertiaHarmonic& it : scene.inertia_harmonics[static_cast<std::size_t>(i)]) {
    const Expression phase = it.order * angle;
    const Expression cosine = cos(phase);
    const Expression sine = sin(phase);
    sum += it.cosine * cosine;
    sum += it.sine * sine;
  }
  return sum.in(graph);
}

/// The entries of J, row by row.
inline std::vector<expression::Node> inertiaOf(expression::Graph& graph, const Scene& scene) {
  if (!scene.inertia_formulas.empty()) return scene.inertia_formulas;
  std::vector<expression::Node> J;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    for (int j = 0; j < scene.shaftCount(); ++j) {
      const expression::Node number = graph.constant(scene.inertia(i, j));
      J.push_back(i == j ? addHarmonics(graph, scene, i, number) : number);
    }
  }
  return J;
}

/// 1/2 J_i' omega_i of the inertia J_i of shaft i.
inline expression::Node connectionOf(expression::Graph& graph, expression::Node inertia, int i) {
  const expression::Node omega = graph.variable(slotOf(expression::Source::kVelocity, i));
  const expression::Node slope =
      graph.differentiate(inertia, slotOf(expression::Source::kAngle, i));
  return graph.multiply(graph.constant(0.5), graph.multiply(slope, omega));
}

/// An inertia whose entries may be formulas of angles, the time and inputs. With J' its total rate
/// and d_i = d/dphi_i, from T = 1/2 J_jk omega_j omega_k and the Christoffel symbols of J [5, 6]:
///     n_i = sum_j J'_ij omega_j - 1/2 sum_jk d_i J_jk omega_j omega_k
///     Gamma R omega = B J^-1 R
///     B_ij = Gamma_j,ik omega_k = 1/2 (J'_ij + sum_k (d_i J_jk - d_j J_ik) omega_k)
/// with the time as an angle of rate 1 that has no inertia.
class GeneralInertia {
 public:
  /// `graph`: the scene's, or a copy of it; has to outlive this.
  GeneralInertia(expression::Graph& graph, const Scene& scene)
      : graph_(graph),
        J_(inertiaOf(graph, scene)),
        S(scene.shaftCount()),
        rates_(ratesOfAll(graph, scene)) {}
  expression::Node entry(int i, int j) const { return J_.data()[S * i + j]; }
  expression::Node inertialTorque(int i) const {
    Expression sum = 0.0;
    for (int j = 0; j < S; ++j) {
      const Expression J_rate = rate(i, j);
      sum += J_rate * omega(j);
      for (int k = 0; k < S; ++k) {
        const Expression half = -0.5 * slope(i, j, k);
        sum += half * (omega(j) * omega(k));
      }
    }
    return sum.in(graph_);
  }
  expression::Node connection(int i, int j) const {
    Expression sum = rate(i, j);
    for (int k = 0; k < S; ++k) {
      const Expression turn = slope(i, j, k) - slope(j, i, k);
      sum += turn * omega(k);
    }
    return (0.5 * sum).in(graph_);
  }

 private:
  Expression omega(int i) const {
    return {graph_, graph_.variable(slotOf(expression::Source::kVelocity, i))};
  }
  /// J'_ij
  Expression rate(int i, int j) const {
    return {graph_, graph_.totalDerivative(entry(i, j), rates_)};
  }
  /// d_i J_jk
  Expression slope(int i, int j, int k) const {
    return {graph_, graph_.differentiate(entry(j, k), slotOf(expression::Source::kAngle, i))};
  }

  expression::Graph& graph_;
  const std::vector<expression::Node> J_;
  const int S;
  std::vector<expression::Graph::Rate> rates_;
};

}  // namespace variator_sim
