// SPDX-License-Identifier: Apache-2.0
// Many noisy, partial views of an object become one set of small oriented facets, whose winding number has an inside.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::reconstruction {

/// What is taken to be there where nobody looked. Of an object seen from all around, what hidden_field makes of each.
enum class Completion {
  planar,    ///< nothing but what the support hides: the back is flat, as in the paper
  mirrored,  ///< what the mirror image of the front says, where that was seen
  tapered,   ///< of the planar one, what narrows downwards as the object narrows upwards
  hidden,    ///< all that no sensor saw to be free, up to as far behind the seen part as that is wide
};

/// A tool met the object here, coming from outside.
struct Touch {
  Vec3 point_m = Vec3::Zero(), inward = -Vec3::UnitZ();
  double radius_m = 0;
};

struct FuseOptions {
  double cell_m = 0;             ///< width over which points are averaged; 0 = from noise, size and density
  int fewest_points = 3;         ///< cells with fewer points are taken for noise (>= 1)
  std::optional<Plane> support;  ///< table or wall that hides a side: the object is completed down to it
  /// Says of a place in the clouds' frame that a sensor looked through it; empty: nothing is known, and the back stays planar.
  std::function<bool(const Vec3&)> free;
  /// The same where what sees the support tells it, and how near: used for the side that nobody saw. Empty: `free`.
  std::function<bool(const Vec3&)> free_to_support;
  std::vector<Touch> touched;  ///< used where free space is known
  Completion completion = Completion::mirrored;
};

/// @throws Error naming the field and its bounds.
void check(const FuseOptions& options);

struct FusedViews {
  TriMesh facets;              ///< one triangle a cell, outward, as large as the surface that it stands for; open
  Index seen = 0;              ///< that many facets come first and were seen; the others complete the object
  Index held = 0;              ///< so many lie on the surface: those seen, and the strip down to the support
  int symmetries = 0;          ///< upright planes at which it was mirrored because what was seen is symmetric there
  double strip_m = 0;          ///< height above the support below which nothing was seen, where facets go on to it
  bool around = false;         ///< seen from all sides, down to the support, and free space is known
  /// Where it is given, a place is inside where this is above one half, and not where the facets' winding number is.
  std::function<double(const Vec3&)> inside;
  VectorX sigma_m;             ///< of the seen facets along their normals, from the scatter of the points and their number
  double cell_m = 0;           ///< width that was used
  double seen_area_m2 = 0;     ///< area of the facets that sensors saw
  double support_area_m2 = 0;  ///< area of the facets that complete the object
};

/// @param clouds  in one frame, each with unit normals that face its sensor
/// A cell's facet lies where a quadratic surface, fitted to the points around it along their mean normal (moving least
/// squares, Levin 1998), passes its middle: noise is averaged and curvature is not flattened. With `support`, the object's
/// shadow along the plane's normal is closed on the plane (the planar back side of Frank et al. 2010). Where free space is
/// known, the unseen side is completed further (see completion.hpp).
/// @throws Error when there are too few points, or a cloud has no normals.
FusedViews fuse_views(const std::vector<PointCloud>& clouds, const FuseOptions& options = {});

}  // namespace palpate::reconstruction
