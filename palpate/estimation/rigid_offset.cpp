// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/rigid_offset.hpp"

#include <cmath>

#include "palpate/core/cross_matrix.hpp"

namespace palpate::estimation {
namespace {

Mat3 left_jacobian(const Vec3& w) {
  const double angle = w.norm();
  const Mat3 s = cross_matrix(w);
  if (angle < 1e-6) return Mat3::Identity() + 0.5 * s + s * s / 6.0;
  return Mat3::Identity() + (1 - std::cos(angle)) / (angle * angle) * s +
         (angle - std::sin(angle)) / (angle * angle * angle) * s * s;
}

}  // namespace

Mat3 RigidOffset::rotation() const {
  const double angle = rotation_rad.norm();
  if (angle < 1e-14) return Mat3::Identity() + cross_matrix(rotation_rad);
  return Eigen::AngleAxisd(angle, rotation_rad / angle).toRotationMatrix();
}

Vec3 RigidOffset::apply(const Vec3& point_m) const { return rotation() * (point_m - pivot_m) + pivot_m + translation_m; }

Vec3 RigidOffset::apply_inverse(const Vec3& point_m) const {
  return rotation().transpose() * (point_m - pivot_m - translation_m) + pivot_m;
}

Eigen::Matrix<double, 3, 6> RigidOffset::derivative(const Vec3& point_m) const {
  Eigen::Matrix<double, 3, 6> d;
  d.leftCols<3>().setIdentity();
  d.rightCols<3>() = -cross_matrix(rotation() * (point_m - pivot_m)) * left_jacobian(rotation_rad);
  return d;
}

RigidMap::RigidMap(const RigidOffset& offset)
    : rotation_(offset.rotation()),
      left_jacobian_(left_jacobian(offset.rotation_rad)),
      pivot_m_(offset.pivot_m),
      shifted_m_(offset.pivot_m + offset.translation_m) {}

Mat3 RigidOffset::inverse_rotation_derivative(const Vec3& vector) const {
  // exp(w)' v = exp(-w) v, and d/dw exp(-w) v = [exp(-w) v]_x J_l(-w) with J_l(-w) = J_r(w).
  return cross_matrix(rotation().transpose() * vector) * left_jacobian(-rotation_rad);
}

}  // namespace palpate::estimation
