// SPDX-License-Identifier: Apache-2.0
// A mesh for one contact, derived from the object's base mesh, that knows its own error. Discretisation error goes straight
// into the estimated E: with linear tetrahedra and edges of the size of the tool, E from the probe's depth is 30 to 70 % too
// low.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

/// A linear mesh whose first nodes are those of the mesh it came from; node i of the others halves the edge `parents[i -
/// first]`.
struct RefinedMesh {
  TetMesh mesh;
  std::vector<std::array<Index, 2>> parents;
};

/// Halves longest edges (Rivara's propagation path, so that the mesh stays conforming and its angles bounded) until every
/// edge is shorter than edge_m within radius_m of the centre, and than edge_m + growth * (distance - radius_m) outside.
/// @param mesh  linear tetrahedra; @param node_limit  refinement stops there (the mesh is still conforming)
/// @throws Error on a mesh that is not linear or an edge length that is not positive
RefinedMesh refine_near(const TetMesh& mesh, const Vec3& centre_m, double radius_m, double edge_m, double growth = 1.0,
                        Index node_limit = 50000);

/// The same near any place. @param distance_m  from it; edges are shorter than edge_m where it is not positive
RefinedMesh refine_near(const TetMesh& mesh, const std::function<double(const Vec3&)>& distance_m, double edge_m,
                        double growth = 1.0, Index node_limit = 50000);

/// Of the elements that reach into a patch; of a patch smaller than the elements, that of the nearest one.
double longest_edge_near(const TetMesh& mesh, const ContactPatch& patch);

/// Adds to a list of nodes of the base mesh the refined nodes whose two parents are in it.
std::vector<Index> extend_nodes(std::vector<Index> nodes, const RefinedMesh& refined);

struct DiscretisationOptions {
  double tolerance = 0.01;  ///< of the relative error in E that the mesh may cause
  int max_levels = 4;
  Index node_limit = 8000;  ///< corners, before edge midpoints are added
  double poisson_ratio = 0.3;
  Dilatation dilatation = Dilatation::pointwise;
};

/// Quadratic tetrahedra refined under the tool.
struct Discretisation {
  RefinedMesh linear;  ///< corners; `mesh` adds the midpoints
  TetMesh mesh;
  double young_error = 0;       ///< estimated relative error in E from the depth under the load
  double base_young_error = 0;  ///< the same of the base mesh with quadratic tetrahedra
  double surface_change = 0;    ///< rms change of the boundary outside the patch from the last level to this, relative
  double edge_m = 0;            ///< longest edge under the tool
  int levels = 0;
  bool tolerance_met = false;
};

/// Boundary of the object on a refined mesh: supports and the force columns of the contact.
using BoundaryOn = std::function<Boundary(const TetMesh& quadratic, const RefinedMesh& linear)>;

/// What a mesh says of one contact.
struct ContactAnswer {
  double depth_m = 0;         ///< what a force-controlled probe reads; any number in proportion to 1 / E will do
  VectorX displacement_m;     ///< 3n
  double patch_radius_m = 0;  ///< of the patch where it was found; 0: it is the one that was given
  double patch_area_m2 = 0;   ///< the same: of the contact
};
using SolveOn = std::function<ContactAnswer(const TetMesh& quadratic, const RefinedMesh& linear)>;

/// Refines under the tool until the depth of the load, work-conjugate (W = a' F' u), which is what a force-controlled probe sees
/// (E_hat / E = u_h / u), changes by so little from level to level that the error left is below the tolerance. The error left is
/// what the last two changes and edges say when it falls as C h^p (0.6 <= p <= 2; the rim of the load keeps p between 1 and 2).
/// A change that is smaller than that is one by chance, unless the area of a contact that was found agrees as well.
/// One change alone is no estimate, so there are two levels at least (within the limit of nodes; then half of the first change).
/// Each level also refines farther away from the tool, for the surface that cameras see.
/// @param solve  any solution of the same load on a mesh, contact search included (contact_statics.hpp)
Discretisation discretise(const TetMesh& base, const ContactPatch& patch, const SolveOn& solve,
                          const DiscretisationOptions& options = {});
/// The same for a uniform pressure on the patch and small strains.
/// @param force  coefficients of the boundary's force columns
Discretisation discretise(const TetMesh& base, const ContactPatch& patch, const BoundaryOn& boundary_on,
                          const VectorX& force, const DiscretisationOptions& options = {});
Discretisation discretise(const TetMesh& base, const Vec3& contact_m, double radius_m, const BoundaryOn& boundary_on,
                          const VectorX& force, const DiscretisationOptions& options = {});

}  // namespace palpate::fem
