// SPDX-License-Identifier: Apache-2.0
// What else an estimator does not know of a contact, on top of a Response: where and how wide it is, which way the force
// points, and how much the supports give. All derivatives are exact for the answer.
#pragma once

#include "palpate/fem/response.hpp"

namespace palpate::fem {

/// Six columns of one contact: forces along x, y, z spread over the patch; and, per newton along `direction`, what it means
/// to shift the contact by a metre along two tangents (orthogonal to `direction`) and to widen the patch by log radius. A
/// contact shift s under a force F is then the coefficient F s, a change of radius F dlog r, both to first order. Order: x,
/// y, z, shift along tangent 1, tangent 2, log radius.
struct ContactColumns {
  Eigen::SparseMatrix<double> forces;  ///< 3n x 6
  Vec3 tangent_1, tangent_2;
};
ContactColumns contact_columns(const TetMesh& mesh, const Vec3& centre_m, double radius_m, const Vec3& direction);

/// Of one contact whose columns are contact_columns'.
struct ContactNuisances {
  double force_n = 0;            ///< its norm
  Vec2 tilt_rad = Vec2::Zero();  ///< of the force, from the columns' direction towards their tangents
  Vec2 shift_m = Vec2::Zero();   ///< of the contact along the tangents, to first order
  double log_radius_change = 0;  ///< of the patch, to first order
};

/// The columns' coefficients and their derivatives: to force_n, tilt 1 and 2, shift 1 and 2, log radius.
struct ContactCoefficients {
  Eigen::Matrix<double, 6, 1> values;
  Eigen::Matrix<double, 6, 6> derivatives;
};
ContactCoefficients contact_coefficients(const ContactColumns& columns, const ContactNuisances& nuisances);

/// Six columns of motion for nodes that a support holds: translation of the support along x, y, z (m), rotation about x, y,
/// z through centre_m (rad, small).
Eigen::SparseMatrix<double> support_motions(const TetMesh& mesh, const std::vector<Index>& nodes, const Vec3& centre_m);

/// An answer whose supports give.
struct SprungState {
  ResponseState state;               ///< of the body, to every coefficient; its derivatives hold the supports' stiffness fixed,
                                     ///< d_motion is to the motion of the springs' far ends
  VectorX support_motion;            ///< m: of the supports themselves
  MatrixX d_log_stiffness;           ///< r x m
  MatrixX reaction_d_log_stiffness;  ///< m x m
};

/// Every motion coefficient is held by a spring: reaction = -stiffness (support motion - motion). Newton's method on the
/// supports' motion, which one step solves for a linear material.
/// @param stiffness  m: N/m, or N m/rad for rotations
/// @param query  its motion is that of the springs' far ends; with derivatives to every coefficient
/// @throws Error where Response::at does, for a stiffness that is not positive, and for directions
SprungState on_springs(const Response& response, ResponseQuery query, const VectorX& stiffness);

}  // namespace palpate::fem
