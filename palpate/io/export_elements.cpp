// SPDX-License-Identifier: Apache-2.0
// Linear tetrahedra for simulators that have no others.
#include <algorithm>
#include <array>

#include "palpate/core/error.hpp"
#include "palpate/io/exporters.hpp"

namespace palpate::io {
namespace {

using Child = std::array<int, 4>;
constexpr int edges[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};

template <class At>
double six_volumes(const Child& child, const At& at) {
  const Vec3 a = at(child[0]), b = at(child[1]), c = at(child[2]), d = at(child[3]);
  return (b - a).cross(c - a).dot(d - a);
}

/// Turned as in a straight tetrahedron, so that a folded one is seen.
Child turned(Child child) {
  const auto straight = [](int k) {
    const auto corner = [](int c) { return c == 0 ? Vec3(Vec3::Zero()) : Vec3(Vec3::Unit(c - 1)); };
    return k < 4 ? corner(k) : Vec3(0.5 * (corner(edges[k - 4][0]) + corner(edges[k - 4][1])));
  };
  if (six_volumes(child, straight) < 0) std::swap(child[2], child[3]);
  return child;
}

/// The four at the corners, and four around one of the three diagonals of the octahedron between them.
std::array<Child, 8> children(int diagonal) {
  constexpr int ends[3][2] = {{4, 9}, {5, 7}, {6, 8}};
  constexpr int rings[3][4] = {{5, 6, 7, 8}, {4, 6, 9, 8}, {4, 5, 9, 7}};
  std::array<Child, 8> out = {{{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3}}};
  for (std::size_t i = 0; i < 4; ++i) out[4 + i] = {ends[diagonal][0], ends[diagonal][1], rings[diagonal][i], rings[diagonal][(i + 1) % 4]};
  for (Child& one : out) one = turned(one);
  return out;
}

/// Of the shortest diagonal with which nothing folds; nothing where every one does.
const std::array<Child, 8>* best_children(const std::array<std::array<Child, 8>, 3>& all, const std::array<Vec3, 10>& nodes) {
  const auto at = [&](int k) { return nodes[static_cast<std::size_t>(k)]; };
  const std::array<Child, 8>* best = nullptr;
  double shortest = 0;
  for (const auto& one : all) {
    const double length = (at(one[4][0]) - at(one[4][1])).norm() + (at(one[5][0]) - at(one[5][1])).norm();
    const bool folds = std::any_of(one.begin(), one.end(), [&](const Child& child) { return !(six_volumes(child, at) > 0); });
    if (!folds && (best == nullptr || length < shortest)) {
      best = &one;
      shortest = length;
    }
  }
  return best;
}

ExportModel split_in_eight(const ExportModel& model) {
  ExportModel linear = model;
  const Eigen::Index count = model.mesh.tetrahedra.rows();
  const std::array<std::array<Child, 8>, 3> all = {children(0), children(1), children(2)};
  linear.mesh.tetrahedra.resize(8 * count, 4);
  const auto nodes_of = [&](Eigen::Index t) {
    std::array<Vec3, 10> nodes;
    for (int k = 0; k < 10; ++k) nodes[static_cast<std::size_t>(k)] = linear.mesh.nodes_m.row(model.mesh.tetrahedra(t, k));
    return nodes;
  };
  // Strongly curved edges may fold a child: they are made straight, which concerns neighbours too.
  bool straightened = true;
  for (int round = 0; straightened; ++round) {
    if (round > 20) throw Error("its curved elements cannot be split; write their corners alone", "--elements");
    straightened = false;
    for (Eigen::Index t = 0; t < count; ++t) {
      if (best_children(all, nodes_of(t))) continue;
      straightened = true;
      const auto tet = model.mesh.tetrahedra.row(t);
      for (int e = 0; e < 6; ++e)
        linear.mesh.nodes_m.row(tet(4 + e)) = 0.5 * (linear.mesh.nodes_m.row(tet(edges[e][0])) + linear.mesh.nodes_m.row(tet(edges[e][1])));
    }
  }
  for (Eigen::Index t = 0; t < count; ++t) {
    const auto& best = *best_children(all, nodes_of(t));
    for (int c = 0; c < 8; ++c)
      for (int k = 0; k < 4; ++k)
        linear.mesh.tetrahedra(8 * t + c, k) = model.mesh.tetrahedra(t, best[static_cast<std::size_t>(c)][static_cast<std::size_t>(k)]);
  }
  linear.region.clear();
  for (const int region : model.region) linear.region.insert(linear.region.end(), 8, region);
  return linear;
}

}  // namespace

std::vector<Index> corner_places(const TetMesh& mesh) {
  std::vector<Index> place(static_cast<std::size_t>(mesh.nodes_m.rows()), -1);
  for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t)
    for (int k = 0; k < 4; ++k) place[static_cast<std::size_t>(mesh.tetrahedra(t, k))] = 0;
  Index count = 0;
  for (Index& one : place)
    if (one == 0) one = count++;
  return place;
}

ExportModel with_linear_elements(const ExportModel& model, LinearElements elements) {
  if (model.mesh.tetrahedra.cols() == 4) return model;
  if (elements == LinearElements::split) return split_in_eight(model);
  ExportModel linear = model;
  const Index nodes = static_cast<Index>(model.mesh.nodes_m.rows());
  const std::vector<Index> place = corner_places(model.mesh);
  const auto place_of = [&](Index node) { return place[static_cast<std::size_t>(node)]; };
  std::vector<std::pair<Index, Index>> ends(static_cast<std::size_t>(nodes), {-1, -1});
  for (Eigen::Index t = 0; t < model.mesh.tetrahedra.rows(); ++t)
    for (int e = 0; e < 6; ++e)
      ends[static_cast<std::size_t>(model.mesh.tetrahedra(t, 4 + e))] = {model.mesh.tetrahedra(t, edges[e][0]),
                                                                         model.mesh.tetrahedra(t, edges[e][1])};
  linear.mesh.nodes_m.resize(*std::max_element(place.begin(), place.end()) + 1, 3);
  for (Index i = 0; i < nodes; ++i)
    if (place_of(i) >= 0) linear.mesh.nodes_m.row(place_of(i)) = model.mesh.nodes_m.row(i);
  linear.mesh.tetrahedra.resize(model.mesh.tetrahedra.rows(), 4);
  for (Eigen::Index t = 0; t < model.mesh.tetrahedra.rows(); ++t)
    for (int k = 0; k < 4; ++k) linear.mesh.tetrahedra(t, k) = place_of(model.mesh.tetrahedra(t, k));
  linear.fixed.clear();
  for (const Index node : model.fixed)
    if (place_of(node) >= 0) linear.fixed.push_back(place_of(node));
  linear.sliding.clear();
  for (const auto& [node, axis] : model.sliding)
    if (place_of(node) >= 0) linear.sliding.emplace_back(place_of(node), axis);
  std::map<Index, Vec3> forces;
  const auto add = [&](Index node, const Vec3& force) {
    auto [it, fresh] = forces.emplace(place_of(node), force);
    if (!fresh) it->second += force;
  };
  for (const auto& [node, force] : model.forces_n) {
    const auto& [a, b] = ends[static_cast<std::size_t>(node)];
    if (place_of(node) >= 0) {
      add(node, force);
    } else if (a >= 0) {
      add(a, 0.5 * force);
      add(b, 0.5 * force);
    }
  }
  linear.forces_n.assign(forces.begin(), forces.end());
  return linear;
}

}  // namespace palpate::io
