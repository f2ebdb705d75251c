// SPDX-License-Identifier: Apache-2.0
// Rigid surfaces that an object may touch, each as a signed distance in its own frame: origin at the tip, z into the object.
// All are twice differentiable where they can be touched, so that Newton's method and sensitivities are exact.
#pragma once

#include <limits>
#include <memory>

#include "palpate/core/mesh.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::fem {

/// What a shape says about one point y of its frame.
struct ShapePoint {
  double gap_m = std::numeric_limits<double>::infinity();  ///< signed distance, negative inside the shape
  Vec3 normal = Vec3::Zero();                              ///< d gap / dy, out of the shape
  Mat3 curvature = Mat3::Zero();                           ///< d2 gap / dy2, 1/m
  /// Stiffness share of a point under the face of a disc or edge: 1 inside, fading to 0 over the last cell before the rim,
  /// which runs between the points of the quadrature.
  double coverage = 1;
  Vec3 coverage_gradient = Vec3::Zero();
  Mat3 coverage_hessian = Mat3::Zero();
};

/// Derivatives of a ShapePoint to the radius (edge: half width) with the tip held.
struct RadiusDerivative {
  double gap = 0;
  Vec3 normal = Vec3::Zero();
  double coverage = 0;
  Vec3 coverage_gradient = Vec3::Zero();
};

class RigidShape {
 public:
  virtual ~RigidShape() = default;
  /// @param cell_m  size of the piece of surface that the point stands for
  /// @return false where the shape cannot be touched (`out` is then undefined)
  virtual bool at(const Vec3& y_m, double cell_m, ShapePoint& out) const = 0;
  virtual bool has_radius() const { return false; }
  virtual RadiusDerivative d_radius(const Vec3& y_m, double cell_m) const;
  /// Sphere about `centre_m` that holds everything that can be touched; infinite for a plane.
  virtual double bounding_radius_m() const = 0;
  virtual Vec3 bounding_centre_m() const { return Vec3::Zero(); }
};

using RigidShapePtr = std::shared_ptr<const RigidShape>;

/// Half space z <= 0: table, wall, platen.
RigidShapePtr plane_shape();
/// Tip at the origin, centre at z = -radius.
RigidShapePtr sphere_shape(double radius_m);
/// Cylinder with round ends along x, tip at the origin, axis at z = -radius; length_m between the centres of its ends.
RigidShapePtr capsule_shape(double radius_m, double length_m);
/// Flat face z = 0 inside a circle; what lies outside the rim is not touched.
RigidShapePtr disc_shape(double radius_m);
/// Flat strip z = 0, |y| <= half_width_m, |x| <= length_m / 2.
RigidShapePtr edge_shape(double half_width_m, double length_m);
/// Closed surface given in the tool's frame. Its exact signed distance (TriangleTree, winding number) is sampled where it is
/// asked for on a lattice of `spacing_m` and joined by cubic B-splines: facets and corners are rounded at that length, flat
/// faces stay exact. @param spacing_m  0: a fortieth of the mesh's diagonal. Not thread-safe (samples are remembered).
RigidShapePtr mesh_shape(const TriMesh& mesh, double spacing_m = 0);

/// Shape of a recording's tool. @throws Error for `vertices`, which name nodes and no surface, or a size that is missing.
RigidShapePtr shape_of(const Tool& tool);

/// A pose with z along `direction` (into the object) and x as near to `axis` as can be, origin at the tip.
Pose tool_pose(const Vec3& tip_m, const Vec3& direction, const Vec3& axis = Vec3::UnitX());

}  // namespace palpate::fem
