// SPDX-License-Identifier: Apache-2.0
// The stress-free shape of an object that was seen while loads (its own weight) already deformed it.
#pragma once

#include <functional>
#include <string>

#include "palpate/fem/statics.hpp"

namespace palpate::fem {

struct RestShapeOptions {
  StaticsOptions statics;
  double tolerance = 1e-10;  ///< of the last step of a node, over the object's diagonal
  int max_iterations = 200;  ///< over all load steps
};

struct RestShape {
  TetMesh mesh;            ///< stress-free; same connectivity as the seen one
  VectorX displacement_m;  ///< 3n: from the stress-free to the seen shape
  bool converged = false;
  std::string reason;
  int iterations = 0;     ///< factorisations, without the proof's
  double mismatch_m = 0;  ///< largest distance of a node from where it was seen, by a forward solution
  double largest_shift_m = 0;
};

/// Solves f_int(X; u = x - X) = F(X) for the nodes X of the stress-free mesh, x being what was seen (Govindjee and Mihalic
/// 1996), by Newton's method: products with the exact tangent by differences, inside Krylov's method with the forward
/// problem's factor; loads in steps where that does not settle. The result is proved by a forward solution.
/// @param boundary_on  supports and loads of a mesh with these nodes, e.g. [](const TetMesh& m) { ... body_force(m) ... }:
/// the
///        weight is that of the stress-free mesh. Held nodes must be chosen by number, not by place.
/// @throws Error as Statics
RestShape rest_shape(const TetMesh& seen, const std::string& material,
                     const std::function<Boundary(const TetMesh&)>& boundary_on, double young_modulus_pa,
                     double poisson_ratio, const VectorX& force_coefficients, const RestShapeOptions& options = {},
                     const VectorX& extra = {});

}  // namespace palpate::fem
