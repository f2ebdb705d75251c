// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "palpate/geometry/lattice.hpp"
#include "palpate/geometry/tet_editor.hpp"

namespace palpate::geometry {

struct CoarsenOptions {
  Index tetrahedra = 0;    ///< where to stop
  double tolerance_m = 0;  ///< first limit of how far a merge may leave the surface; grows when the number asks for it
  std::function<double(const Vec3&)> edge_m;  ///< wished longest edge at a place, or empty
  double wall_m = 0;  ///< width of a shell: before its volume changes by more than 3 % the number is given up; 0 = no shell
};

/// Inside of tetrahedralise. Merges edges, those first that cost the surface least (quadrics of Garland, Heckbert 1997, and
/// what a tip loses), until the wished number is left. What is curved or thin keeps short edges, flat and inner parts get
/// long ones.
void coarsen(TetEditor& mesh, const Solid& solid, const SurfaceSamples& samples, const CoarsenOptions& options);

}  // namespace palpate::geometry
