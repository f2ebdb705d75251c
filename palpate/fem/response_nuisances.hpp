// SPDX-License-Identifier: Apache-2.0
// What else an estimator does not know of a contact, on top of a Response: where and how wide it is, which way the force
// points, and how much the supports give. All derivatives are exact for the answer.
#pragma once

#include "palpate/fem/response.hpp"

namespace palpate::fem {

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
  ResponseState state;               ///< of the body; its derivatives hold the supports' stiffness fixed, d_motion is to
                                     ///< the motion of the springs' far ends
  VectorX support_motion;            ///< m: of the supports themselves
  MatrixX d_log_stiffness;           ///< r x m
  MatrixX reaction_d_log_stiffness;  ///< m x m
};

/// Every motion coefficient is held by a spring: reaction = -stiffness (support motion - motion). Newton's method on the
/// supports' motion, which one step solves for a linear material.
/// @param stiffness  m: N/m, or N m/rad for rotations
/// @throws Error where Response::at does, and for a stiffness that is not positive
SprungState on_springs(const Response& response, double young_modulus_pa, double poisson_ratio, const VectorX& force,
                       const VectorX& motion, const VectorX& stiffness);

}  // namespace palpate::fem
