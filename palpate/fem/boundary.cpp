// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/boundary.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/fem/tetrahedron.hpp"

namespace palpate::fem {
namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

Eigen::SparseMatrix<double> three_columns(Index nodes, const Triplets& triplets) {
  Eigen::SparseMatrix<double> columns(3 * nodes, 3);
  columns.setFromTriplets(triplets.begin(), triplets.end());
  return columns;
}

std::array<Index, 3> sorted(Index a, Index b, Index c) {
  std::array<Index, 3> key{a, b, c};
  std::sort(key.begin(), key.end());
  return key;
}

// Midpoint nodes of a mesh by their edge's corners (empty for a linear mesh).
std::map<std::pair<Index, Index>, Index> midpoints(const TetMesh& mesh) {
  std::map<std::pair<Index, Index>, Index> middle;
  if (mesh.tetrahedra.cols() != 10) return middle;
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e)
    for (int k = 0; k < 6; ++k)
      middle[std::minmax(mesh.tetrahedra(e, kTetEdges[k][0]), mesh.tetrahedra(e, kTetEdges[k][1]))] =
          mesh.tetrahedra(e, 4 + k);
  return middle;
}

}  // namespace

Tetrahedra boundary_faces(const TetMesh& mesh, std::vector<Index>* elements) {
  const bool quadratic = mesh.tetrahedra.cols() == 10;
  struct Seen {
    Index element = 0;
    int face = 0;
    int count = 0;
  };
  std::map<std::array<Index, 3>, Seen> seen;
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e)
    for (int f = 0; f < 4; ++f) {
      const int* c = kTetFaces[f];
      Seen& s = seen[sorted(mesh.tetrahedra(e, c[0]), mesh.tetrahedra(e, c[1]), mesh.tetrahedra(e, c[2]))];
      if (s.count++ == 0) {
        s.element = e;
        s.face = f;
      }
    }
  std::vector<std::pair<Index, int>> outer;
  for (const auto& [key, s] : seen)
    if (s.count == 1) outer.emplace_back(s.element, s.face);
  std::sort(outer.begin(), outer.end());
  Tetrahedra faces(outer.size(), quadratic ? 6 : 3);
  for (std::size_t i = 0; i < outer.size(); ++i) {
    const auto [e, f] = outer[i];
    if (elements != nullptr) elements->push_back(e);
    const int* c = kTetFaces[f];
    for (int k = 0; k < 3; ++k) {
      faces(i, k) = mesh.tetrahedra(e, c[k]);
      if (quadratic) faces(i, 3 + k) = mesh.tetrahedra(e, edge_node(c[k], c[(k + 1) % 3]));
    }
  }
  return faces;
}

Triangles boundary_triangles(const TetMesh& mesh) {
  const Tetrahedra faces = boundary_faces(mesh);
  if (faces.cols() == 3) return faces;
  Triangles triangles(4 * faces.rows(), 3);
  for (Index f = 0; f < faces.rows(); ++f) {
    const auto n = faces.row(f);
    triangles.row(4 * f) << n(0), n(3), n(5);
    triangles.row(4 * f + 1) << n(3), n(1), n(4);
    triangles.row(4 * f + 2) << n(5), n(4), n(2);
    triangles.row(4 * f + 3) << n(3), n(4), n(5);
  }
  return triangles;
}

TetMesh to_quadratic(const TetMesh& mesh) {
  if (mesh.tetrahedra.cols() == 10) return mesh;
  if (mesh.tetrahedra.cols() != 4) throw Error("needs 4 columns", "mesh.tetrahedra");
  TetMesh out;
  out.tetrahedra.resize(mesh.tetrahedra.rows(), 10);
  std::map<std::pair<Index, Index>, Index> middle;
  std::vector<Vec3> added;
  const Index n = static_cast<Index>(mesh.nodes_m.rows());
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    for (int a = 0; a < 4; ++a) out.tetrahedra(e, a) = mesh.tetrahedra(e, a);
    for (int k = 0; k < 6; ++k) {
      const Index a = mesh.tetrahedra(e, kTetEdges[k][0]), b = mesh.tetrahedra(e, kTetEdges[k][1]);
      const auto [it, fresh] = middle.emplace(std::minmax(a, b), n + static_cast<Index>(added.size()));
      if (fresh) added.push_back(0.5 * (mesh.nodes_m.row(a) + mesh.nodes_m.row(b)).transpose());
      out.tetrahedra(e, 4 + k) = it->second;
    }
  }
  out.nodes_m.resize(n + static_cast<Index>(added.size()), 3);
  out.nodes_m.topRows(n) = mesh.nodes_m;
  for (std::size_t i = 0; i < added.size(); ++i) out.nodes_m.row(n + static_cast<Index>(i)) = added[i].transpose();
  return out;
}

