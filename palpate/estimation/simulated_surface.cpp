// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/simulated_surface.hpp"

#include <algorithm>
#include <array>
#include <set>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::estimation {
namespace {

std::array<Index, 3> sorted(Index a, Index b, Index c) {
  std::array<Index, 3> key{a, b, c};
  std::sort(key.begin(), key.end());
  return key;
}

}  // namespace

SimulatedSurface SimulatedSurface::boundary_of(const TetMesh& mesh, const Triangles* observed) {
  const Tetrahedra faces = fem::boundary_faces(mesh);
  std::set<std::array<Index, 3>> seen;
  if (observed != nullptr) {
    for (Index t = 0; t < observed->rows(); ++t) seen.insert(sorted((*observed)(t, 0), (*observed)(t, 1), (*observed)(t, 2)));
  }

  const bool quadratic = faces.cols() == 6;
  std::vector<std::array<Index, 3>> triangles;
  SimulatedSurface surface;
  Index matched = 0;
  for (Index f = 0; f < faces.rows(); ++f) {
    const char is_seen = observed == nullptr || seen.count(sorted(faces(f, 0), faces(f, 1), faces(f, 2))) > 0 ? 1 : 0;
    matched += observed != nullptr && is_seen;
    if (quadratic) {
      const Index a = faces(f, 0), b = faces(f, 1), c = faces(f, 2), ab = faces(f, 3), bc = faces(f, 4), ca = faces(f, 5);
      triangles.insert(triangles.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
      surface.observed_.insert(surface.observed_.end(), 4, is_seen);
    } else {
      triangles.push_back({faces(f, 0), faces(f, 1), faces(f, 2)});
      surface.observed_.push_back(is_seen);
    }
  }
  if (observed != nullptr && matched == 0) {
    throw Error("none of the observed triangles is a face of the mesh's boundary; give node indices of the mesh that "
                "`rest` names",
                "rest.observed_triangles");
  }

  // Number the nodes on the boundary from zero.
  std::vector<Index> vertex_of(static_cast<std::size_t>(mesh.nodes_m.rows()), -1);
  std::vector<Index> node_of;
  surface.rest_.triangles.resize(static_cast<Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      Index& vertex = vertex_of[static_cast<std::size_t>(triangles[t][static_cast<std::size_t>(k)])];
      if (vertex < 0) {
        vertex = static_cast<Index>(node_of.size());
        node_of.push_back(triangles[t][static_cast<std::size_t>(k)]);
      }
      surface.rest_.triangles(static_cast<Index>(t), k) = vertex;
    }
  }
  surface.rest_.vertices_m.resize(static_cast<Index>(node_of.size()), 3);
  for (std::size_t v = 0; v < node_of.size(); ++v) {
    surface.rest_.vertices_m.row(static_cast<Index>(v)) = mesh.nodes_m.row(node_of[v]);
    surface.start_.push_back(static_cast<int>(v));
    surface.nodes_.push_back(node_of[v]);
    surface.weights_.push_back(1.0);
  }
  surface.start_.push_back(static_cast<int>(node_of.size()));
  return surface;
}

SimulatedSurface SimulatedSurface::embedded(const TetMesh& mesh, const TriMesh& triangles, const SurfaceEmbedding& embedding) {
  if (embedding.element.rows() != triangles.vertices_m.rows()) {
    throw Error("the embedding has another number of vertices than the surface", "ObjectModel.embedding");
  }
  SimulatedSurface surface;
  surface.rest_ = triangles;
  surface.observed_.assign(static_cast<std::size_t>(triangles.triangles.rows()), 1);
  for (Index v = 0; v < triangles.vertices_m.rows(); ++v) {
    surface.start_.push_back(static_cast<int>(surface.nodes_.size()));
    const auto element = mesh.tetrahedra.row(embedding.element(v));
    const Eigen::Vector4d l = embedding.weights.row(v);
    const auto add = [&](int local, double weight) {
      surface.nodes_.push_back(element(local));
      surface.weights_.push_back(weight);
    };
    if (element.size() == 4) {
      for (int k = 0; k < 4; ++k) add(k, l(k));
    } else {  // Lagrange polynomials of second order in barycentric coordinates
      static constexpr int edges[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};
      for (int k = 0; k < 4; ++k) add(k, l(k) * (2 * l(k) - 1));
      for (int e = 0; e < 6; ++e) add(4 + e, 4 * l(edges[e][0]) * l(edges[e][1]));
    }
  }
  surface.start_.push_back(static_cast<int>(surface.nodes_.size()));
  return surface;
}

MatrixX SimulatedSurface::restrict(const MatrixX& nodal) const {
  MatrixX values = MatrixX::Zero(3 * vertex_count(), nodal.cols());
  for (Index c = 0; c < nodal.cols(); ++c) {
    const double* from = nodal.col(c).data();
    double* to = values.col(c).data();
    for (Index v = 0; v < vertex_count(); ++v) {
      for (int e = start_[static_cast<std::size_t>(v)]; e < start_[static_cast<std::size_t>(v) + 1]; ++e) {
        const Index node = nodes_[static_cast<std::size_t>(e)];
        const double weight = weights_[static_cast<std::size_t>(e)];
        for (int d = 0; d < 3; ++d) to[3 * v + d] += weight * from[3 * node + d];
      }
    }
  }
  return values;
}

Eigen::SparseMatrix<double> SimulatedSurface::rows(Index node_count) const {
  std::vector<Eigen::Triplet<double>> entries;
  for (Index v = 0; v < vertex_count(); ++v) {
    for (int e = start_[static_cast<std::size_t>(v)]; e < start_[static_cast<std::size_t>(v) + 1]; ++e) {
      const auto at = static_cast<std::size_t>(e);
      for (int d = 0; d < 3; ++d) entries.emplace_back(3 * v + d, 3 * nodes_[at] + d, weights_[at]);
    }
  }
  Eigen::SparseMatrix<double> matrix(3 * vertex_count(), 3 * node_count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

}  // namespace palpate::estimation
