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

}  // namespace palpate::estimation
