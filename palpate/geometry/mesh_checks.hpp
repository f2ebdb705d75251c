// SPDX-License-Identifier: Apache-2.0
// What is right and wrong with a mesh, in numbers and in plain words. Nothing here repairs or throws on a bad mesh, except
// on vertex indices that are out of range.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

struct Finding {
  std::string code;     ///< stable, e.g. "open_surface"
  std::string message;  ///< plain words
  bool fatal = false;   ///< nothing can be computed on such a mesh
};

struct SurfaceCheck {
  Index vertices = 0, triangles = 0;
  Index unused_vertices = 0;       ///< in no triangle
  Index coincident_vertices = 0;   ///< exact copies of another vertex; topology below is that after welding them
  Index degenerate_triangles = 0;  ///< without area
  Index shared_faces = 0;          ///< that two closed parts have in common; neither copy counts in what follows
  Index duplicate_triangles = 0;   ///< same three corners as another, in any order
  Index boundary_edges = 0;        ///< in one triangle
  Index non_manifold_edges = 0;    ///< in three or more
  Index inconsistent_edges = 0;    ///< two triangles that run along it in the same direction: one of them is flipped
  Index pinched_vertices = 0;      ///< surface touches itself in a point
  Index components = 0;            ///< pieces that share no vertex
  double area_m2 = 0;
  std::optional<double> volume_m3;  ///< signed (negative = inside out); empty when open, non-manifold or inconsistent
  Vec3 min_m = Vec3::Zero(), max_m = Vec3::Zero();
  std::vector<Finding> findings;

  double diagonal_m() const { return (max_m - min_m).norm(); }
  bool watertight() const {
    return triangles > 0 && boundary_edges == 0 && non_manifold_edges == 0 && inconsistent_edges == 0;
  }
};

/// @throws Error when an index is out of range.
SurfaceCheck check_surface(const TriMesh& mesh);

struct VolumeCheck {
  Index nodes = 0, tetrahedra = 0;
  Index unused_nodes = 0;    ///< in no tetrahedron (a stiffness matrix would be singular there)
  Index inverted = 0;        ///< determinant below zero
  Index degenerate = 0;      ///< |determinant| below 1e-12 of the longest edge cubed
  Index overfull_faces = 0;  ///< faces of three or more tetrahedra
  Index components = 0;      ///< pieces that share no face (they would move apart)
  Index non_manifold_boundary_edges = 0;
  Index pinched_boundary_vertices = 0;
  double volume_m3 = 0;
  double min_dihedral_deg = 0, max_dihedral_deg = 0;
  double worst_quality = 0;  ///< smallest 3 x inradius / circumradius: 1 regular, 0 flat
  Vec3 min_m = Vec3::Zero(), max_m = Vec3::Zero();
  std::vector<Finding> findings;
};

/// Linear or quadratic tetrahedra; of the latter only the corners are looked at.
/// @throws Error when an index is out of range or there are neither 4 nor 10 columns.
VolumeCheck check_volume(const TetMesh& mesh);

/// Boundary of a volume mesh, outward oriented when no element is inverted.
struct BoundarySurface {
  TriMesh surface;
  std::vector<Index> node;         ///< of a surface vertex
  std::vector<Index> tetrahedron;  ///< of a surface triangle
};
BoundarySurface boundary_surface(const TetMesh& mesh);

/// Vertices at exactly the same place become one; triangles keep their number and order. `vertex_of`: new index of an old
/// one.
TriMesh weld(const TriMesh& mesh, std::vector<Index>* vertex_of = nullptr);

/// "this object is 150 m long: millimetres?" for a size that no robot pushes, empty for a plausible one.
std::string unit_guess(double longest_edge_m);

/// Smallest and largest of the six dihedral angles of a tetrahedron in degrees (0 and 180 when flat).
std::pair<double, double> dihedral_range_deg(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

/// 1 for a triangle whose corners an earlier one has, in whatever order.
std::vector<char> copies(const Triangles& triangles);

/// 1 for both copies of a face that two closed parts have in common, one facing each way: the parts are one body there. Nothing
/// where what is left would not be closed: of a sheet whose every triangle is there once for each side, one is the surface.
/// @param triangles  of welded vertices
std::vector<char> shared_faces(const Triangles& triangles);

/// What sensors see of a mesh: welded and without shared faces, or the mesh itself where it has none. Their rims would be outlines.
TriMesh without_shared_faces(const TriMesh& mesh);

}  // namespace palpate::geometry
