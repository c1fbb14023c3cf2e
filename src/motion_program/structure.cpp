/// Which unknowns and equations of a motion have anything to do with each other.
#include <algorithm>
#include <boost/graph/adjacency_list.hpp>
#include <boost/graph/connected_components.hpp>
#include <boost/graph/cuthill_mckee_ordering.hpp>
#include <numeric>
#include <set>

#include "motion_program/motion_program.h"

namespace variator_sim {

using expression::Node;
using expression::slotOf;
using expression::Source;

namespace {

using Net = boost::adjacency_list<boost::setS, boost::vecS, boost::undirectedS,
                                  boost::property<boost::vertex_color_t, boost::default_color_type,
                                                  boost::property<boost::vertex_degree_t, int>>>;

}  // namespace

/// True where J_ij of two shafts may not be 0.
bool MotionProgram::areCoupled(const Scene& scene, int i, int j) const {
  if (i == j) return true;
  if (IS_GENERAL == 0) return scene.inertia(i, j) != 0.0;
  const int n = S * i + j;
  return !scene.graph->isConstant(formulas_.pair[static_cast<std::size_t>(n)], 0.0);
}

/// Lists the blocks of unknowns that constraints or inertia join, and the places of their matrices.
void MotionProgram::listBlocks(const Scene& scene) {
  Net net(static_cast<std::size_t>(SIZE));
  const auto join = [&net](int a, int b) {
    boost::add_edge(static_cast<std::size_t>(a), static_cast<std::size_t>(b), net);
  };
  for (int i = 0; i < S; ++i) {
    for (int j = 0; j < i; ++j) {
      if (areCoupled(scene, i, j)) join(i, j);
    }
  }
  for (int p = 0; p < K; ++p) {
    for (int e = entry_begin[p]; e < entry_begin[p + 1]; ++e) join(S + p, entry_shaft[e]);
  }
  std::vector<int> block_of(static_cast<std::size_t>(SIZE));
  const int blocks = boost::connected_components(net, block_of.data());
  const bool are_whole = IS_CURVED != 0 || HOLDS > 0;
  entry_place.values.resize(entry_shaft.values.size());
  SCENE_MATRIX = 0;
  for (int b = 0; b < blocks; ++b) {
    std::vector<int> unknowns;
    for (int n = 0; n < SIZE; ++n) {
      if (block_of[static_cast<std::size_t>(n)] == b) unknowns.push_back(n);
    }
    const auto constraints =
        std::find_if_not(unknowns.begin(), unknowns.end(), [this](int n) { return n < S; });
    const auto rows = are_whole ? unknowns.end() - unknowns.begin() : unknowns.end() - constraints;
    if (rows == 0) continue;
    for (auto it = constraints; it != unknowns.end(); ++it) {
      for (int e = entry_begin[*it - S]; e < entry_begin[*it - S + 1]; ++e) {
        entry_place.values[static_cast<std::size_t>(e)] = static_cast<int>(
            std::find(unknowns.begin(), constraints, entry_shaft[e]) - unknowns.begin());
      }
    }
    block_begin.values.push_back(static_cast<int>(block_unknown.values.size()));
    block_shafts.values.push_back(static_cast<int>(constraints - unknowns.begin()));
    block_matrix.values.push_back(SCENE_MATRIX);
    block_unknown.values.insert(block_unknown.values.end(), unknowns.begin(), unknowns.end());
    SCENE_MATRIX += static_cast<int>(rows * rows);
  }
  BLOCKS = static_cast<int>(block_begin.values.size());
  block_begin.values.push_back(static_cast<int>(block_unknown.values.size()));
  SCENE_MATRIX = std::max(1, SCENE_MATRIX);
}

/// Links unknowns to the residuals of stages that they move. The formulas of `nodes`, in the
/// `residuals`, do so along the directions of every shaft and state that they read.
void MotionProgram::linkFormulas(const Scene& scene, const std::vector<Node>& nodes,
                                 const std::vector<int>& residuals, Links* links) const {
  for (const int n : scene.graph->listReachable(nodes)) {
    const auto& entry = scene.graph->entry({n});
    if (entry.operation != expression::Operation::kVariable) continue;
    links->read.insert(entry.slot);
    for (int u = 0; u < SIZE + STATES; ++u) {
      const bool is_own =
          u < S ? entry.slot == slotOf(Source::kAngle, u) ||
                      entry.slot == slotOf(Source::kVelocity, u) ||
                      entry.slot == slotOf(Source::kAcceleration, u)
                : u >= SIZE && entry.slot == slotOf(Source::kInput, state_input[u - SIZE]);
      if (is_own)
        links->moved[static_cast<std::size_t>(u)].insert(residuals.begin(), residuals.end());
    }
  }
}

MotionProgram::Links MotionProgram::findLinks(const Scene& scene) const {
  Links links;
  const int unknowns = SIZE + STATES;
  links.moved.resize(static_cast<std::size_t>(unknowns));
  const auto link = [&links](int unknown, int residual) {
    links.moved[static_cast<std::size_t>(unknown)].insert(residual);
  };
  const auto at = [](const std::vector<Node>& nodes, int n) {
    return nodes[static_cast<std::size_t>(n)];
  };
  for (int i = 0; i < S; ++i) {
    std::vector<Node> force = {at(formulas_.torque, i), at(formulas_.inertial_torque, i)};
    if (IS_GENERAL == 0) force.push_back(at(formulas_.inertia, i));
    for (int j = 0; j < S; ++j) {
      if (areCoupled(scene, i, j)) link(j, i);
      if (IS_GENERAL != 0) force.push_back(at(formulas_.pair, S * i + j));
    }
    linkFormulas(scene, force, {i}, &links);
  }
  for (int p = 0; p < K; ++p) {
    std::vector<int> moved = {S + p};
    std::vector<Node> rows;
    link(S + p, S + p);
    for (int e = entry_begin[p]; e < entry_begin[p + 1]; ++e) {
      const int i = entry_shaft[e];
      moved.push_back(i);
      rows.insert(rows.end(), {at(formulas_.entry, S * p + i), at(formulas_.direction, S * p + i)});
      link(S + p, i);
      link(i, S + p);
    }
    linkFormulas(scene, {at(formulas_.residual, p)}, {S + p}, &links);
    linkFormulas(scene, rows, moved, &links);
  }
  for (int n = 0; n < STATES; ++n) {
    link(SIZE + n, SIZE + n);
    linkFormulas(scene, {at(formulas_.rate, n)}, {SIZE + n}, &links);
  }
  return links;
}

/// Returns all unknowns in an order in which linked ones are near to each other. Constraints come
/// right behind their shafts: pivots of shafts are inertias, however small C is.
std::vector<std::size_t> MotionProgram::orderUnknowns(const Links& links) const {
  const std::size_t unknowns = links.moved.size();
  const auto isConstraint = [this](std::size_t u) {
    return static_cast<int>(u) >= S && static_cast<int>(u) < SIZE;
  };
  Net net(unknowns);
  for (std::size_t u = 0; u < unknowns; ++u) {
    for (const int residual : links.moved[u]) {
      const auto other = static_cast<std::size_t>(residual);
      if (other != u && !isConstraint(u) && !isConstraint(other)) boost::add_edge(u, other, net);
    }
  }
  for (int p = 0; p < K; ++p) {
    for (int e = entry_begin[p] + 1; e < entry_begin[p + 1]; ++e) {
      boost::add_edge(static_cast<std::size_t>(entry_shaft[e - 1]),
                      static_cast<std::size_t>(entry_shaft[e]), net);
    }
  }
  std::vector<std::size_t> near(unknowns);
  boost::cuthill_mckee_ordering(net, near.rbegin(), boost::get(boost::vertex_color, net),
                                boost::make_degree_map(net));
  std::vector<std::size_t> order;
  std::set<std::size_t> left;  // constraints
  for (int p = 0; p < K; ++p) left.insert(static_cast<std::size_t>(S + p));
  const auto isPlaced = [&order](int shaft) {
    return std::find(order.begin(), order.end(), static_cast<std::size_t>(shaft)) != order.end();
  };
  for (const std::size_t u : near) {
    if (isConstraint(u)) continue;
    order.push_back(u);
    for (auto it = left.begin(); it != left.end();) {
      const std::size_t p = *it - static_cast<std::size_t>(S);
      const auto shafts = entry_shaft.values.begin();
      if (!std::all_of(shafts + entry_begin.values[p], shafts + entry_begin.values[p + 1],
                       isPlaced)) {
        ++it;
        continue;
      }
      order.push_back(*it);
      it = left.erase(it);
    }
  }
  return order;
}

/// Lists the links, the places of unknowns in matrices, and the envelope of their rows.
void MotionProgram::listPlaces(const Links& links) {
  const std::size_t unknowns = links.moved.size();
  link_begin.values.push_back(0);
  for (const std::set<int>& moved : links.moved) {
    linked.values.insert(linked.values.end(), moved.begin(), moved.end());
    link_begin.values.push_back(static_cast<int>(linked.values.size()));
  }
  const std::vector<std::size_t> order = orderUnknowns(links);
  place_of.values.resize(unknowns);
  for (std::size_t n = 0; n < unknowns; ++n) place_of.values[order[n]] = static_cast<int>(n);
  envelope_begin.values.resize(unknowns);
  std::iota(envelope_begin.values.begin(), envelope_begin.values.end(), 0);
  envelope_end.values.resize(unknowns);
  std::iota(envelope_end.values.begin(), envelope_end.values.end(), 1);
  for (std::size_t u = 0; u < unknowns; ++u) {
    for (const int residual : links.moved[u]) {
      const auto row = static_cast<std::size_t>(place_of[residual]);
      int& begin = envelope_begin.values[row];
      int& end = envelope_end.values[row];
      begin = std::min(begin, place_of.values[u]);
      end = std::max(end, place_of.values[u] + 1);
    }
  }
}

/// Lists the directions that can be differentiated along at once, since no residual is moved by two
/// of them.
void MotionProgram::listGroups(const Links& links) {
  std::vector<std::set<int>> taken;  // the residuals that each group moves
  int first = 0;                     // the first group of epsilon, omega, phi or z
  const Source kinds[] = {Source::kAcceleration, Source::kVelocity, Source::kAngle};
  for (int q = 0; q < 3 * S + STATES; ++q) {
    const int unknown = q < 3 * S ? q % S : SIZE + q - 3 * S;
    const std::set<int>& moved = links.moved[static_cast<std::size_t>(unknown)];
    const int slot =
        q < 3 * S ? slotOf(kinds[q / S], q % S) : slotOf(Source::kInput, state_input[q - 3 * S]);
    if (q % S == 0 && q <= 3 * S) first = static_cast<int>(taken.size());
    group_of.values.push_back(-1);
    if (links.read.count(slot) == 0 || (q < S && READS_ACCELERATIONS == 0)) continue;
    const auto overlaps = [&](const std::set<int>& other) {
      return std::any_of(moved.begin(), moved.end(), [&](int it) { return other.count(it) != 0; });
    };
    const auto group = std::find_if_not(taken.begin() + first, taken.end(), overlaps);
    group_of.values.back() = static_cast<int>(group - taken.begin());
    if (group == taken.end())
      taken.push_back(moved);
    else
      group->insert(moved.begin(), moved.end());
  }
  GROUPS = static_cast<int>(taken.size());
}

}  // namespace variator_sim
