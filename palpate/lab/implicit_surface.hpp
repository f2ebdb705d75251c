// SPDX-License-Identifier: Apache-2.0
// Closed surfaces of bodies that a function describes: what the lab's own objects are made of.
#pragma once

#include <functional>

#include "palpate/core/mesh.hpp"

namespace palpate::lab {

/// Negative inside, about a distance in metres near the surface.
using Implicit = std::function<double(const Vec3&)>;

struct ImplicitBox {
  Vec3 min_m = Vec3::Zero(), max_m = Vec3::Zero();  ///< the body lies inside, but may be cut flat at z = min
  double cell_m = 0.003;
};

/// Marching tetrahedra on a grid (six a cell), vertices moved onto the function's zero set along its gradient; watertight,
/// outward, vertices shared. What reaches the box's bottom is cut off there, flat.
/// @throws Error when the box is empty, the body is not in it, or reaches another of its faces.
TriMesh implicit_surface(const Implicit& body, const ImplicitBox& box);

/// Union of two bodies with a fillet of about `radius_m` between them (Quilez's polynomial smooth minimum).
double smooth_union(double a_m, double b_m, double radius_m);
/// Distance to an ellipsoid with the given half axes about a centre (first order: exact on the surface and for spheres).
double ellipsoid(const Vec3& p_m, const Vec3& centre_m, const Vec3& half_m);
/// Distance to a capsule between two points.
double capsule(const Vec3& p_m, const Vec3& a_m, const Vec3& b_m, double radius_m);

}  // namespace palpate::lab
