// SPDX-License-Identifier: Apache-2.0
// Inside of tetrahedralise: what is improved.
#pragma once

#include <algorithm>
#include <cmath>

#include "palpate/core/math.hpp"
#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

/// Quality from the extreme dihedral angles: min(sin(smallest), 1 + cos(largest)), about 1 for a regular tetrahedron, 0.41
/// for 24 or 126 degrees, 0.26 for 15 or 138 degrees, 0 when flat, negative when inverted. Scale-free.
inline double tet_quality(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const Vec3 u = b - a, v = c - a, w = d - a;
  const Vec3 nd = v.cross(u), nb = w.cross(v), nc = u.cross(w);  // outward normals of the faces at a
  const Vec3 na = -(nd + nb + nc);
  const double det = -nd.dot(w);
  const double la = na.squaredNorm(), lb = nb.squaredNorm(), lc = nc.squaredNorm(), ld = nd.squaredNorm();
  const double longest2 = std::max({u.squaredNorm(), v.squaredNorm(), w.squaredNorm()});
  if (!(det > 1e-9 * longest2 * std::sqrt(longest2))) {
    return longest2 > 0 ? std::min(0.0, det / (longest2 * std::sqrt(longest2)) - 1e-9) : -1;
  }
  const double ra = 1 / std::sqrt(la), rb = 1 / std::sqrt(lb), rc = 1 / std::sqrt(lc), rd = 1 / std::sqrt(ld);
  const double c0 = -na.dot(nb) * ra * rb, c1 = -na.dot(nc) * ra * rc, c2 = -na.dot(nd) * ra * rd;
  const double c3 = -nb.dot(nc) * rb * rc, c4 = -nb.dot(nd) * rb * rd, c5 = -nc.dot(nd) * rc * rd;
  const double high = std::max({c0, c1, c2, c3, c4, c5}), low = std::min({c0, c1, c2, c3, c4, c5});
  const double sharp = high > 0 ? std::sqrt(std::max(0.0, 1 - high * high)) : 1.0;
  return std::min(sharp, low < 0 ? 1 + low : 1.0);
}
inline double tet_quality(const TetMesh& mesh, Index t) {
  const auto node = [&](int k) { return Vec3(mesh.nodes_m.row(mesh.tetrahedra(t, k))); };
  return tet_quality(node(0), node(1), node(2), node(3));
}

}  // namespace palpate::geometry