TetMesh refine_uniform(const TetMesh& mesh) {
  if (mesh.tetrahedra.cols() != 4) throw Error("needs 4 columns (a linear mesh)", "mesh.tetrahedra");
  const TetMesh q = to_quadratic(mesh);
  TetMesh out;
  out.nodes_m = q.nodes_m;
  out.tetrahedra.resize(8 * mesh.tetrahedra.rows(), 4);
  // The inner octahedron is cut along its shortest diagonal (Bey 1995 cuts a fixed one; the shortest keeps shapes best).
  static const int diagonals[3][6] = {{6, 8, 4, 5, 9, 7}, {4, 9, 6, 7, 8, 5}, {5, 7, 4, 6, 9, 8}};
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    const auto t = q.tetrahedra.row(e);
    const int corners[4][4] = {{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3}};
    for (int k = 0; k < 4; ++k)
      for (int a = 0; a < 4; ++a) out.tetrahedra(8 * e + k, a) = t(corners[k][a]);
    int best = 0;
    double shortest = (q.nodes_m.row(t(6)) - q.nodes_m.row(t(8))).squaredNorm();
    for (int d = 1; d < 3; ++d) {
      const double length = (q.nodes_m.row(t(diagonals[d][0])) - q.nodes_m.row(t(diagonals[d][1]))).squaredNorm();
      if (length < shortest * (1 - 1e-12)) {
        shortest = length;
        best = d;
      }
    }
    const int* d = diagonals[best];
    for (int k = 0; k < 4; ++k) {
      Index child[4] = {t(d[0]), t(d[1]), t(d[2 + k]), t(d[2 + (k + 1) % 4])};
      Mat3 edges;
      for (int a = 0; a < 3; ++a) edges.col(a) = (q.nodes_m.row(child[a + 1]) - q.nodes_m.row(child[0])).transpose();
      if (edges.determinant() < 0) std::swap(child[2], child[3]);
      for (int a = 0; a < 4; ++a) out.tetrahedra(8 * e + 4 + k, a) = child[a];
    }
  }
  return out;
}

Eigen::SparseMatrix<double> spread_over_nodes(Index node_count, const std::vector<Index>& nodes) {
  if (nodes.empty()) throw Error("is empty: a force needs nodes to act on", "nodes");
  Triplets triplets;
  for (Index node : nodes) {
    if (node < 0 || node >= node_count)
      throw Error("names node " + std::to_string(node) + ", the mesh has " + std::to_string(node_count), "nodes");
    for (int k = 0; k < 3; ++k) triplets.emplace_back(3 * node + k, k, 1.0 / static_cast<double>(nodes.size()));
  }
  return three_columns(node_count, triplets);
}

MatrixX mass_times(const TetMesh& mesh, const MatrixX& fields) {
  const int nodes = static_cast<int>(mesh.tetrahedra.cols());
  MatrixX out = MatrixX::Zero(fields.rows(), fields.cols());
  const auto quadrature = tet_quadrature_64();
  std::vector<VectorX> shapes;
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, 3>> gradients;
  for (const auto& point : quadrature) {
    shapes.push_back(tet_shape(nodes, point.barycentric));
    gradients.push_back(tet_shape_gradient(nodes, point.barycentric));
  }
  MatrixX x(nodes, 3), local(nodes, nodes);
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    for (int a = 0; a < nodes; ++a) x.row(a) = mesh.nodes_m.row(mesh.tetrahedra(e, a));
    local.setZero();
    for (std::size_t q = 0; q < quadrature.size(); ++q) {
      const Mat3 jacobian = x.transpose() * gradients[q];
      local.noalias() += (quadrature[q].weight * jacobian.determinant()) * shapes[q] * shapes[q].transpose();
    }
    for (int a = 0; a < nodes; ++a)
      for (int b = 0; b < nodes; ++b)
        out.middleRows<3>(3 * mesh.tetrahedra(e, a)) += local(a, b) * fields.middleRows<3>(3 * mesh.tetrahedra(e, b));
  }
  return out;
}

Eigen::SparseMatrix<double> body_force(const TetMesh& mesh) {
  const Index n = static_cast<Index>(mesh.nodes_m.rows());
  MatrixX unit = MatrixX::Zero(3 * n, 1);
  for (Index i = 0; i < n; ++i) unit(3 * i, 0) = 1;
  const MatrixX weights = mass_times(mesh, unit);  // integral of each shape function
  Triplets triplets;
  for (Index i = 0; i < n; ++i)
    for (int k = 0; k < 3; ++k) triplets.emplace_back(3 * i + k, k, weights(3 * i, 0));
  return three_columns(n, triplets);
}

double volume(const TetMesh& mesh) {
  double sum = 0;
  const auto columns = body_force(mesh);
  for (Eigen::SparseMatrix<double>::InnerIterator it(columns, 0); it; ++it) sum += it.value();
  return sum;
}

std::vector<Index> support_nodes(const TetMesh& mesh, const Support& support) {
  const Index n = static_cast<Index>(mesh.nodes_m.rows());
  const std::string name = "support" + (support.name.empty() ? std::string() : " '" + support.name + "'");
  std::set<Index> held;
  const bool box_given =
      (support.box_max_m - support.box_min_m).minCoeff() >= 0 && (support.box_max_m - support.box_min_m).norm() > 0;
  if (!support.vertices.empty()) {
    for (Index v : support.vertices) {
      if (v < 0 || v >= n)
        throw Error("names vertex " + std::to_string(v) + ", the mesh has " + std::to_string(n) + " nodes", name);
      held.insert(v);
    }
    for (const auto& [edge, middle] : midpoints(mesh))
      if (held.count(edge.first) && held.count(edge.second)) held.insert(middle);
  } else if (support.kind == SupportKind::box || (support.kind == SupportKind::clamp && box_given)) {
    const Vec3 low = support.box_min_m.array() - support.tolerance_m, high = support.box_max_m.array() + support.tolerance_m;
    for (Index i = 0; i < n; ++i) {
      const Vec3 x = mesh.nodes_m.row(i).transpose();
      if ((x.array() >= low.array()).all() && (x.array() <= high.array()).all()) held.insert(i);
    }
  } else if (support.kind != SupportKind::vertices) {
    const Vec3 normal = support.plane.normal.normalized();
    for (Index i = 0; i < n; ++i)
      if (std::abs(normal.dot(mesh.nodes_m.row(i).transpose() - support.plane.point_m)) <= support.tolerance_m)
        held.insert(i);
  }
  if (held.empty())
    throw Error("holds no node: check its vertices, box or plane (same units and frame as the mesh?) or raise its tolerance",
                name);
  return {held.begin(), held.end()};
}

}  // namespace palpate::fem
