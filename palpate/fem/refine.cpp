// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "palpate/core/error.hpp"
#include "palpate/fem/discretisation.hpp"
#include "palpate/fem/tetrahedron.hpp"

namespace palpate::fem {
namespace {

using Edge = std::array<Index, 2>;

class Bisection {
 public:
  explicit Bisection(const TetMesh& mesh) {
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i) nodes_.push_back(mesh.nodes_m.row(i).transpose());
    around_.resize(nodes_.size());
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e)
      add({mesh.tetrahedra(e, 0), mesh.tetrahedra(e, 1), mesh.tetrahedra(e, 2), mesh.tetrahedra(e, 3)});
  }

  std::size_t size() const { return tets_.size(); }
  std::size_t node_count() const { return nodes_.size(); }
  bool alive(std::size_t t) const { return alive_[t]; }
  const std::array<Index, 4>& tet(std::size_t t) const { return tets_[t]; }
  const Vec3& node(Index i) const { return nodes_[i]; }

  // Ties are broken by node numbers, so that neighbours agree on which edge is longest.
  std::tuple<double, Index, Index> rank(const Edge& e) const {
    return {(nodes_[e[0]] - nodes_[e[1]]).squaredNorm(), e[0], e[1]};
  }

  Edge longest(std::size_t t) const {
    Edge best{-1, -1};
    for (const auto& k : kTetEdges) {
      const Edge e{std::min(tets_[t][k[0]], tets_[t][k[1]]), std::max(tets_[t][k[0]], tets_[t][k[1]])};
      if (best[0] < 0 || rank(e) > rank(best)) best = e;
    }
    return best;
  }

  // Halves an edge once it is the longest of all its tetrahedra; longer neighbours go first.
  void halve(const Edge& edge) {
    for (;;) {
      const std::vector<std::size_t> star = tetrahedra_of(edge);
      if (star.empty()) return;
      Edge longer = edge;
      for (std::size_t t : star)
        if (rank(longest(t)) > rank(longer)) longer = longest(t);
      if (longer != edge) {
        halve(longer);
        continue;
      }
      const Index middle = static_cast<Index>(nodes_.size());
      nodes_.push_back(0.5 * (nodes_[edge[0]] + nodes_[edge[1]]));
      around_.emplace_back();
      parents.push_back(edge);
      for (std::size_t t : star) {
        alive_[t] = false;
        for (Index replaced : edge) {
          std::array<Index, 4> child = tets_[t];
          std::replace(child.begin(), child.end(), replaced, middle);  // keeps the orientation
          add(child);
        }
      }
      return;
    }
  }

  std::vector<Edge> parents;

 private:
  void add(const std::array<Index, 4>& t) {
    for (Index node : t) around_[node].push_back(tets_.size());
    tets_.push_back(t);
    alive_.push_back(true);
  }

  std::vector<std::size_t> tetrahedra_of(const Edge& e) {
    auto& list = around_[e[0]];
    std::erase_if(list, [&](std::size_t t) { return !alive_[t]; });
    std::vector<std::size_t> star;
    for (std::size_t t : list)
      if (std::find(tets_[t].begin(), tets_[t].end(), e[1]) != tets_[t].end()) star.push_back(t);
    return star;
  }

  std::vector<Vec3> nodes_;
  std::vector<std::array<Index, 4>> tets_;
  std::vector<bool> alive_;
  std::vector<std::vector<std::size_t>> around_;
};

}  // namespace

RefinedMesh refine_near(const TetMesh& mesh, const Vec3& centre_m, double radius_m, double edge_m, double growth,
                        Index node_limit) {
  return refine_near(
      mesh, [&](const Vec3& x) { return (x - centre_m).norm() - radius_m; }, edge_m, growth, node_limit);
}

RefinedMesh refine_near(const TetMesh& mesh, const std::function<double(const Vec3&)>& distance_m, double edge_m,
                        double growth, Index node_limit) {
  if (mesh.tetrahedra.cols() != 4) throw Error("needs 4 columns (a linear mesh)", "mesh.tetrahedra");
  if (!(edge_m > 0)) throw Error("must be positive, is " + std::to_string(edge_m), "edge_m");
  Bisection work(mesh);
  // Children are appended, so one pass over the growing list meets every tetrahedron.
  for (std::size_t t = 0; t < work.size(); ++t) {
    while (work.alive(t) && work.node_count() < static_cast<std::size_t>(node_limit)) {
      const Edge edge = work.longest(t);
      double distance = std::numeric_limits<double>::infinity();
      for (Index node : work.tet(t)) distance = std::min(distance, distance_m(work.node(node)));
      const double allowed = edge_m + growth * std::max(0.0, distance);
      if ((work.node(edge[0]) - work.node(edge[1])).norm() <= allowed) break;
      work.halve(edge);
    }
  }
  RefinedMesh out;
  out.parents = work.parents;
  out.mesh.nodes_m.resize(static_cast<Index>(work.node_count()), 3);
  for (Index i = 0; i < out.mesh.nodes_m.rows(); ++i) out.mesh.nodes_m.row(i) = work.node(i).transpose();
  Index count = 0;
  for (std::size_t t = 0; t < work.size(); ++t) count += work.alive(t);
  out.mesh.tetrahedra.resize(count, 4);
  count = 0;
  for (std::size_t t = 0; t < work.size(); ++t)
    if (work.alive(t)) {
      for (int a = 0; a < 4; ++a) out.mesh.tetrahedra(count, a) = work.tet(t)[a];
      ++count;
    }
  return out;
}

std::vector<Index> extend_nodes(std::vector<Index> nodes, const RefinedMesh& refined) {
  std::set<Index> in(nodes.begin(), nodes.end());
  const Index first = static_cast<Index>(refined.mesh.nodes_m.rows()) - static_cast<Index>(refined.parents.size());
  for (std::size_t i = 0; i < refined.parents.size(); ++i)
    if (in.count(refined.parents[i][0]) && in.count(refined.parents[i][1])) {
      in.insert(first + static_cast<Index>(i));
      nodes.push_back(first + static_cast<Index>(i));
    }
  return nodes;
}

}  // namespace palpate::fem
