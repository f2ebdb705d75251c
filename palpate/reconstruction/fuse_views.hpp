// SPDX-License-Identifier: Apache-2.0
// Many noisy, partial views of an object become one set of small oriented facets, whose winding number has an inside.
#pragma once

#include <optional>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::reconstruction {

struct FuseOptions {
  double cell_m = 0;             ///< width over which points are averaged; 0 = from noise, size and density
  int fewest_points = 3;         ///< cells with fewer points are taken for noise (>= 1)
  std::optional<Plane> support;  ///< table or wall that hides a side: the object is completed down to it
};

/// @throws Error naming the field and its bounds.
void check(const FuseOptions& options);

struct FusedViews {
  TriMesh facets;              ///< one triangle a cell, outward, as large as the surface that it stands for; open
  Index seen = 0;              ///< that many facets come first and were seen; the others complete the object
  VectorX sigma_m;             ///< of the seen facets along their normals, from the scatter of the points and their number
  double cell_m = 0;           ///< width that was used
  double seen_area_m2 = 0;     ///< area of the facets that sensors saw
  double support_area_m2 = 0;  ///< area of the facets that complete the object down to the support
};

/// @param clouds  in one frame, each with unit normals that face its sensor
/// A cell's facet lies where a quadratic surface, fitted to the points around it along their mean normal (moving least
/// squares, Levin 1998), passes its middle: noise is averaged and curvature is not flattened. With `support`, the object's
/// shadow along the plane's normal is closed on the plane (the planar back side of Frank et al. 2010): unseen flanks come
/// out too wide, never too narrow.
/// @throws Error when there are too few points, or a cloud has no normals.
FusedViews fuse_views(const std::vector<PointCloud>& clouds, const FuseOptions& options = {});

}  // namespace palpate::reconstruction
