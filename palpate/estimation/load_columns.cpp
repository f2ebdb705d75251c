// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/load_columns.hpp"

#include <algorithm>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

/// A line load: points along the line, each carried by the boundary triangle nearest to it.
Eigen::SparseMatrix<double> along_line(const TetMesh& mesh, const Vec3& centre_m, const Vec3& axis, double length_m) {
  const geometry::TriangleTree tree({mesh.nodes_m, fem::boundary_triangles(mesh)});
  constexpr int samples = 200;
  std::vector<Eigen::Triplet<double>> entries;
  for (int s = 0; s < samples; ++s) {
    const double along_m = ((s + 0.5) / samples - 0.5) * length_m;
    const auto hit = tree.closest(centre_m + along_m * axis.normalized());
    for (int k = 0; k < 3; ++k) {
      const Index node = tree.mesh().triangles(hit.triangle, k);
      for (int d = 0; d < 3; ++d) entries.emplace_back(3 * node + d, d, hit.barycentric(k) / samples);
    }
  }
  Eigen::SparseMatrix<double> columns(3 * mesh.nodes_m.rows(), 3);
  columns.setFromTriplets(entries.begin(), entries.end());
  return columns;
}

}  // namespace

Eigen::SparseMatrix<double> load_columns(const TetMesh& mesh, const Tool& tool, const Load& load) {
  switch (tool.shape) {
    case ToolShape::vertices:
      return fem::spread_over_nodes(static_cast<Index>(mesh.nodes_m.rows()), tool.vertices);
    case ToolShape::sphere:
    case ToolShape::disc:
      return fem::spread_over_patch(mesh, {touched_m(load), tool.radius_m, Vec3::Zero(), tool.pressure});
    case ToolShape::edge:
    case ToolShape::capsule:
      return along_line(mesh, touched_m(load), tool.axis, tool.length_m);
    case ToolShape::mesh:
    case ToolShape::platen:
      break;
  }
  throw Error("a force can be spread under vertices, a sphere, a disc, an edge or a capsule; give the motion (travel_m) of a "
              "platen, or describe the contact patch of a mesh tool by a disc of its radius",
              "tools." + tool.name + ".shape");
}

std::array<Vec3, 2> tangents(const Vec3& direction) {
  const Vec3 along = direction.normalized();
  Index least = 0;
  along.cwiseAbs().minCoeff(&least);
  const Vec3 first = (Vec3::Unit(least) - along(least) * along).normalized();
  return {first, along.cross(first)};
}

Eigen::SparseMatrix<double> shifted_columns(const TetMesh& mesh, const Tool& tool, const Load& load, const Vec3& tangent) {
  const double h = tool.radius_m > 0 ? tool.radius_m / 8 : std::max(tool.length_m, 1e-3) / 50;
  Load ahead = load, behind = load;  // of where it acts
  ahead.contact_m += h * tangent;
  behind.contact_m -= h * tangent;
  return (load_columns(mesh, tool, ahead) - load_columns(mesh, tool, behind)) / (2 * h);
}

Eigen::SparseMatrix<double> widened_columns(const TetMesh& mesh, const Tool& tool, const Load& load) {
  const double h = tool.radius_m / 8;
  Tool wider = tool, narrower = tool;
  wider.radius_m += h;
  narrower.radius_m -= h;
  return (load_columns(mesh, wider, load) - load_columns(mesh, narrower, load)) / (2 * h);
}

}  // namespace palpate::estimation
