// SPDX-License-Identifier: Apache-2.0
// A small rigid motion about a pivot: x' = exp(w) (x - pivot) + pivot + t, with exact derivatives at any w.
#pragma once

#include "palpate/core/math.hpp"

namespace palpate::estimation {

struct RigidOffset {
  Vec3 translation_m = Vec3::Zero();
  Vec3 rotation_rad = Vec3::Zero();  ///< rotation vector w
  Vec3 pivot_m = Vec3::Zero();

  Mat3 rotation() const;
  Vec3 apply(const Vec3& point_m) const;
  Vec3 apply_inverse(const Vec3& point_m) const;
  /// d x' / d (t, w): 3 x 6. Uses the left Jacobian of SO(3) (Sola et al. 2018, eq. 145).
  Eigen::Matrix<double, 3, 6> derivative(const Vec3& point_m) const;
  /// d (exp(w)' v) / d w for a vector v given in the outer frame: 3 x 3.
  Mat3 inverse_rotation_derivative(const Vec3& vector) const;
};

/// A RigidOffset made ready for many points.
class RigidMap {
 public:
  explicit RigidMap(const RigidOffset& offset);
  const Mat3& rotation() const { return rotation_; }
  Vec3 apply(const Vec3& point_m) const { return rotation_ * (point_m - pivot_m_) + shifted_m_; }
  /// d (gradient . x') / d (t, w)
  Eigen::Matrix<double, 1, 6> slope(const Vec3& gradient, const Vec3& point_m) const {
    Eigen::Matrix<double, 1, 6> d;
    d.head<3>() = gradient.transpose();
    d.tail<3>() = (rotation_ * (point_m - pivot_m_)).cross(gradient).transpose() * left_jacobian_;
    return d;
  }

 private:
  Mat3 rotation_, left_jacobian_;
  Vec3 pivot_m_, shifted_m_;
};

}  // namespace palpate::estimation
