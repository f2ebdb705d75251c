// SPDX-License-Identifier: Apache-2.0
// Inside of TriangleTree and RayBundle: does a ray meet a triangle? The ray becomes the z axis of a sheared frame, and a point on a
// shared edge belongs to both triangles, so that no ray slips between (Woop, Benthin, Wald 2013).
#pragma once

#include <algorithm>

#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::geometry {

class WatertightRay {
 public:
  explicit WatertightRay(const Vec3& direction) {
    direction.cwiseAbs().maxCoeff(&kz_);
    kx_ = (kz_ + 1) % 3;
    ky_ = (kx_ + 1) % 3;
    sz_ = 1 / direction[kz_];
    sx_ = direction[kx_] / direction[kz_];
    sy_ = direction[ky_] / direction[kz_];
  }

  /// @param a, b, c  corners relative to where the ray starts, three numbers each
  /// @param out  barycentric coordinates and range, where the answer is yes
  bool hit(const double* a, const double* b, const double* c, double max_range, RayHit& out) const {
    const double ax = a[kx_] - sx_ * a[kz_], ay = a[ky_] - sy_ * a[kz_];
    const double bx = b[kx_] - sx_ * b[kz_], by = b[ky_] - sy_ * b[kz_];
    const double cx = c[kx_] - sx_ * c[kz_], cy = c[ky_] - sy_ * c[kz_];
    const double u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
    if (std::min({u, v, w}) < 0 && std::max({u, v, w}) > 0) return false;
    const double det = u + v + w;
    if (det == 0) return false;
    const double t = (u * sz_ * a[kz_] + v * sz_ * b[kz_] + w * sz_ * c[kz_]) / det;
    if (!(t >= 0 && t < max_range)) return false;
    out.barycentric = Vec3(u, v, w) / det;
    out.range_m = t;
    return true;
  }

 private:
  int kx_ = 0, ky_ = 1, kz_ = 2;
  double sx_ = 0, sy_ = 0, sz_ = 1;
};

}  // namespace palpate::geometry
