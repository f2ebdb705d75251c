// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

struct SurfaceDistance {
  double rms_m = 0;        ///< over samples of both surfaces
  double hausdorff_m = 0;  ///< largest distance of a sample or vertex of one surface from the other
};

/// Two-sided distance, `samples` points spread by area on each surface plus all vertices (which count for hausdorff_m only).
SurfaceDistance surface_distance(const TriMesh& a, const TriMesh& b, int samples = 20000);

/// Largest and mean-square distance of `from` from `to` only.
SurfaceDistance one_sided_distance(const TriMesh& from, const TriMesh& to, int samples = 20000);

}  // namespace palpate::geometry
