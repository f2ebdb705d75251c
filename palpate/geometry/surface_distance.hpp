// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

class Solid;

struct SurfaceDistance {
  double rms_m = 0;        ///< over samples of both surfaces
  double hausdorff_m = 0;  ///< largest distance of a sample or vertex of one surface from the other
};

/// Says whether a point of a triangle counts; asked of points that are farther than `from_m` only, because it may be slow.
struct CountedPoints {
  std::function<bool(const Vec3& point_m, Index triangle)> counts;
  double from_m = 0;
};

/// Points of a self-intersecting `surface` that do not lie within another part of it: only those are boundary of the solid
/// that it describes. Both must outlive the answer.
CountedPoints not_buried(const TriMesh& surface, const Solid& solid);

/// Largest and root-mean-square distance of `from` from `to`: `samples` points spread by area, and all vertices, which count
/// for hausdorff_m only.
SurfaceDistance one_sided_distance(const TriMesh& from, const TriMesh& to, int samples = 20000,
                                   const CountedPoints& counted = {});

/// Both ways; `counted` is about points of `a`.
SurfaceDistance surface_distance(const TriMesh& a, const TriMesh& b, int samples = 20000, const CountedPoints& counted = {});

}  // namespace palpate::geometry
