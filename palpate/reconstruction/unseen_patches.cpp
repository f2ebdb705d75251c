// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/unseen_patches.hpp"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <vector>

#include "palpate/geometry/union_find.hpp"

namespace palpate::reconstruction {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

constexpr double stands_within_reach = 0.1;   // of the reach, above the support
constexpr int rounds = 3;              // edges that were stretched count anew
constexpr double shortest_edge = 0.2;  // of the reach: marching leaves slivers, which would count without bound
constexpr int halvings = 4;            // of a way that ends in free space

/// Which unknown and which row of `differences` belong to a vertex; -1 where none does.
struct Places {
  std::vector<Index> vertices;  ///< that move
  std::vector<Index> unknown;   ///< a vertex
  std::vector<Index> row;       ///< a vertex: those that move and their neighbours
  Index rows = 0;
};

/// A triangle's vertices of which one moves already.
template <class F>
void around_those_that_move(const TriMesh& surface, const std::vector<Index>& unknown, F visit) {
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return static_cast<std::size_t>(surface.triangles(t, k)); };
    if (unknown[corner(0)] < 0 && unknown[corner(1)] < 0 && unknown[corner(2)] < 0) continue;
    for (int k = 0; k < 3; ++k) visit(corner(k));
  }
}

/// A part that is far from every facet has no shape of least bending but a point.
void leave_alone_what_nothing_holds(const TriMesh& surface, std::vector<Index>& far) {
  geometry::UnionFind parts(surface.vertices_m.rows());
  for (Index t = 0; t < surface.triangles.rows(); ++t)
    for (int k = 1; k < 3; ++k) parts.join(surface.triangles(t, 0), surface.triangles(t, k));
  std::vector<char> held(far.size(), 0);
  for (std::size_t v = 0; v < far.size(); ++v)
    if (far[v] < 0) held[static_cast<std::size_t>(parts.root(static_cast<Index>(v)))] = 1;
  for (std::size_t v = 0; v < far.size(); ++v)
    if (!held[static_cast<std::size_t>(parts.root(static_cast<Index>(v)))]) far[v] = -1;
}

Places places_of(const TriMesh& surface, const Grid& facets, double reach_m, const std::optional<Plane>& support) {
  const auto count = static_cast<std::size_t>(surface.vertices_m.rows());
  std::vector<Index> far(count, -1);
  for (std::size_t v = 0; v < count; ++v) {
    const Vec3 p = surface.vertices_m.row(static_cast<Index>(v)).transpose();
    if (support && support->normal.dot(p - support->point_m) < stands_within_reach * reach_m) continue;
    if (!facets.any_around(p, [&](Index i) { return (facets.point(i) - p).squaredNorm() < reach_m * reach_m; })) far[v] = 0;
  }
  leave_alone_what_nothing_holds(surface, far);
  Places out;
  out.unknown.assign(count, -1);
  out.row.assign(count, -1);
  around_those_that_move(surface, far, [&](std::size_t v) {
    if (out.unknown[v] >= 0) return;
    out.unknown[v] = static_cast<Index>(out.vertices.size());
    out.vertices.push_back(static_cast<Index>(v));
  });
  around_those_that_move(surface, out.unknown, [&](std::size_t v) {
    if (out.row[v] < 0) out.row[v] = out.rows++;
  });
  return out;
}

/// Differences of vertices from their neighbours, near ones counting more (Fujiwara 1995), as they stand: of those that move, a
/// matrix of the unknowns; of those that do not, what they say.
void differences(const TriMesh& surface, const Places& places, double shortest_m, Sparse& of_unknowns, MatrixX& of_the_rest) {
  std::vector<Eigen::Triplet<double>> entries;
  of_the_rest = MatrixX::Zero(places.rows, 3);
  const auto add = [&](Index row, Index vertex, double weight) {
    const Index u = places.unknown[static_cast<std::size_t>(vertex)];
    if (u >= 0) entries.emplace_back(row, u, weight);
    else of_the_rest.row(row) += weight * surface.vertices_m.row(vertex);
  };
  for (Index t = 0; t < surface.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {  // every edge comes once from either end
      const Index a = surface.triangles(t, k), b = surface.triangles(t, (k + 1) % 3);
      const Index row = places.row[static_cast<std::size_t>(a)];
      if (row < 0) continue;
      const double weight = 1 / std::max(shortest_m, (surface.vertices_m.row(a) - surface.vertices_m.row(b)).norm());
      add(row, b, weight);
      add(row, a, -weight);
    }
  of_unknowns.resize(places.rows, static_cast<Index>(places.vertices.size()));
  of_unknowns.setFromTriplets(entries.begin(), entries.end());
}

}  // namespace

void smooth_unseen_patches(TriMesh& surface, const Grid& facets, double reach_m, const std::function<bool(const Vec3&)>& free,
                          const std::optional<Plane>& support) {
  const Places places = places_of(surface, facets, reach_m, support);
  if (places.vertices.empty()) return;
  Sparse moving;
  MatrixX still;
  for (int round = 0; round < rounds; ++round) {
    differences(surface, places, shortest_edge * reach_m, moving, still);
    const Sparse bending = moving.transpose() * moving;
    Eigen::ConjugateGradient<Sparse, Eigen::Lower, Eigen::IncompleteCholesky<double>> solver;
    solver.setTolerance(1e-6);
    solver.setMaxIterations(1000);  // large patches are good enough by then
    solver.compute(bending);
    const MatrixX from = surface.vertices_m(places.vertices, Eigen::all);
    const MatrixX found = solver.solveWithGuess(-(moving.transpose() * still).eval(), from);
    if (!found.allFinite()) return;
    for (std::size_t i = 0; i < places.vertices.size(); ++i) {
      const Vec3 was = from.row(static_cast<Index>(i)).transpose();
      Vec3 to = found.row(static_cast<Index>(i)).transpose();
      if (support) to += std::max(0.0, support->normal.dot(support->point_m - to)) * support->normal;
      for (int k = 0; free && k < halvings && free(to); ++k) to = 0.5 * (was + to);
      if (!free || !free(to)) surface.vertices_m.row(places.vertices[i]) = to.transpose();
    }
  }
}

}  // namespace palpate::reconstruction
