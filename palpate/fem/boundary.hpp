// SPDX-License-Identifier: Apache-2.0
// Columns for Boundary::forces and node sets for its constraints.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

/// Boundary faces of a tetrahedral mesh, oriented outwards: F x 3 (linear) or F x 6 (quadratic: corners, then midpoints of
/// 01, 12, 20). @param elements  filled with the element of each
Tetrahedra boundary_faces(const TetMesh& mesh, std::vector<Index>* elements = nullptr);

/// Splits every quadratic boundary face into four flat triangles (linear faces pass through).
Triangles boundary_triangles(const TetMesh& mesh);

/// Adds edge midpoints: linear to quadratic (corner indices keep their numbers).
TetMesh to_quadratic(const TetMesh& mesh);

/// Halves every edge: 8 children a tetrahedron (linear meshes; corner indices keep their numbers).
TetMesh refine_uniform(const TetMesh& mesh);

/// Three columns (unit resultant force along x, y, z) spread equally over `nodes`. @throws Error when empty.
Eigen::SparseMatrix<double> spread_over_nodes(Index node_count, const std::vector<Index>& nodes);

/// Three columns: consistent nodal forces of a uniform traction with unit resultant over the part of the boundary inside a
/// sphere of radius_m about centre_m (exact disc quadrature by sub-sampling; never the nearest node). Only the connected
/// part of the boundary around the point nearest to the centre counts, so the far side of a thin object is not pushed.
/// @throws Error when no boundary face lies in it.
Eigen::SparseMatrix<double> spread_over_patch(const TetMesh& mesh, const Vec3& centre_m, double radius_m);

/// What a tool touches: points within radius_m of the segment centre_m - half_length_m to centre_m + half_length_m (no
/// length: a disc, the patch of a sphere; else that of a bar).
struct ContactPatch {
  Vec3 centre_m = Vec3::Zero();
  double radius_m = 0;
  Vec3 half_length_m = Vec3::Zero();
  Pressure pressure = Pressure::uniform;
  double distance_m(const Vec3& x_m) const;  ///< of a point to the segment
};
Eigen::SparseMatrix<double> spread_over_patch(const TetMesh& mesh, const ContactPatch& where);

/// Three columns: body force per unit density (kg/m3) and unit acceleration along x, y, z: newton.
Eigen::SparseMatrix<double> body_force(const TetMesh& mesh);

/// Product of the consistent mass matrix at unit density with nodal fields (3n x c): kg per kg/m3 times the field's unit.
MatrixX mass_times(const TetMesh& mesh, const MatrixX& fields);

/// Volume of the mesh, m3.
double volume(const TetMesh& mesh);

/// Nodes that a support holds (of a quadratic mesh also the midpoints of edges between two listed corners). @throws Error
/// naming the support when it holds none.
std::vector<Index> support_nodes(const TetMesh& mesh, const Support& support);

}  // namespace palpate::fem
