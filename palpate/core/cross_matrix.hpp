// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/math.hpp"

namespace palpate {

/// The matrix [v]x with [v]x w = v x w.
inline Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace palpate
